"""Many environments together, as an ensemble in compiled code; with contacts each in the code of its FMU."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NoReturn, final

import casadi as ca
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike

from liaisons.base.arguments import check_integer, float_array
from liaisons.base.arrays import lane_blocks, rows_of_blocks
from liaisons.errors import InvalidValueError, SimulationError
from liaisons.expressions import Program
from liaisons.library import component
from liaisons_motion.ensembles import Members
from liaisons_motion.gymnasium.environment import Environment
from liaisons_motion.gymnasium.task import Floats, Task, Truths
from liaisons_motion.right_hand_sides import LANES, METHODS, ContinuousModel, compiled_advance, continuous_model

_MOST_COPIES = 10**7


@final
class VectorEnvironment(VectorEnv[Any, Any, Any]):
    """Copies of an :class:`Environment` of one component, integrated together, each with its own random values.

    An episode that has ended is reset by the next step.  Each half step is one step of a method of eighth order; the
    energy balance in ``info`` is the sum of its errors since the reset.  With unilateral liaisons or dry friction each
    half step is that of the FMU, with the same numbers.

    :raises LiaisonsError: as for :class:`Environment`, and for samples and arrays of values.
    """

    metadata = VectorEnv.metadata | {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, *subject: Any, num_envs: int = 1, **settings: Any) -> None:
        """Take the settings of :class:`Task`, and how many copies."""
        declared = component(Task(*subject, **settings).subject)
        model = continuous_model(
            declared, "a VectorEnvironment", "take Environment, which runs its FMU", allow_contacts=True
        )
        one = Environment(*subject, **settings)  # refuses what is wrong
        one.close()
        check_integer("num_envs", num_envs)
        if num_envs > _MOST_COPIES:
            raise InvalidValueError(f"num_envs = {num_envs}: more than memory holds; {_MOST_COPIES} at most")
        self.task, self.title, self.num_envs = one.task, one.title, (num_envs := int(num_envs))
        self.single_action_space, self.single_observation_space = one.action_space, one.observation_space
        self.action_space = batch_space(one.action_space, num_envs)
        self.observation_space = batch_space(one.observation_space, num_envs)
        self._moved = [name for port in self.task.act_ports for name in port[:-1]]
        self._names = list(dict.fromkeys([*self.task.act, *self.task.randomize, *self._moved]))
        self._fixed = [row for row, name in enumerate(self._names) if name not in self._moved]
        variables = model.variables
        values = {name: variable.starts[0] for name, variable in variables.items()} | dict(self.task.start_values)
        self._common = [name for name in self.task.start_values if name not in self._names]
        self._first, self._shared = (
            np.array([float_array(name, values[name]) for name in names]).reshape(-1, 1)
            for names in (self._names, self._common)
        )
        (self._create_instances if model.model.contacts else self._compile_ensemble)(model)
        self._elapsed, self._balance = np.zeros((2, num_envs))
        self._ended = np.zeros(0, dtype=bool)

    def __reduce__(self) -> NoReturn:
        """Refuse copies, which would share what is in compiled code."""
        raise SimulationError(f"{self.title} is neither copied nor pickled; make another VectorEnvironment")

    def _compile_ensemble(self, one: ContinuousModel) -> None:
        """Compile a step of all copies; what acts move, and the time of each copy, are states."""
        task, moved, model = self.task, self._moved, one.model
        outputs = [variable.name for variable in model.outputs]
        original = one.right_hand_side(lanes=self._names, shared=self._common, record=outputs)
        t, each, once, y = original.symbols
        lanes, clock = dict(zip(self._names, ca.vertsplit(each), strict=True)), ca.SX.sym("clock")
        followed = ca.vertcat(*(lanes[name] for name in moved), clock)
        columns = each[self._fixed], once, ca.vertcat(y, followed)
        expressions = [original.rates, original.outputs, original.conditions, original.projected, original.reach]
        rates, readings, conditions, projected, reach = ca.substitute(expressions, [t], [clock])
        equations = replace(
            original,
            symbols=(t, *columns),
            rates=ca.vertcat(rates, *(lanes[name] for port in task.act_ports for name in port[1:]), 1),
            projected=ca.vertcat(projected, followed),
            reach=reach,
            full_rank=ca.SX(np.inf),  # a copy has no other steps to take
        )
        step = compiled_advance(equations, METHODS["rk8"], self._shared)
        starts = Program.of([each, once], [ca.vertcat(original.start, *(lanes[name] for name in moved), 0)])

        def advance(size: float) -> Floats:
            blocks, fixed = (lane_blocks(rows, LANES) for rows in (self._states, self._values[self._fixed]))
            step(0.0, size, 1, fixed, blocks)
            return rows_of_blocks(blocks, self.num_envs)

        def start(restarted: Truths) -> Floats:
            return starts.evaluate([self._values[:, restarted], self._shared])[0]

        self._motion = start, advance
        signals = dict(zip(outputs, ca.vertsplit(readings), strict=True))
        balance = ca.SX(0, 1)
        if "energy_balance" in signals:  # which remembers a start, another one for each copy
            balance = signals["energy"] - signals["work"] + signals["dissipated"]
        begun = range(len(model.condition_texts) - model.start_only, len(model.condition_texts))
        lasting = [row for row in range(conditions.numel()) if row not in begun]
        gaps = [gap for name in moved for gap in one.domain_gaps(name, lanes[name])]
        last = ca.vertcat(conditions[lasting], *gaps)
        self._program = Program.of(columns, [task.measures(signals | lanes), balance, last])

    def _create_instances(self, one: ContinuousModel) -> None:
        """Create an instance of the FMU's code for each copy; its outputs, and what acts move, serve as states."""
        task, moved, outputs = self.task, self._moved, [variable.name for variable in one.model.outputs]
        members, time = Members(one.model, self.num_envs), np.zeros(self.num_envs)
        inputs = [name for port in task.act_ports for name in port]

        def advance(size: float) -> Floats:
            values = dict(zip(self._names, self._values, strict=True))
            values |= dict(zip(moved, self._states[len(outputs) :], strict=True))
            held = np.stack([values[name] for name in inputs], axis=-1)
            members.step(np.array([0.0, size]), inputs, held, origin=time)
            time[:] += size
            values = task.advance_moved(values, size)
            return np.vstack([members.read(outputs).T, *(values[name] for name in moved)])

        def start(restarted: Truths) -> Floats:
            names, values = [*self._names, *self._common], np.repeat(self._shared, self.num_envs, axis=1)
            values = np.vstack([self._values, values]).T
            time[restarted] = 0.0
            for copy in np.flatnonzero(restarted).tolist():
                members.start(names, values[copy : copy + 1], time=0.0, tolerance=0.0, first=copy)
            for copy, reason in members.failures().items():
                if restarted[copy]:
                    drawn = ", ".join(f"{name} = {values[copy, names.index(name)]:g}" for name in task.randomize)
                    raise SimulationError(f"{self.title}, copy {copy}: {drawn}: {reason}")
            rows = [self._names.index(name) for name in moved]
            return np.vstack([members.read(outputs).T, self._values[rows]])[:, restarted]

        self._motion = start, advance
        each, once = ca.SX.sym("each", len(self._fixed)), ca.SX.sym("shared", len(self._common))
        y = ca.SX.sym("y", len(outputs) + len(moved))
        lanes = dict(zip((self._names[row] for row in self._fixed), ca.vertsplit(each), strict=True))
        signals = lanes | dict(zip((*outputs, *moved), ca.vertsplit(y), strict=True))
        balance = signals.get("energy_balance", ca.SX(0, 1))
        self._program = Program.of([each, once, y], [task.measures(signals), balance, ca.SX(0, 1)])

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode in all copies.

        :param seed: of all draws.
        :param options: none: start values are drawn.
        """
        if options:
            raise InvalidValueError(f"options = {options!r}: give ranges in randomize")
        super().reset(seed=seed)
        self._values, self._ended = np.repeat(self._first, self.num_envs, axis=1), np.zeros(self.num_envs, dtype=bool)
        self._states = self._motion[0](~self._ended)
        self._restart(~self._ended)
        return self._evaluate()[0][:-2].T, {"energy_balance": self._balance.copy()}

    def step(self, actions: ArrayLike) -> tuple[Floats, Floats, Truths, Truths, dict[str, Any]]:
        """Advance by a step, in which the acts are held; copies whose episode has ended are reset, and earn nothing.

        :param actions: shape (copies, acts).
        :returns: observations, rewards, whether episodes have ended, whether they were truncated, information.
        :raises SimulationError: for actions of another shape or outside their ranges, and before the first reset.
        """
        acts, size, restarted = self.task.checked_action(actions, self.num_envs), self.task.step_size, self._ended
        if not restarted.size:
            raise SimulationError(f"{self.title}: no episode is under way; call reset() first")
        before = self._states
        self._values[: len(self.task.act)] = acts.T
        measured = [self._evaluate()]
        for _ in range(2):
            self._states = self._motion[1](size / 2)
            measured.append(self._evaluate())
        (_, begin, _), (middle, *_), (after, end, conditions) = measured
        failed = ~(restarted | (np.isfinite(self._states).all(axis=0) & (conditions > 0).all(axis=0)))
        self._states[:, failed] = before[:, failed]
        self._balance += np.where(failed, 0.0, (end - begin).sum(axis=0))
        self._elapsed += size
        self._restart(restarted)
        moving = ~(restarted | failed)
        after[:, ~moving] = self._evaluate(~moving)[0]
        stopped = failed | (moving & (after[-1] > 0))
        truncated = moving & (self._elapsed > self.task.stop_time - size / 4)
        self._ended = stopped | truncated
        rewards = size * np.where(moving, middle[-2], 0.0)
        return after[:-2].T, rewards, stopped, truncated, {"energy_balance": self._balance.copy(), "failure": failed}

    def _restart(self, restarted: Truths) -> None:
        """Begin an episode in these copies, with draws of their own."""
        self._values[:, restarted] = self._first
        for name, (low, high) in self.task.randomize.items():
            self._values[self._names.index(name), restarted] = self.np_random.uniform(low, high, restarted.sum())
        self._states[:, restarted] = self._motion[0](restarted)
        self._elapsed[restarted] = self._balance[restarted] = 0.0

    def _evaluate(self, copies: Any = ...) -> list[Floats]:
        """Arrays of observations, reward and stop; of the energy balance; of conditions: (rows, copies) each."""
        return self._program.evaluate([self._values[self._fixed][:, copies], self._shared, self._states[:, copies]])
