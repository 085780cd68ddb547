"""Legendre's transformation of L gives both the motion of a mechanism with an operator and the operator's forces.

M eq. 29-38.  H(x, s, p, p_s) is made from L; ∂H/∂p_s = ṡ is solved for p_s, and Hamilton's equations with multipliers
give ẋ, ṗ and λ = dp_s/dt + ∂H/∂s.  The FMUs are derived differently, from Lagrange's equations in (x, p, ṡ).  L has to
be hyper-regular, which it is not if a prescribed coordinate moves no mass of its own: the kinetic energy of the
Pendulum has rank 2 in its four rates.  Then H̃ - Σ Y p_s on V*M takes the place of H (M eq. 45-47), with the same
equations.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import analysis, operator, simulate
from liaisons.models import CircularHoop, Pendulum, Swing
from liaisons.scenarios import Claims, dots, panels, scenario, within

SETTINGS: Any = {"stop_time": 10.0, "step_size": 0.02, "tolerance": 1e-11}
CASES: Any = {
    Swing: ("theta", {"rope": (2.0, 0.1, 3.0), "lean": (0.2, 0.5, 4.0)}, 3),
    CircularHoop: ("xi", {"beta": (0.0, 1.2, 1.0)}, 2),
    Pendulum: ("theta", {"length": (1.0, 0.2, 6.0), "pivot_x": (0.0, 0.1, 4.0)}, 2),
}


@scenario
def main(claim: Claims) -> None:
    axes = panels(*((f"{case.__name__}: λ by Hamilton's equations", "t [s]", "λ [N, N.m]") for case in CASES))
    rounding = within(1e-11, because="an identity: rounding errors of some hundred operations, relative to the largest")
    counted = within(0.0, because="a whole number")
    for axis, (component, (q, moved, rank)) in zip(axes, CASES.items(), strict=True):
        drives = {
            name: operator("Sinusoid", offset=offset, amplitude=amplitude, angular_frequency=rate)
            for name, (offset, amplitude, rate) in moved.items()
        }
        actives = [item.name for item in component.actives]
        own = [f"{q}_dot", f"p_{q}_dot", *(f"{name}_force" for name in actives)]
        state = [q, f"p_{q}", *(f"{name}{end}" for name in moved for end in ("", "_dot", "_ddot"))]
        run = simulate(component, **drives, **{f"{q}_dot_0": 1.0}, record=[*own, *state], **SETTINGS)
        found, count = analysis.legendre_rank(component)
        claim(f"{component.__name__}: the kinetic energy has rank {rank} of {count} in the rates", found, rank, counted)
        routes = {"V*M": analysis.reduced_multiplier_equations}
        if rank == count:
            routes["T*M"] = analysis.multiplier_equations
        expected = np.array([run[name] for name in own])
        size = np.max(np.abs(expected), axis=1, keepdims=True)
        for space, equations in routes.items():
            found = equations(component).evaluate(**{name: run[name] for name in state})
            text = f"{component.__name__}: ẋ, ṗ and λ of the FMU are those of Hamilton's equations on {space}"
            claim(text, found / size, expected / size, rounding)
        derived = routes["V*M"](component).evaluate(**{name: run[name] for name in state})
        for row, name in enumerate(actives, 2):
            axis.plot(run.time, expected[row], label=name)
            dots(axis, run.time, derived[row])
