"""A mechanism with its regulators: the system of FMUs, the linear prediction, and the verdicts on both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov
from scipy.optimize import linear_sum_assignment

from liaisons import Result, System, Verdict, fmu_path, verdict
from liaisons.base.arguments import check_positive, merged_start_values, name_dictionary, shown
from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.base.clocks import check_memory
from liaisons.base.logs import ignored_warnings, logger
from liaisons.base.port_names import port_names
from liaisons.cosim import DefaultExperiment
from liaisons.errors import LiaisonsError, PlanError, suggestion
from liaisons.interface import with_table
from liaisons.language import ParameterArray
from liaisons_catalogue import regulator
from liaisons_catalogue.force_regulator import ForceRegulator
from liaisons_motion.goals import Goal
from liaisons_motion.holding.observers import Observer, normal_verdict

After = Literal["rests", "repeats", "ends"]

_DIFFERENCE = 1e-5
"""Differences of states, relative to sizes, by which the FMUs' multipliers are measured: their squares are 1e-10."""
_LEAST_SCALE = 0.1
"""Least scale of the error of a measured matrix, beside 1 of a deviation that stays: solvers leave 1e-11 / 1e-5."""
_NO_DEVIATION = 1e-6
"""Deviations below this, relative to sizes, count as none."""
_SETTLING = 20
"""Duration of the settling that is simulated, in radians of the free motion: 2e-9 is left of exp(-t)."""
_DOUBLINGS = 60
"""Most doublings of the first force tried: to 1e18 times as much."""
_JUMP_DISTANCE = 1e-6
"""Two knots nearer than this part of a step are the two sides of a jump, as in :class:`liaisons.models.Regulator`."""
_NO_JUMP = 1e30
_ROUNDING = 1e-10
"""Rounding of a time, relative to the duration of a round."""


@final
@dataclass(frozen=True, eq=False)
class ReferenceTrajectory:
    """The motion to be held, at its communication points; an equilibrium has one point."""

    times: Floats
    motion: Floats  # σ, σ̇, σ̈ (driven, 3, times), and forces, without rates
    states: Floats  # that are read (states, times)
    after: After

    @property
    def states_and_motion(self) -> Iterator[tuple[Floats, Floats]]:
        """States (states,), and σ with its two rates (moves, 3), at each communication point in turn."""
        return zip(self.states.T, self.motion.transpose(2, 0, 1), strict=True)

    def next_jump_times(self, jump_width: float) -> Floats:
        """Instant of the next jump of σ or of its rates after each communication point [s]; 1e30 if there is none.

        :param jump_width: two points closer than this [s] whose motion differs are the two sides of a jump.
        """
        differs = np.any(np.diff(self.motion, axis=2) != 0, axis=(0, 1))
        jumps = self.times[1:][differs & (np.diff(self.times) < jump_width)]
        return np.append(jumps, _NO_JUMP)[np.searchsorted(jumps, self.times, side="right")]


