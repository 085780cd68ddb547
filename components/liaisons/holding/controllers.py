"""A mechanism and its regulators: the system that they are, what was predicted of it, and what its FMUs show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from liaisons.base.arguments import finite, merged, positive, shown
from liaisons.base.logs import ignored_warnings
from liaisons.check import Verdict, verdict
from liaisons.cosim import Result
from liaisons.cosim.description.fmu import DefaultExperiment
from liaisons.cosim.messages import logger
from liaisons.cosim.structure.memory import check_memory
from liaisons.errors import LiaisonsError, PlanError, suggestion
from liaisons.interface import System, with_table
from liaisons.language import ParameterArray
from liaisons.language.operator import TRIPLE
from liaisons.library import Target, component, fmu_file, fmu_path, model
from liaisons.models import regulator
from liaisons.planning.goals import Array, chain_size, motion_names

After = Literal["rests", "repeats", "ends"]

_NEAR = 1e-5
"""Size of the differences by which the FMUs' multipliers are measured."""
_CONTRACTED = 0.1
"""Of a deviation: where no more is left, what differs is a solver's tolerance over the differences' size."""
_STILL = 1e-6
"""What is off by less, relative to its size, has not moved."""
_RADIANS = 20
"""Of the free motion: so long is seen whether something comes back."""
_DOUBLINGS = 60
"""Of the first force tried."""
_PAIR = 1e-6
"""Two knots that are nearer than this part of a step are both sides of a jump, for a Regulator, too."""
_NEVER = 1e30
_SAME = 1e-10
"""Part of a round that is owed to rounding."""


@final
@dataclass(frozen=True, eq=False)
class ReferenceTrajectory:
    """A motion at its communication points; an equilibrium has one."""

    times: Array
    motion: Array  # σ, σ̇, σ̈ (moves, 3, times)
    states: Array  # that are read (states, times)
    after: After

    @property
    def points(self) -> Iterator[tuple[Array, Array]]:
        """States and motion at each of the times."""
        return zip(self.states.T, self.motion.transpose(2, 0, 1), strict=True)

    def next_jump(self, apart: float) -> Array:
        """The first instant after each of the times [s] at which σ or a rate jumps; 1e30 if there is none.

        :param apart: two times that are less apart [s], where σ or a rate differs, are a jump.
        """
        differs = np.any(np.diff(self.motion, axis=2) != 0, axis=(0, 1))
        jumps = self.times[1:][differs & (np.diff(self.times) < apart)]
        return np.append(jumps, _NEVER)[np.searchsorted(jumps, self.times, side="right")]


@final
@dataclass(frozen=True, eq=False)
class LinearPrediction:
    """Deviations over one step, or over the whole reference trajectory, to first order."""

    loop: Array  # in the directions in which the states can differ
    directions: Array  # (states, directions) at the start
    final_directions: Array  # and at the end
    reach: Array  # (directions, ·) basis of the controllable ones
    conserved: tuple[str, ...]  # states, or sums of them, that no move can change
    returns: bool  # whether the trajectory ends where it starts, up to the mechanism's orientation

    def multipliers(self, matrix: Array) -> NDArray[np.complex128]:
        """Eigenvalues of a matrix, greatest first; singular values where the trajectory ends elsewhere."""
        if not self.returns:
            return np.linalg.svd(matrix, compute_uv=False).astype(complex)
        eigenvalues = np.linalg.eigvals(matrix).astype(complex)
        return eigenvalues[np.argsort(-np.abs(eigenvalues), kind="stable")]


