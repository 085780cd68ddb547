"""``liaisons equations``."""

from __future__ import annotations

from typing import Annotated

import typer

from liaisons_tools.cli._command import (
    BalanceInertia,
    FloatingBase,
    LeaveOut,
    Limits,
    Prescribe,
    add_robot_options,
    command,
    flag,
    option,
    subject_argument,
)
from liaisons_tools.cli._texts import requested_component


@command("""
    liaisons equations Pendulum
    liaisons equations Pendulum --part motion --latex
    liaisons equations DoublePendulum --part accelerations --fix pivot_x,pivot_z
    liaisons equations M50                              the equations to which equation 50 of Marle belongs
    liaisons equations my_system.py:crane               those of a whole system
    liaisons equations my_component.py --html > equations.html
    liaisons equations robot.urdf --prescribe shoulder,elbow
""")
def equations(
    target: Annotated[
        str,
        subject_argument(
            "NAME|NUMBER|FILE.py|FILE.urdf|FILE.xml|FILE.ssp",
            "a component, a system of components, or a number of the two texts",
        ),
    ],
    *,
    prescribe: Prescribe = "",
    limits: Limits = False,
    balance_inertia: BalanceInertia = False,
    floating_base: FloatingBase = False,
    leave_out: LeaveOut = "",
    part: Annotated[str | None, option("PART", "only lagrangian, momenta, motion, accelerations, forces, ...")] = None,
    fix: Annotated[str, option("NAME,...", "prescribed coordinates that are kept at rest")] = "",
    text: Annotated[bool, flag("--text", "print text for a terminal (the default)")] = False,
    latex: Annotated[bool, flag("--latex", "print LaTeX for a document")] = False,
    html: Annotated[bool, flag("--html", "print HTML for a browser")] = False,
    modelica: Annotated[bool, flag("--modelica", "print the whole component as Modelica text")] = False,
) -> int:
    """Show the equations of a component: Lagrangian, momenta, motion, forces of the operators, Hamiltonian."""
    target, own = requested_component(target)
    part = part or own
    if text + latex + html + modelica > 1 or (modelica and (part or fix)):
        raise typer.BadParameter("choose one of --text, --latex, --html, --modelica, the last without --part and --fix")
    (target,) = add_robot_options(
        [target], prescribe, leave_out, limits=limits, balance_inertia=balance_inertia, floating_base=floating_base
    )
    from liaisons import System
    from liaisons import equations as displayed
    from liaisons import modelica as modelica_text
    from liaisons_tools.cli._subject import declared_system

    system = System.from_ssp(target) if target.lower().endswith(".ssp") else declared_system(target)
    if modelica:
        print(modelica_text(system or target))
        return 0
    shown = displayed(system or target)
    shown = shown.fix(*fix.split(",")) if fix else shown
    shown = shown if part is None else shown[part]
    if html:
        print("<!DOCTYPE html>", '<meta charset="utf-8">', *shown.html(), sep="\n")
    else:
        print(shown.latex() if latex else shown.text())
    return 0
