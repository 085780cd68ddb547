"""``liaisons animate`` and ``liaisons show``: the mechanism in motion, as a file or as a live page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

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
    Smoothing,
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
    fmu: Annotated[str, subject_argument(f"{_WHAT}|RESULT.csv", "a file, a component, or a result (with --fmu)")],
    *,
    output: Annotated[
        Path,
        option(
            "FILE",
            "file to write: .gif, .png (a strip of snapshots), .mp4, .glb, .html or _visual.xml (OMEdit)",
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
    smoothing: Smoothing = None,
    speed: Annotated[
        float | None,
        option("X", "seconds of motion per second (default: 1, or more so that it lasts at most 20 s)", parser=float),
    ] = None,
    turns: Annotated[float, option("N", "number of turns of the camera about a spatial mechanism", parser=float)] = 0.0,
    recorded_fmu: Annotated[
        Path | None, option("FILE", "the FMU of a result that is read from a CSV file", "--fmu")
    ] = None,
) -> int:
    """Simulate an FMU or an SSP archive, and write its motion as a film or a page."""
    from liaisons import read_result
    from liaisons_tools.cli._subject import requested_simulation

    (fmu,) = add_robot_options(
        [fmu], prescribe, leave_out, limits=limits, balance_inertia=balance_inertia, floating_base=floating_base
    )
    path = Path(fmu)
    if path.suffix.lower() != ".csv":
        moved: dict[str, Any] = {"inputs": inputs, "join": join, "smoothing": smoothing}
        asked = requested_simulation(fmu, starts, start, stop, step, tolerance, size=size, **moved)
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
    liaisons show Pendulum --controls length,theta_0 --plots theta --question "When does it swing higher?"
    liaisons show kapitza
""")
def show(
    fmus: Annotated[
        list[str], subject_argument(f"{_WHAT}|SCENARIO", "files or components, several side by side; or a lesson")
    ],
    *,
    output: Annotated[
        Path | None, option("FILE", "file for the page (default: NAME.html here)", "--output", "-o")
    ] = None,
    launch: Annotated[bool, flag("--open/--no-open", "open the page in the browser")] = True,
    prescribe: Prescribe = "",
    limits: Limits = False,
    balance_inertia: BalanceInertia = False,
    floating_base: FloatingBase = False,
    leave_out: LeaveOut = "",
    starts: Starts,
    inputs: Inputs,
    join: Join = "quintic",
    smoothing: Smoothing = None,
    controls: Annotated[str | None, option("NAME,...", "show controls only for these")] = None,
    plots: Annotated[str | None, option("NAME,...", "plot only these signals")] = None,
    question: Annotated[str, option("TEXT", "text above the picture")] = "",
) -> int:
    """Write a live page: the FMU's own C in the browser, with sliders, picture, plot and energy account.

    Without the compiler for WebAssembly, or if --input moves forces or jumps, the page shows a recorded motion.
    """
    from liaisons.library import is_target
    from liaisons_tools.scenarios import load_lesson, names

    fmu, *others = add_robot_options(
        fmus, prescribe, leave_out, limits=limits, balance_inertia=balance_inertia, floating_base=floating_base
    )
    if others and inputs:
        raise ProjectError("--input moves one FMU or system; show it alone, or several without --input")
    contents: dict[str, Any] = {
        "controls": None if controls is None else controls.split(","),
        "plots": None if plots is None else plots.split(","),
        "question": question,
    }
    remark = ""
    if fmu in names() and not is_target(fmu) and not (others or inputs):
        page = load_lesson(fmu).show(output or f"{fmu}.html").path
    else:
        moved = {"inputs": inputs, "join": join, "smoothing": smoothing}
        page, remark = _written_page([fmu, *others], starts, output, contents, moved)
    print(f"page: {page}{remark}")
    if launch:
        import webbrowser

        webbrowser.open(page.resolve().as_uri())
    return 0


def _written_page(
    fmus: Sequence[str], starts: Starts, output: Path | None, contents: Mapping[str, Any], moved: Mapping[str, Any]
) -> tuple[Path, str]:
    """Write the live page of FMUs, or of one the recorded motion; return its path, and a remark on the latter.

    :param contents: what is shown, arguments of :func:`liaisons.show`.
    :param moved: inputs of the first FMU, and how rows of tables are joined, arguments of ``requested_simulation``.
    """
    from liaisons import show
    from liaisons.base.compiler import INSTALLATION, zig_compiler
    from liaisons_exchange.live import default_page_path
    from liaisons_tools.cli._inputs import tabulated_inputs
    from liaisons_tools.cli._subject import requested_simulation, resolved_subject

    (fmu, *others), live, asked = fmus, zig_compiler(), None
    shown, rest = resolved_subject(fmu, starts)
    if moved["inputs"] or not (live or others):
        asked = requested_simulation(fmu, starts, None, None, None, None, **moved)
    moves: dict[str, Any] | None = {}
    if asked and moved["inputs"]:
        span = asked.settings["start_time"], asked.settings["stop_time"]
        moves = tabulated_inputs(asked.settings["inputs"], *span) if live and asked.fmu else None
        rest = {**(asked.start_values or {}), **(moves or {})}
    if asked is None or (live and moves is not None):
        return show(shown, *others, path=output, start_values=rest, **contents).path, ""
    page = output or default_page_path(shown)
    asked.run().animate(page)
    cure = "" if live else f"; a live page needs a compiler: {INSTALLATION} ({_ZIG})"
    return page, f", a recorded motion{cure}"
