"""Every mechanism of the catalogue in motion, as gif, strip, glb and live page; their table, and one sheet of them all.

``python docs/contact_sheet.py --output sheet --validator validate.cjs`` writes ``sheet/NAME.gif`` and so on,
``sheet/table.md`` and ``sheet/contact_sheet.png``.  The validator is Khronos's, by a script for Node.js that prints of
each file its name and its numbers of errors and warnings; without one that column says so.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from math import pi
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from liaisons import Result, operator, show, simulate
from liaisons.language import Operator
from liaisons.library import catalogue
from liaisons_pages.pictures import motion_frames
from liaisons_pages.pictures.drawing import add_empty_polygons, draw_faces
from liaisons_pages.pictures.frames import RATE, Frames
from liaisons_pages.pictures.stage import Stage

KINDS = ("gif", "png", "glb")
"""What ``animate`` writes; the live page, ``html``, comes from ``show``."""

TURN = {"beta": ("SmoothStep", {"end_value": 2 * pi, "duration": 6.0})}
MOTIONS: Mapping[str, Mapping[str, Any]] = {
    "CartesianPendulum": {"stop_time": 4.0, "x_0": 0.8, "z_0": 0.4},
    "ChargedParticle": {"stop_time": 12.0, "B_z": 6.0},
    "CircularHoop": {"stop_time": 8.0, **TURN},
    "DoublePendulum": {"stop_time": 6.0, "theta_1_0": 2.0, "theta_2_0": 2.5},
    "DrivenChain": {"stop_time": 12.0, "drive": ("Sinusoid", {"amplitude": 0.5, "angular_frequency": 1.0})},
    "EllipticHoop": {"stop_time": 8.0, **TURN},
    "FourierHoop": {"stop_time": 8.0, "cos_2": 0.3, "sin_3": 0.1, **TURN},
    "IsokineticOscillator": {"stop_time": 12.0},
    "KeplerOrbit": {"stop_time": 20.0, "y_dot_0": 1.2},
    "LinearMolecule": {"stop_time": 60.0, "x_1_0": -0.04},
    "NoseHooverOscillator": {"stop_time": 15.0},
    "Oscillator": {"stop_time": 8.0},
    "OscillatorChain": {"stop_time": 15.0},
    "Pendulum": {
        "stop_time": 8.0,
        "theta_0": 0.3,
        "length": ("Sinusoid", {"offset": 1.0, "amplitude": 0.15, "angular_frequency": 6.2642}),
    },
    "PendulumChain": {"stop_time": 5.0, "theta_0": tuple(0.1 * k for k in range(1, 11))},
    "PlanarCat": {
        "phi_dot_0": 0.0,
        "psi_1": ("Sinusoid", {"amplitude": 1.5, "angular_frequency": 2 * pi}),
        "psi_2": ("Sinusoid", {"amplitude": 1.5, "angular_frequency": 2 * pi, "phase": pi / 2}),
    },
    "PlanarOscillator": {"stop_time": 8.0},
    "PolarOscillator": {"stop_time": 8.0},
    "Satellite": {
        "stop_time": 12.0,
        "J_wheel": 4.0,
        "wheel_1": ("SmoothStep", {"end_value": 4.0, "duration": 4.0}),
        "wheel_2": ("SmoothStep", {"end_value": 4.0, "duration": 4.0, "start_time": 4.0}),
        "wheel_3": ("SmoothStep", {"end_value": 4.0, "duration": 4.0, "start_time": 8.0}),
    },
    "SpatialCat": {
        "com_z_dot_0": 9.81,
        "bend": ("SmoothStep", {"end_value": 1.2, "duration": 0.6}),
        "azimuth": ("SmoothStep", {"end_value": 2 * pi, "duration": 0.8, "start_time": 0.6}),
    },
    "Swing": {"stop_time": 8.0, "lean": ("Sinusoid", {"offset": 2.2, "amplitude": 0.5, "angular_frequency": 2.1})},
}
"""What differs from a component's default experiment; an operator moves what is followed by its name and parameters."""


def names() -> list[str]:
    """The mechanisms of the catalogue."""
    return sorted(name for name, item in catalogue().items() if not issubclass(item, Operator))


def motion(name: str) -> Result:
    """A motion that shows what the component is."""
    chosen: dict[str, Any] = {
        key: operator(value[0], **value[1]) if isinstance(value, tuple) and isinstance(value[0], str) else value
        for key, value in MOTIONS.get(name, {}).items()
    }
    chosen.setdefault("step_size", 1 / RATE)
    return simulate(name, **chosen)


def written(name: str, result: Result, folder: Path) -> Iterator[str]:
    """All files of a component; of each its kilobytes and the seconds that it took."""
    for kind in (*KINDS, "html"):
        path, begin = folder / f"{name}.{kind}", time.perf_counter()
        if kind == "html":
            show(name, path)
        else:
            result.animate(path)
        yield f"{path.stat().st_size / 1000:.0f} kB, {time.perf_counter() - begin:.1f} s"


def validated(script: Path | None, paths: Sequence[Path]) -> list[str]:
    """What Khronos's validator says of glb files: errors, warnings."""
    if script is None:
        return ["not tried: no --validator"] * len(paths)
    command = ["node", str(script), *map(str, paths)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    return [", ".join(line.removeprefix(str(path)).split()[:2]) for path, line in zip(paths, said, strict=True)]


def frames(result: Result) -> Frames:
    """The motion at 300 instants."""
    assert result.scene is not None  # as of all that was simulated
    signals = dict(zip(result.names, result.values, strict=True))
    return motion_frames(
        result.scene, result.time, signals, float(result.time[-1] - result.time[0]) / 300, result.title
    )


def contact_sheet(results: Mapping[str, Result], path: Path, *, columns: int = 5, part: float = 0.4) -> None:
    """All mechanisms side by side, each at this part of its motion."""
    rows = -(-len(results) // columns)
    figure = Figure(figsize=(3.2 * columns, 3.0 * rows), dpi=90, layout="constrained")
    for axes, name in zip(figure.subplots(rows, columns, squeeze=False).ravel(), [*results, *[""] * 99], strict=False):
        axes.set_axis_off()
        if name:
            stage = Stage(frames(results[name]))
            draw_faces(add_empty_polygons(stage, axes), stage.faces(int(part * len(stage.frames.time))))
            axes.set_title(name, fontsize=11)
    figure.savefig(path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write everything."""
    assert __doc__
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="mechanisms (default: all)")
    parser.add_argument("--output", type=Path, default=Path("contact_sheet"), help="folder (default: %(default)s)")
    parser.add_argument("--validator", type=Path, help="a script that validates .glb files")
    parser.add_argument("--sheet", action="store_true", help="only the sheet")
    given = parser.parse_args(arguments)
    given.output.mkdir(parents=True, exist_ok=True)
    chosen = given.names or names()
    results = {name: motion(name) for name in chosen}
    if not given.sheet:
        rows = [[name, *written(name, result, given.output)] for name, result in results.items()]
        verdicts = validated(given.validator, [given.output / f"{name}.glb" for name in chosen])
        heads = ["component", *KINDS, "html", "glb: errors, warnings"]
        lines = [heads, ["---"] * len(heads), *([*row, said] for row, said in zip(rows, verdicts, strict=True))]
        table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        (given.output / "table.md").write_text(f"{table}\n", encoding="utf-8")
        print(table)
    contact_sheet(results, given.output / "contact_sheet.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
