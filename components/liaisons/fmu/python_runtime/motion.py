"""Motion of one instance through communication steps [t, t + H].

Inside a step every input is a polynomial in τ = (t' − t)/H, by ``input_reconstruction``:

=================  ==========================================================================================
0 hold             σ, σ̇, σ̈ constant, each as given
1 extrapolate      Taylor polynomial of σ from the values at t; other inputs constant
2 interpolate      quintic Hermite polynomial of σ between the values at t and at t + H; other inputs linear
=================  ==========================================================================================

The motion follows σ by its rate, up to ``followed`` at the end of a step.  The difference to σ at the next communication
point is a jump, as in ``prescribed.c``.  Interpolation reaches σ, unless a polynomial through both ends would have to
move much faster than σ̇ and σ̈ there: such a step is extrapolated, too, and σ jumps at its end.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .calls import Array, Call
from .component import Component, violation

HOLD, EXTRAPOLATE, INTERPOLATE = range(3)
TIGHTEST, LOOSEST = 1e-14, 1e-2  # tolerances are kept between these
ARRAYS = ("t", "k", "given", "u", "y", "m", "past", "size")  # the members that a saved state holds

# Error of an internal step: this part of the importer's tolerance, so that hundreds of periods stay near it, and not
# less than rounding allows.
_PART, _LEAST = 0.02, 1e-14
_MOST_STEPS, _SMALLEST = 100_000, 1e-13  # internal steps in an interval; smallest one relative to it
_SHRINK, _GROW, _SAFETY = 0.2, 6.0, 0.85  # factors of the step size: limits, and what keeps most from rejection

_JUMPS, _MIXES = 1, 2  # in the table of jumps: one moves states; rates of both are factors in those of the states
_ROUNDING = 1e-14  # jumps below this part of σ are rounding errors
_VALUE, _RATE = 1e-6, 1e-3  # tolerance of the source: parts of σ, and of the distance by its rate
_FAR = 5.0  # a difference so many times the distance by rate and acceleration is a jump


class StepRefusedError(Exception):
    """No step is possible; the message says why."""


class Motion:
    """Numbers of one instance, named as in the functions of the component.

    :ivar values: all Real variables by value reference: k, given (inputs as set by the importer), z, drawn; those below
        the first parameter belong to none.
    :ivar moving: everything that a step changes: t, y, u (inputs at the present time), m, past.
    :ivar past: H, u and ``followed`` of the last step, H = 0 if there was none; then the distances and the time of the
        last comparison of σ with its rates.
    :ivar size: nominal values of y, which the tolerance is relative to.
    :ivar jumped: whether parameters or inputs were set since the last step, so that the energy may have jumped.
    """

    def __init__(self, component: Component) -> None:
        f, inputs, active = component.functions, len(component.inputs), component.active.shape[1]
        states, memory = f["start"].numel_out(0), f["start"].numel_out(1)
        first, zeros = 1 + len(component.sizes), np.zeros
        self.mode, self.tolerance, self.jumped = EXTRAPOLATE, component.tolerance, False
        self.values = np.array([math.nan] * first + [entry.start for entry in component.variables])
        _, self.k, self.given, self.z, self.drawn = _parts(
            self.values, first, len(component.parameters), inputs, len(component.outputs)
        )
        self.moving = zeros(1 + states + inputs + memory + 1 + inputs + 2 * active + 1)
        self.t, self.y, self.u, self.m, self.past = _parts(self.moving, 1, states, inputs, memory)
        self._past_H, self._past_u, self._followed, self._went, self._compared_at = _parts(
            self.past, 1, inputs, active, active
        )
        self.size = np.ones(states)
        self._component, self._warned = component, set[int]()
        self._measured = component.mismatches >= 0
        self._mode, self._H, self._tau, self._after = zeros(1), zeros(1), zeros(1), zeros(1)
        self._instants, self._coefficients = zeros(f["events"].numel_out(0)), zeros(f["polynomials"].numel_out(0))
        self._s, self._h, self._span, self._error, self._y_next = zeros(1), zeros(1), zeros(4), zeros(1), zeros(states)
        self._jump, moved = zeros(active), f["jump_along"].numel_out(0) if "jump_along" in f else 0
        self._y_moved, self._y_moved_next = zeros(moved), zeros(moved)
        point, step = (self.t, self.y, self.u, self.k), (self._s, self._h)
        jump = (self._y_moved, self.size[:moved], *point, self._jump, self._followed)
        arrays = {
            "start": ((self.t, self.u, self.k), (self.y, self.m)),
            "nominals": (point, (self.size,)),
            "outputs": ((*point, self.m), (self.z,)),
            "draw": (point, (self.drawn,)),
            "jump": ((*point, self.m), (self.y,)),
            "remember": ((*point, self.m), (self.m,)),
            "project": (point, (self.y,)),
            "events": ((self.k, self._after)[: f["events"].n_in()], (self._instants,)),
            "polynomials": ((self._mode, self._H, self.u, self.given), (self._coefficients,)),
            "inputs": ((self._tau, self._coefficients), (self.u,)),
            "advance": (
                (*step, self.y, self.size, self._span, self._coefficients, self.k),
                (self._y_next, self._error),
            ),
            "jump_along": ((*step, *jump), (self._y_moved_next, self._error)),
        }
        self._calls = {name: Call(f[name], *bound) for name, bound in arrays.items() if name in f}

    def run(self, name: str) -> None:
        """Run a function of the component, unless it has none of this name."""
        if name in self._calls:
            self._calls[name].run()

    def start(self) -> None:
        """Calculate state and memory from parameters and inputs."""
        self.u[:] = self.given
        self.run("start")

    def initialize(self) -> str:
        """Start at t; returns what forbids that, or an empty text."""
        self.start()
        self.run("nominals")
        self.size[~((self.size > 0) & np.isfinite(self.size))] = 1.0
        self._follow(0.0, self.u)
        component, t = self._component, float(self.t[0])
        if problem := violation(component.parameters, self.k, t) or violation(component.inputs, self.given, t):
            return problem
        if not np.isfinite(self.y).all():
            return "the initial state is not finite"
        conditions = len(component.condition_texts)
        failed = component.failed_condition(t, self.y, self.u, self.k, 0.0, conditions)
        if failed or not np.isfinite(self.m).all():
            return failed or "the initial energy is not finite"
        return self._overflow(t) if t else ""

    def _overflow(self, t: float) -> str:
        """The output that is not finite at this start time, if it is at 0: functions of time overflow at 1e300."""
        self.run("outputs")
        z, self.t[0] = self.z.copy(), 0.0
        self.run("outputs")
        self.t[0] = t
        for entry, value in zip(self._component.outputs, z.tolist(), strict=True):
            if not math.isfinite(value) and np.isfinite(self.z).all():
                return f"{entry.name} = {value:g} at t = {t:.9g}: it must be finite"
        return ""

    def take_inputs(self) -> None:
        """Make the given inputs those of the present time, unless they are interpolated."""
        if self.mode != INTERPOLATE and self.u.tobytes() != self.given.tobytes():
            self.u[:] = self.given
            self.jumped = True

    def step(self, H: float) -> None:
        """Advance by a communication step of size H [s].

        :raises StepRefusedError: if the motion does not reach its end; numbers in ``moving`` are then undefined.
        """
        self.take_inputs()
        leaps, given = self._compare(H), self.given.copy()
        if self.jumped:
            self._book_jump()
        if leaps.any():
            if problem := violation(self._component.inputs, given, float(self.t[0]) + H):
                raise StepRefusedError(problem)
            value, rate, acceleration = self.u[self._component.active]
            ends = value + H * rate + H**2 * acceleration / 2, rate + H * acceleration, acceleration
            self.given[self._component.active] = np.where(leaps, ends, given[self._component.active])
        try:
            self._advance(H)
        finally:
            self.given[:] = given
        self.run("project")  # back onto constraints and unit quaternions
        self.run("remember")
        if leaps.any():
            self._follow(0.0, self.u)
            self.u[:] = given
            self._book_jump()
            self.run("remember")
        self.jumped = False

    def _advance(self, H: float) -> None:
        """Integrate from event to event, with inputs by their polynomials."""
        t, u, begin = float(self.t[0]), self.u.copy(), 0.0
        self._mode[0], self._H[0], earliest = self.mode, H, t
        self.run("polynomials")
        while begin < H:
            instant = self._next_instant(earliest)
            end = min(instant - t, H)
            self._span[:] = t, H, earliest, math.nextafter(instant, t)
            if self.y.size:
                reached = self._integrate("advance", self.y, self._y_next, begin, end)
                if reached < end:
                    raise StepRefusedError(self._obstacle(reached, H))
            begin, earliest = end, instant
        self._set_inputs(1.0)
        if self.mode == INTERPOLATE:
            self.u[:] = self.given  # the polynomials have rounding errors
        self._follow(H, u)
        rounding = 1e-12 * (1 + abs(t + H))  # by which an end may miss an instant: 3 * 0.3 is not 0.9
        instant = self._next_instant(t + H - rounding)
        self.t[0] = instant if instant <= t + H + rounding else t + H

    def _integrate(self, name: str, y: Array, y_next: Array, begin: float, end: float) -> float:
        """Advance y from begin to end, with error control; returns how far it came."""
        allowed = max(_PART * self.tolerance, _LEAST)
        s, rest = begin, end - begin
        h = rest
        for _ in range(_MOST_STEPS):
            self._s[0], self._h[0] = s, h
            self.run(name)
            error = float(self._error[0]) / allowed
            if error <= 1:
                y[:] = y_next
                s, rest = s + h, rest - h
                if rest == 0:
                    return end
            elif h < _SMALLEST * (end - begin):
                break
            # The error is of order 5; where it is not a number the step shrinks.
            h = min(rest, h * min(_GROW, max(_SHRINK, _SAFETY * (error + 1e-9) ** -0.2)))
        return s

    def _obstacle(self, elapsed: float, H: float) -> str:
        """Why the motion ends, so many seconds after the start of the step."""
        component, t, h = self._component, float(self.t[0]), float(self._h[0])
        ahead = min(elapsed + h / _SHRINK, H)  # as far as the stages of the last step but one
        self._set_inputs(ahead / H)
        if problem := violation(component.inputs, self.u, t + ahead):
            return problem
        if h > H * _SMALLEST:
            return f"more than {_MOST_STEPS} internal steps are needed: choose a smaller step"
        self._set_inputs(elapsed / H)
        # Conditions are distances from a singularity, of order 1 elsewhere.
        condition = component.failed_condition(t + elapsed, self.y, self.u, self.k, 1e-3, component.lasting)
        return condition or f"no step from t = {t + elapsed:.9g} is small enough for the tolerance {self.tolerance:g}"

    def _set_inputs(self, tau: float) -> None:
        """Evaluate the polynomials of the inputs."""
        self._tau[0] = tau
        self.run("inputs")

    def _next_instant(self, t: float) -> float:
        """The first instant after t [s] at which the component is not smooth; inf if there is none."""
        self._after[0] = t
        self.run("events")
        return min((instant for instant in self._instants.tolist() if instant > t), default=math.inf)

    # ---- prescribed coordinates -------------------------------------------------------------------------------

    def _follow(self, H: float, u: Array) -> None:
        """Note the end of a step of size H, which began with the inputs u."""
        value, rate, _ = self._component.active
        self._past_H[0], self._past_u[:] = H, u
        self._followed[:] = u[value] + H * u[rate] if self.mode == HOLD else self.u[value]

    def _compare(self, H: float) -> NDArray[np.bool_]:
        """Measure the mismatch of σ and its rates over the last step, or over the next one if inputs are interpolated.

        :returns: whether each σ jumps at the end of the next step instead of being interpolated.
        """
        active, t = self._component.active, float(self.t[0])
        leaps = np.zeros(active.shape[1], dtype=bool)
        if not active.size or self.mode == HOLD:
            return leaps
        if self.mode == INTERPOLATE:
            before, after = self.u[active], self.given[active]
            followed, time = before[0] + H * (before[1] + H * before[2] / 2), t + H
        else:
            before, after, followed, H, time = self._past_u[active], self.u[active], self._followed, self._past_H[0], t
        difference = after[0] - followed
        largest, change = np.maximum(abs(before), abs(after)), abs(after - before)
        went = H * (largest[1] + H * largest[2] / 2)
        # A rate that jumps inside the step moves σ by up to H times the jump, an acceleration by up to half of H².
        explained = H * (change[1] + H * change[2] / 2) + _RATE * went + _VALUE * largest[0] + math.ulp(1.0)
        mismatch = np.where((abs(difference) > explained) & (H > 0), difference, 0.0)
        self.m[self._component.mismatches[self._measured]] = mismatch[self._measured]
        self._went[:], self._compared_at[:] = went, time
        return abs(difference) > _FAR * went if self.mode == INTERPOLATE else leaps

    def _book_jump(self) -> None:
        """Move states along with jumps of σ, and book the work of the jump."""
        if self._component.jumps.any() and self._find_jumps():
            self._y_moved[:] = self.y[: self._y_moved.size]
            # Through a singularity there is no limit.
            if self._integrate("jump_along", self._y_moved, self._y_moved_next, 0.0, 1.0) == 1:
                self.y[: self._y_moved.size] = self._y_moved
        self.run("jump")

    def _find_jumps(self) -> bool:
        """Set how far each σ jumps; returns whether that moves states by a limit."""
        values, rates, _ = self._component.active
        value, followed = self.u[values], self._followed
        rounding = _ROUNDING * np.maximum(abs(value), abs(followed))
        stays = (value == self._past_u[values]) | (abs(value - followed) <= rounding)
        self._jump[:] = np.where(stays, 0.0, value - followed)
        moves, mixed = self._component.jumps & _JUMPS, (self._component.jumps & _MIXES)[~stays]
        return not mixed[:, ~stays].any() and bool(moves[~stays].any() or mixed[:, self.u[rates] != 0].any())

    def warnings(self) -> Iterator[str]:
        """Mismatches before the present step, once for each coordinate."""
        component = self._component
        for i in np.flatnonzero(self._measured).tolist():
            mismatch = self.m[component.mismatches[i]]
            if mismatch == 0 or i in self._warned:
                continue
            self._warned.add(i)
            value, rate, acceleration = (component.inputs[index].name for index in component.active[:, i])
            when = f"{self._compared_at[0]:.9g}"
            if abs(mismatch) > _FAR * self._went[i]:
                yield (
                    f"{value} jumps by {mismatch:.6g} at t = {when}, of which {rate} and {acceleration} say nothing: "
                    + self._treatment(i)
                )
            else:
                yield (
                    f"{value}, {rate} and {acceleration} contradict each other: at t = {when}, after a step, "
                    f"{value} is off by {mismatch:.6g} from what they said"
                )

    def _treatment(self, i: int) -> str:
        if self._component.jumps.any() and not self._component.jumps[i, i] & _MIXES:
            return "it is taken as the limit of an ever faster motion"
        if "project" in self._calls:
            return "the state is put back onto the constraints"
        return "coordinates and momenta stay as they are"


def _parts(array: Array, *sizes: int) -> list[Array]:
    """Views of consecutive parts; the last one is the rest."""
    return np.split(array, np.cumsum(sizes))
