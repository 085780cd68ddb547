"""Newton, on the processor: kinematic bodies as its documentation has them, and joint targets."""

import mujoco
import newton
import warp as wp

from referee.way import CannotError, Model, Way

wp.config.quiet = True


class _Model(Model):
    """A task in Newton at its start; joints follow targets if they have a stiffness, else they are kinematic."""

    def __init__(self, task, step, stiffness=0.0):
        if task.constraint == "equality":
            raise CannotError("importer leaves out a site")
        inertia = mujoco.MjModel.from_xml_string(task.mjcf())
        builder = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        builder.add_mjcf(task.mjcf().replace("1e-12", "1e-06"))  # single precision corrects less
        names = [label.rpartition("/")[2] for label in builder.joint_label]
        for name in task.motions:
            joint = names.index(name)
            row = builder.joint_qd_start[joint]
            if stiffness:
                builder.joint_target_mode[row] = int(newton.JointTargetMode.POSITION_VELOCITY)
                own = inertia.dof_M0[inertia.joint(name).dofadr[0]]
                builder.joint_target_ke[row] = own * stiffness / step**2
                builder.joint_target_kd[row] = own * 2 * stiffness**0.5 / step
            elif builder.joint_parent[joint] != -1:
                raise CannotError("no joint between bodies")
            else:
                builder.body_flags[builder.joint_child[joint]] = int(newton.BodyFlags.KINEMATIC)
        self.model = builder.finalize(device="cpu")
        self.now, self.next, self.control = self.model.state(), self.model.state(), self.model.control()
        contacts = task.constraint == "contact"
        self.solver = newton.solvers.SolverMuJoCo(self.model, use_mujoco_cpu=True, disable_contacts=not contacts)
        self.observed = self.solver.observables({"qfrc_actuator"})
        super().__init__(task, step, names, builder.joint_q_start, builder.joint_qd_start)

    q = property(lambda self: self.now.joint_q.numpy().astype(float))
    v = property(lambda self: self.now.joint_qd.numpy().astype(float))

    def write(self, q, v):
        self.now.joint_q.assign(q)
        self.now.joint_qd.assign(v)
        newton.eval_fk(self.model, self.now.joint_q, self.now.joint_qd, self.now)

    def advance(self, _):
        self.solver.step(self.now, self.next, self.control, None, self.step, observables=self.observed)
        self.now, self.next = self.next, self.now

    def attitude(self, q):
        return q[[3, 0, 1, 2]]


def targeted(task, step, stiffness):
    it = _Model(task, step, stiffness)
    places, rates = it.control.joint_target_q.numpy(), it.control.joint_target_qd.numpy()

    def aim(t):
        places[it.moved], rates[it.rows], _ = task.sigma(t + step)
        it.control.joint_target_q.assign(places)
        it.control.joint_target_qd.assign(rates)

    return it.march(aim, lambda: it.observed.qfrc_actuator.numpy()[it.rows].astype(float))


PAGE = "https://newton-physics.github.io/newton/latest/"
WAYS = (
    Way("newton", "kinematic body", f"{PAGE}concepts/articulations.html#kinematic-links", _Model.overwritten),
    Way("newton", "joint target", f"{PAGE}solvers/mujoco.html", targeted, {"stiffness": (1e-3, 1e-2, 0.1, 1.0)}),
)
