"""``liaisons list`` and ``liaisons build``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from liaisons.cli._command import command
from liaisons.cli._terminal import fitting_table
from liaisons.library import catalogue, claim, model
from liaisons.library import components as find
from liaisons.project import declared_components, fmus_directory, from_here

if TYPE_CHECKING:
    from liaisons.cli._command import Commands
    from liaisons.fmu.layout import Fmi
    from liaisons.mechanics import Component


def register(commands: Commands) -> None:
    """Add the commands."""
    listing = command(
        commands,
        "list",
        _list,
        "show the components: free and active coordinates, and what each one is",
        "liaisons list\nliaisons list my_component.py",
    )
    listing.add_argument("targets", nargs="*", metavar="FILE.py", help="show those of these files instead")
    build = command(
        commands,
        "build",
        _build,
        "build FMUs",
        "liaisons build\n"
        "liaisons build Pendulum Sinusoid --backend python\n"
        "liaisons build Pendulum --fmi both\n"
        "liaisons build OscillatorChain --size n=1000\n"
        "liaisons build my_component.py --output /tmp/fmus --platforms all",
    )
    build.add_argument(
        "targets",
        nargs="*",
        metavar="NAME|FILE.py",
        help="what to build (default: what fmus/fmus.toml declares; without one, the whole catalogue)",
    )
    build.add_argument(
        "--backend",
        choices=("auto", "native", "python"),
        default="auto",
        help="native: generated C; python: pythonfmu; auto (default): native where a C compiler is found",
    )
    build.add_argument(
        "--platforms",
        choices=("host", "all"),
        default="host",
        help="binaries inside a native FMU: for this machine (default), or for Linux, Windows and macOS",
    )
    build.add_argument(
        "--fmi",
        choices=("2", "3", "both"),
        default="2",
        help="version: FMI 2.0 (default), FMI 3.0, which goes to fmi3/ and is native, or both",
    )
    build.add_argument(
        "--size", type=_size, metavar="n=NUMBER", help="how many links a chain has (default: as it declares)"
    )
    build.add_argument("--output", type=Path, metavar="DIR", help="where they go (default: fmus/)")


def _list(arguments: argparse.Namespace) -> int:
    targets = arguments.targets or catalogue()
    print(fitting_table([_row(component) for target in targets for component in find(target)], narrow={"free": 13}))
    return 0


def _build(arguments: argparse.Namespace) -> int:
    from liaisons.fmu import build

    # All are found before the first is built: a misspelt name must not cost a compilation.
    found = [component for target in _targets(arguments.targets) for component in find(target)]
    output = arguments.output or fmus_directory()
    versions: tuple[Fmi, ...] = ("2", "3") if arguments.fmi == "both" else (arguments.fmi,)
    for component in found:
        claim(component, output)
    for component in found:
        sized = model(component, **dict([arguments.size] if arguments.size else []))
        for fmi in versions:
            fmu = build(sized, output, backend=arguments.backend, platforms=arguments.platforms, fmi=fmi)
            print(from_here(fmu), flush=True)
    return 0


def _targets(named: list[str]) -> list[str]:
    """What to build: what is named, else what the project declares, else the whole catalogue."""
    declared = None if named else declared_components()
    return named or (list(catalogue()) if declared is None else declared)


def _size(text: str) -> tuple[str, object]:
    name, separator, number = text.partition("=")
    if not separator:
        raise argparse.ArgumentTypeError(f"{text!r}: write name=number, for example n=100")
    return name, int(number) if number.isdigit() else number


def _row(component: type[Component]) -> dict[str, str]:
    from liaisons.mechanics import Chain, Mechanism

    moving = component if issubclass(component, (Mechanism, Chain)) else None
    ending = "[n]" if issubclass(component, Chain) else ""
    free = [f"{c.name}{ending}" for c in moving.coordinates] if moving else []
    free += [turn.name for turn in component.orientations] if issubclass(component, Mechanism) else []
    return {
        "name": component.__name__,
        "free": ", ".join(free) or "-",
        "active": ", ".join(c.name for c in moving.actives) or "-" if moving else "-",
        "what it is": component.summary(),
    }
