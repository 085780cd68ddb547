"""What a Python FMU computes: one vector of all its numbers, and CasADi functions from this vector to the next one.

They are made when the FMU is written, so that its runtime holds no symbols.  The numbers are, by name:

==========================  ================================================================================
t, H                        time; size of the communication step
x, h, earliest, latest      time since its start; internal step; times of the last event and of the next one
mode, tolerance             input_reconstruction; of the importer
jumped                      1: the energy may have jumped since the last step
k, given, z, drawn          the Real variables by value reference; given: inputs as set by the importer
u, target                   inputs at t; those that a step reaches at t + H if it interpolates
y, m, size                  states, memory, nominal values of the states
y_next, error               result of an internal step, and its relative error
past_H, past_u              size and inputs of the last step at its start; 0 and u where u reached the given ones
far, compared               1: σ is far from where its rates led; the time of that comparison
leaps, jump                 1: σ jumps at the end of the step; how far it jumps, 0 where that moves no states
away                        of y_next from the constraints, in units of what is kept
trial, reached              states on their way onto the constraints; what is left there, and what is prescribed
looked                      what is known of rates that nobody gives, see ``python_runtime/rates.py``
margins, instants           of the conditions; at which the component is not smooth
==========================  ================================================================================

Inside a step every input is a polynomial in τ = x/H.  mode 0 holds σ, σ̇ and σ̈; 1 takes the Taylor polynomial of σ from
the values at t; 2 takes the quintic Hermite polynomial between those at t and at t + H, and other inputs are linear.

The motion follows σ by its rate.  The difference to σ at the next communication point is a jump, as in
``prescribed.c``.  Interpolation reaches σ, unless a polynomial through both ends would have to move much faster than σ̇
and σ̈ there: such a step is extrapolated, too, and σ jumps at its end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import reduce
from types import SimpleNamespace

import casadi as ca
import numpy as np
from scipy.integrate import RK45

from liaisons.base.hermite import upper_coefficients
from liaisons.fmu import coupled_state_count, energy_accounts, jump_effects, memory_index
from liaisons.language import Variable
from liaisons.mechanics import Model

_HOLD, _EXTRAPOLATE, _INTERPOLATE = range(3)
_ROUNDING = 1e-14  # jumps below this part of σ are rounding errors
_FAR = 5.0  # a difference so many times the distance by rate and acceleration is a jump
_VALUE, _RATE = 1e-6, 1e-3  # tolerance of the source: parts of σ, and of the distance by its rate
_LOOKED = 5 + 3 * 4  # numbers of a coordinate
_LARGEST = 1.7976931348623157e308


def allowed_range(variable: Variable) -> tuple[float, float]:
    """Least and the largest number that a variable may have; both are allowed."""
    low = -_LARGEST if variable.minimum is None else variable.minimum
    high = _LARGEST if variable.maximum is None else variable.maximum
    return (math.nextafter(low, math.inf), math.nextafter(high, -math.inf)) if variable.strict else (low, high)


def initial_numbers(model: Model) -> dict[str, list[float]]:
    """Start values of all numbers of an instance, by the names above."""
    inputs, zero = [variable.starts[0] for variable in model.inputs], [0.0]
    states, prescribed = zero * model.start.numel_out(0), zero * len(model.active)
    return {
        **dict.fromkeys(("t", "H", "x", "h", "earliest", "latest"), zero),
        "mode": [float(_EXTRAPOLATE)],
        "tolerance": [model.experiment.tolerance],
        "jumped": zero,
        "k": [variable.starts[0] for variable in model.parameters],
        "given": inputs,
        "z": zero * len(model.outputs),
        "drawn": zero * len(model.drawn),
        **dict.fromkeys(("u", "target", "past_u"), inputs),
        **dict.fromkeys(("y", "y_next", "size", "trial"), states),
        "m": zero * model.start.numel_out(1),
        **dict.fromkeys(("error", "past_H", "compared", "away"), zero),
        "reached": zero * (model.reach.numel_out(0) if model.reach else 0),
        **dict.fromkeys(("far", "leaps", "jump"), prescribed),
        "looked": zero * (_LOOKED * len(model.active)),
        "margins": zero * len(model.condition_texts),
        "instants": zero * model.events.numel_out(0),
    }


def slave_functions(model: Model, active: list[list[int]]) -> dict[str, ca.Function]:
    """Functions of all numbers that return all numbers, some of them changed; by name.

    :param model: without arrays.
    :param active: for each active coordinate the indices of σ, σ̇, σ̈ among the inputs.
    """
    sizes = {name: len(numbers) for name, numbers in initial_numbers(model).items()}
    everything = ca.MX.sym("everything", sum(sizes.values()))
    parts = ca.vertsplit(everything, [0, *np.cumsum(list(sizes.values())).tolist()])
    n = SimpleNamespace(**dict(zip(sizes, parts, strict=True)))
    point, inputs = (n.t, n.y, n.u, n.k), _input_polynomials(model, active)
    y, m = model.start(n.t, n.given, n.k)
    nominals = model.nominals(n.t, y, n.given, n.k)
    size = ca.if_else(ca.logic_and(nominals > 0, nominals < math.inf), nominals, 1)
    u = _inputs_at(n, inputs, n.H)
    projected = n.y if model.project is None else model.project(n.t, n.y, u, n.k)
    for energy, work, _ in energy_accounts(model) if model.project else ():  # takes back what σ̇ has moved a held σ
        change = [model.outputs_function(n.t, states, u, n.k, n.m)[energy] for states in (n.y, projected)]
        projected[work] += ca.if_else(n.mode == _HOLD, change[1] - change[0], 0)
    arrived = n.mode == _INTERPOLATE
    past = {"past_H": ca.if_else(arrived, 0, n.H), "past_u": ca.if_else(arrived, u, n.u)}
    drawn = {} if model.draw is None else {"drawn": model.draw(*point)}
    changes = {
        "start": {"u": n.given, "y": y, "m": m, "size": size, "past_H": 0, "past_u": n.given, "jumped": 1},
        "outputs": {"z": model.outputs_function(*point, n.m), "margins": model.conditions(*point), **drawn},
        "events": {"instants": model.events(*(n.k, n.x)[: model.events.n_in()])},
        "compare": _mismatch_and_jump(model, n, active),
        "leap": _runge_kutta_step(n, _jump_rates(model, n, active)) if active else {},
        "jump": {"y": model.jump(*point, n.m)},
        "inputs": {"u": _inputs_at(n, inputs, n.x)},
        "advance": _advance(model, n, inputs, active),
        "reach": _reach(model, n, inputs),
        "finish": {"u": u, "y": projected, "m": model.remember(n.t, projected, u, n.k, n.m), **past},
        "remember": {"m": model.remember(*point, n.m)},
    }
    return {
        name: ca.Function(name, [everything], [ca.densify(ca.vertcat(*map(ca.vec, (vars(n) | changed).values())))])
        for name, changed in changes.items()
    }


def _input_polynomials(model: Model, active: list[list[int]]) -> ca.Function:
    """Function (interpolates, x, H, mode, u at start, u at end) → u at x, a time since the start of the step.

    Only the polynomial of the mode is evaluated: that between both ends has many times the operations of the other.
    """
    between, ahead = (_polynomial(model, active, interpolates=interpolates) for interpolates in (True, False))
    return ca.Function.if_else("inputs", between, ahead)


def _polynomial(model: Model, active: list[list[int]], *, interpolates: bool) -> ca.Function:
    """Function (x, H, mode, u at start, u at end) → u at x, between both ends or by what is known at the start."""
    x, H, mode = ca.SX.sym("x"), ca.SX.sym("H"), ca.SX.sym("mode")
    start, end = ca.SX.sym("start", len(model.inputs)), ca.SX.sym("end", len(model.inputs))
    tau = x / H
    u = start + tau * (end - start) if interpolates else ca.SX(start)
    for indices in active:
        value, rate, acceleration = ca.vertsplit(start[indices])
        sigma = value + x * (rate + x * acceleration / 2)
        if interpolates:
            cubic, quartic, quintic = upper_coefficients(ca.vertsplit(start[indices]), ca.vertsplit(end[indices]), H)
            sigma += tau**3 * (cubic + tau * (quartic + tau * quintic))
        for index in indices:
            u[index] = sigma
            sigma = ca.jacobian(sigma, x)
    # The polynomials have rounding errors.
    u = ca.if_else(x == H, end, u) if interpolates else ca.if_else(mode == _HOLD, start, u)
    return ca.Function("polynomial", [x, H, mode, start, end], [ca.densify(u)], {"cse": True})


def _inputs_at(n: SimpleNamespace, inputs: ca.Function, x: ca.MX) -> ca.MX:
    """Inputs at x, a time since the start of the step."""
    return inputs(n.mode == _INTERPOLATE, x, n.H, n.mode, n.u, n.target)


def _motion_rates(
    model: Model, n: SimpleNamespace, inputs: ca.Function, active: list[list[int]]
) -> Callable[[ca.MX, ca.MX], ca.MX]:
    """Function (x, y) → dy/dt inside a step; NaN outside of a domain.

    Time is kept between the earliest and the latest, that is on one side of an event.  Work is done along σ and σ̇ of
    the step: power is that along σ̇ and σ̈, by which σ and σ̇ do not move in mode 0; see ``core_correct_work``.
    """
    arguments = model.derivatives.sx_in()
    now, y, u, k = arguments
    valid = [margin > 0 for margin in ca.vertsplit(model.conditions(now, y, u, k))]
    valid = valid[: len(valid) - model.start_only]
    for value, (low, high) in zip(ca.vertsplit(u), map(allowed_range, model.inputs), strict=True):
        valid += [value >= low, value <= high]
    trap = ca.if_else(reduce(ca.logic_and, valid, ca.SX(1)), 0, math.nan)
    derivatives, accounts = model.derivatives(*arguments), energy_accounts(model)
    held = _rates_with_power_of_hold(model, arguments, derivatives, active)
    moves, holds = (
        ca.Function(name, arguments, [ca.densify(rates + trap)], {"cse": True})
        for name, rates in (("rates", derivatives), ("held", held))
    )
    by_mode = ca.Function.if_else("by_mode", holds, moves)

    def slopes(x: ca.MX, y: ca.MX) -> ca.MX:
        t = ca.fmax(n.earliest, ca.fmin(n.latest, n.t + x))
        point = t, y, _inputs_at(n, inputs, x), n.k
        return by_mode(n.mode == _HOLD, *point) if accounts else moves(*point)

    return slopes


def _rates_with_power_of_hold(model: Model, arguments: list[ca.SX], rates: ca.SX, active: list[list[int]]) -> ca.SX:
    """dy/dt in mode 0, from that of the other modes."""
    now, y, u, k = arguments
    moved, held = ca.SX.zeros(u.numel()), ca.SX(rates)
    for value, rate, acceleration in active:
        moved[value], moved[rate] = u[rate], u[acceleration]
    z = model.outputs_function(now, y, u, k, ca.SX(model.start.numel_out(1), 1))
    for energy, work, dissipated in energy_accounts(model):
        if model.project:
            held[work] = ca.jtimes(z[energy], y, rates) + ca.jacobian(z[energy], now) + rates[dissipated]
        else:
            held[work] = rates[work] - ca.jtimes(z[energy], u, moved)
    return held


def _advance(model: Model, n: SimpleNamespace, inputs: ca.Function, active: list[list[int]]) -> dict[str, ca.MX]:
    """Expressions of an internal step, and how far it leaves the constraints."""
    step = _runge_kutta_step(n, _motion_rates(model, n, inputs, active))
    if model.reach is None:
        return step
    x = n.x + n.h
    left = model.reach(n.t + x, step["y_next"], _inputs_at(n, inputs, x), n.k)
    return {**step, "away": ca.norm_inf(left[: len(model.reaches)])}


def _reach(model: Model, n: SimpleNamespace, inputs: ca.Function) -> dict[str, ca.MX]:
    """Expressions of what the trial leaves of the constraints at x, and of the next one, which is projected."""
    if model.reach is None or model.project is None:
        return {}
    point = n.t + n.x, n.trial, _inputs_at(n, inputs, n.x), n.k
    return {"reached": model.reach(*point), "trial": model.project(*point)}


def _runge_kutta_step(n: SimpleNamespace, rates: Callable[[ca.MX, ca.MX], ca.MX]) -> dict[str, ca.MX]:
    """Expressions of the next y and of its error by a step of the pair of Dormand and Prince."""
    slopes, y = rates(n.x, n.y), n.y
    for part, row in zip([*RK45.C[1:], 1], [*RK45.A[1:], RK45.B], strict=True):
        y = n.y + n.h * ca.mtimes(slopes, ca.DM(row[: slopes.shape[1]]))
        slopes = ca.horzcat(slopes, rates(n.x + part * n.h, y))
    error = n.h * ca.mtimes(slopes, ca.DM(RK45.E))
    return {"y_next": y, "error": ca.norm_2(error / (n.size + ca.fabs(y)))}


# ---- prescribed coordinates ------------------------------------------------------------------------------------------


def _mismatch_and_jump(
    model: Model,
    n: SimpleNamespace,
    active: list[list[int]],
) -> dict[str, ca.MX]:
    """Expressions of the mismatch of σ and its rates over a step, and of the jump that follows from it."""
    if not active:
        return {"target": n.given}
    values, rates, accelerations = map(list, zip(*active, strict=True))
    interpolates, moves = n.mode == _INTERPOLATE, n.mode != _HOLD
    H = ca.if_else(interpolates, n.H, n.past_H)
    start, end = ca.if_else(interpolates, n.u, n.past_u), ca.if_else(interpolates, n.given, n.u)
    followed = start[values] + H * (start[rates] + moves * H * start[accelerations] / 2)
    difference, change, largest = end[values] - followed, ca.fabs(end - start), ca.fmax(ca.fabs(start), ca.fabs(end))
    distance = H * (largest[rates] + H * largest[accelerations] / 2)
    # A rate that jumps inside the step moves σ by up to H times the jump, an acceleration by up to half of H².
    explained = H * (change[rates] + H * change[accelerations] / 2)
    explained += _RATE * distance + _VALUE * largest[values] + math.ulp(1.0)
    m, mismatch = ca.MX(n.m), ca.if_else(ca.fabs(difference) > explained, difference, 0)
    for i, coordinate in enumerate(model.active):
        index = memory_index(model, f"{coordinate.value}_mismatch")
        if index >= 0:
            m[index] = ca.if_else(ca.logic_and(moves, H > 0), mismatch[i], 0)
    far, target = ca.fabs(difference) > _FAR * distance, ca.MX(n.given)
    leaps = ca.logic_and(interpolates, far)
    extrapolated = start[rates] + H * start[accelerations]
    for indices, reached in ((values, followed), (rates, extrapolated), (accelerations, start[accelerations])):
        target[indices] = ca.if_else(leaps, reached, n.given[indices])
    rounding = _ROUNDING * ca.fmax(ca.fabs(end[values]), ca.fabs(followed))
    jumps = ca.logic_and(change[values] > 0, ca.fabs(difference) > rounding)
    jumps = ca.logic_and(jumps, ca.logic_or(leaps, ca.logic_not(interpolates)))
    effects, compared = jump_effects(model), n.t + ca.if_else(interpolates, H, 0)
    mixing = ca.mtimes(ca.DM(effects.mixes.astype(float)), jumps)  # of each rate, with the rates of jumps
    moving = ca.dot(ca.DM(effects.moves.astype(float)), jumps) + ca.dot(mixing, end[rates] != 0)
    has_limit = ca.logic_and(moving * effects.move_states > 0, ca.dot(mixing, jumps) == 0)
    jump = ca.if_else(ca.logic_and(has_limit, jumps), difference, 0)
    return {"m": m, "far": far, "compared": compared, "leaps": leaps, "target": target, "jump": jump}


def _jump_rates(model: Model, n: SimpleNamespace, active: list[list[int]]) -> Callable[[ca.MX, ca.MX], ca.MX]:
    """Function (x, y) → dy/dx along a jump of σ to u, 0 <= x <= 1."""
    values, rates, _ = (ca.DM.eye(n.u.numel())[:, list(indices)] for indices in zip(*active, strict=True))
    count, jump = coupled_state_count(model), n.jump

    def slopes(x: ca.MX, y: ca.MX) -> ca.MX:
        resting = n.u + (x - 1) * ca.mtimes(values, jump)
        jumping = model.derivatives(n.t, y, resting + ca.mtimes(rates, jump), n.k)
        change = jumping - model.derivatives(n.t, y, resting, n.k)
        return ca.vertcat(change[:count], ca.MX.zeros(y.numel() - count))

    return slopes
