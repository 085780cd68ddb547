"""FMU files in, system, result out: composition and simulation on fmpy; no symbols here."""

from typing import TYPE_CHECKING

import lazy_loader

from liaisons.cosim.arrays import Memory, Numbers
from liaisons.cosim.compiled.cached import cached_library
from liaisons.cosim.compiled.calls import HEADER, Action, Call
from liaisons.cosim.description.fmu import DefaultExperiment, Fmu, experiment_problems, read_description
from liaisons.cosim.description.sampled_function import SampledFunction, sampled
from liaisons.cosim.description.variables import Entry
from liaisons.cosim.instances.loading import SharedFunctions
from liaisons.cosim.instances.protocol import Instance, Loaded, Scalars
from liaisons.cosim.messages import DISCARD, FATAL, STATUSES, SUCCESS
from liaisons.cosim.running.contacts import contact_variables, friction_variables
from liaisons.cosim.running.kernel import Kernel
from liaisons.cosim.running.moment import Moment
from liaisons.cosim.running.run import Run, run_to_end
from liaisons.cosim.structure.components import Port, SystemComponent
from liaisons.cosim.structure.connections import Connection
from liaisons.cosim.structure.document import Diagram, SystemDocument
from liaisons.cosim.structure.scenes import read_result
from liaisons.cosim.structure.schedule import Coupling, VariableReference
from liaisons.cosim.structure.services import Services, register
from liaisons.cosim.structure.simulation import Settings, Simulation, checked_simulation
from liaisons.cosim.structure.sources import Signal
from liaisons.cosim.structures import Record, structure_fields
from liaisons.cosim.system import OperatorFmu, System, simulate, start
from liaisons.results import IncompleteError, Interrupted, Result

if TYPE_CHECKING:
    from liaisons.cosim.instances.fmi2 import Instance2
    from liaisons.cosim.instances.fmi3 import Instance3
    from liaisons.cosim.running.fmu_equations import FmuEquations
    from liaisons.cosim.running.linearization import Linearization
    from liaisons.cosim.running.roll_back import roll_back_difference

__all__ = [
    "DISCARD",
    "FATAL",
    "HEADER",
    "STATUSES",
    "SUCCESS",
    "Action",
    "Call",
    "Connection",
    "Coupling",
    "DefaultExperiment",
    "Diagram",
    "Entry",
    "Fmu",
    "FmuEquations",
    "IncompleteError",
    "Instance",
    "Instance2",
    "Instance3",
    "Interrupted",
    "Kernel",
    "Linearization",
    "Loaded",
    "Memory",
    "Moment",
    "Numbers",
    "OperatorFmu",
    "Port",
    "Record",
    "Result",
    "Run",
    "SampledFunction",
    "Scalars",
    "Services",
    "Settings",
    "SharedFunctions",
    "Signal",
    "Simulation",
    "System",
    "SystemComponent",
    "SystemDocument",
    "VariableReference",
    "cached_library",
    "checked_simulation",
    "contact_variables",
    "experiment_problems",
    "friction_variables",
    "read_description",
    "read_result",
    "register",
    "roll_back_difference",
    "run_to_end",
    "sampled",
    "simulate",
    "start",
    "structure_fields",
]

# What not every run needs is imported at its first use.
__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "instances.fmi2": ["Instance2"],
        "instances.fmi3": ["Instance3"],
        "running.fmu_equations": ["FmuEquations"],
        "running.linearization": ["Linearization"],
        "running.roll_back": ["roll_back_difference"],
    },
)
