"""When an arm holds its load at rest, the operator's torques are the moments of the weights about its six axes.

The Arm is at rest in five poses, and its load hangs on a spherical joint.  Inverse dynamics at rest is statics, so each
torque is the moment of all weights that the axis carries.  This moment follows from the geometry of the pose.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from liaisons import simulate
from liaisons.models import Arm
from liaisons.scenarios import Claims, dots, panels, scenario, within

RIGHT = np.pi / 2


@scenario
def main(claim: Claims) -> None:
    rounding = within(1e-9, "N.m", because="rounding errors of moments of 200 N m and of the load's start attitude")
    poses, names = np.linspace(0.0, 1.2, 5), [f"axis_{k}" for k in range(1, 7)]
    (axis,) = panels(("torques that hold the arm", "lift of the upper arm [rad]", "λ [N m]"), size=(7, 4))
    torques = []
    for lift in poses:
        pose = {"axis_2": lift, "axis_3": -0.5, "axis_5": 0.3 - lift}
        upper = Rotation.from_euler("XZY", [RIGHT, lift - 0.5, RIGHT])
        flange = upper * Rotation.from_euler("XZX", [RIGHT, 0.3 - lift, -RIGHT])
        attitude = dict(zip("wxyz", flange.inv().as_quat(scalar_first=True), strict=True))
        load = {f"grip_q_{axis}_0": value for axis, value in attitude.items()}
        run = simulate("Arm", stop_time=0.1, step_size=0.05, tolerance=1e-11, **pose, **load)
        statics = Arm.static_torques(**pose)
        torques.append([run[f"{name}_force"][0] for name in names])
        claim(
            f"lift {lift:.1f} rad: torques at rest", torques[-1], [statics[f"{name}_force"] for name in names], rounding
        )
    for name, column in zip(names, np.transpose(torques), strict=True):
        axis.plot(poses, column, label=name)
    fine = np.linspace(0.0, 1.2, 40)
    exact = [Arm.static_torques(axis_2=lift, axis_3=-0.5, axis_5=0.3 - lift)["axis_2_force"] for lift in fine]
    dots(axis, fine, np.array(exact), every=4, label="moments of the weights")
