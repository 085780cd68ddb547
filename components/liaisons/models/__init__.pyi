from liaisons.language import Component
from liaisons_catalogue import *  # noqa: F403 - all that it has

CATALOGUE: tuple[type[Component], ...]
