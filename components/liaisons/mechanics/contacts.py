"""Contacts of models, of which a package makes functions that has declarations of them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from liaisons.language import Layout, MechanicalComponent
from liaisons.mechanics.functions import model_functions
from liaisons.mechanics.model import Contact, Equation


@dataclass(frozen=True, slots=True, eq=False)
class ContactMethod:
    """What a package brings that declares contacts.

    :param contacts: component → its contacts, unilateral liaisons first.
    :param numbers: mechanism → columns of :data:`liaisons.mechanics.functions.CONTACT_NUMBERS`.
    :param functions: arguments of :func:`contact_functions` → arguments of Model.
    :param equations: equations of a mechanism → those of its contacts, for the documentation.
    :param refuse: name of a component, contacts and links of its longest chain: raises an error for too many.
    """

    contacts: Callable[[MechanicalComponent], tuple[Contact, ...]]
    numbers: Callable[[Any], dict[str, ca.SX]]
    functions: Callable[..., dict[str, Any]]
    equations: Callable[[Any], Iterable[Equation]]
    refuse: Callable[[str, Sequence[Contact], int], None]


_METHODS: list[ContactMethod] = []


def contacts_by(**fields: Callable[..., Any]) -> None:
    """Let contacts be derived by a package, by the fields of :class:`ContactMethod`."""
    _METHODS[:] = [ContactMethod(**fields)]


def contact_method(contacts: Sequence[object]) -> ContactMethod | None:
    """Method for contacts or their declarations, if there are any; who declares them has loaded the package."""
    return _METHODS[0] if contacts else None


def contact_functions(
    contacts: tuple[Contact, ...],
    *,
    vectors: Mapping[str, Any],
    forced: Mapping[str, Any],
    numbers: Mapping[str, ca.SX],
    layout: Layout,
    memory: tuple[str, ...],
    condition_texts: tuple[str, ...],
) -> dict[str, Any]:
    """Functions of a model whose contacts, if it has some, are in the modes that its memory holds: arguments of Model.

    :param vectors: t, y, u, k, m and the contact forces x, by letter.
    :param forced: results of the functions under given contact forces, see :func:`model_functions`.
    :param numbers: by which modes are chosen.
    :param layout: without arrays.
    :param memory: names of its numbers.
    :param condition_texts: one for each row of the result ``conditions``.
    """
    if method := contact_method(contacts):
        return method.functions(
            contacts=contacts,
            vectors=vectors,
            forced=forced,
            numbers=numbers,
            layout=layout,
            memory=memory,
            condition_texts=condition_texts,
        )
    functions = model_functions(vectors, forced)
    return {**functions, "condition_texts": condition_texts, "memory": memory, "contacts": ()}
