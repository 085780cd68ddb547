"""One environment: a run of FMUs, step by step."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NoReturn, Unpack, final

import casadi as ca
import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike

from liaisons import start
from liaisons.base.arguments import check_integer, name_dictionary
from liaisons.errors import IncompleteError, InvalidValueError, SimulationError
from liaisons.fmu import Call
from liaisons.library import component
from liaisons_motion.gymnasium.task import Floats, Task, TaskOptions
from liaisons_motion.planning import Plan, plan
from liaisons_pages.pictures import last_image

_START = re.compile(r"_0(?=\[|$)")


@final
class Environment(gymnasium.Env[Any, Any]):
    """A mechanism or system to be learned, stepped as FMUs.

    ::

        environment = Environment(
            "Pendulum", observe=["cos(theta)", "sin(theta)", "theta_dot"], act={"pivot_x_ddot": (-5, 5)},
            reward="1 - cos(theta)", step_size=0.02, stop="abs(pivot_x) - 2", stop_time=5.0,
            randomize={"mass": (0.8, 1.2)},
        )

    ``reset(options={"theta_0": 0.3})`` sets start values of one episode.  ``info`` has the energy balance at every
    step.  A step that an FMU refuses ends the episode, and ``info["failure"]`` gives the reason.  Settings are those of
    :class:`Task`.

    :raises LiaisonsError: for an unknown name, an empty range, or a value that the subject cannot have.
    """

    metadata = gymnasium.Env.metadata | {"render_modes": ["rgb_array"]}

    def __init__(
        self,
        subject: Any,
        observe: Sequence[str],
        act: Mapping[str, Sequence[float]],
        reward: str,
        step_size: float,
        **options: Unpack[TaskOptions],
    ) -> None:
        task = Task(subject, observe, act, reward, step_size, **options)
        self.task, self.render_mode, self.action_space = task, task.render_mode, task.action_space
        self.metadata = self.metadata | {"render_fps": round(1 / task.step_size)}
        low, high = ({name: pair[end] for name, pair in task.randomize.items()} for end in (0, 1))
        self._run = start(task.subject, step_size=task.step_size / 2, start_values={**task.start_values, **low})
        try:
            self._compile_measures(high)
        except BaseException:
            self.close()
            raise

    def __reduce__(self) -> NoReturn:
        """Refuse copies, which would share the instance of an FMU."""
        raise SimulationError(f"{self.title} is neither copied nor pickled; make another Environment")

    def _compile_measures(self, highest: dict[str, Any]) -> None:
        """Compile observations, reward and stop, and refuse start values that the subject cannot have."""
        task = self.task
        self._run.reset(highest)
        result = self._run.result
        self.title, self._scene = result.title, result.scene
        self._balances = [name for name in result.names if name.rpartition(".")[2] == "energy_balance"]
        inputs = [name for port in task.act_ports for name in port]
        self._step = self._run.stepper(inputs, [])
        if jumping := [name for name in task.act if f"{name}_power" in result.names]:
            raise InvalidValueError(f"act: {jumping[0]} would jump; act on {jumping[0]}_dot or {jumping[0]}_ddot")
        measures = task.measures({name: ca.SX.sym(name) for name in (*result.names, *inputs, *task.randomize)})
        symbols = ca.vertcat(*ca.symvar(measures))
        self._names = [x.name() for x in ca.vertsplit(symbols)]
        self._numbers, self._measures = np.zeros(len(self._names)), np.zeros(measures.numel())
        function = ca.Function("measures", [symbols], [ca.densify(measures)])
        self._call = Call(function, (self._numbers,), (self._measures,))
        self._begin_episode({})
        self.observation_space = Box(-np.inf, np.inf, (self._measures.size - 2,), np.float64)
        self._ended = True

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode.

        :param options: start values by name.
        :raises SimulationError: for an unknown name, or a value that cannot be set.
        """
        if seed is not None:
            check_integer("seed", seed, minimum=0)
        options = {} if options is None else options
        super().reset(seed=seed)
        drawn = {name: self.np_random.uniform(low, high) for name, (low, high) in self.task.randomize.items()}
        self._begin_episode({**drawn, **name_dictionary("options", options)})
        self._observed = self._evaluate_measures()[:-2]
        return self._observed.copy(), self._energy_balances()

    def step(self, action: ArrayLike) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Advance by a step, in which the acts are held.

        :returns: observation, reward, whether the episode has ended, whether it was truncated, information.
        :raises SimulationError: for an action of another shape or outside its range, and after the end of an episode.
        """
        task, acts = self.task, self.task.checked_action(action)
        if self._ended:
            raise SimulationError(f"{self.title}: no episode is under way; call reset() first")
        try:
            middle, after = self._advance_half_step(acts), self._advance_half_step(acts)
        except IncompleteError as error:
            self._ended = True
            return self._observed.copy(), 0.0, True, False, {"failure": str(error)}
        stopped = bool(after[-1] > 0)
        truncated = self._run.time > task.stop_time - task.step_size / 4
        self._ended, self._observed = stopped or truncated, after[:-2].copy()
        return after[:-2], task.step_size * float(middle[-2]), stopped, truncated, self._energy_balances()

    def render(self) -> Any:
        """Pixels of the picture, (height, width, 3); None without ``render_mode``."""
        if self.render_mode is None or self._scene is None:
            return None
        names = self._scene.picture.variables
        self._shown.append([self._run.time, *map(self._value, names)])
        time, *columns = np.transpose(self._shown)
        values = dict(zip(names, columns, strict=True))
        return last_image(self._scene.picture, time, values.__getitem__, title=self.title)

    def close(self) -> None:
        """Free the FMUs."""
        self._run.close()

    @cached_property
    def optimum(self) -> Plan:
        """Motion of largest return from the start of this episode until ``stop_time``, see :func:`liaisons.plan`.

        Its cost is the integral of the negative reward, so the regret is ``-optimum.cost`` minus the return.  Actions
        of the plan are not constant over steps.  State the limits of ``stop`` in ``goal``, as bounds.  The computation
        takes seconds, once per episode.

        :raises PlanError: if there is no such motion.
        """
        task, declared = self.task, {parameter.name for parameter in component(self.task.subject).parameters}
        goal = {
            "duration": task.stop_time,
            "minimize": f"-({task.reward})",
            "start": {_START.sub("", name): self._starts[name] for name in self._starts if name not in declared},
            "start_values": {name: self._starts[name] for name in self._starts if name in declared},
            **task.goal,
            "bounds": {**task.act, **task.goal.get("bounds", {})},
        }
        moves, controls = ([port[0] for port in task.act_ports if (len(port) > 1) == moved] for moved in (True, False))
        return plan(task.subject, moves or None, controls=controls or None, **goal)

    def _begin_episode(self, starts: dict[str, Any]) -> None:
        """Reset the run to start values, and forget what was drawn and planned of the last episode."""
        self._run.reset(starts)
        self._own = {name: self._run[name] for port in self.task.act_ports for name in port[:-1]}
        self._starts, self._shown, self._ended = {**self.task.start_values, **starts, **self._own}, [], False
        vars(self).pop("optimum", None)

    def _advance_half_step(self, acts: Floats) -> Floats:
        """Hold the acts for half a step; return observations, reward and stop after it."""
        held = self._own | dict(zip(self.task.act, acts.tolist(), strict=True))
        self._step([held[name] for port in self.task.act_ports for name in port])
        self._own = self.task.advance_moved(held, self.task.step_size / 2)
        return self._evaluate_measures()

    def _value(self, name: str) -> float:
        """Value of a variable: that which the environment sets, else that of the run."""
        return self._own[name] if name in self._own else self._run[name]

    def _evaluate_measures(self) -> Floats:
        """Observations, reward and stop, (observations + 2,)."""
        self._numbers[:] = [self._value(name) for name in self._names]
        self._call.run()
        return self._measures.copy()

    def _energy_balances(self) -> dict[str, Any]:
        return {name: self._run[name] for name in self._balances}
