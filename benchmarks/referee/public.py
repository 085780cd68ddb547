"""``MujocoOperator`` on three files that Gymnasium publishes, beside mocap and weld, a rate overwritten and our FMU.

cd benchmarks && python -m referee.public FOLDER
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

from liaisons import MujocoOperator, simulate
from liaisons.errors import ComponentError
from referee.task import sinusoid

ASSETS = Path(gymnasium.__file__).parent / "envs/mujoco/assets"
FILES: dict[str, tuple[str, Any, dict[str, float]]] = {
    "inverted_double_pendulum": ("slider", sinusoid(0.0, 0.1, 3.0), {"hinge": 0.1, "hinge2": -0.05}),
    "reacher": ("joint0", sinusoid(0.0, 0.8, 2.0), {"joint1": 0.5}),
    "swimmer": ("motor1_rot", sinusoid(0.0, 0.5, 2.0), {}),
}
STOP, STEP = 1.0, 5e-4


def main(folder: str) -> None:
    found = {}
    for name, (joint, *_) in FILES.items():
        exact, force = run(name, STEP / 4, "operator")
        size = np.abs(exact).max()
        row: dict[str, Any] = {"joint": joint}
        for way in ("operator", "overwritten", "mocap"):
            row[way] = None
            if (ended := run(name, STEP, way)) is not None:
                row[way] = [float(np.abs(ended[0] - exact).max() / size), float(abs(ended[1] / force - 1))]
        try:
            row["our FMU"] = ours(name, exact, force)
        except ComponentError as error:
            row["our FMU"] = str(error).rpartition("assets/")[2].partition(";")[0]
        found[name] = row
    (Path(folder) / "public.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def ours(name: str, exact: Any, force: float) -> list[float]:
    joint, motion, start = FILES[name]
    path = ASSETS / f"{name}.xml"
    model: Any = mujoco.MjModel.from_xml_path(str(path))
    names = [model.joint(k).name for k in range(model.njnt)]
    result = simulate(
        f"{path}:{joint}",
        stop_time=STOP,
        step_size=0.01,
        tolerance=1e-10,
        inputs={joint: motion},
        record=[*(n for n in names if n != joint), f"{joint}_force"],
        **{f"{n}_0": value for n, value in start.items()},
    )
    ends = np.array([result[n][-1] if n != joint else motion(STOP)[0] for n in names])
    size = np.abs(exact).max()
    return [float(np.abs(ends - exact).max() / size), float(abs(result[f"{joint}_force"][-1] / force - 1))]


def run(name: str, step: float, way: str) -> Any:
    """Places at the end, and force (nan where it is not said)."""
    joint, motion, start = FILES[name]
    spec = mujoco.MjSpec.from_file(str(ASSETS / f"{name}.xml"))
    body = spec.joint(joint).parent
    if way == "mocap":
        if body.parent.name != "world":
            return None
        spec.worldbody.add_body(name="hand", mocap=True, pos=body.pos)
        weld = spec.add_equality(type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY)
        weld.name1, weld.name2, weld.solref = "hand", body.name, [2 * step, 1.0]
    model: Any = spec.compile()
    model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_RK4
    data: Any = mujoco.MjData(model)
    for other, value in start.items():
        data.qpos[model.joint(other).qposadr[0]] = value
    operator = MujocoOperator(model, {joint: motion})
    operator.place(data)
    axis = model.joint(joint).axis
    if way == "operator":
        mujoco.set_mjcb_control(operator)
    try:
        for _ in range(round(STOP / step)):
            if way == "overwritten":
                operator.place(data)
            if way == "mocap" and model.joint(joint).type[0] == mujoco.mjtJoint.mjJNT_SLIDE:
                data.mocap_pos[0] = body.pos + motion(data.time)[0] * axis
            elif way == "mocap":
                mujoco.mju_axisAngle2Quat(data.mocap_quat[0], axis, motion(data.time)[0])
            mujoco.mj_step(model, data)
        if way == "operator":
            return data.qpos.copy(), operator.forces(model, data)[joint]
        row = model.joint(joint).dofadr[0]
        return data.qpos.copy(), data.qfrc_constraint[row] if way == "mocap" else math.nan
    finally:
        mujoco.set_mjcb_control(None)


if __name__ == "__main__":
    main(*sys.argv[1:])
