"""The linear system that deviations from a point follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, final

import numpy as np

from liaisons.cosim.compiled.calls import Vector
from liaisons.errors import SimulationError

LinearizationMethod = Literal["directional derivatives", "differences"]
"""How derivatives are calculated: by the FMU, or from values at points near each other."""


@final
@dataclass(frozen=True, eq=False, repr=False)
class Linearization:
    """x' = rates + A Δx + B Δu, y = y* + C Δx + D Δu, for deviations Δ from a point x*, u*, y*.

    :param title: what was linearized.
    :param A: shape (states, states).
    :param B: shape (states, inputs).
    :param C: shape (outputs, states).
    :param D: shape (outputs, inputs).
    :param states: names, element by element.
    :param inputs: names, element by element.
    :param outputs: names, element by element.
    :param rates: of the states at the point, shape (states,); 0 at an equilibrium.
    :param values: of states, inputs and outputs at the point, by name.
    :param units: name -> unit; empty where there is none.
    :param method: the FMU's ``"directional derivatives"``, or ``"differences"``.
    """

    title: str
    A: Vector
    B: Vector
    C: Vector
    D: Vector
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    rates: Vector
    values: Mapping[str, float]
    units: Mapping[str, str]
    method: LinearizationMethod

    def __repr__(self) -> str:
        sizes = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"<Linearization of {self.title}: {sizes}, by {self.method}>"

    @property
    def poles(self) -> Any:
        """Eigenvalues of A [1/s], complex, shape (states,)."""
        return np.sort_complex(np.linalg.eigvals(self.A))

    def to_control(self) -> Any:
        """The linear system as ``StateSpace`` of python-control; its names have ``_`` for dots.

        :raises SimulationError: if python-control is missing (``pip install 'liaisons[control]'``).
        """
        try:
            from control import ss
        except ImportError:
            raise SimulationError("to_control needs python-control; pip install 'liaisons[control]'") from None
        labels = {
            kind: [name.replace(".", "_") for name in getattr(self, kind)] for kind in ("states", "inputs", "outputs")
        }
        return ss(self.A, self.B, self.C, self.D, **labels)
