"""A motion makes the action stationary under variations compatible with the liaisons: Hölder and d'Alembert agree.

M 3.1 to 3.3, eq. 1 to 28.  An operator lengthens a pendulum and shortens it again.  Let ⟨δI, w⟩ be the first variation
of the action under a variation w.  The FMU computes its motion from d'Alembert's equations.  For this motion ⟨δI, w⟩ =
0 if w leaves the length unchanged.  If w varies the length, ⟨δI, w⟩ = -∫ λ w_l dt, which is the work of the liaison;
with this equation the text proves that the two principles are equivalent.  The same holds in Cartesian coordinates,
with a multiplier; there w is compatible if it is perpendicular to the rod (M eq. 14, 20 to 22).  Along a motion with a
wrong weight the action is not stationary.  Scenario ``vakonomic_skate`` has a non-holonomic liaison.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import simpson

from liaisons import Result, analysis, operator, simulate
from liaisons.models import CartesianPendulum, Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

T, SAMPLES = 4.0, 801
SETTINGS: Any = {"stop_time": T, "step_size": T / (SAMPLES - 1), "tolerance": 1e-12}
LENGTH: Any = {"offset": 1.0, "amplitude": 0.2, "angular_frequency": 2.0}
MODES = range(1, 4)
Path = dict[str, NDArray]


def sine(run: Result, name: str, n: int) -> Path:
    """δ of one coordinate: sin(nπt/T), and its rate."""
    k = n * np.pi / T
    return {name: np.sin(k * run.time), f"{name}_dot": k * np.cos(k * run.time)}


def variation(component: Any, run: Result, path: Path, w: Path, **values: float) -> float:
    """⟨δI, w⟩ of M eq. 9."""
    return analysis.action(component, run.time, path, w, **values).first


def across(run: Result, n: int) -> Path:
    """sin(nπt/T) times what is across the rod, (1 - z, x)."""
    s, s_dot = sine(run, "s", n).values()
    x_dot, z_dot = s_dot * (1 - run["z"]) - s * run["z_dot"], s_dot * run["x"] + s * run["x_dot"]
    return {"x": s * (1 - run["z"]), "x_dot": x_dot, "z": s * run["x"], "z_dot": z_dot}


@scenario
def main(claim: Claims) -> None:
    why = "error of cubic interpolation: h⁴/384 (2e-12 s⁴) times fourth derivatives of 4e3 /s⁴ times forces of 20 N"
    interpolated = within(1e-7, "J.s", because=why)
    quadrature = within(1e-7, "J.s", because="error of Simpson's rule: h⁴/180 times fourth derivatives of 3e3 W/s³")
    run = simulate("Pendulum", length=operator("Sinusoid", **LENGTH), theta_0=1.0, **SETTINGS)
    path = {name: run[name] for name in ("theta", "theta_dot", "length", "length_dot")}
    along = [sine(run, "theta", n) for n in MODES]
    kept = [variation(Pendulum, run, path, w) for w in along]
    claim("adapted: ⟨δI, w⟩ = 0 for three w that leave the length unchanged", kept, 0.0, interpolated)

    off = [sine(run, "length", n) for n in MODES]
    work = [float(-simpson(run["length_force"] * w["length"], x=run.time)) for w in off]
    varied = [variation(Pendulum, run, path, w | along[0]) for w in off]
    claim(f"w that varies the length: -∫ λ w_l dt, {min(work):.1f} to {max(work):.1f} J.s", varied, work, quadrature)

    heavy = [variation(Pendulum, run, path, w, gravity=9.0) for w in along]
    torque = (9.81 - 9.0) * run["length"] * np.sin(run["theta"])
    missing = [float(simpson(torque * w["theta"], x=run.time)) for w in along]
    claim("other gravity, so no motion: ⟨δI, w⟩ is the virtual work of the missing weight", heavy, missing, quadrature)

    x, z = np.sin(1.0), -np.cos(1.0)
    xyz: Any = {"x_0": x, "z_0": 1 + z, "x_dot_0": 0.4 * x, "z_dot_0": 0.4 * z}
    free = simulate("CartesianPendulum", rod=operator("Sinusoid", **LENGTH), **xyz, **SETTINGS)
    place = {f"{axis}{end}": free[f"{axis}{end}"] for axis in "xyz" for end in ("", "_dot")}
    kept = [variation(CartesianPendulum, free, place, across(free, n)) for n in MODES]
    claim("multipliers: ⟨δI, w⟩ = 0 for three w across the rod", kept, 0.0, interpolated)
    in_theta = {"x": run["length"] * np.sin(run["theta"]), "z": 1 - run["length"] * np.cos(run["theta"])}
    same = within(1e-9, "m", because="errors of the solver at tolerance 1e-12, amplified less than 100-fold within 4 s")
    claim("both pendulums give the same motion", free, in_theta, same)

    motion, action = panels(
        ("a motion and two variations of it", "t [s]", "θ [rad]"),
        ("the action beside the motion", "ε", "I - I(0) [J.s]"),
    )
    motion.plot(run.time, run["theta"], label="FMU, l(t) prescribed")
    for e in (-0.3, 0.3):
        motion.plot(run.time, run["theta"] + e * along[0]["theta"], "--", color="tab:orange")
    size = np.linspace(-0.3, 0.3, 9)
    start = analysis.action(Pendulum, run.time, path).action
    for label, w in (("compatible: θ alone", along[0]), ("not compatible: the length", off[0])):
        moved = [path | {name: path[name] + e * value for name, value in w.items()} for e in size]
        action.plot(size, [analysis.action(Pendulum, run.time, k).action - start for k in moved], label=label)
