"""Derivation of equations of motion from declarations, and their layout for an FMU."""

from liaisons.language import ActiveInput, State
from liaisons.mechanics.assembly import assemble, assemble_by
from liaisons.mechanics.constraints import STABILISATION, accelerations_by_gauss
from liaisons.mechanics.contacts import contact_functions, contact_method, contacts_by
from liaisons.mechanics.dynamics import Dynamics, derive_by
from liaisons.mechanics.energy_accounting import BOOKED, MEMORY, memory_names, with_energy_accounting
from liaisons.mechanics.equations import Equations, derive
from liaisons.mechanics.friction import Dissipation
from liaisons.mechanics.functions import CONTACT_NUMBERS, SIGNATURES, model_functions, results_of
from liaisons.mechanics.inertia import Inertia
from liaisons.mechanics.legendre import rates_from_momenta
from liaisons.mechanics.model import (
    NEXT_EVENT,
    Code,
    Contact,
    Equation,
    Model,
    declared_fields,
    domain_conditions,
    impulsive_operators,
)
from liaisons.mechanics.output_variables import contact_outputs, mechanical_outputs
from liaisons.mechanics.pictures import Drawing
from liaisons.mechanics.printing import (
    constraint_equations,
    dissipation_equation,
    further_equations,
    mechanism_equations,
    row_equations,
)

__all__ = [
    "BOOKED",
    "CONTACT_NUMBERS",
    "MEMORY",
    "NEXT_EVENT",
    "SIGNATURES",
    "STABILISATION",
    "ActiveInput",
    "Code",
    "Contact",
    "Dissipation",
    "Drawing",
    "Dynamics",
    "Equation",
    "Equations",
    "Inertia",
    "Model",
    "State",
    "accelerations_by_gauss",
    "assemble",
    "assemble_by",
    "constraint_equations",
    "contact_functions",
    "contact_method",
    "contact_outputs",
    "contacts_by",
    "declared_fields",
    "derive",
    "derive_by",
    "dissipation_equation",
    "domain_conditions",
    "further_equations",
    "impulsive_operators",
    "mechanical_outputs",
    "mechanism_equations",
    "memory_names",
    "model_functions",
    "rates_from_momenta",
    "results_of",
    "row_equations",
    "with_energy_accounting",
]
