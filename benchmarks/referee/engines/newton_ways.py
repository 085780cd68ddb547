"""Newton, on the processor: kinematic bodies as its documentation has them, and position targets."""

from __future__ import annotations

import newton
import numpy as np
import warp as wp
from numpy.typing import NDArray

from referee.bodies import DUST
from referee.task import Task
from referee.way import CannotError, Run, Way, march

wp.config.quiet = True


class _Model:
    """A task in Newton at its start."""

    def __init__(self, task: Task, step: float, stiffness: float | None) -> None:
        if task.constraint:
            raise CannotError(f"no {task.constraint} tried")
        builder = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        builder.add_mjcf(task.mjcf(step).replace(str(DUST), "1e-06"))  # single precision corrects less
        labels = [label.rpartition("/")[2] for label in builder.joint_label]
        self.places = dict(zip(labels, builder.joint_q_start, strict=True))
        self.rates = dict(zip(labels, builder.joint_qd_start, strict=True))
        if missing := (set(task.motions) | {n for names in task.asked for n in names}) - set(labels):
            raise CannotError(f"its MJCF importer merges joints: {', '.join(sorted(missing))}")
        for name in task.motions:
            joint, row = labels.index(name), self.rates[name]
            if stiffness is None:
                if builder.joint_parent[joint] != -1:
                    raise CannotError("kinematic bodies are roots")
                builder.body_flags[builder.joint_child[joint]] = int(newton.BodyFlags.KINEMATIC)
            else:
                builder.joint_target_mode[row] = int(newton.JointTargetMode.POSITION_VELOCITY)
                builder.joint_target_ke[row], builder.joint_target_kd[row] = (
                    stiffness / step**2,
                    2 * stiffness**0.5 / step,
                )
        self.task, self.step = task, step
        self.model = builder.finalize(device="cpu")
        self.state, self.next, self.control = self.model.state(), self.model.state(), self.model.control()
        q, v = self.model.joint_q.numpy(), self.model.joint_qd.numpy()
        for name, (place, rate) in task.start.items():
            if name == "attitude":
                v[self.rates[name] : self.rates[name] + 3] = [task.start_values[f"omega_{a}_0"] for a in "xyz"]
            else:
                q[self.places[name]], v[self.rates[name]] = place, rate
        self._assign(q, v, 0.0)
        self.solver = newton.solvers.SolverMuJoCo(self.model, use_mujoco_cpu=True, disable_contacts=True)

    def _assign(self, q: NDArray, v: NDArray, t: float) -> None:
        for name, sigma, sigma_dot in zip(self.task.motions, *self.task.sigma(t)[:2], strict=True):
            q[self.places[name]], v[self.rates[name]] = sigma, sigma_dot
        self.state.joint_q.assign(q)
        self.state.joint_qd.assign(v)
        newton.eval_fk(self.model, self.state.joint_q, self.state.joint_qd, self.state)

    def overwrite(self, t: float) -> None:
        self._assign(self.state.joint_q.numpy(), self.state.joint_qd.numpy(), t)

    def target(self, t: float) -> None:
        wanted, rates = self.control.joint_target_q, self.control.joint_target_qd
        q, v = wanted.numpy(), rates.numpy()
        for name, sigma, sigma_dot in zip(self.task.motions, *self.task.sigma(t)[:2], strict=True):
            q[self.places[name]], v[self.rates[name]] = sigma, sigma_dot
        wanted.assign(q)
        rates.assign(v)

    def advance(self) -> None:
        self.solver.step(self.state, self.next, self.control, None, self.step)
        self.state, self.next = self.next, self.state

    def asked(self) -> NDArray:
        q = self.state.joint_q.numpy().astype(float)
        if self.task.asked[0] == ("attitude",):
            x, y, z, w = q[self.places["attitude"] :][:4]
            return np.array([w, x, y, z])
        return np.array([sum(q[self.places[name]] for name in names) for names in self.task.asked])


def kinematic(task: Task, step: float) -> Run:
    it = _Model(task, step, None)

    def advance(t: float) -> None:
        it.overwrite(t)
        it.advance()

    return march(task, step, advance, lambda: (it.asked(), None))


def targeted(task: Task, step: float, stiffness: float) -> Run:
    it = _Model(task, step, stiffness)

    def advance(t: float) -> None:
        it.target(t + step)
        it.advance()

    return march(task, step, advance, lambda: (it.asked(), None))


PAGE = "newton-physics.github.io/newton: "
WAYS = (
    Way("newton", "kinematic body", PAGE + "concepts, articulations, kinematic bodies", kinematic),
    Way(
        "newton",
        "joint target",
        PAGE + "concepts, joint targets",
        targeted,
        [{"stiffness": s} for s in (0.01, 0.1, 1.0)],
    ),
)
