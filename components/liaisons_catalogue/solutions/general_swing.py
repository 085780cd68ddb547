"""Any swing in a fixed shape: a compound pendulum."""

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons_catalogue.solutions import elliptic


@closed_form("the motion in a fixed shape: the compound pendulum I θ'' = -D sin θ, by elliptic functions")
def exact(t: NDArray, at: Values, component: Any) -> dict[str, NDArray]:
    shape = [getattr(at, s.name) for s in component.actives]
    inertia, weight = (float(ca.evalf(ca.SX(component.functions[name](*shape)))) for name in ("I", "D"))
    at.require(inertia > 0 and weight > 0, f"I = {inertia} and D = {weight} must be > 0")
    theta, theta_dot = elliptic.pendulum(t, at.theta_0, at.theta_dot_0, np.sqrt(weight / inertia))
    return {"theta": theta, "theta_dot": theta_dot}
