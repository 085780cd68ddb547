"""One environment: a run of FMUs, step by step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, final

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike

from liaisons.base.arguments import named, with_settings
from liaisons.base.port_names import port_names
from liaisons.errors import IncompleteError, SimulationError
from liaisons.gymnasium.task import BALANCE, Floats, Signals, Task, advanced, evaluator
from liaisons.interface import System, start
from liaisons.library import component
from liaisons.pictures.drawing import pixels
from liaisons.pictures.frames import frames
from liaisons.pictures.stage import Stage
from liaisons.planning import Plan, plan


@final
@dataclass(frozen=True, eq=False)
class Optimum:
    """The best motion from the start of an episode.

    :param plan: that motion; ``plan.cost`` is the integral of the negative reward.
    :param total: its rewards, summed up as those of an episode are: ``total`` less these is a learner's regret.
    """

    plan: Plan
    total: float


@final
class Environment(gymnasium.Env[Floats, Floats]):
    """A mechanism or system to be learned, stepped as FMUs.

    ::

        environment = Environment(
            "Pendulum", observe=["cos(theta)", "sin(theta)", "theta_dot"], act={"pivot_x_ddot": (-5, 5)},
            reward="1 - cos(theta)", step_size=0.02, stop="abs(pivot_x) - 2", stop_time=5.0,
            randomize={"mass": (0.8, 1.2)},
        )

    ``reset(options={"theta_0": 0.3})`` sets start values of one episode.  ``info`` has the energy balance at every step;
    what an FMU refuses ends the episode, and ``info["failure"]`` says why.  Settings are those of :class:`Task`.

    :raises LiaisonsError: for an unknown name, an empty range, or a value that the subject cannot have.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"]}

    @with_settings(Task)
    def __init__(self, task: Task) -> None:
        self.task, self.render_mode = task, task.render_mode
        self.metadata = {**type(self).metadata, "render_fps": round(1 / task.step_size)}
        (*self._observed, self._reward, self._stop), names = zip(
            *map(evaluator, [*task.observe, task.reward, task.stop or (lambda _: False)]), strict=True
        )
        prefixes = [f"{part}." for part in task.subject.parts] if isinstance(task.subject, System) else [""]
        self._run = start(
            task.subject,
            step_size=task.step_size,
            record=list(dict.fromkeys(sum(names, []))) or None,
            start_values={**task.start_values, **{name: low for name, (low, _) in task.randomize.items()}},
        )
        self.title = self._run.result.title
        self._run.reset({name: high for name, (_, high) in task.randomize.items()})
        self._balances = [name for prefix in prefixes if self._has(name := f"{prefix}{BALANCE}")]
        for base, order in task.acts:
            if not order and self._has(rate := port_names(base).rate) and self._has(base, rate, step=True):
                raise task.jump_error(base)
        inputs = [name for base, order in task.acts for name in (port_names(base)[:3] if order else [base])]
        self._step = self._run.stepper(inputs, [])
        self.action_space = task.action_space
        self._begin({})
        self.observation_space = Box(-np.inf, np.inf, self._observation().shape, dtype=np.float64)
        self._ended = True

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode.

        :param options: start values of it by name.
        :raises SimulationError: for an unknown name, or a value that cannot be set.
        """
        super().reset(seed=seed)
        drawn = {name: self.np_random.uniform(*pair) for name, pair in self.task.randomize.items()}
        self._begin(drawn | dict(named("options", options or {})))
        return self._observation(), self._information()

    def step(self, action: ArrayLike) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Hold the acts for a step.

        :returns: observation, reward, whether the episode has ended, whether it was truncated, information.
        :raises SimulationError: for an action of another shape or outside its range, and after the end of an episode.
        """
        values = self.task.checked_action(action)
        if self._ended:
            raise SimulationError(f"{self.title}: no episode is under way; call reset() first")
        inputs = advanced(self.task.acts, values, self._sigma, self.task.step_size)
        try:
            self._step(np.array([*inputs.values()]))
        except IncompleteError as error:
            self._ended = True
            return self._observation(), 0.0, True, False, {"failure": str(error)}
        self._signals = Signals(self._run.__getitem__, {**inputs, **self._sigma})
        stopped = bool(self._stop(self._signals) > 0)
        stop_time = np.inf if self.task.stop_time is None else self.task.stop_time
        truncated = bool(self._run.time > stop_time - self.task.step_size / 2)
        self._ended = stopped or truncated
        reward = self.task.step_size * float(self._reward(self._signals))
        return self._observation(), reward, stopped, truncated, self._information()

    def render(self) -> Any:
        """The picture now, (height, width, 3) of bytes; None without ``render_mode``."""
        if self.render_mode is None:
            return None
        picture = self._run.result.scene.picture
        self._shown.append([self._run.time, *(float(self._signals[name]) for name in picture.variables)])
        time, *columns = np.transpose(self._shown)
        values = dict(zip(picture.variables, columns, strict=True))
        stage = Stage(frames(picture, time, values.__getitem__, title=self.title))
        return next(pixels(stage, first=len(time) - 1, ratio=1.0))

    def close(self) -> None:
        """Release the FMUs."""
        self._run.close()

    @property
    def optimum(self) -> Optimum:
        """The motion of largest return from the start of this episode until ``stop_time``, by :func:`liaisons.plan`.

        It takes seconds, once for each start.  Acts of the plan are not held, and what ``stop`` forbids goes into
        ``goal``, as bounds.

        :raises PlanError: if there is no such motion, or acts are forces.
        """
        return _optimum(self.task, tuple(self._starts.items()))

    def _has(self, *names: str, step: bool = False) -> bool:
        """Whether there are such variables, or inputs that a step can set."""
        try:
            _ = self._run.stepper(names, []) if step else [self._run[name] for name in names]
        except SimulationError:
            return False
        return True

    def _begin(self, starts: dict[str, Any]) -> None:
        """Begin an episode with start values."""
        self._run.reset(starts)
        moved = [name for base, order in self.task.acts if order for name in port_names(base)[:2]]
        self._sigma = {name: self._run[name] for name in moved}
        self._signals = Signals(self._run.__getitem__, self._sigma)
        self._starts, self._shown, self._ended = {**self.task.start_values, **starts}, [], False

    def _observation(self) -> Floats:
        return np.array([read(self._signals) for read in self._observed], dtype=float)

    def _information(self) -> dict[str, Any]:
        return {name: self._run[name] for name in self._balances}


@lru_cache(maxsize=256)
def _optimum(task: Task, starts: tuple[tuple[str, Any], ...]) -> Optimum:
    """The optimum from start values."""
    values, reward = dict(starts), task.reward
    moves = [base for base, _ in task.acts]
    first = {name: values.pop(name) for move in moves for name in port_names(move)[:2] if name in values}
    goal: dict[str, Any] = {
        "end": {},
        "duration": task.stop_time,
        "minimize": f"-({reward})" if isinstance(reward, str) else lambda m: -reward(m),
        **task.goal,
        "bounds": {**task.act, **task.goal.get("bounds", {})},
    }
    best = plan(task.subject, moves, start=first, start_values=values, **goal)
    run = best.system().simulate(stop_time=best.duration, step_size=task.step_size)
    name, times = component(task.subject).__name__, run.time[1:]
    signals = Signals(lambda variable: run[f"{name}.{variable}"][1:], best.sigma(times))
    return Optimum(best, task.step_size * float(np.sum(evaluator(reward)[0](signals))))
