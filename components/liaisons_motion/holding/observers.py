"""``observe``: estimates of what is not measured, by a Kalman filter as a sampled FMU beside its mechanism."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, repeat
from pathlib import Path
from tempfile import mkdtemp
from types import new_class
from typing import Any, final

import casadi as ca
import numpy as np

from liaisons import Result, System, Verdict, build, fmu_path, operator, verdict
from liaisons.base.arguments import check_positive, merged_start_values, name_dictionary, name_list, shown
from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.base.folders import process_folder
from liaisons.base.logs import ignored_warnings
from liaisons.cosim import DefaultExperiment
from liaisons.errors import PlanError
from liaisons.language import DiscreteOutput, DiscreteState, Input, Parameter, Sampled
from liaisons.library import Target
from liaisons_catalogue.knotted_motion import KNOTS
from liaisons_motion.holding.filtering import EstimationModel, Uncertainty, identifier
from liaisons_motion.holding.sampling import SampledMechanism
from liaisons_motion.holding.subjects import planned_motion, sampled_subject
from liaisons_motion.planning import Plan

_RUNS = 200
_RADIANS = 4
"""Radians of the free motion that runs at an equilibrium last: where it is not stable, deviations grow to 27 times."""
_LAGS = 10
"""Samples by which innovations are shifted to see whether they are white."""
_STANDARD_ERRORS = 3.29


def observe(
    motion: Plan | Target,
    /,
    measured: str | Sequence[str],
    noise: Mapping[str, float],
    disturbance: Mapping[str, float] | None = None,
    *,
    at: Mapping[str, Any] | None = None,
    moves: str | Sequence[str] | None = None,
    controls: str | Sequence[str] | None = None,
    bias: Mapping[str, float] | None = None,
    unknown_forces: Mapping[str, float] | None = None,
    deviations: Mapping[str, float] | None = None,
    step_size: float | None = None,
    start_values: Mapping[str, float] | None = None,
    **keywords: float,
) -> Observer:
    """Design the Kalman filter that estimates the states of a mechanism from what is measured.

    ::

        observer = observe(
            "Pendulum", "theta", {"theta": 0.01}, {"theta_force": 0.1}, at={"theta": 0}, moves="pivot_x"
        )
        print(table(observer.verify()))

    Once a period the filter reads what is measured, and σ, σ̇, σ̈ and the forces, which the operators know; between
    samples it predicts by the mechanism's equations.  At an equilibrium its gains are constant; along a plan they
    follow from its covariance (extended Kalman filter).  With constraints or orientations, errors are tangential.

    :param motion: a plan; or name, file or class of a mechanism.
    :param measured: outputs by name; arrays and orientations are measured element by element.
    :param noise: standard deviation of each sample, by what is measured.
    :param disturbance: random forces by input: standard deviation of the impulse over a time T, divided by √T [unit of
        the input · √s].
    :param at: equilibrium, ``moves``: active coordinates that operators move, ``controls``: forces that they set; as
        for :func:`liaisons.hold`.
    :param bias: biases that are estimated, too: standard deviations by what is measured.
    :param unknown_forces: forces that are estimated, too: standard deviations by input.  They, and the biases, drift by
        one standard deviation while the free motion passes through 100 radians.
    :param deviations: standard deviations of states at the start of a plan; unless given a tenth of the states' typical
        magnitudes.
    :param step_size: sampling period [s]; unless given as for :func:`liaisons.hold`.
    :param start_values: parameters by name; ``keywords`` are further ones, where they are no settings.
    :raises PlanError: for an unknown name, a number that is not greater than 0, a mechanism that is not in equilibrium,
        a plan that jumps, or a state that is not observable; it is named.
    """
    values = merged_start_values("observe", start_values, keywords, PlanError)
    sampled, H = sampled_subject("observe", motion, at, moves, controls, step_size, values)
    if not sampled.names:
        raise PlanError(f"{sampled.name} has no state that {', '.join(sampled.driven)} move: nothing is to be observed")
    groups = {"bias": bias, "disturbance": disturbance, "unknown_forces": unknown_forces, "deviations": deviations}
    uncertainty = _checked_uncertainty(sampled, name_list("measured", measured, PlanError), noise, groups)
    model = EstimationModel(sampled, uncertainty, H)
    if not isinstance(motion, Plan):
        if deviations:
            raise PlanError(
                f"{sampled.name}: deviations are those at the start of a plan; at an equilibrium leave them out"
            )
        return Observer(model, model.steady_covariance(), None)
    if motion.problem.control_order < 2 and motion.switches.size:
        words = "an observer reads σ at samples, between which it must not jump"
        raise PlanError(f"{sampled.name}: the plan jumps at {motion.switches[0]:g} s; {words}")
    _refuse_unobservable_along(model, motion)
    return Observer(model, model.start_covariance(), motion)


def _checked_uncertainty(
    sampled: SampledMechanism,
    measured: Sequence[str],
    noise: Mapping[str, float],
    groups: Mapping[str, Mapping[str, float] | None],
) -> Uncertainty:
    """Standard deviations by the names of scalars, from names of scalars, arrays and orientations.

    :param groups: those of bias, disturbance, unknown forces and deviations at the start, by the name of the setting.
    :raises PlanError: for an unknown name, a number that is not greater than 0, or what is measured without noise.
    """
    names, quaternions = [*sampled.symbols.signals], sampled.symbols.quaternions

    def by_scalar(label: str, values: Mapping[str, float] | None) -> dict[str, float]:
        scalars: dict[str, float] = {}
        for name, value in name_dictionary(f"observe: {label}", {} if values is None else values, PlanError).items():
            check_positive(f"{sampled.name}: {label} of {name}", value, PlanError)
            scalars |= sampled.symbols.values_by_element(
                label, dict.fromkeys(quaternions.get(name, [name]), value), names
            )
        return scalars

    chosen, noises = by_scalar("measured", dict.fromkeys(measured, 1)), by_scalar("noise", noise)
    biases = by_scalar("bias", groups["bias"])
    if chosen.keys() != noises.keys() or not biases.keys() <= chosen.keys() or not chosen:
        texts = (", ".join(group) or "nothing" for group in (chosen, noises, biases))
        words = "measured is {}, noise is that of {}, bias that of {}".format(*texts)
        raise PlanError(f"{sampled.name}: {words}: name outputs, and a noise for each")
    pushes, forces = (by_scalar(label, groups[label]) for label in ("disturbance", "unknown_forces"))
    return Uncertainty(noises, pushes, biases, forces, by_scalar("deviations", groups["deviations"]))


def _refuse_unobservable_along(model: EstimationModel, motion: Plan) -> None:
    """Raise a PlanError for a state at the start of a plan that no measurement along it tells.

    It is observable if its changes change what is measured at the k-th sample, C_k F_{k-1} … F_0, somewhere.
    """
    samples = np.arange(round(motion.duration / model.period) + 1) * model.period
    path = planned_motion(motion, samples).transpose(2, 0, 1)
    x, rows = model.start, []
    D, passed = model.tangents(x, path[0]), np.eye(len(x))
    for begin, end in pairwise(path):
        rows.append(np.array(model.measure(x, begin)[1]) @ passed)
        x, F, _ = (np.array(result) for result in model.predict(x, begin, end))
        passed = F @ passed
    model.refuse_unobservable(np.vstack(rows), D)


@final
@dataclass(frozen=True, eq=False)
class Observer:
    """A Kalman filter of a mechanism, from :func:`liaisons.observe`."""

    model: EstimationModel
    covariance: Floats  # before the first measurement, of a steady filter before each; divided by sizes
    motion: Plan | None  # None: the filter is steady, at an equilibrium

    @property
    def name(self) -> str:
        """Name of the mechanism."""
        return self.model.sampled.name

    @property
    def part(self) -> str:
        """Name of the observer in systems."""
        return f"{self.name}_observer"

    @property
    def outputs(self) -> dict[str, str]:
        """Names of the FMU's outputs by what they estimate: states, biases, unknown forces."""
        return by_name(self.model.states, map(identifier, self.model.states))

    @cached_property
    def corrected(self) -> tuple[Floats, Floats]:
        """Covariance of the errors after the first measurement, and its gain, both divided by sizes.

        In a steady filter they are the same at each measurement.
        """
        model, x, sigma = self.model, self.model.start, self.model.sampled.sigma
        _, after, _, gain = model.correct(x, self.covariance, sigma, model.measure(x, sigma)[0])
        return np.array(after), np.array(gain)

    @property
    def gain(self) -> Floats:
        """Gain (states, measured) at the first measurement; in a steady filter at each."""
        return self.corrected[1] * self.model.sizes[:, None] / self.model.noise

    @property
    def standard_deviations(self) -> dict[str, float]:
        """Standard deviations of the errors after the first measurement, by name; in a steady filter after each."""
        variances = np.maximum(0.0, np.diag(self.corrected[0]))
        return by_name(self.model.states, map(float, self.model.sizes * np.sqrt(variances)))

    @cached_property
    def directions(self) -> Floats:
        """Columns that span the changes of the estimates at the start, divided by sizes; under constraints tangents."""
        return self.model.tangents(self.model.start, self.model.sampled.sigma)

    @property
    def multipliers(self) -> Any:
        """Eigenvalues of the step from error to error of a steady filter, over one period."""
        F, _, C = self.model.start_matrices()
        return np.linalg.eigvals(self.directions.T @ (F - self.corrected[1] @ C @ F) @ self.directions)

    @cached_property
    def fmu(self) -> Path:
        """FMU of the filter, built at its first use, and deleted at the end of this process."""
        return build(self._component(), Path(mkdtemp(dir=process_folder())))

    def _component(self) -> type[Sampled]:
        """Class of the filter as a sampled component: measured values, noise and σ -> estimates, innovations."""
        model, n, steady = self.model, len(self.model.states), self.motion is None
        step, period = model.filter_step(self.covariance if steady else None), model.period
        variables = model.sampled.symbols.model
        units = {v.name: v.unit for v in (*variables.inputs, *variables.outputs)}
        measured = [*map(identifier, model.measured)]
        motion = model.sampled.motion_names
        triangle = [] if steady else [f"covariance_{i + 1}_{j + 1}" for j in range(n) for i in range(j, n)]
        body: dict[str, Any] = {"period": Parameter(period, "s", "sampling period", minimum=period, maximum=period)}

        def declare(
            kind: Any, names: Iterable[str], of_unit: Iterable[str], starts: Iterable[float] = repeat(0.0)
        ) -> None:
            for name, variable, start in zip(names, of_unit, starts, strict=False):
                unit = units.get(variable.removesuffix("_bias"), "1")
                words = name.replace("_", " ")
                body[name] = kind(unit, words, start=start, unchecked="the filter has units in its numbers")

        readings = [f"{name}_measured" for name in measured]
        noises = [f"{name}_noise" for name in measured]
        innovations = [f"{name}_innovation" for name in measured]
        before = [f"{name}_before" for name in motion]
        declare(Input, readings, model.measured)
        declare(Input, noises, model.measured)
        declare(Input, motion, motion)
        declare(DiscreteOutput, self.outputs.values(), model.states, map(float, model.start * model.sizes))
        declare(DiscreteOutput, innovations, repeat("1"))
        columns, rows = np.triu_indices(n)
        declare(DiscreteOutput, triangle, repeat("1"), map(float, self.covariance[rows, columns]))
        declare(DiscreteState, before, motion)
        declare(DiscreteState, ["samples"], ["1"])

        def update(filter_: Any) -> dict[str, ca.SX]:
            def column(names: Iterable[str]) -> ca.SX:
                return ca.vertcat(*(filter_.symbols[name] for name in names))

            begin, end = (model.sampled.motion_of_values(column(names)) for names in (before, motion))
            x = column(self.outputs.values()) / model.sizes
            y = (column(readings) + column(noises)) / model.noise
            x, P, e = step(filter_.samples < 0.5, x, column(triangle), begin, end, y)
            names = *self.outputs.values(), *triangle, *innovations, *before, "samples"
            after = ca.vertcat(x * model.sizes, P, e, column(motion), 1)
            return by_name(names, ca.vertsplit(after))

        body |= {"__doc__": f"Kalman filter of {self.name}.", "__module__": __name__, "update": update}
        return new_class(f"{self.name}Observer", (Sampled,), exec_body=lambda space: space.update(body))

    def connect_to(self, system: System) -> Any:
        """Add the filter to a system, and connect it with the mechanism NAME and its operators NAME_pivot_x.

        :returns: the component NAME_observer.
        """
        if not isinstance(system, System):
            raise PlanError(f"{self.name}: connect_to: system = {shown(system)}: give a System")
        part, parts = system.add(self.part, self.fmu), system.parts
        for name in self.model.measured:
            system.connect(parts[self.name][name], part[f"{identifier(name)}_measured"])
        for m in self.model.sampled.moves:
            system.connect(parts[f"{self.name}_{m}"]["y"], part[m])
        for force in self.model.sampled.controls:
            system.connect(parts[f"{self.name}_{force}"]["held"], part[force])
        return part

    def system(self, *, start_values: Mapping[str, float] | None = None, **keywords: float) -> System:
        """The mechanism connected with the observer, and with operators that hold σ or follow the plan.

        :param start_values: start values of the mechanism that differ; ``keywords`` are further ones.
        """
        starts, sampled = merged_start_values(self.name, start_values, keywords, PlanError), self.model.sampled
        if self.motion is None:
            system, goal = System(f"observed_{self.name}"), sampled.symbols.goal
            settings: dict[str, Any] = goal.parameters | sampled.start_values | starts
            held = by_name(sampled.driven, sampled.sigma.tolist())
            for m in sampled.moves:
                settings[m] = operator("Ramp", offset=held[m][0], rate=held[m][1])
            mechanism = system.add(self.name, goal.fmu, **settings)
            for force in sampled.controls:
                x = held[force][0]
                values: dict[str, Any] = {"period": self.model.period, "planned": np.full(KNOTS, x), "next_0": x}
                part = system.add(f"{self.name}_{force}", fmu_path("ForceRegulator"), **values)
                system.connect(part["force"], mechanism[force])
        elif sampled.controls:
            words = "the plan's forces are held from sample to sample by feedback: hold(plan, measured=...) runs it"
            raise PlanError(f"{self.name}: {words}")
        else:
            system = self.motion.system().with_start_values({f"{self.name}.{name}": x for name, x in starts.items()})
        self.connect_to(system)
        system.experiment = DefaultExperiment(0.0, self.duration, self.model.period)
        return system

    @property
    def duration(self) -> float:
        """Duration of a run [s], in whole periods: that of the plan, or four radians of the free motion."""
        period = self.model.period
        duration = self.motion.duration if self.motion else _RADIANS * self.model.sampled.time
        return period * round(duration / period)

    def verify(self) -> list[Verdict]:
        """Verdicts from 200 runs with random noise, forces and errors at the start: the filter knows its errors.

        The innovations are white, and of the size that their covariance says (χ²); so are the errors of the states at
        the end (NEES).
        """
        return self.consistency(self.random_runs(self.system()))

    def random_runs(self, system: System) -> list[tuple[Result, Floats]]:
        """Simulate 200 runs of a system with the observer, from a fixed seed.

        :returns: each run with the true values of what is estimated, but at the last instant, which has no noise.
        """
        random, model, uncertainty = np.random.default_rng(1), self.model, self.model.uncertainty
        H, n = model.period, len(model.sampled.names)
        count = round(self.duration / H)
        deviations = uncertainty.disturbance
        forces = list({**deviations, **uncertainty.unknown_forces})
        inputs = [f"{self.part}.{identifier(name)}_noise" for name in model.measured]
        inputs += [f"{self.name}.{force}" for force in forces]
        sources = [f"{name}_bias" for name in model.measured] + forces
        slow = [(sources.index(name), i) for i, name in enumerate(model.states[n:])]
        of_forces = [deviations.get(name, 0.0) / np.sqrt(H) for name in forces]
        sizes = np.append(model.noise, of_forces)
        means = np.append(0 * model.noise, [model.sampled.symbols.inputs[name] for name in forces])
        vectors, variances, _ = np.linalg.svd(self.covariance)
        coupling = "gauss-seidel" if self.motion and model.sampled.moves else "jacobi"
        runs = []
        with ignored_warnings(), system.start(step_size=H, tolerance=1e-9, coupling=coupling) as run:
            step = run.stepper(inputs, [])
            for _ in range(_RUNS):
                error = vectors @ (np.sqrt(variances) * random.standard_normal(len(variances)))
                estimates = (model.start - error) * model.sizes
                run.reset(by_name((f"{self.part}.{name}_0" for name in self.outputs.values()), estimates))
                drifts = np.cumsum(random.standard_normal((count, len(slow))) * model.drift[n:], axis=0)
                drifts = (drifts - drifts[0]) * model.sizes[n:]
                values = random.standard_normal((count, len(inputs))) * sizes + means
                for column, i in slow:
                    values[:, column] += drifts[:, i]
                for row in values:
                    step(row)
                result = run.result
                states = [result[f"{self.name}.{name}"][:-1] for name in model.sampled.names]
                runs.append((result, np.vstack([*states, drifts.T])))
        return runs

    def consistency(self, runs: list[tuple[Result, Floats]]) -> list[Verdict]:
        """Verdicts on the innovations of runs, and on the errors at their last sample.

        :param runs: as of :meth:`random_runs`.
        """
        model, nees, rank = self.model, 0.0, 0
        innovations = [f"{self.part}.{identifier(m)}_innovation" for m in model.measured]
        e = np.array([[run[name][:-1] for name in innovations] for run, _ in runs])
        power, freedom = 0.0, _LAGS * e.shape[1] ** 2
        for k in range(1, _LAGS + 1):
            late, early = e[:, :, k:], e[:, :, :-k]
            pairs = len(runs) * late.shape[2]
            power += np.sum(np.einsum("rik,rjk->ij", late, early) ** 2) / pairs
        ones = range(1, len(model.states) + 1)

        def last(run: Result, name: str) -> float:
            return float(run[f"{self.part}.{name}"][-2])

        for run, truth in runs:
            estimate = np.array([last(run, name) for name in self.outputs.values()]) / model.sizes
            values = ca.SX(ca.DM([last(run, name) for name in model.sampled.motion_names]))
            sigma = np.array(ca.DM(model.sampled.motion_of_values(values)))
            D = model.tangents(estimate, sigma)
            P, _ = self.corrected
            if self.motion:
                P = np.array([[last(run, f"covariance_{max(i, j)}_{min(i, j)}") for i in ones] for j in ones])
            off = D.T @ (truth[:, -1] / model.sizes - estimate)
            nees += float(off @ np.linalg.solve(D.T @ P @ D, off))
            rank += len(off)
        statistics = {
            "innovations have the size that their covariance says, χ² of all": (np.sum(e**2), e.size),
            f"they are white, χ² of {_LAGS} autocorrelations": (power, freedom),
            f"errors have the size that their covariance says, NEES over {_RUNS} runs": (nees, rank),
        }
        return [normal_verdict(words, (x - mean) / np.sqrt(2 * mean)) for words, (x, mean) in statistics.items()]

    def __repr__(self) -> str:
        text = ", ".join(f"{name} ± {value:.3g}" for name, value in self.standard_deviations.items())
        return f"<{self.name} observed by {', '.join(self.model.measured)} every {self.model.period:g} s: {text}>"


def normal_verdict(claim: str, value: float) -> Verdict:
    """Verdict on a standard normal statistic: its distance from 0."""
    reason = f"{_STANDARD_ERRORS} standard deviations: a right filter exceeds them with one seed in a thousand"
    return verdict(claim, error=abs(value), tolerance=_STANDARD_ERRORS, reason=reason)
