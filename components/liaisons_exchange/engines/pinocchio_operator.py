"""The operator of prescribed joints in Pinocchio: hybrid dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.errors import InvalidValueError, ProjectError, suggestion
from liaisons_exchange.engines.motions import Motion, evaluated, multipliers, require_motions

pin: Any = import_module("pinocchio") if find_spec("pinocchio") else None


@final
class PinocchioOperator:
    """Hybrid dynamics of a Pinocchio model: prescribed joints in, their forces and the other accelerations out.

    With q̈⁰ = ``aba(q, v, τ)`` and M⁻¹ of ``computeMinverse``, λ = Θ (σ̈ - q̈⁰_α), Θ = ((M⁻¹)_αα)⁻¹, and
    q̈ = q̈⁰ + M⁻¹ e_α λ (M eq. 27, 50).  Your integrator calls ``accelerations`` at each stage.

    :param model: ``pinocchio.Model``.
    :param motions: joint -> function of time [s] that returns σ, σ̇, σ̈ (rad or m).
    :raises ProjectError: if the package ``pin`` is missing.
    :raises InvalidValueError: without motions, for a joint that is unknown or has more than one coordinate, and for a
        motion that does not return three finite numbers.

    Source: M 3.5 and 7, with R. Featherstone, Rigid Body Dynamics Algorithms, 9.2.
    """

    def __init__(self, model: Any, motions: Mapping[str, Motion]) -> None:
        if pin is None:
            raise ProjectError("PinocchioOperator needs Pinocchio; pip install pin")
        require_motions(motions)
        joints = [_joint(model, name) for name in motions]
        self._model, self._data = model, model.createData()
        self._motions = tuple(motions.items())
        self._positions = np.array([joint.idx_q for joint in joints], dtype=int)
        self._rows = np.array([joint.idx_v for joint in joints], dtype=int)

    def place(self, time: float, q: ArrayLike, v: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Copies of q (nq,) and v (nv,) with σ and σ̇ at the prescribed joints."""
        q, v = np.array(q, dtype=float), np.array(v, dtype=float)
        q[self._positions], v[self._rows], _ = evaluated(self._motions, time)
        return q, v

    def accelerations(
        self, time: float, q: ArrayLike, v: ArrayLike, torque: ArrayLike | None = None
    ) -> tuple[NDArray[np.float64], dict[str, float]]:
        """q̈ (nv,), σ̈ at the prescribed joints, and their forces λ, N or N m; the power of each is λ σ̇ (M eq. 28).

        :param q: configuration (nq,); σ takes its place at prescribed joints, σ̇ that of ``v``.
        :param torque: other forces τ (nv,), 0 by default.
        """
        q, v = self.place(time, q, v)
        free = pin.aba(self._model, self._data, q, v, np.zeros(len(v)) if torque is None else np.asarray(torque, float))
        rows = pin.computeMinverse(self._model, self._data, q)[self._rows]
        lacking = evaluated(self._motions, time)[2] - free[self._rows]
        forces = multipliers(rows, self._rows, lacking)
        return free + forces @ rows, self._by_name(forces)

    def jump(self, time: float, q: ArrayLike, v: ArrayLike) -> tuple[NDArray[np.float64], dict[str, float]]:
        """Rates after a jump to σ̇, which leaves the momenta of the other joints as they are, and impulses of λ."""
        q, after = self.place(time, q, v)
        rows = pin.computeMinverse(self._model, self._data, q)[self._rows]
        before = np.array(v, dtype=float)
        impulses = multipliers(rows, self._rows, (after - before)[self._rows])
        return before + impulses @ rows, self._by_name(impulses)

    def _by_name(self, values: NDArray[np.float64]) -> dict[str, float]:
        return {name: float(value) for (name, _), value in zip(self._motions, values, strict=True)}


def _joint(model: Any, name: str) -> Any:
    if not model.existJointName(name):
        raise InvalidValueError(f"the model has no joint {name!r}{suggestion(name, list(model.names)[1:])}")
    joint = model.joints[model.getJointId(name)]
    if (joint.nq, joint.nv) != (1, 1):
        raise InvalidValueError(f"joint {name!r} has {joint.nq} coordinates; prescribe a chain of joints with one each")
    return joint
