"""Newton, on the processor: kinematic bodies as its documentation has them, and joint targets."""

from __future__ import annotations

from typing import Any

import newton
import warp as wp
from numpy.typing import NDArray

from referee.task import Task
from referee.way import CannotError, Places, Run, Way, march

wp.config.quiet = True


class _Model:
    """A task in Newton at its start."""

    def __init__(self, task: Task, step: float, stiffness: float | None) -> None:
        if task.constraint in ("friction loss", "equality"):
            raise CannotError(f"its MJCF importer leaves out the {task.constraint}")
        builder = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        builder.add_mjcf(task.mjcf().replace("1e-12", "1e-06"))  # single precision corrects less
        names = [label.rpartition("/")[2] for label in builder.joint_label]
        addresses = (builder.joint_q_start, builder.joint_qd_start)
        if missing := {*task.motions, *task.asked} - {*names}:
            raise CannotError(f"its MJCF importer merges joints: {', '.join(sorted(missing))}")
        # x, y, z, w
        self.places = Places(task, *(dict(zip(names, a, strict=True)) for a in addresses), lambda q: q[[3, 0, 1, 2]])
        for name, row in zip(task.motions, self.places.rows, strict=True):
            joint = names.index(name)
            if stiffness:
                builder.joint_target_mode[row] = int(newton.JointTargetMode.POSITION_VELOCITY)
                builder.joint_target_ke[row] = stiffness / step**2
                builder.joint_target_kd[row] = 2 * stiffness**0.5 / step
            elif builder.joint_parent[joint] != -1:
                raise CannotError("kinematic bodies are roots")
            else:
                builder.body_flags[builder.joint_child[joint]] = int(newton.BodyFlags.KINEMATIC)
        self.task, self.step = task, step
        self.model: Any = builder.finalize(device="cpu")
        self.state, self.next, self.control = self.model.state(), self.model.state(), self.model.control()
        self.write(self.state.joint_q, self.state.joint_qd, self.places.start)
        newton.eval_fk(self.model, self.state.joint_q, self.state.joint_qd, self.state)
        contacts = task.constraint == "contact"
        self.solver = newton.solvers.SolverMuJoCo(self.model, use_mujoco_cpu=True, disable_contacts=not contacts)

    def write(self, places: Any, rates: Any, change: Any, *when: float) -> None:
        q, v = places.numpy(), rates.numpy()
        change(q, v, *when)
        places.assign(q)
        rates.assign(v)

    def march(self, before: Any) -> Run:
        def advance(t: float) -> None:
            before(t)
            self.solver.step(self.state, self.next, self.control, None, self.step)
            self.state, self.next = self.next, self.state

        def read() -> tuple[NDArray, None]:
            return self.places.read(self.state.joint_q.numpy().astype(float)), None

        return march(self.task, self.step, advance, read)


def kinematic(task: Task, step: float) -> Run:
    it = _Model(task, step, None)

    def move(t: float) -> None:
        it.write(it.state.joint_q, it.state.joint_qd, it.places.move, t)
        newton.eval_fk(it.model, it.state.joint_q, it.state.joint_qd, it.state)

    return it.march(move)


def targeted(task: Task, step: float, stiffness: float) -> Run:
    it = _Model(task, step, stiffness)
    wanted = (it.control.joint_target_q, it.control.joint_target_qd)
    return it.march(lambda t: it.write(*wanted, it.places.move, t + step))


PAGE = "https://newton-physics.github.io/newton/latest/"
WAYS = (
    Way("newton", "kinematic body", f"{PAGE}concepts/articulations.html#kinematic-links", kinematic),
    Way("newton", "joint target", f"{PAGE}solvers/mujoco.html", targeted, [{"stiffness": s} for s in (0.01, 0.1, 1.0)]),
)
