"""The operator of prescribed joints in MuJoCo."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.errors import InvalidValueError, ProjectError, suggestion
from liaisons_exchange.engines.motions import Motion, evaluated, multipliers, require_motions

mujoco: Any = import_module("mujoco") if find_spec("mujoco") else None

AWAY = 1e-6  # from σ and σ̇ at a start, relative: more than what steps before a saved state miss


@final
class MujocoOperator:
    """Control callback that moves hinges and slides of a MuJoCo model as σ(t), by the exact generalised force.

    With q̈⁰ = M⁻¹ (passive + actuator + applied - bias), what MuJoCo would do without the operator, the prescribed
    joints α get::

        λ = Θ (σ̈ - q̈⁰_α),    Θ = ((M⁻¹)_αα)⁻¹                M eq. 27, 50

    in ``qfrc_applied``, which belongs to the operator there; M, bias and forces are MuJoCo's own.  So q̈_α = σ̈ at each
    stage of a step, and the others feel the inertial coupling.  Example::

        operator = MujocoOperator(model, {"pivot": lambda t: (0.1 * sin(3 * t), 0.3 * cos(3 * t), -0.9 * sin(3 * t))})
        operator.place(data)
        mujoco.set_mjcb_control(operator)

    Call ``place`` after ``mj_resetData``, too: λ keeps σ̈, and the joints stay as far from σ as they start.

    :param model: ``mujoco.MjModel`` whose integrator is RK4, or Euler where no joint damping is integrated implicitly.
    :param motions: joint -> function of time [s] that returns σ, σ̇, σ̈ (rad or m).
    :param control: your own control callback, called before, since λ depends on what actuators do.
    :raises ProjectError: if the package ``mujoco`` is missing.
    :raises InvalidValueError: without motions, for a joint that is unknown or no hinge or slide, and for other
        integrators; by the callback for another model, where time starts and the joints are not at σ and σ̇, where a
        contact, equality, friction loss or limit acts on the kinematic tree of a prescribed joint, and for a motion
        that does not return three finite numbers.

    Source: M 3.5 and 7, with R. Featherstone, Rigid Body Dynamics Algorithms, 9.2 (hybrid dynamics).
    """

    def __init__(
        self,
        model: Any,
        motions: Mapping[str, Motion],
        *,
        control: Callable[[Any, Any], object] | None = None,
    ) -> None:
        if mujoco is None:
            raise ProjectError("MujocoOperator needs MuJoCo; pip install mujoco")
        require_motions(motions)
        _refuse_integrator(model)
        joints = [_joint(model, name) for name in motions]
        self._motions = tuple(motions.items())
        self._control = control
        self._signature = model.signature
        self._rk4 = int(mujoco.mjtIntegrator.mjINT_RK4)
        self._positions = model.jnt_qposadr[joints]
        self._rows = model.jnt_dofadr[joints]
        self._units = np.eye(model.nv)[self._rows]
        self._time = np.inf  # of the last call
        self._coupled = np.isin(model.dof_treeid, model.dof_treeid[self._rows])

    def __call__(self, model: Any, data: Any) -> None:
        """Set ``qfrc_applied`` of the prescribed joints to λ."""
        if self._control is not None:
            self._control(model, data)
        self._refuse(model, data)
        data.qfrc_applied[self._rows] = 0.0
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        motion = evaluated(self._motions, data.time)
        if data.time < self._time:
            self._require_place(data, motion[:2])
        self._time = data.time
        lacking = motion[2] - data.qacc_smooth[self._rows]
        data.qfrc_applied[self._rows] = multipliers(self._inverse_mass(model, data), self._rows, lacking)

    def place(self, data: Any) -> None:
        """Set the prescribed joints to σ and σ̇ at ``data.time``; the others keep place and rate."""
        data.qpos[self._positions], data.qvel[self._rows], _ = evaluated(self._motions, data.time)

    def jump(self, model: Any, data: Any) -> dict[str, float]:
        """Where σ̇ jumps at ``data.time``: set σ and the new σ̇; the momenta of the other joints stay as they are.

        :returns: impulse of λ at each prescribed joint, N s or N m s.
        """
        sigma, sigma_dot, _ = evaluated(self._motions, data.time)
        data.qpos[self._positions] = sigma
        mujoco.mj_fwdPosition(model, data)
        inverse_mass = self._inverse_mass(model, data)
        impulses = multipliers(inverse_mass, self._rows, sigma_dot - data.qvel[self._rows])
        data.qvel[:] += impulses @ inverse_mass
        return self._by_name(impulses)

    def forces(self, model: Any, data: Any) -> dict[str, float]:
        """λ at each prescribed joint at the present state, N or N m; its power is λ σ̇ (M eq. 28)."""
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        self(model, data)
        return self._by_name(data.qfrc_applied[self._rows])

    def _require_place(self, data: Any, wanted: NDArray[np.float64]) -> None:
        """:raises InvalidValueError: if a joint is not at the wanted place and rate, (2, number of joints)."""
        own = np.array([data.qpos[self._positions], data.qvel[self._rows]])
        away = np.argwhere(abs(own - wanted) > AWAY * (1.0 + abs(wanted)))
        if len(away) > 0:
            what, joint = away[0]
            raise InvalidValueError(
                f"{('place', 'rate')[what]} of joint {self._motions[joint][0]!r} is {own[what, joint]:g} at "
                f"t = {data.time:g} s, its motion begins with {wanted[what, joint]:g}; call place(data) of the "
                "operator first, after mj_resetData, too"
            )

    def _by_name(self, values: NDArray[np.float64]) -> dict[str, float]:
        return {name: float(value) for (name, _), value in zip(self._motions, values, strict=True)}

    def _inverse_mass(self, model: Any, data: Any) -> NDArray[np.float64]:
        """Rows α of M⁻¹, which is symmetric."""
        rows = np.empty_like(self._units)
        mujoco.mj_solveM(model, data, rows, self._units)
        return rows

    def _refuse(self, model: Any, data: Any) -> None:
        """MuJoCo adds forces of constraints after the callback, so that λ would not be that of σ(t)."""
        if model.signature != self._signature:
            raise InvalidValueError(
                f"MujocoOperator of {', '.join(name for name, _ in self._motions)} was called with another model: "
                "set_mjcb_control holds for all models; call set_mjcb_control(None) before you step another one"
            )
        if model.opt.integrator != self._rk4:  # without enumerations, which take longer
            _refuse_integrator(model)
        if data.nefc == 0:
            return
        acts = _acting(model, data)[:, self._coupled].any(axis=1)
        if acts.any():
            row = int(np.argmax(acts))
            kind, name = _constraint(model, data, row)
            joints = ", ".join(name for name, _ in self._motions)
            raise InvalidValueError(
                f"{kind} {name} acts at t = {data.time:g} s on the kinematic tree of {joints}, which is prescribed; "
                "take it out of the model, or free these joints"
            )


def _joint(model: Any, name: str) -> int:
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
    if joint < 0:
        names = [model.joint(i).name for i in range(model.njnt)]
        raise InvalidValueError(f"the model has no joint {name!r}{suggestion(name, names)}")
    kind = mujoco.mjtJoint(int(model.jnt_type[joint]))
    if kind not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        raise InvalidValueError(f"joint {name!r} is neither hinge nor slide; prescribe a chain of these in its place")
    return joint


def _refuse_integrator(model: Any) -> None:
    integrator = mujoco.mjtIntegrator(model.opt.integrator)
    if integrator == mujoco.mjtIntegrator.mjINT_RK4:
        return
    explicit = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_EULERDAMP or not model.dof_damping.any()
    if integrator != mujoco.mjtIntegrator.mjINT_EULER or not explicit:
        why = "with joint damping " if integrator == mujoco.mjtIntegrator.mjINT_EULER else ""
        raise InvalidValueError(
            f"integrator {integrator.name} {why}is not explicit; σ̈ would not be kept. Set model.opt.integrator to RK4"
        )


def _acting(model: Any, data: Any) -> NDArray[np.bool_]:
    """Which constraints, in rows, act on which degrees of freedom."""
    if not mujoco.mj_isSparse(model):
        return data.efc_J.reshape(data.nefc, model.nv) != 0.0
    acts = np.zeros((data.nefc, model.nv), dtype=bool)
    acts[np.repeat(np.arange(data.nefc), data.efc_J_rownnz), data.efc_J_colind[: data.efc_J_rownnz.sum()]] = True
    return acts


def _constraint(model: Any, data: Any, row: int) -> tuple[str, str]:
    """Kind and name of a constraint."""
    kinds, kind, index = mujoco.mjtConstraint, mujoco.mjtConstraint(int(data.efc_type[row])), int(data.efc_id[row])
    if kind == kinds.mjCNSTR_EQUALITY:
        return "equality", _named(model.equality(index))
    if kind == kinds.mjCNSTR_FRICTION_DOF:
        return "friction loss of joint", _named(model.joint(int(model.dof_jntid[index])))
    if kind == kinds.mjCNSTR_LIMIT_JOINT:
        return "limit of joint", _named(model.joint(index))
    if kind in (kinds.mjCNSTR_FRICTION_TENDON, kinds.mjCNSTR_LIMIT_TENDON):
        return "friction loss or limit of tendon", _named(model.tendon(index))
    return "contact of geoms", " and ".join(_named(model.geom(int(geom))) for geom in data.contact.geom[index])


def _named(element: Any) -> str:
    """Its name, or its number where it has none."""
    return repr(element.name) if element.name else f"number {element.id}"
