"""Many environments together, as an ensemble in compiled code."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, final

import casadi as ca
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arguments import named, numbers, whole
from liaisons.base.port_names import port_names
from liaisons.ensembles.methods import METHODS
from liaisons.ensembles.right_hand_sides import right_hand_side, settable, smooth_model
from liaisons.ensembles.steps import compiled, packs, unpacked
from liaisons.errors import ComponentError, InvalidValueError, SimulationError, suggestion
from liaisons.expressions import Program, program
from liaisons.gymnasium.task import BALANCE, Floats, Signals, Task, evaluator

Truths = NDArray[np.bool_]


@final
class VectorEnvironment(VectorEnv[Floats, Floats, NDArray[Any]]):
    """Copies of an :class:`Environment` of one component, integrated together, each with draws of its own.

    An episode that has ended is reset by the next step.  A step is one of a method of eighth order; the energy balance
    in ``info`` is what its errors have summed up to since the reset.

    :raises LiaisonsError: as for :class:`Environment`, and for contacts, samples and arrays of values.
    """

    metadata: ClassVar[dict[str, Any]] = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    def __init__(self, *subject: Any, num_envs: int = 1, **settings: Any) -> None:
        """Take the settings of :class:`Task`, and how many copies."""
        self.task = task = Task(*subject, **settings)
        whole("num_envs", num_envs)
        self.num_envs = num_envs
        model = smooth_model(task.subject, "a VectorEnvironment", "take Environment, which runs its FMU")
        self.title, variables = model.name, settable(model, {})
        ports = [port_names(base)[: order + 1] for base, order in task.acts]
        moved, rates = ([name for port in ports for name in port[part]] for part in (slice(0, -1), slice(1, None)))
        self._names = list(dict.fromkeys([*task.randomize, *task.act, *moved]))
        shared = {name: value for name, value in task.start_values.items() if name not in self._names}
        for name in (*self._names, *shared):
            if name not in variables:
                raise ComponentError(f"{self.title} has no value {name!r} to set{suggestion(name, variables)}")
        for name, order in task.acts:
            if not order and name in {active.value for active in model.active}:
                raise task.jump_error(name)
        values = {name: variable.starts[0] for name, variable in variables.items()} | dict(task.start_values)
        self._first = np.array([numbers(name, values[name]) for name in self._names])[:, None]
        self._once = np.array([numbers(name, value) for name, value in shared.items()], dtype=float)

        outputs = [variable.name for variable in model.outputs]
        found = right_hand_side(model, {}, lanes=self._names, shared=shared, record=outputs)
        t, each, once, y = found.symbols
        lanes = dict(zip(self._names, ca.vertsplit(each), strict=True))
        self._fixed = [row for row, name in enumerate(self._names) if name not in moved]
        clock = ca.SX.sym("clock")
        followed = ca.vertcat(*(lanes[name] for name in moved), clock)
        states, fixed = ca.vertcat(y, followed), each[self._fixed]

        def timed(expression: ca.SX) -> ca.SX:
            """The expression with the time of each lane."""
            return ca.substitute(expression, t, clock)

        equations = replace(
            found,
            symbols=(t, fixed, once, states),
            rates=ca.vertcat(timed(found.rates), *(lanes[name] for name in rates), 1),
            projected=None if found.projected is None else ca.vertcat(timed(found.projected), followed),
        )
        self._advance = compiled(equations, METHODS["rk8"], self._once)
        start = ca.vertcat(found.start, *(lanes[name] for name in moved), 0)
        self._begin, self._columns = program([each, once], [start]), [fixed, once, states]
        self._conditions = program(self._columns, [timed(found.conditions)])
        constants = {name: ca.SX(value) for name, value in values.items() if np.ndim(value) == 0}
        readings = dict(zip(outputs, ca.vertsplit(timed(found.outputs)), strict=True))
        self._expressions = constants | readings | lanes
        self._programs: dict[str, Program] = {}

        self._observed = [evaluator(name)[0] for name in task.observe]
        self._reward, self._stop = (evaluator(one)[0] for one in (task.reward, task.stop or (lambda _: False)))
        self._values, self._states = np.repeat(self._first, num_envs, 1), np.empty((states.numel(), num_envs))
        self._elapsed, self._balance = np.zeros(num_envs), np.zeros(num_envs)
        self._ended, self._begun = np.ones(num_envs, dtype=bool), False
        self._restart(self._ended)
        self.single_action_space = task.action_space
        self.single_observation_space = Box(-np.inf, np.inf, self._observations(self._signals()).shape[1:], np.float64)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode in all copies.

        :param seed: of all draws: one number.
        :param options: start values by name, of those that are randomized, integrated or acted on: a number, or one for
            each copy.
        """
        if isinstance(seed, list):
            raise InvalidValueError(f"seed = {seed!r}: give one number, of which all draws follow")
        super().reset(seed=seed)
        self._restart(np.ones(self.num_envs, dtype=bool), named("options", options or {}))
        self._begun, self._ended = True, np.zeros(self.num_envs, dtype=bool)
        return self._observations(self._signals()), self._information()

    def step(self, actions: ArrayLike) -> tuple[Floats, Floats, Truths, Truths, dict[str, Any]]:
        """Hold the acts for a step; copies whose episode has ended are reset, and earn nothing.

        :param actions: shape (copies, acts).
        :returns: observations, rewards, whether episodes have ended, whether they were truncated, information.
        :raises SimulationError: for actions of another shape or outside their ranges, and before the first reset.
        """
        task, size = self.task, self.task.step_size
        acts = task.checked_action(actions, self.num_envs)
        if not self._begun:
            raise SimulationError(f"{self.title}: no episode is under way; call reset() first")
        self._values[[self._names.index(name) for name in task.act]] = acts.T
        before, balance = self._states, self._energy_balance()
        blocks = packs(before, fill="edge")
        self._advance(0.0, size, 1, packs(self._values[self._fixed], fill="edge"), blocks)
        self._states, again = unpacked(blocks, self.num_envs), self._ended
        (conditions,) = self._conditions.evaluate(self._numbers)
        failed = ~(np.isfinite(self._states).all(axis=0) & (conditions > 0).all(axis=0)) & ~again
        self._states[:, failed] = before[:, failed]
        self._balance += self._energy_balance() - balance
        self._elapsed += size
        self._restart(again)

        signals, moving = self._signals(), ~(again | failed)
        stopped = failed | (moving & (np.asarray(self._stop(signals)) > 0))
        stop_time = np.inf if task.stop_time is None else task.stop_time
        truncated = moving & (self._elapsed > stop_time - size / 2)
        self._ended = stopped | truncated
        rewards = size * np.where(moving, self._reward(signals), 0.0)
        information = self._information() | {"failure": failed, "_failure": failed}
        return self._observations(signals), rewards, stopped, truncated, information

    def _restart(self, again: Truths, options: Any = None) -> None:
        """Begin an episode in some copies."""
        if not again.any():
            return
        starts = {name: self.np_random.uniform(*pair, again.sum()) for name, pair in self.task.randomize.items()}
        self._values[:, again] = self._first
        for name, value in (starts | dict(options or {})).items():
            if name not in self._names:
                raise ComponentError(f"{self.title} has no value {name!r} to reset{suggestion(name, self._names)}")
            self._values[self._names.index(name), again] = numbers(name, value)
        self._states[:, again] = self._begin.evaluate([self._values[:, again], self._once[:, None]])[0]
        self._elapsed[again] = self._balance[again] = 0.0

    @property
    def _numbers(self) -> list[Floats]:
        """Fixed values, those that all copies share, and states."""
        return [self._values[self._fixed], self._once[:, None], self._states]

    def _read(self, name: str) -> Floats:
        """A variable of all copies."""
        if name not in self._programs:
            if name not in self._expressions:
                raise ComponentError(f"{self.title} has no variable {name!r}{suggestion(name, self._expressions)}")
            self._programs[name] = program(self._columns, [self._expressions[name]])
        return self._programs[name].evaluate(self._numbers)[0][0]

    def _energy_balance(self) -> Floats | float:
        """Energy less work, and what was dissipated; no start, of which the model's own balance has no memory here."""
        if BALANCE not in self._expressions:
            return 0.0
        energy, work, dissipated = map(self._read, ("energy", "work", "dissipated"))
        return energy - work + dissipated

    def _signals(self) -> Signals:
        return Signals(self._read, {})

    def _observations(self, signals: Signals) -> Floats:
        return np.stack([np.broadcast_to(read(signals), self.num_envs) for read in self._observed], axis=-1)

    def _information(self) -> dict[str, Any]:
        if BALANCE not in self._expressions:
            return {}
        return {BALANCE: self._balance.copy(), f"_{BALANCE}": np.ones(self.num_envs, dtype=bool)}
