"""A chain of a few links as an ordinary mechanism: a second derivation, and the way to the analysis of a chain."""

from __future__ import annotations

from typing import Any

import casadi as ca

from liaisons.language.chain import Chain
from liaisons.language.declarations import Coordinate, point
from liaisons.language.mechanism import Mechanism
from liaisons.mechanics.chains.sweeps import link_of


def unrolled(component: type[Chain], n: int) -> type[Mechanism]:
    """The mechanism with one coordinate a link, ``theta_1`` ... ``theta_n``, derived in the ordinary, dense way.

    Its cost grows with n³; it is meant for :mod:`liaisons.analysis` and for tests.

    :param component: a subclass of Chain.
    :param n: how many links.
    :returns: a subclass of Mechanism with the chain's parameters and active coordinates; points are ``bob_1``, ...
    :raises ComponentError: if n is no whole number or too small.
    """
    chain = component(n)
    links, base = range(1, chain.sizes["n"] + 1), chain.base()
    link = link_of(chain)

    def at(m: Mechanism, i: int, expression: ca.SX) -> ca.SX:
        """An expression of one link, of link i of the mechanism."""
        q, q_dot = (ca.vertcat(*(m.symbols[f"{c.name}_{i}{end}"] for c in chain.coordinates)) for end in ("", "_dot"))
        if i > 1:
            w = at(m, i - 1, link.tip)
        else:
            w = ca.substitute(chain.place(base), _all(chain), _all(m)) if base else ca.SX.zeros(*link.w.shape)
        symbols = [link.q, link.v, link.w, link.w_dot, link.bonded, chain.parameter_column]
        values = [q, q_dot, w, m.dot(w), ca.SX(base is not None or i > 1), m.parameter_column]
        return ca.substitute(expression, ca.vertcat(*symbols), ca.vertcat(*values))

    names: dict[str, Any] = {p.name: p for p in component.parameters} | {s.name: s for s in component.actives}
    for q in component.coordinates:
        starts = (*q.leading, *(q.start for _ in links))
        for i, start in zip(links, starts, strict=False):
            text = f"{q.description}, link {i}"
            names[f"{q.name}_{i}"] = Coordinate(q.unit, text, start=start, start_rate=q.start_rate, nominal=q.nominal)
    for item in component.points:
        axes = getattr(chain, item.name)
        for i in links:
            names[f"{item.name}_{i}"] = point(item.unit, f"{item.description}, link {i}")(
                lambda m, axes=axes, i=i: {axis: at(m, i, ca.SX(value)) for axis, value in axes.items()}
            )
    return type(
        component.__name__,
        (Mechanism,),
        names
        | {
            "__module__": component.__module__,
            "__doc__": component.__doc__,
            "experiment": component.experiment,
            "kinetic_energy": lambda m: sum(at(m, i, link.kinetic) for i in links),
            "potential_energy": lambda m: sum(at(m, i, link.potential) for i in links),
            "dissipation_function": lambda m: sum(at(m, i, link.friction.function) for i in links),
        },
    )


def _all(m: Chain | Mechanism) -> ca.SX:
    """Parameters and active coordinates."""
    return ca.vertcat(m.parameter_column, m.s if isinstance(m, Chain) else m.active.s)
