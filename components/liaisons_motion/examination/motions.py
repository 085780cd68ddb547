"""Motions of a component by its equations, as functions of numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from liaisons import assemble
from liaisons.errors import ComponentError
from liaisons.language import Component, Variable

Motion = Mapping[str, NDArray]
"""Outputs of a component by name, each over the same times."""
_TOLERANCE = 1e-11
"""Relative tolerance of the motion."""
_COARSE = 1e-9
"""Relative tolerance of the motion whose distance from the other one bounds its error."""


@final
class EquationsOfMotion:
    """Derived equations of a component, integrated by SciPy's DOP853 from any start values.

    :raises ComponentError: unless they are smooth in time: contacts, samples and tables are left to the FMU.
    """

    def __init__(self, component: type[Component]) -> None:
        self.model = model = assemble(component).flat()
        what = {"contacts": model.contacts, "samples": model.sample, "a table": model.table}
        if reasons := [name for name, part in what.items() if part]:
            raise ComponentError(f"{component.__name__}: its motion has {' and '.join(reasons)}")
        self.variables: dict[str, Variable] = {v.name: v for v in (*model.parameters, *model.inputs)}
        self.outputs = [v.name for v in model.outputs]

        self.declared = {name: float(variable.starts[0]) for name, variable in self.variables.items()}
        reference = self.model.experiment.reference
        self.values = self.declared | {k: float(v) for k, v in reference.items() if k in self.declared}

    def motion(self, values: Mapping[str, float], times: NDArray) -> tuple[Motion, Motion]:
        """Return all outputs at times, and bounds of their errors; prescribed coordinates are quadratic in time.

        Beyond a singularity outputs are NaN, and their bounds infinite.
        """
        fine, coarse = (self.outputs_at(values, times, tolerance) for tolerance in (_TOLERANCE, _COARSE))
        bounds = np.nan_to_num(np.abs(fine - coarse), nan=np.inf)
        return self.by_name(fine), self.by_name(bounds)

    def distances(self, values: Mapping[str, float]) -> NDArray:
        """Distances of the conditions that must stay > 0 from failing, at the start."""
        model = self.model
        parameters, u = ([values[v.name] for v in part] for part in (model.parameters, model.inputs))
        start, memory = model.start(0.0, u, parameters)
        last = [memory] if model.conditions.n_in() > 4 else []
        return np.array(model.conditions(0.0, start, u, parameters, *last)).ravel()

    def by_name(self, outputs: NDArray) -> Motion:
        """Rows of an array as outputs by their names."""
        return dict(zip(self.outputs, outputs, strict=True))

    def outputs_at(
        self, values: Mapping[str, float], times: NDArray, tolerance: float = _TOLERANCE, most: int = 15_000
    ) -> NDArray:
        """Return all outputs at times, shape (outputs, times), by an integration of this tolerance.

        :param most: calls of the derivatives after which the motion ends, as at a singularity.
        """
        model = self.model
        parameters = [values[v.name] for v in model.parameters]
        constant = np.array([values[v.name] for v in model.inputs])
        rows = {v.name: row for row, v in enumerate(model.inputs)}
        moved = np.array([[rows[n] for n in (a.value, a.rate, a.acceleration)] for a in model.active], int)

        def inputs(t: float) -> NDArray:
            u = constant.copy()
            for value, rate, acceleration in moved:
                u[value] += constant[rate] * t + constant[acceleration] / 2 * t**2
                u[rate] += constant[acceleration] * t
            return u

        start, memory = (np.array(part).ravel() for part in model.start(0.0, inputs(0.0), parameters))
        last = [memory] if model.derivatives.n_in() > 4 else []
        sizes = np.array(model.nominals(0.0, start, inputs(0.0), parameters)).ravel()

        def rates(t: float, y: NDArray) -> NDArray:
            return np.array(model.derivatives(t, y, inputs(t), parameters, *last)).ravel()

        atol = tolerance * np.maximum(np.abs(sizes), 1e-12)
        states = (
            _states_at(times, rates, start, most, rtol=tolerance, atol=atol) if len(start) else [start] * len(times)
        )
        reached = zip(times, states, strict=False)  # where it is singular the integration ends
        outputs = [np.array(model.outputs_function(t, y, inputs(t), parameters, memory)).ravel() for t, y in reached]
        whole = np.full((len(times), len(self.outputs)), np.nan)
        for row, output in zip(whole, outputs, strict=False):
            row[:] = output
        return whole.T


def _states_at(
    times: NDArray, rates: Callable[[float, NDArray], NDArray], start: NDArray, most: int, **tolerances: Any
) -> Sequence[NDArray]:
    """States at times from 0, until the motion ends."""
    states = [start]
    if not np.all(np.isfinite(rates(0.0, start))):  # no step size would be small enough
        return states
    with np.errstate(all="ignore"):
        solver = DOP853(rates, 0.0, start, float(times[-1]), **tolerances)
        while solver.status == "running" and solver.nfev < most:
            solver.step()
            if solver.status != "failed" and times[len(states)] <= solver.t:
                dense = solver.dense_output()
                states += [dense(t) for t in times[len(states) :] if t <= solver.t]
    return states
