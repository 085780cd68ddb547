"""Unilateral liaisons and dry friction: their declarations, and the motion in modes that an FMU chooses at events.

With this package loaded, :mod:`liaisons.mechanics` derives models with contacts.
"""

from liaisons.contacts.declarations import dry_friction, unilateral
from liaisons.contacts.forces import Compliance
from liaisons.contacts.modes import contact_numbers, contact_thresholds, contacts_of, functions_in_modes, refuse_many
from liaisons.contacts.printing import contact_equations, contact_laws, friction_equations
from liaisons.mechanics import contacts_by

__all__ = [
    "Compliance",
    "contact_equations",
    "contact_laws",
    "contact_numbers",
    "contact_thresholds",
    "contacts_of",
    "dry_friction",
    "friction_equations",
    "unilateral",
]

contacts_by(
    contacts=contacts_of,
    numbers=contact_numbers,
    functions=functions_in_modes,
    equations=contact_equations,
    refuse=refuse_many,
)