@final
@dataclass(frozen=True, eq=False)
class Controller:
    """A mechanism with sampled feedback, from :func:`liaisons.hold`: once a step w = -gains (x - x_0).

    To first order deviations, divided by sizes, are predicted over one step, or over the whole trajectory.
    """

    name: str  # of the component
    goal: Goal  # the mechanism with its initial state
    moves: tuple[str, ...]
    controls: tuple[str, ...]  # forces
    step_size: float
    free: tuple[str, ...]  # coordinates that are held
    ports: tuple[str, ...]  # inputs of the mechanism that are free
    states: tuple[str, ...]  # that are read: the mechanism's, σ if it is held, forces, σ̇, σ̈
    trajectory: ReferenceTrajectory
    gains: Floats  # (times, driven, states); after the end the last ones
    correction_limits: Mapping[str, Floats]  # bounds of corrections by names of a Regulator: (moves, times)
    force_limits: Mapping[str, tuple[float, float]]  # by forces
    input_sizes: Floats  # of accelerations of σ, and of forces
    loop: Floats  # matrix of the closed loop, in the directions
    directions: Floats  # of deviations at the start (states, directions)
    final_directions: Floats  # the same at the end
    reach: Floats  # (directions, ·) basis of the controllable ones
    conserved: tuple[str, ...]  # states, or sums of them, that no input changes
    returns: bool  # whether the trajectory ends where it starts, up to the mechanism's orientation
    cost: tuple[Floats, Floats, Floats] | None  # B, Q and R at an equilibrium whose deviations are controllable
    sizes: Floats  # of the states, by which deviations are divided
    energy: float  # kinetic energy of a motion by these sizes in the time below [J]
    time: float  # in which states change by their sizes [s]
    starts: Mapping[str, float]  # start values of the FMU, including σ, σ̇ and σ̈
    perturbations: tuple[Mapping[str, float], ...]  # differences of start values that span the directions
    observer: Observer | None = None  # its estimates are read instead of the states that it estimates

    @property
    def driven(self) -> tuple[str, ...]:
        """Names of the variables that have a regulator: moved coordinates, then forces."""
        return (*self.moves, *self.controls)

    @property
    def duration(self) -> float:
        """Duration of the reference trajectory, or of one step at an equilibrium [s]."""
        return float(self.trajectory.times[-1]) or self.step_size

    @property
    def floquet_multipliers(self) -> NDArray[np.complex128]:
        """Eigenvalues of the closed loop over one step or one round, greatest first; 1 for conserved quantities.

        If a plan does not end where it begins: singular values, the factors of deviations from start to end.
        """
        return self._multipliers(self.loop)

    @property
    def controlled(self) -> NDArray[np.complex128]:
        """Floquet multipliers of the controllable directions, all of them inside the unit circle."""
        reach = self.reach
        return self._multipliers(reach.T @ self.loop @ reach if self.returns else self.loop @ reach)

    def _multipliers(self, matrix: Floats) -> NDArray[np.complex128]:
        """Eigenvalues of a matrix, greatest first; if the plan does not end where it begins, its singular values."""
        if not self.returns:
            return np.linalg.svd(matrix, compute_uv=False).astype(complex)
        eigenvalues = np.linalg.eigvals(matrix).astype(complex)
        return eigenvalues[np.argsort(-np.abs(eigenvalues), kind="stable")]

    def system(self, *, start_values: Mapping[str, float] | None = None, **keywords: float) -> System:
        """The mechanism connected with one regulator FMU for each moved coordinate.

        :param start_values: start values that differ from the reference trajectory: of the mechanism, ``theta_0=3.3``,
            and of σ, ``pivot_x=0.1``, ``pivot_x_dot=0.2``; ``keywords`` are further ones.
        """
        return self._connected_system(
            merged_start_values(self.name, start_values, keywords, PlanError), announces_samples=True
        )

    def _connected_system(self, start_values: Mapping[str, float], *, announces_samples: bool = False) -> System:
        """:meth:`system`; its regulators may announce their samples, for importers that choose communication points."""
        system = System(f"held_{self.name}")
        starts: dict[str, Any] = {**self.starts, **start_values}
        trajectory, sources, regulators = self.trajectory, {}, []
        for i, name in enumerate(self.driven):
            # Readings are samples: constant until the next communication point.
            is_force = name in self.controls
            settings: dict[str, Any] = {"period": self.step_size, "input_reconstruction": 0}
            settings |= {} if is_force else {"announced": float(announces_samples)}
            fmu, columns = self._regulator_fmu(i)
            settings |= columns
            triple = (name,) if is_force else port_names(name)[:3]
            if is_force:
                settings["next_0"] = starts.pop(name)
            else:
                for n, start in enumerate(("value_0", "rate_0", "acceleration_0")):
                    settings[start] = starts.pop(triple[n]) - trajectory.motion[i, n, 0]
            if trajectory.after == "repeats":
                settings["repeats"] = self.duration
            regulators.append(system.add(f"{self.name}_{name}", fmu, **settings))
            # From knot to knot, which may be less than a period, "held" comes one sample late.
            shown = "force" if trajectory.times.size > 1 else "held"
            outputs = (shown,) if is_force else port_names("y")[:3]
            sources |= {end: regulators[-1][y] for end, y in zip(triple, outputs, strict=True)}
        system.experiment = DefaultExperiment(
            0.0, self._default_stop, self.duration / float(np.ceil(self.duration / self.step_size - 1e-9))
        )
        follows = {"input_reconstruction": 2} if self._interpolates else {}
        starts = {**self.goal.parameters, **follows, **starts}
        mechanism = system.add(self.name, self.goal.fmu, **starts)
        for name, part in zip(self.driven, regulators, strict=True):
            system.connect(part["force" if name in self.controls else "y"], mechanism[name])
        if self.observer:
            estimates, observer = self.observer.outputs, self.observer.connect_to(system)
            sources |= {name: observer[estimates[name]] for name in self.states if name in estimates}
        for part in regulators:
            for i, name in enumerate(self.states, start=1):
                if part.name != f"{self.name}_{name}" or name in self.moves:  # a force is known to its own regulator
                    system.connect(sources[name] if name in sources else mechanism[name], part[f"reading_{i}"])
        return system

    @property
    def _interpolates(self) -> bool:
        """Whether the mechanism interpolates σ, which regulators hand on before it steps: along a plan."""
        return bool(self.moves) and self.trajectory.times.size > 1

    @property
    def _settling(self) -> float:
        """Duration of a simulated settling [s], in whole steps."""
        return self.step_size * float(np.ceil(_SETTLING * self.time / self.step_size))

    @property
    def _default_stop(self) -> float:
        """Default end of a simulation [s]: the end of the plan, or of the settling at an equilibrium."""
        return self._settling if self.trajectory.times.size == 1 else self.duration

    def _regulator_fmu(self, i: int) -> tuple[Path, dict[str, Any]]:
        """FMU of the i-th regulator, and its parameters; the table is none of them if it is a file in the FMU."""
        trajectory, gains = self.trajectory, self.gains[:, i]
        is_force, settings = i >= len(self.moves), dict[str, Any]()
        columns = by_name(("planned", "planned_rate", "planned_acceleration"), trajectory.motion[i])
        if is_force:
            columns = {"planned": columns["planned"]}
            limits = self.force_limits.get(self.driven[i])
            settings = by_name(("lowest", "highest"), limits) if limits else {}
        else:
            columns |= {name: values[i] for name, values in self.correction_limits.items()}
            columns["next_jump"] = trajectory.next_jump_times(_JUMP_DISTANCE * self.step_size)
        columns |= {
            "own_gain" if is_force and name == self.driven[i] else f"gain_{j}": gain
            for j, (name, gain) in enumerate(zip(self.states, gains.T, strict=True), start=1)
        }
        columns |= {
            "instant": trajectory.times,
            "offset": np.sum(gains.T * trajectory.states, axis=0),
            "advance": self._change_in_round @ gains.T,
        }
        kind = ForceRegulator if is_force else regulator.Regulator
        fmu, missing = fmu_path(kind.__name__), regulator.KNOTS - trajectory.times.size
        if missing >= 0:
            return fmu, settings | {name: np.pad(x, (0, missing), mode="edge") for name, x in columns.items()}
        arrays = (array for array in kind.parameters if isinstance(array, ParameterArray))
        constant = np.ones(trajectory.times.size)
        rows = [columns.get(array.name, constant * sum(array.leading[:1])) for array in arrays]
        return with_table(fmu, np.array(rows)), settings

    @property
    def _change_in_round(self) -> Floats:
        """Changes of the states in a round of a plan that repeats itself: those of coordinates; 0 for other states."""
        gap = self.trajectory.states[:, -1] - self.trajectory.states[:, 0]
        return np.where([name in self.free for name in self.states], gap, 0.0)

    def times(self, stop_time: float) -> Floats:
        """Communication points until a stop time [s].

        :raises PlanError: unless it is a number greater than 0.
        :raises SimulationError: if they do not fit into memory.
        """
        check_positive("stop_time", stop_time, PlanError)
        check_memory(0.0, stop_time, self.step_size, len(self.states))
        trajectory = self.trajectory
        if trajectory.after == "repeats":
            rounds = np.arange(int(np.ceil(stop_time / self.duration - _ROUNDING)))
            points = np.add.outer(rounds * self.duration, trajectory.times[:-1]).ravel()
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
        """Simulate :meth:`system`.

        :param stop_time: end [s]; unless given that of the plan, at an equilibrium twenty radians of the free motion.
        :param inputs: disturbances: input of the mechanism -> function of time.
        :param start_values: as for :meth:`system`; ``keywords`` are further ones.
        :raises PlanError: if the end is not after the start.
        :raises SimulationError: for a start value that is not allowed.
        """
        given = name_dictionary("inputs", {} if inputs is None else inputs, PlanError)
        ports = {f"{self.name}.{name}": value for name, value in given.items()}
        starts = merged_start_values(self.name, start_values, keywords, PlanError)
        stop_time = self._default_stop if stop_time is None else stop_time
        times = self.times(stop_time)
        if self.trajectory.after == "ends" and stop_time > self.duration * (1 + 1e-9):
            logger.warning(
                "%s: the plan ends in motion at %g s; what is simulated until %g s is not planned: σ goes on evenly",
                self.name,
                self.duration,
                stop_time,
            )
        return self._simulate(self._connected_system(starts), times, ports or None)

    def _simulate(self, system: System, times: Floats, inputs: Mapping[str, Any] | None = None) -> Result:
        """Simulate a system with the coupling that its regulators need."""
        coupling = "gauss-seidel" if self._interpolates else "jacobi"
        return system.simulate(times=times, coupling=coupling, tolerance=1e-11, inputs=inputs)

    @property
    def signals(self) -> list[str]:
        """Names of the states as signals of :meth:`system`."""
        outputs = {name: f"{self.name}_{name}.force" for name in self.controls}
        for move in self.moves:
            outputs |= by_name(port_names(move)[:3], (f"{self.name}_{move}.{output}" for output in port_names("y")[:3]))
        return [outputs.get(name, f"{self.name}.{name}") for name in self.states]

    def deviation(self, run: Result) -> Floats:
        """Deviations of the states of a run from the reference trajectory, (states, times)."""
        if not isinstance(run, Result):
            raise PlanError(f"{self.name}: deviation: run = {shown(run)}: give a result of simulate()")
        repeats = self.trajectory.after == "repeats"
        rounds = np.floor(run.time / self.duration + _ROUNDING) * repeats
        late = run.time - rounds * self.duration + _ROUNDING * self.duration
        knots = np.maximum(0, np.searchsorted(self.trajectory.times, late, side="right") - 1)
        states = np.array([run[name] for name in self.signals])
        return states - self.trajectory.states[:, knots] - np.outer(self._change_in_round, rounds)

    def survives(self, port: str, duration: float, *, stop_time: float | None = None) -> float:
        """Greatest of the forces tried at a port after which the mechanism returns to its reference trajectory.

        The first one is a thousandth of a force whose work is a typical kinetic energy.  It is doubled until the
        mechanism falls, at most sixty times; then the interval is bisected twelve times.  A force between those that
        were tried may give another result.

        :param port: input of the mechanism, ``"theta_force"``.
        :param duration: of the force [s].
        :param stop_time: end of the runs [s].  In the last radian of the free motion the deviations of free coordinates
            have to be below 5 % of their maxima.  Unless given, twenty radians after the force and the plan.
        :raises PlanError: if the port is no free input, or a number is not finite and greater than 0.
        """
        if port not in self.ports:
            raise PlanError(f"{self.name}: survives: no input {shown(port)} is free{suggestion(port, self.ports)}")
        check_positive("survives: duration", duration, PlanError)
        ends = self.trajectory.after == "ends"
        settled = self.duration if ends else max(self.duration, duration) + self._settling
        stop = settled if stop_time is None else stop_time
        check_positive("survives: stop_time", stop, PlanError)
        if stop <= duration:
            raise PlanError(
                f"survives: stop_time = {stop:g} s: must be greater than the push, duration = {duration:g} s"
            )
        coordinate = port.removesuffix("_force").removesuffix("_load")
        high = 1e-3 * self.energy / by_name(self.states, self.sizes).get(coordinate, 1.0)
        free = [self.states.index(name) for name in self.free if name not in self.moves]

        def returns(force: float) -> bool:
            """Whether free coordinates are back at the end of a run with this force, in its last radian."""
            try:
                with ignored_warnings():  # of the intended jump of the force between two points
                    run = self.simulate(stop, inputs={port: lambda t: force if t < duration else 0.0})
            except LiaisonsError:
                if force == 0:
                    raise
                return False
            off = np.abs(self.deviation(run)[free]) / self.sizes[free, None]
            after = off[:, run.time >= max(duration, stop - self.time)]
            return bool(np.all(after <= max(0.05 * np.max(off, initial=0.0), _NO_DEVIATION)))

        low = 0.0
        if not returns(low):
            return low
        for _ in range(_DOUBLINGS):
            if not returns(high):
                break
            low, high = high, 2 * high
        for _ in range(12):
            middle = (low + high) / 2
            low, high = (middle, high) if returns(middle) else (low, middle)
        return low

    def measured(self) -> Floats:
        """Matrix of the closed loop over one step or the whole trajectory, from central differences of runs of FMUs.

        With an observer, estimates follow the deviations in its rows and columns.  Corrections have no bounds there: at
        a bound the motion has no derivative.
        """
        unbounded, starts, ends = replace(self, correction_limits={}, force_limits={}), [], []
        perturbations: list[Mapping[str, float]] = [*self.perturbations]
        own, names = dict(self.starts), list[str]()
        if self.observer:
            model = self.observer.model
            names = [f"{self.observer.part}.{output}_0" for output in self.observer.outputs.values()]
            own |= by_name(names, model.start * model.sizes)
            perturbations += [by_name(names, column * model.sizes) for column in self.observer.directions.T]
        for direction in perturbations:
            runs = []
            for by in (_DIFFERENCE, -_DIFFERENCE):
                values = {name: own[name] + by * x for name, x in direction.items()}
                estimates = {name: x for name, x in values.items() if "." in name}
                system = unbounded._connected_system({n: x for n, x in values.items() if n not in estimates})  # noqa: SLF001
                with ignored_warnings():  # of long steps: the matrix contains the sampling
                    runs.append(self._simulate(system.with_start_values(estimates), self.times(self.duration)))
            one, other = map(self.deviation, runs)
            for points, k, D in (starts, 0, self.directions), (ends, -1, self.final_directions):
                changes = [np.linalg.pinv(D) @ ((one - other)[:, k] / self.sizes)]
                if self.observer:
                    first, second = (np.array([run[n.removesuffix("_0")][k] for n in names]) for run in runs)
                    changes.append(self.observer.directions.T @ ((first - second) / self.observer.model.sizes))
                points.append(np.concatenate(changes) / (2 * _DIFFERENCE))
        return np.linalg.lstsq(np.array(starts), np.array(ends), rcond=None)[0].T

    def verify(self) -> list[Verdict]:
        """Verdicts: runs of the FMUs agree with the linear prediction, and follow the undisturbed motion.

        The measured matrix of one step, or of the whole trajectory, and its multipliers are the predicted ones;
        controllable deviations decay; without disturbance the mechanism follows the trajectory, for two rounds or until
        well after the end of the plan.  With an observer, in addition: the errors of 200 random runs have the predicted
        covariance; at an equilibrium the multipliers of the loop are those of the feedback together with those of the
        observer, and its cost is that of the closed formula.
        """
        if self.observer:
            return [*replace(self, observer=None).verify(), *self._verify_estimates(self.observer)]
        measured = self.measured()
        subject = "one step" if self.trajectory.times.size == 1 else "one round" if self.returns else "the whole plan"
        scale = max(_LEAST_SCALE, np.max(np.abs(self.loop)))
        error = float(np.max(np.abs(measured - self.loop)) / scale)
        apart = _greatest_difference(self.floquet_multipliers, self._multipliers(measured))
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

    def _verify_estimates(self, observer: Observer) -> list[Verdict]:
        """Verdicts on the errors of an observer in the loop; at an equilibrium on its multipliers and cost, too."""
        unbounded = replace(self, correction_limits={}, force_limits={})  # at a bound no law holds
        runs = observer.random_runs(unbounded._connected_system({}))  # noqa: SLF001
        claims = observer.consistency(runs)
        if observer.motion is not None:
            return claims
        predicted = np.concatenate([self.floquet_multipliers, observer.multipliers])
        error = _greatest_difference(np.linalg.eigvals(self.measured()), predicted)
        words = "multipliers of the loop are those of feedback and of the observer"
        why = "a root of the error where they coincide"
        claims.append(verdict(words, error=error, tolerance=1e-3, reason=why))
        if self.cost is not None and not observer.model.uncertainty.unknown_forces:
            expected, costs = self._expected_and_measured_costs(observer, [run for run, _ in runs])
            error = (np.mean(costs) - expected) / (np.std(costs) / np.sqrt(len(costs)))
            claims.append(normal_verdict(f"a step costs tr(S W) + tr(P Kᵀ(R + BᵀSB)K) = {expected:.4g}", error))
        return claims

    def _expected_and_measured_costs(self, observer: Observer, runs: Sequence[Result]) -> tuple[float, Floats]:
        """Mean cost of a step in the steady state by the closed formula, and mean cost of a step in each run.

        Runs begin off the steady state, which adds the future cost of their last deviation less that of the first.
        """
        assert self.cost is not None  # all is controllable
        (B, Q, R), D, model = self.cost, self.directions, observer.model
        decay = np.repeat([np.exp(-1.0), 0.0], [len(self.moves), len(self.controls)])  # of what is set, in a period
        K = self.gains[0] / self.input_sizes[:, None] * self.sizes @ D
        rows = [self.states.index(name) for name in (*(port_names(m)[2] for m in self.moves), *self.controls)]
        S = solve_discrete_lyapunov(self.loop.T, Q + K.T @ R @ K)
        inverse, n = np.linalg.pinv(D), len(model.sampled.names)
        of_states = inverse[:, :n] @ np.eye(n, len(model.states))
        (_, added, _), error = model.start_matrices(), K @ of_states
        expected = np.sum(of_states.T @ S @ of_states * added)
        expected += np.sum(error.T @ (R + B.T @ S @ B) @ error * observer.corrected[0])
        costs = []
        for run in runs:
            off = self.deviation(run) / self.sizes[:, None]
            x, w = (inverse @ off[:, :-1]).T, (off[rows, 1:].T - decay * off[rows, :-1].T) / (1 - decay)
            of_steps = np.sum((x @ Q) * x, axis=1) + np.sum((w @ R) * w, axis=1)
            first, *_, last = np.sum((x @ S) * x, axis=1)
            costs.append((np.sum(of_steps[:-1]) + last - first) / (len(x) - 1))
        return float(expected), np.array(costs)

    def __repr__(self) -> str:
        radius = np.max(np.abs(self.controlled))
        subject = "|multiplier| <= " if self.returns else "from start to end deviations times at most "
        moves, names = ", ".join(self.driven), ", ".join(self.conserved)
        conserved = f"; conserved: {names}" if names else ""
        return f"<{self.name} held by {moves} every {self.step_size:g} s: {subject}{radius:.6f}{conserved}>"


def _greatest_difference(multipliers: NDArray[Any], expected: NDArray[Any]) -> float:
    """Greatest difference between multipliers and expected ones, paired at least total distance."""
    differences = np.abs(multipliers[:, None] - expected)
    return float(np.max(differences[linear_sum_assignment(differences)]))
