"""FMU files in, system, result out: composition and simulation on fmpy; no symbols here."""

from typing import TYPE_CHECKING

import lazy_loader

from liaisons.cosim.compiled.calls import (
    DISCARD,
    ERROR,
    FATAL,
    HEADER,
    STATUSES,
    SUCCESS,
    Action,
    Call,
    Memory,
    Numbers,
    Record,
    record_type,
)
from liaisons.cosim.compiled.library import cached_library
from liaisons.cosim.instances import extract_fmus, make_instance, try_to_start
from liaisons.cosim.instances.loading import Loaded, SharedFunctions
from liaisons.cosim.instances.protocol import Instance, Scalars
from liaisons.cosim.running.contacts import LEAST_IMPULSE, contact_variables, friction_variables
from liaisons.cosim.running.kernel import Kernel
from liaisons.cosim.running.moment import Moment
from liaisons.cosim.running.run import Run, run_to_end
from liaisons.cosim.structure.components import Port, SystemComponent
from liaisons.cosim.structure.connections import Connection
from liaisons.cosim.structure.document import Diagram, Services, SystemDocument, register
from liaisons.cosim.structure.scenes import read_result
from liaisons.cosim.structure.schedule import Coupling, VariableReference
from liaisons.cosim.structure.simulation import Settings, Simulation, checked_simulation
from liaisons.cosim.structure.sources import SIGNALS, Signal
from liaisons.cosim.system import OperatorFmu, System, simulate, start
from liaisons.fmu_files import (
    DefaultExperiment,
    Entry,
    Fmu,
    SampledFunction,
    experiment_problems,
    read_description,
    sampled,
)
from liaisons.results import IncompleteError, Interrupted, Result

if TYPE_CHECKING:
    from liaisons.cosim.coupling.strong_component import Polynomial, interpolation_to_end
    from liaisons.cosim.instances.fmi2 import Instance2
    from liaisons.cosim.instances.fmi3 import Instance3
    from liaisons.cosim.running.linearization import Linearization, LinearizationMethod

__all__ = [
    "DISCARD",
    "ERROR",
    "FATAL",
    "HEADER",
    "LEAST_IMPULSE",
    "SIGNALS",
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
    "IncompleteError",
    "Instance",
    "Instance2",
    "Instance3",
    "Interrupted",
    "Kernel",
    "Linearization",
    "LinearizationMethod",
    "Loaded",
    "Memory",
    "Moment",
    "Numbers",
    "OperatorFmu",
    "Polynomial",
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
    "extract_fmus",
    "friction_variables",
    "interpolation_to_end",
    "make_instance",
    "read_description",
    "read_result",
    "record_type",
    "register",
    "run_to_end",
    "sampled",
    "simulate",
    "start",
    "try_to_start",
]

# What not every run needs is imported at its first use.
__getattr__, _, _ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "coupling.strong_component": ["Polynomial", "interpolation_to_end"],
        "instances.fmi2": ["Instance2"],
        "instances.fmi3": ["Instance3"],
        "running.linearization": ["Linearization", "LinearizationMethod"],
    },
)
