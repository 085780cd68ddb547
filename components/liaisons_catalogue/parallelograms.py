"""Parallelograms in a row: a mechanism that passes through singular configurations, where its constraints lose rank."""

from itertools import pairwise
from types import new_class
from typing import Any

import casadi as ca
import numpy as np

from liaisons.errors import ComponentError
from liaisons.language import Coordinate, Experiment, Gravity, Mechanism, Parameter, Rod, Shapes, constraint, point


class FourBars(Mechanism, abstract=True):
    """Uniform rods of equal length: upright ones on pivots in a row, their tops joined by horizontal ones; abstract.

    The upright rod i = 0 .. N turns by θ_i about (i l, 0), and its top is B_i; the horizontal rod i joins B_i-1 and
    B_i.  A uniform rod whose ends move at v and w has the kinetic energy m (v² + v·w + w²)/6::

        T = Σ m l² θ_i'²/6 + Σ m (B_i-1'² + B_i-1'·B_i' + B_i'²)/6,    V = m g (Σ z(B_i)/2 + Σ (z(B_i-1) + z(B_i))/2)
        σ_i = (|B_i - B_i-1|² - l²)/2l = 0,    i = 1 .. N
        parallelograms, θ_i = θ:    J θ'' = -G cos θ,    J = m l² ((N + 1)/3 + N),    G = m g l ((N + 1)/2 + N)

    θ [rad] from the horizontal, m [kg], l [m], g [m/s2].  Where all rods lie in line, θ = 0 and θ = π, the gradients of
    all σ_i are linearly dependent, the mechanism has N + 1 degrees of freedom instead of one, and the forces of the
    rods have poles, unless N = 1.  The motion passes through without a stop.

    Source: IFToMM library of computational benchmark problems, A02; E. Bayo, A. Avello, Nonlinear Dynamics 5 (1994).
    """

    windows: int
    mass = Parameter(1.0, "kg", "mass of each rod", above=0)
    length = Parameter(1.0, "m", "length of each rod", above=0)
    gravity = Gravity()
    experiment = Experiment(stop_time=20.0, step_size=0.05)

    @point("m", "B_0, the top of the first rod")
    def top(self) -> dict[str, ca.SX]:
        return self._top(0)

    def picture(self) -> Shapes:
        tops = [self._top(i) for i in self._indices]
        standing = [Rod({"x": i * self.length}, top) for i, top in enumerate(tops)]
        return [*standing, *(Rod(left, right) for left, right in pairwise(tops))]

    def kinetic_energy(self) -> ca.SX:
        standing = ca.SX(sum(self.length**2 * self.dot(self.symbols[f"theta_{i}"]) ** 2 for i in self._indices))
        tops = [{axis: self.dot(z) for axis, z in self._top(i).items()} for i in self._indices]
        lying = sum(v[a] ** 2 + v[a] * w[a] + w[a] ** 2 for v, w in pairwise(tops) for a in "xz")
        return self.mass / 6 * (standing + lying)

    def potential_energy(self) -> ca.SX:
        heights = [self._top(i)["z"] for i in self._indices]
        lying = sum((left + right) / 2 for left, right in pairwise(heights))
        return self.mass * self.gravity * (ca.SX(sum(heights)) / 2 + lying)

    @property
    def _indices(self) -> range:
        """Indices i of the standing rods."""
        return range(self.windows + 1)

    def _top(self, i: int) -> dict[str, ca.SX]:
        """Position of B_i, the top of standing rod i, by axis."""
        theta = self.symbols[f"theta_{i}"]
        return {"x": self.length * (i + ca.cos(theta)), "z": self.length * ca.sin(theta)}

    def stretch(self, i: int) -> ca.SX:
        """Stretch σ_i of lying rod i [m]."""
        left, right = self._top(i - 1), self._top(i)
        return (sum((right[axis] - left[axis]) ** 2 for axis in "xz") - self.length**2) / (2 * self.length)

    from liaisons_catalogue.solutions.parallelograms import exact, pull


def four_bars(windows: int) -> type[FourBars]:
    """Make a row of parallelograms: coordinates theta_0 .. theta_N, constraints rod_1 .. rod_N.

    :param windows: how many, N; all standing rods are upright at the start and fall to the right at 1 rad/s.
    :returns: the component; its FMU is called ``FourBars`` and the number.
    :raises ComponentError: unless there is at least one window.
    """
    if windows < 1:
        raise ComponentError(f"four_bars: windows = {windows}: it must be >= 1")
    namespace: dict[str, Any] = {"__module__": __name__, "__doc__": FourBars.__doc__, "windows": windows}
    for i in range(windows + 1):
        angle = Coordinate("rad", f"angle of standing rod {i} from the horizontal", start=np.pi / 2, start_rate=-1.0)
        namespace[f"theta_{i}"] = angle
    for i in range(1, windows + 1):
        namespace[f"rod_{i}"] = constraint("m", f"stretch of lying rod {i}")(lambda m, i=i: m.stretch(i))
    return new_class(f"FourBars{windows}", (FourBars,), exec_body=lambda body: body.update(namespace))
