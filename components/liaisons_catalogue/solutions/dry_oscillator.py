"""A mass on a spring that rubs on a belt: at rest, at constant speed, or shaken."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form

Phase = tuple[float, float, float, float]
"""Instant [s], elongation [m] and rate [m/s] at which it begins; direction of sliding, ±1, or 0 where it sticks."""


def _static_and_sliding_elongations(at: Values) -> tuple[float, float]:
    """Elongations [m] at which static and sliding friction balance the spring."""
    weight = at.mass * at.gravity / at.stiffness
    return at.mu_static * weight, at.mu_sliding * weight


def _phases(end: float, at: Values) -> Iterator[Phase]:
    """Yield the phases of sliding and sticking until ``end`` [s], or until the mass rests."""
    static, sliding = _static_and_sliding_elongations(at)
    omega, belt = np.sqrt(at.stiffness / at.mass), at.belt_dot
    t, x, rate = 0.0, at.x_0 - at.support, at.x_dot_0
    direction = np.sign(rate - belt)
    while t <= end:
        if direction == 0 and abs(x) <= static:
            yield t, x, rate, 0.0
            if belt == 0:
                return
            direction = -np.sign(belt)
            t, x = t - (x + direction * static) / belt, -direction * static
        elif direction == 0:
            direction = -np.sign(x)
        yield t, x, rate, direction
        # x is a cos τ + (rate/ω) sin τ beside its centre: its rate is size · cos(τ + phase), next that of the belt
        a = x + direction * sliding
        size, phase = np.hypot(a * omega, rate), np.arctan2(a * omega, rate)
        if size < abs(belt):
            return
        equal = np.arccos(belt / size)
        angle = equal - phase if direction > 0 else 2 * np.pi - equal - phase % (2 * np.pi)
        x = a * np.cos(angle) + rate / omega * np.sin(angle) - direction * sliding
        t, rate, direction = t + angle / omega, belt, 0.0


@closed_form(
    "the motion on a belt of constant speed: half swings about the points where friction balances the spring",
    stiffness="> 0",
    mu_static=">= mu_sliding",
    gravity=">= 0",
    support_dot="== 0",
)
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    _, sliding = _static_and_sliding_elongations(at)
    omega = np.sqrt(at.stiffness / at.mass)
    motion = np.zeros((3, *np.shape(t)))
    for begin, start, rate, direction in _phases(np.max(t), at):
        since = t - begin
        if direction == 0:
            elongation = start + rate * since
            state = elongation, rate, at.stiffness * elongation
        else:
            a, sine, cosine = start + direction * sliding, np.sin(omega * since), np.cos(omega * since)
            position = a * cosine + rate / omega * sine - direction * sliding
            state = position, rate * cosine - a * omega * sine, -direction * at.stiffness * sliding
        motion = np.where(since >= 0, np.broadcast_arrays(*state), motion)
    return {"x": at.support + motion[0], "x_dot": motion[1], "slip_force": motion[2]}


@closed_form(
    "instants [s] and elongations [m] of the turning points on a belt at rest, the last where it stays",
    stiffness="> 0",
    mu_sliding="> 0",
    mu_static=">= mu_sliding",
    gravity="> 0",
)
def turning_points(at: Values) -> tuple[NDArray, NDArray]:
    """Return instants and elongations: a half swing takes π/ω and loses 2 μ m g/k, until static friction holds."""
    static, sliding = _static_and_sliding_elongations(at)
    x = [at.x_0 - at.support]
    while abs(x[-1]) > static:
        x.append(2 * np.sign(x[-1]) * sliding - x[-1])
    return np.pi * np.sqrt(at.mass / at.stiffness) * np.arange(len(x)), np.array(x)


@closed_form(
    "stick-slip on a belt of constant speed: how long it sticks and slides in turn [s]",
    stiffness="> 0",
    mu_static=">= mu_sliding",
    belt_dot="!= 0",
)
def stick_slip(at: Values) -> tuple[float, float]:
    """Return both durations, 2δ/v and (2/ω)(π - arctan(δω/v)), δ = (μ_s - μ_k) m g/k.

    It slides from δ beyond the centre, at the belt's speed: x = δ cos ωt + (v/ω) sin ωt.  The rate is v again where
    tan(ωt/2) = -δω/v, there x = -δ, and the belt carries it over 2δ.
    """
    static, sliding = _static_and_sliding_elongations(at)
    omega, reach, speed = np.sqrt(at.stiffness / at.mass), static - sliding, abs(at.belt_dot)
    return float(2 * reach / speed), float(2 / omega * (np.pi - np.arctan(reach * omega / speed)))


@closed_form(
    "the mean velocity [m/s] of a free block under the constant force x_force on a belt A sin ωt, for Aω² ≫ μg",
    mu_sliding="> 0",
    gravity="> 0",
    stiffness="== 0",
)
def drift(at: Values, *, amplitude: float, angular_frequency: float) -> float:
    """Return V = Aω sin(πF/2μmg), at which the mean of sign(V - Aω cos ωt), (2/π) arcsin(V/Aω), is F/μmg."""
    share = at.x_force / (at.mu_sliding * at.mass * at.gravity)
    at.require(abs(share) < 1, f"x_force = {at.x_force}: friction does not hold it")
    return float(amplitude * angular_frequency * np.sin(np.pi / 2 * share))
