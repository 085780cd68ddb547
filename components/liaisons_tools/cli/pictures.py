"""``liaisons animate`` and ``liaisons show``: the mechanism in motion, as a file or as a live page."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

from liaisons.base.project import ProjectError
from liaisons_tools.cli._command import (
    BalanceInertia,
    FloatingBase,
    Inputs,
    Join,
    LeaveOut,
    Limits,
    Prescribe,
    Size,
    Start,
    Starts,
    Step,
    Stop,
    Tolerance,
    add_robot_options,
    command,
    flag,
    option,
    subject_argument,
)

_WHAT = "FMU|SSP|NAME|FILE.py|FILE.urdf|FILE.xml"
_ZIG = "100 MB, 400 MB unpacked"


@command("""
    liaisons animate Pendulum --set theta_0=2 --output swing.gif
    liaisons animate Swing --input rope="2 + 0.1*sin(4.4*t)" --stop 20 --output swing.mp4
    liaisons animate SpatialCat --input bend=1 --input azimuth="3*t" --turns 1 --output cat.gif
    liaisons animate system.ssp --output system.html
    liaisons animate motion.csv --fmu fmus/Pendulum.fmu --output motion.glb
""")
def animate(
    fmu: Annotated[str, subject_argument(f"{_WHAT}|RESULT.csv", "a file, a component, or a result with --fmu")],
    *,
    output: Annotated[
        Path,
        option(
            "FILE",
            "ends in .gif, .png (a strip of instants), .mp4, .glb, .html or _visual.xml (OMEdit)",
            "--output",
            "-o",
        ),
    ],
    starts: Starts,
    size: Size = None,
    prescribe: Prescribe = "",
    limits: Limits = False,
    balance_inertia: BalanceInertia = False,
    floating_base: FloatingBase = False,
    leave_out: LeaveOut = "",
    start: Start = None,
    stop: Stop = None,
    step: Step = None,
    tolerance: Tolerance = None,
    inputs: Inputs,
    join: Join = "quintic",
    speed: Annotated[
        float | None, option("X", "seconds of motion a second (default: 1, or what makes it last 20 s)", parser=float)
    ] = None,
    turns: Annotated[float, option("N", "how often the camera goes round a spatial mechanism", parser=float)] = 0.0,
    recorded_fmu: Annotated[
        Path | None, option("FILE", "the FMU of a result that is read from a file", "--fmu")
    ] = None,
) -> int:
    """Simulate an FMU or an SSP archive, and write the motion as a film or a page."""
    from liaisons import read_result
    from liaisons_tools.cli._subject import requested_simulation

    (fmu,) = add_robot_options(
        [fmu], prescribe, leave_out, limits=limits, balance_inertia=balance_inertia, floating_base=floating_base
    )
    path = Path(fmu)
    if path.suffix.lower() != ".csv":
        asked = requested_simulation(fmu, starts, start, stop, step, tolerance, inputs=inputs, join=join, size=size)
        result = asked.run()
    elif recorded_fmu is None:
        raise ProjectError(f"{path}: a result does not know what it looks like; add --fmu FILE")
    else:
        result = read_result(path, recorded_fmu, dict(starts))
    ratio = result.animate(output, speed=speed, turns=turns)
    print(f"motion: {output}{f', {ratio:g} times as fast as it is' if ratio != 1 else ''}")
    return 0


@command("""
    liaisons show Pendulum
    liaisons show SpatialCat --output cat.html --no-open
    liaisons show Pendulum DoublePendulum
    liaisons show my_component.py
    liaisons show robot.urdf --prescribe shoulder,elbow
    liaisons show system.ssp
    liaisons show Pendulum --input "length=1 + 0.1*sin(6*t)"
""")
def show(
    fmus: Annotated[list[str], subject_argument(_WHAT, "files or components; several side by side")],
    *,
    output: Annotated[
        Path | None, option("FILE", "where the page goes (default: NAME.html here)", "--output", "-o")
    ] = None,
    launch: Annotated[bool, flag("--open/--no-open", "open it in the browser")] = True,
    prescribe: Prescribe = "",
    limits: Limits = False,
    balance_inertia: BalanceInertia = False,
    floating_base: FloatingBase = False,
    leave_out: LeaveOut = "",
    starts: Starts,
    inputs: Inputs,
    join: Join = "quintic",
) -> int:
    """Write a live page: the FMU's own C in the browser, with sliders, picture, plot and energy account.

    With --input, or without the compiler for WebAssembly, a page with the recorded motion.
    """
    from liaisons import show
    from liaisons.base.compiler import INSTALLATION, zig_compiler
    from liaisons_exchange.live import default_page_path
    from liaisons_tools.cli._subject import requested_simulation, resolved_subject

    fmu, *others = add_robot_options(
        fmus, prescribe, leave_out, limits=limits, balance_inertia=balance_inertia, floating_base=floating_base
    )
    live, remark = zig_compiler(), ""
    if others and inputs:
        raise ProjectError("--input moves one FMU or system; show it alone, or several without --input")
    shown, rest = resolved_subject(fmu, starts)
    if others or (live and not inputs):
        page = show(shown, *others, path=output, start_values=rest).path
    else:
        page = output or default_page_path(shown)
        requested_simulation(fmu, starts, None, None, None, None, inputs=inputs, join=join).run().animate(page)
        cure = "" if live else f"; a live page needs a compiler: {INSTALLATION} ({_ZIG})"
        remark = f", a recorded motion{cure}"
    print(f"page: {page}{remark}")
    if launch:
        webbrowser.open(page.resolve().as_uri())
    return 0
