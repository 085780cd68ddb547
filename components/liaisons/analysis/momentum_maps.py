"""Momentum maps: the conserved quantities of a group of symmetries together, and how they transform under it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.analysis.phase_space import poisson_bracket
from liaisons.analysis.quantity import Quantity, Source, equations_of, random_states, require_independent
from liaisons.analysis.symmetry import noether
from liaisons.errors import ComponentError

_ROUNDING = 1e-10
"""Part of the size of brackets that is no combination of the momenta by rounding."""


@dataclass(frozen=True, eq=False)
class MomentumMap:
    """J on phase space: a component for each generator ξ_a of a group that leaves L as it is."""

    components: Mapping[str, Quantity]  # J_a = Σ ξ_a^k p_k by the name of the generator
    structure: NDArray  # c with {J_a, J_b} = Σ_c c[a, b, c] J_c, in the sign of poisson_bracket; (k, k, k)

    def evaluate(self, **values: ArrayLike) -> dict[str, Any]:
        """Values of the components by name; see :meth:`Quantity.evaluate`."""
        return {name: component.evaluate(**values) for name, component in self.components.items()}


def momentum_map(
    source: Source, group: Mapping[str, Callable[[Any], Mapping[str, Any]]], **values: float
) -> MomentumMap:
    """The momentum map of a group action, equivariant: the brackets of its components are those of the group.

    :param group: generators by name, each a field of :func:`noether`, whose quantity is the component: of rotations in
        the plane and translations ``{"turn": lambda m: {"x": -m.y, "y": m.x}, "x": lambda m: {"x": 1.0}, "y": lambda
        m: {"y": 1.0}}``.  Together they must span all their brackets.
    :param values: parameters and forces where they differ from their defaults.
    :raises ComponentError: if a generator is no symmetry, as :func:`noether`; if a bracket is no combination of the
        components with constant coefficients, so that the generators span no group, or the action has no equivariant
        map, as translations in a magnetic field; for constraints.
    """
    equations = equations_of(source)
    require_independent(equations, "a momentum map")
    components = {name: noether(equations, field, **values) for name, field in group.items()}
    names, states = list(components), random_states(equations, values)
    samples = np.array([component.evaluate(**states) for component in components.values()])
    structure = np.zeros((len(names),) * 3)
    for a, first in enumerate(components.values()):
        for b, second in enumerate([*components.values()][:a]):
            bracket = poisson_bracket(first, second).evaluate(**states)
            structure[a, b] = np.linalg.lstsq(samples.T, bracket, rcond=None)[0]
            structure[b, a] = -structure[a, b]
            left = np.max(np.abs(bracket - structure[a, b] @ samples))
            if left > _ROUNDING * (1 + np.max(np.abs(bracket))):
                raise ComponentError(
                    f"{equations.name}: the bracket of {names[b]} and {names[a]} is no combination of "
                    f"{', '.join(names)}; give the generators that are missing"
                )
    return MomentumMap(components, structure)
