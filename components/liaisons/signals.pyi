from .cosim import OperatorFmu as OperatorFmu
from .cosim import Signal as Signal
from .cosim import sampled as sampled
from .engines import MujocoOperator as MujocoOperator
from .engines import PinocchioOperator as PinocchioOperator
from .interface import operator as operator
from .interface import tabulated as tabulated
from .typed_formulas import formula_signal as formula_signal
