"""``MujocoOperator`` on three files that Gymnasium publishes, beside mocap and weld, a rate overwritten and our FMU."""

from dataclasses import replace
from pathlib import Path

import gymnasium
import mujoco

from referee.engines import mujoco_ways, ours_ways
from referee.task import Task, sinusoid

ASSETS = Path(gymnasium.__file__).parent / "envs/mujoco/assets"
STEP = 5e-4


def prescribed(name, joint, motion, **start):
    """A second of a file: the places of all other joints are asked, and held against a quarter of the step."""
    path = ASSETS / f"{name}.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    others = {other.name: (start.get(other.name, 0.0), 0.0) for other in map(model.joint, range(model.njnt))}
    del others[joint]
    task = Task(f"{path.name}: {joint}", 1.0, {joint: motion}, [*others], f"{path}:{joint}", start=others, file=path)
    return replace(task, reference=lambda _: (mujoco_ways.operated(task, STEP / 4)[0], {}))


TASKS = (
    prescribed("inverted_double_pendulum", "slider", sinusoid(0.0, 0.1, 3.0), hinge=0.1, hinge2=-0.05),
    prescribed("reacher", "joint0", sinusoid(0.0, 0.8, 2.0), joint1=0.5),
    prescribed("swimmer", "motor1_rot", sinusoid(0.0, 0.5, 2.0)),
)
NAMES = ("rate overwritten", "mocap and weld", "MujocoOperator")
WAYS = [
    *(replace(way, steps=[STEP]) for way in mujoco_ways.WAYS if way.name in NAMES),
    replace(ours_ways.WAYS[0], steps=[STEP]),
]