@final
@dataclass(frozen=True, eq=False)
class Controller:
    """A mechanism with sampled feedback, from :func:`liaisons.hold`: accelerations are -gains (x - x_0) once a step."""

    name: str  # of the component
    component: Target
    moves: tuple[str, ...]
    step_size: float
    free: tuple[str, ...]  # coordinates that are held
    states: tuple[str, ...]  # what is read: the mechanism's, σ where it is held, σ̇, σ̈
    trajectory: ReferenceTrajectory
    gains: Array  # (times, moves, states); the last ones after the end
    correction_limits: Mapping[str, Array]  # for corrections, by the names of a Regulator: (moves, times)
    prediction: LinearPrediction
    sizes: Array  # of the states, by which the prediction is divided
    energy: float  # kinetic, of what moves by its size in that time [J]
    time: float  # in which states change by their sizes [s]
    values: Mapping[str, float]  # of parameters, as they were given
    starts: Mapping[str, float]  # start values of the FMU, σ, σ̇ and σ̈ among them
    perturbations: tuple[Mapping[str, float], ...]  # of these, by which the states are made to differ

    @property
    def duration(self) -> float:
        """Duration of the reference trajectory, or of one step at an equilibrium [s]."""
        return float(self.trajectory.times[-1]) or self.step_size

    @property
    def loop(self) -> Array:
        """Matrix of deviations over one step or the whole trajectory, divided by sizes."""
        return self.prediction.loop

    @property
    def conserved(self) -> tuple[str, ...]:
        """States, or sums of them, that no move can change."""
        return self.prediction.conserved

    @property
    def returns(self) -> bool:
        """Whether the trajectory ends where it starts, up to the mechanism's orientation."""
        return self.prediction.returns

    @property
    def floquet_multipliers(self) -> NDArray[np.complex128]:
        """Eigenvalues of the closed loop over one step or one round, greatest first; 1 for conserved quantities.

        For a plan that ends elsewhere the singular values: factors of deviations from start to end.
        """
        return self.prediction.multipliers(self.loop)

    @property
    def controlled(self) -> NDArray[np.complex128]:
        """Multipliers of the controllable directions: inside the unit circle."""
        reach = self.prediction.reach
        return self.prediction.multipliers(reach.T @ self.loop @ reach if self.returns else self.loop @ reach)

    def system(self, *, start_values: Mapping[str, float] | None = None, **keywords: float) -> System:
        """The mechanism and one regulator FMU a coordinate, wired; communication points are those of :meth:`times`.

        :param start_values: start values of the mechanism that differ from those that are held, ``theta_0=3.3``, and of
            what moves, ``pivot_x=0.1``, ``pivot_x_dot=0.2``; ``keywords`` are further ones.
        """
        return self._system(merged(self.name, start_values, keywords, PlanError), announced=True)

    def _system(self, start_values: Mapping[str, float], *, announced: bool = False) -> System:
        """The same; samples are announced to importers that choose their communication points."""
        system = System(f"held_{self.name}")
        starts: dict[str, Any] = {**self.starts, **start_values}
        trajectory, sources, regulators = self.trajectory, {}, []
        for i, move in enumerate(self.moves):
            # What is read is a sample: it stays until the next communication point.
            settings: dict[str, Any] = {
                "period": self.step_size,
                "input_reconstruction": 0,
                "announced": float(announced),
            }
            fmu, columns = self._regulator(i)
            settings |= columns
            triple = motion_names(move)
            for n, start in enumerate(("value_0", "rate_0", "acceleration_0")):
                settings[start] = starts.pop(triple[n]) - trajectory.motion[i, n, 0]
            if trajectory.after == "repeats":
                settings["repeats"] = self.duration
            regulators.append(system.add(f"{self.name}_{move}", fmu, **settings))
            sources |= {name: regulators[-1][y] for name, y in zip(triple, TRIPLE, strict=True)}
        system.experiment = DefaultExperiment(
            0.0, self._stop, self.duration / float(np.ceil(self.duration / self.step_size - 1e-9))
        )
        follows: dict[str, Any] = {} if trajectory.times.size == 1 else {"input_reconstruction": 2}
        sizes = chain_size(self.component, self.values)
        values: dict[str, Any] = {name: value for name, value in self.values.items() if name not in sizes}
        fmu = fmu_path(self.component, **sizes)
        mechanism = system.add(self.name, fmu, **values, **follows, **starts)
        for move, part in zip(self.moves, regulators, strict=True):
            system.connect(part["y"], mechanism[move])
            system.connect(part["elapsed"], part["sampled"])
            for i, name in enumerate(self.states, start=1):
                system.connect(sources[name] if name in sources else mechanism[name], part[f"reading_{i}"])
        return system

    @property
    def _settling(self) -> float:
        """How long is seen what comes back [s], in whole steps."""
        return self.step_size * float(np.ceil(_RADIANS * self.time / self.step_size))

    @property
    def _stop(self) -> float:
        """Until when what is held is seen [s]: the end of the plan."""
        return self._settling if self.trajectory.times.size == 1 else self.duration

    def _regulator(self, i: int) -> tuple[Path, dict[str, Array]]:
        """The FMU for one of what moves, with its table in a file if it is long, else in its parameters."""
        trajectory, gains = self.trajectory, self.gains[:, i]
        columns = dict(zip(("planned", "planned_rate", "planned_acceleration"), trajectory.motion[i], strict=True))
        columns |= {"next_jump": trajectory.next_jump(_PAIR * self.step_size)}
        columns |= {"instant": trajectory.times, "offset": np.sum(gains.T * trajectory.states, axis=0)}
        columns |= {"advance": self._shift @ gains.T} | {
            name: values[i] for name, values in self.correction_limits.items()
        }
        columns |= {f"gain_{j}": gains[:, j - 1] for j in range(1, len(self.states) + 1)}
        fmu, missing = fmu_file("Regulator"), regulator.KNOTS - trajectory.times.size
        if missing >= 0:
            return fmu, {name: np.pad(x, (0, missing), mode="edge") for name, x in columns.items()}
        arrays = (p for p in regulator.Regulator.parameters if isinstance(p, ParameterArray))
        whole = [columns.get(p.name, np.full(trajectory.times.size, sum(p.leading[:1]))) for p in arrays]
        return with_table(fmu, np.array(whole)), {}

    @property
    def _shift(self) -> Array:
        """By how much coordinates that enter nothing move on in a round."""
        gap = self.trajectory.states[:, -1] - self.trajectory.states[:, 0]
        return np.where([name in self.free for name in self.states], gap, 0.0)

    def times(self, stop_time: float) -> Array:
        """Communication points until then [s].

        :raises PlanError: if it is no number greater than 0.
        :raises SimulationError: if they are more than fit into memory.
        """
        positive("stop_time", stop_time, PlanError)
        check_memory(0.0, stop_time, self.step_size, len(self.states))
        trajectory = self.trajectory
        if trajectory.after == "repeats":
            rounds = np.arange(int(np.ceil(stop_time / self.duration - _SAME)))
            points = np.append((rounds[:, None] * self.duration + trajectory.times[:-1]).ravel(), stop_time)
        else:
            last = trajectory.times[-1]
            count = int(np.ceil((stop_time - last) / self.step_size - 1e-9))
            more = last + np.arange(1, count + 1) * self.step_size
            points = np.concatenate([trajectory.times, np.minimum(more, stop_time)])
        return np.append(points[points < stop_time * (1 - 1e-12)], stop_time)

    def simulate(
        self,
        stop_time: float | None = None,
        *,
        inputs: Mapping[str, Any] | None = None,
        start_values: Mapping[str, float] | None = None,
        **keywords: float,
    ) -> Result:
        """Run :meth:`system`.

        :param stop_time: end [s]; unless given that of the plan, of an equilibrium twenty radians of the free motion.
        :param inputs: input of the mechanism -> function of time: a disturbance.
        :param start_values: as of :meth:`system`; ``keywords`` are further ones.
        :raises PlanError: if a time or a start value is no finite number, or the end is not after the start.
        """
        ports = {f"{self.name}.{name}": value for name, value in (inputs or {}).items()}
        starts = merged(self.name, start_values, keywords, PlanError)
        for name, value in starts.items():
            finite(f"{self.name}: {name}", value, PlanError)
        stop_time = self._stop if stop_time is None else stop_time
        times = self.times(stop_time)
        if self.trajectory.after == "ends" and stop_time > self.duration * (1 + 1e-9):
            logger.warning(
                "%s: the plan ends in motion at %g s; what is simulated until %g s is not planned: σ goes on evenly",
                self.name,
                self.duration,
                stop_time,
            )
        return self._run(self._system(starts), times, ports or None)

    def _run(self, system: System, times: Array, inputs: Mapping[str, Any] | None = None) -> Result:
        coupling = "jacobi" if self.trajectory.times.size == 1 else "gauss-seidel"
        return system.simulate(times=times, coupling=coupling, tolerance=1e-11, inputs=inputs)

    def deviation(self, run: Result) -> Array:
        """By how much the states of a run differ from those that are held, (states, times)."""
        outputs = {
            name: f"{self.name}_{move}.{output}"
            for move in self.moves
            for name, output in zip(motion_names(move), TRIPLE, strict=True)
        }
        names = [outputs.get(name, f"{self.name}.{name}") for name in self.states]
        repeats = self.trajectory.after == "repeats"
        rounds = np.floor(run.time / self.duration + _SAME) * repeats
        late = run.time - rounds * self.duration + _SAME * self.duration
        knots = np.maximum(0, np.searchsorted(self.trajectory.times, late, side="right") - 1)
        states = np.array([run[name] for name in names])
        return states - self.trajectory.states[:, knots] - np.outer(self._shift, rounds)

    def survives(
        self, port: str, duration: float, *, stop_time: float | None = None, first: float | None = None
    ) -> float:
        """Greatest of the forces tried at a port, from 0 on, after which what is held came back.

        The force is doubled until the mechanism falls, sixty times at most; then the interval is bisected twelve
        times.  Forces that were not tried may give another result.

        :param port: input of the mechanism, ``"theta_force"``.
        :param duration: how long the force acts [s].
        :param stop_time: in the last radian of the free motion before it [s] the free coordinates are back to 5 % of
            where they were most; unless given twenty radians after the push and the plan.
        :param first: the first force tried; unless given a thousandth of one whose work is a usual energy.
        :raises PlanError: if the port is no free input, or a number is not finite and greater than 0.
        """
        inputs = model(component(self.component), **chain_size(self.component, self.values)).flat().inputs
        moved = {name for move in self.moves for name in motion_names(move)}
        ports = [v.name for v in inputs if v.name not in moved]
        if port not in ports:
            raise PlanError(f"{self.name}: survives: no input {shown(port)} is free{suggestion(port, ports)}")
        positive("survives: duration", duration, PlanError)
        ends = self.trajectory.after == "ends"
        settled = self.duration if ends else max(self.duration, duration) + self._settling
        stop = settled if stop_time is None else stop_time
        positive("survives: stop_time", stop, PlanError)
        if stop <= duration:
            raise PlanError(
                f"survives: stop_time = {stop:g} s: must be greater than the push, duration = {duration:g} s"
            )
        coordinate = port.removesuffix("_force").removesuffix("_load")
        usual = self.energy / dict(zip(self.states, self.sizes, strict=True)).get(coordinate, 1.0)
        high = 1e-3 * usual if first is None else first
        positive("survives: first", high, PlanError)
        free = [self.states.index(name) for name in self.free if name not in self.moves]

        def comes_back(force: float) -> bool:
            try:
                with ignored_warnings():  # of a push that begins and ends between two points, as it is meant
                    run = self.simulate(stop, inputs={port: lambda t: force if t < duration else 0.0})
            except LiaisonsError:
                if force == 0:
                    raise
                return False
            off = np.abs(self.deviation(run)[free]) / self.sizes[free, None]
            after = off[:, run.time >= max(duration, stop - self.time)]
            return bool(np.all(after <= max(0.05 * np.max(off, initial=0.0), _STILL)))

        low = 0.0
        if not comes_back(low):
            return low
        for _ in range(_DOUBLINGS):
            if not comes_back(high):
                break
            low, high = high, 2 * high
        for _ in range(12):
            middle = (low + high) / 2
            low, high = (middle, high) if comes_back(middle) else (low, middle)
        return low

    def measured(self) -> Array:
        """The matrix of one step, or of the whole course, as the FMUs perform it, from runs on both sides of it.

        Without bounds: where the course lies on one, a correction that it stops is none of first order.
        """
        unbounded = replace(self, correction_limits={})
        first = np.linalg.pinv(self.prediction.directions)
        last = np.linalg.pinv(self.prediction.final_directions)
        starts, ends = [], []
        for direction in self.perturbations:
            shifted = [{name: self.starts[name] + by * x for name, x in direction.items()} for by in (_NEAR, -_NEAR)]
            with ignored_warnings():  # of steps too long for a continuous feedback: that is in the matrix
                times = self.times(self.duration)
                runs = [self._run(unbounded._system(values), times) for values in shifted]  # noqa: SLF001
            change = (self.deviation(runs[0]) - self.deviation(runs[1])) / (2 * _NEAR * self.sizes[:, None])
            starts.append(first @ change[:, 0])
            ends.append(last @ change[:, -1])
        return np.linalg.lstsq(np.array(starts), np.array(ends), rcond=None)[0].T

    def verify(self) -> list[Verdict]:
        """Verdicts on the linear prediction and on the undisturbed motion, as the FMUs perform them.

        The measured matrix of one step, or of the whole trajectory, and its multipliers are the predicted ones;
        controllable deviations decay; without disturbance the mechanism follows the trajectory, for two rounds or
        until well after the end of the plan.
        """
        measured = self.measured()
        subject = "one step" if self.trajectory.times.size == 1 else "one round" if self.returns else "the whole plan"
        error = float(np.max(np.abs(measured - self.loop)) / max(_CONTRACTED, np.max(np.abs(self.loop))))
        far = np.abs(self.floquet_multipliers[:, None] - self.prediction.multipliers(measured))
        apart = float(np.max(far[linear_sum_assignment(far)]))
        why = "differences of 1e-5, solver tolerance 1e-11"
        claims = [
            verdict(f"{subject} of the FMUs is the matrix predicted", error=error, tolerance=1e-5, reason=why),
            verdict("so are its multipliers", error=apart, tolerance=1e-3, reason="a root of it where they coincide"),
        ]
        if self.returns:
            radius = float(np.max(np.abs(self.controlled)))
            claims.append(verdict("what is controlled comes back, |multiplier| < 1", error=radius, tolerance=1 - 1e-9))
        after = 0.0 if self.trajectory.after == "ends" else max(self._settling, self.duration)
        stop = self.duration + after
        with ignored_warnings():
            off = np.abs(self.deviation(self.simulate(stop))) / self.sizes[:, None]
        why = "ten times by how much a motion that returns may miss its begin"
        words = f"undisturbed it stays with its motion for {stop:.3g} s, relative to sizes"
        return [*claims, verdict(words, error=float(np.max(off)), tolerance=1e-5, reason=why)]

    def __repr__(self) -> str:
        radius = np.max(np.abs(self.controlled))
        subject = "|multiplier| <= " if self.returns else "from start to end deviations times at most "
        moves, names = ", ".join(self.moves), ", ".join(self.conserved)
        conserved = f"; conserved: {names}" if names else ""
        return f"<{self.name} held by {moves} every {self.step_size:g} s: {subject}{radius:.6f}{conserved}>"
