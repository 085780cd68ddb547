"""``observe``: estimates of states that are not measured, by a Kalman filter at an equilibrium or along a plan."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from liaisons.base.arguments import listed, merged, named, positive
from liaisons.errors import PlanError
from liaisons.holding.filtering import EstimationModel, Uncertainty
from liaisons.holding.observers import Observer
from liaisons.holding.subjects import planned_motion, sampled_subject
from liaisons.library import Target
from liaisons.planning.goals import values_by_element
from liaisons.planning.plans import Plan


def observe(
    motion: Plan | Target,
    /,
    measured: str | Sequence[str],
    noise: Mapping[str, float],
    disturbance: Mapping[str, float] | None = None,
    *,
    at: Mapping[str, Any] | None = None,
    moves: str | Sequence[str] | None = None,
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

    Once a period it reads what is measured, and σ, σ̇, σ̈, which the operators know; between samples it predicts by the
    mechanism's equations.  At an equilibrium its gains are the steady ones; along a plan they follow its covariance
    (extended Kalman filter).  Of constraints and orientations the errors are tangential.

    :param motion: a plan; or name, file or class of a mechanism.
    :param measured: outputs by name; arrays and orientations are measured element by element.
    :param noise: standard deviation of each sample, by what is measured.
    :param disturbance: random forces by input: standard deviation of the impulse in a second [unit of the input · √s].
    :param at: equilibrium, ``moves``: active coordinates that operators move; as for :func:`liaisons.hold`.
    :param bias: biases that are estimated, too: standard deviations by what is measured.
    :param unknown_forces: forces that are estimated, too: standard deviations by input.  They drift, as biases do, by
        their standard deviation in 100 radians of the free motion.
    :param deviations: standard deviations of states at the start of a plan; unless given a tenth of their sizes.
    :param step_size: sampling period [s]; unless given as for :func:`liaisons.hold`.
    :param start_values: parameters by name; ``keywords`` are further ones, where they are no settings.
    :raises PlanError: for an unknown name, a number that is not greater than 0, a mechanism that is not in equilibrium,
        a plan that jumps, or a state that is not observable; it is named.
    """
    values = merged("observe", start_values, keywords, PlanError)
    sampled, H = sampled_subject("observe", motion, at, moves, step_size, values)
    if not sampled.names:
        raise PlanError(f"{sampled.name} has no state that {', '.join(sampled.moves)} move: nothing is to be observed")
    names, quaternions = [*sampled.symbols.signals], sampled.symbols.quaternions

    def elements(label: str, values: Mapping[str, float] | None) -> dict[str, float]:
        """Standard deviations by scalars, from those of scalars, arrays and orientations."""
        scalars: dict[str, float] = {}
        for name, value in named(f"observe: {label}", values or {}, PlanError).items():
            positive(f"{sampled.name}: {label} of {name}", value, PlanError)
            scalars |= values_by_element(label, dict.fromkeys(quaternions.get(name, [name]), value), names)
        return scalars

    chosen = elements("measured", dict.fromkeys(listed("measured", measured, PlanError), 1))
    noises, biases = elements("noise", noise), elements("bias", bias)
    if chosen.keys() != noises.keys() or not biases.keys() <= chosen.keys() or not chosen:
        texts = (", ".join(group) or "nothing" for group in (chosen, noises, biases))
        words = "measured is {}, noise is that of {}, bias that of {}".format(*texts)
        raise PlanError(f"{sampled.name}: {words}: name outputs, and a noise for each")
    pushes, forces = elements("disturbance", disturbance), elements("unknown_forces", unknown_forces)
    uncertainty = Uncertainty(noises, pushes, biases, forces, elements("deviations", deviations))
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
    samples = np.arange(round(motion.duration / H) + 1) * H
    path = planned_motion(motion, samples).transpose(2, 0, 1)
    x, rows = model.start, []
    D, passed = model.tangents(x, path[0]), np.eye(len(x))
    for begin, end in pairwise(path):
        rows.append(np.array(model.measure(x, begin)[1]) @ passed)
        x, F, _ = (np.array(result) for result in model.predict(x, begin, end))
        passed = F @ passed
    model.refuse_unobservable(np.vstack(rows), D)
    return Observer(model, model.start_covariance(), motion)
