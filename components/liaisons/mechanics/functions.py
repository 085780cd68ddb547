"""The functions that a model is made of, in one table: what they take, and what they return.

Vectors are named by letters, see :mod:`liaisons.mechanics.model`; of functions alone are

====  ==========================================================================================
``c``  distances of the conditions from failing, which must stay > 0: a singularity lies at 0
``e``  instants at which the model is not smooth, unsorted; where they recur the next one among them
``d``  what only the picture needs, or the next event: calculated when it is read
``i``  event indicators, below 0 where the mode of a contact ends
``n``  numbers that modes of contacts are chosen by, by name
``r``  residuals of the constraints, which are kept where all are between -1 and 1, and what is prescribed for each
``x``  contact forces
``Λ``  impulses of the contacts
``ν``  distances to move along the gaps
``I``  impulses of the operators
====  ==========================================================================================
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca


@dataclass(frozen=True, slots=True)
class Signature:
    """Arguments and results of a function, a letter a vector.

    :param optional: a last argument that the function takes only if a result depends on it.
    :param member: its name in ``Model`` of core.h; none: it stands there in another form.
    """

    arguments: str
    results: str
    member: str = ""
    optional: str = ""


SIGNATURES: Mapping[str, Signature] = {
    "conditions": Signature("tyuk", "c", "distances", optional="m"),
    "events": Signature("k", "e", "instants", optional="t"),
    "draw": Signature("tyuk", "d", "draw"),
    # state and memory at initialization
    "start": Signature("tuk", "ym", "start"),
    # right-hand side
    "derivatives": Signature("tyuk", "y", optional="m"),
    # all variables that can be read
    "outputs_function": Signature("tyukm", "z", "calculate"),
    # state after the inputs have jumped: books the impulse's work
    "jump": Signature("tyukm", "y", "jump"),
    # memory after a completed step or jump
    "remember": Signature("tyukm", "m", "remember"),
    # memory after the sample that is due
    "sample": Signature("tyukm", "m", "sample"),
    # size of each state, at initialization: scales the tolerance
    "nominals": Signature("tyuk", "y", "nominals"),
    # state put back onto constraints after a step of the solver
    "project": Signature("tyuk", "y", "project"),
    # whether constraints are kept
    "reach": Signature("tyuk", "r", "reach"),
    # the least of what makes a constraint independent of the others, relative to what it usually is
    "margin": Signature("tyuk", "c"),
    # of contacts: numbers without contact forces, the state after impulses and shifts, event indicators
    "contact": Signature("tyuk", "n", "contact"),
    "push": Signature("tyukmΛν", "yI", "push"),
    "indicate": Signature("tyukm", "i", "indicate"),
    # motion under given contact forces, for compositions
    "forced_motion": Signature("tyukmx", "yzn"),
}
"""Functions of :class:`liaisons.mechanics.model.Model`, by its members, in the order of their C.

``conditions`` and ``derivatives`` take the memory of a model with contacts, which holds their modes.
"""

CONTACT_NUMBERS: Mapping[str, tuple[bool, ...]] = {
    **dict.fromkeys(("v", "a", "rate_scale", "acceleration_scale"), (False, True)),
    **dict.fromkeys(("gap", "scale", "restitution"), (False,)),
    **dict.fromkeys(("stick", "slide"), (True,)),
}
"""Numbers by which modes are chosen, as in core.h; False if gaps have them, True if dry frictions do."""


def model_functions(vectors: Mapping[str, Any], results: Mapping[str, Any], *, merge: bool = True) -> dict[str, Any]:
    """CasADi functions of a model from their results, by name: arguments of Model.

    :param vectors: symbols by letter, all SX or all MX.
    :param results: by the name of the function a result, several, or several by name; functions without are left out.
    :param merge: calculate repeated subexpressions of scalar code once.
    """
    return {name: _casadi_function(name, vectors, value, merge) for name, value in results.items() if value is not None}


def results_of(name: str, function: ca.Function, vectors: Mapping[str, Any]) -> list[Any]:
    """Call a function of a model with vectors by their letters; return its results."""
    signature = SIGNATURES[name]
    letters = (signature.arguments + signature.optional)[: function.n_in()]
    return list(function.call([vectors[letter] for letter in letters]))


def _casadi_function(name: str, vectors: Mapping[str, Any], value: Any, merge: bool) -> ca.Function:
    """CasADi function of a signature, with dense results and, if merged, common subexpressions shared."""
    names = list(value) if isinstance(value, Mapping) else []
    columns: Any = value.values() if names else value if isinstance(value, tuple) else [value]
    dense: Any = [ca.densify(column) for column in columns]
    if merge and all(isinstance(column, ca.SX) for column in dense):
        dense = ca.cse(dense)
    letters, optional = SIGNATURES[name].arguments, SIGNATURES[name].optional
    if optional and ca.depends_on(ca.vertcat(*dense), vectors[optional]):
        letters += optional
    named: Any = ([f"i{i}" for i in range(len(letters))], names) if names else ()
    return ca.Function(name.removesuffix("_function"), [vectors[letter] for letter in letters], dense, *named)
