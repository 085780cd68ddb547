from .models import compose as compose
from .systems import composed_model as composed_model
from .systems import flatten as flatten
from .systems import model_of as model_of
