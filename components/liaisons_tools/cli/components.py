"""``liaisons list`` and ``liaisons build``."""

from __future__ import annotations

import ast
import os
import signal
import sys
import tomllib
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

from liaisons.base.compiler import Backend, Fmi, Platforms
from liaisons.base.folders import fmus_directory
from liaisons.base.logs import logger
from liaisons.base.processes import die_with_parent
from liaisons.base.project import relative_to_working_directory
from liaisons.base.published import own_components, published_components, publishers
from liaisons.errors import BackEndError, LiaisonsError, ProjectError
from liaisons.library import build_versions, is_target, reserve_fmu
from liaisons.library import components as find
from liaisons_tools.cli._command import (
    BalanceInertia,
    FloatingBase,
    LeaveOut,
    Limits,
    Prescribe,
    Size,
    add_robot_options,
    command,
    flag,
    has_words,
    option,
    print_scenarios,
    print_table,
    subject_argument,
)

if TYPE_CHECKING:
    from liaisons.language import Component

S = TypeVar("S")
T = TypeVar("T")


@command(
    """
    liaisons list
    liaisons list kapitza                                those that contain this word
    liaisons list bead hoop                              ... both words
    liaisons list my_component.py
    """,
    name="list",
)
def list_components(
    targets: Annotated[
        list[str] | None, subject_argument("WORD|NAME|FILE.py", "show those that contain all words, or those of files")
    ] = None,
) -> int:
    """Show the components, with their free and active coordinates, and the scenarios by theme."""
    if targets and not any(target == "all" or is_target(target) for target in targets) and _show_found(targets):
        return 0
    print_table([_component_row(component) for target in targets or ["all"] for component in find(target)])
    if not targets:
        _show_published()
        print_scenarios()
        _show_files()
    return 0


def _show_files() -> None:
    """Print a table of what the files of this folder declare, which are read, not run."""
    from liaisons.language import Component

    rows, kinds = [], {*_names_of_kinds(Component)}
    for path in sorted(Path().glob("*.py")):
        with suppress(OSError, SyntaxError, UnicodeDecodeError):
            for item in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(item, ast.ClassDef) and not kinds.isdisjoint(map(_last_name, item.bases)):
                    summary = (ast.get_docstring(item) or "").partition("\n")[0]
                    rows.append({"file": str(path), "component": item.name, "summary": summary})
    if rows:
        print("\nIn this folder: liaisons check FILE.py\n")
        print_table(rows)


def _names_of_kinds(kind: type[Component]) -> Iterator[str]:
    """Yield the names of the abstract classes that have been loaded, which components are derived from."""
    for derived in kind.__subclasses__():
        if derived.is_abstract:
            yield derived.__name__
            yield from _names_of_kinds(derived)


def _last_name(base: ast.expr) -> str:
    """Name of the base of a class, without that of its module."""
    return ast.unparse(base).rpartition(".")[2]


def _show_found(words: list[str]) -> bool:
    """Print components and scenarios that have all words in their names or docstrings; return whether there are any."""
    found = [c for c in find("all") if has_words(f"{c.__name__} {c.__doc__}", words)]
    if found:
        print_table(map(_component_row, found))
    return print_scenarios(words) or bool(found)


def _show_published() -> None:
    """Print a table of components for each other package that publishes some, without those that cannot be loaded."""
    for package, entries in published_components().items():
        if package == "liaisons":
            continue
        rows = []
        for component in entries:
            if component in own_components() or len(publishers(component)) > 1:
                logger.warning(
                    "package %s: its %s is %s:%s; others have this name", package, component, package, component
                )
            try:
                rows += map(_component_row, find(f"{package}:{component}"))
            except LiaisonsError as error:
                logger.warning("left out: %s", error)
        print(f"\nOf the package {package}:\n")
        print_table(rows)


@command("""
    liaisons build
    liaisons build Pendulum Sinusoid --backend python
    liaisons build Pendulum --fmi both
    liaisons build PendulumChain --fmi 3 --no-arrays
    liaisons build Pendulum --fmi 3 --platforms wasm
    liaisons build OscillatorChain --size n=1000
    liaisons build my_component.py --output /tmp/fmus --platforms all
    liaisons build Pendulum --modelica --standard-library
    liaisons build robot.urdf --prescribe shoulder,elbow
""")
def build(
    targets: Annotated[
        list[str] | None,
        subject_argument(
            "NAME|FILE.py|FILE.urdf|FILE.xml",
            "components to build (default: those listed in fmus/fmus.toml or, without this file, the whole catalogue)",
        ),
    ] = None,
    *,
    backend: Annotated[
        Backend, typer.Option(help="native: generated C; python: pythonfmu; auto: native where a C compiler is found")
    ] = "auto",
    platforms: Annotated[
        Platforms,
        typer.Option(
            help="binaries in a native FMU: for this machine; for Linux, Windows and macOS; or (experimental, FMI 3.0 "
            "only) for this machine and WebAssembly"
        ),
    ] = "host",
    fmi: Annotated[
        Literal["2", "3", "both"],
        typer.Option(help="version: FMI 2.0; FMI 3.0 (in fmi3/, native only); or both"),
    ] = "2",
    arrays: Annotated[
        bool,
        flag(
            "--arrays/--no-arrays",
            "in FMI 3.0: keep arrays, or write an FMU in fmi3/scalars/ with a variable for each element",
        ),
    ] = True,
    size: Size = None,
    prescribe: Prescribe = "",
    limits: Limits = False,
    balance_inertia: BalanceInertia = False,
    floating_base: FloatingBase = False,
    leave_out: LeaveOut = "",
    as_modelica: Annotated[
        bool,
        flag(
            "--modelica", "write Modelica text, NAME.mo, instead of FMUs; without names one package with all components"
        ),
    ] = False,
    standard_library: Annotated[
        bool,
        flag("--standard-library", "with --modelica: use flanges and units of the Modelica Standard Library"),
    ] = False,
    output: Annotated[
        Path | None, option("DIR", "folder for the files (default: fmus/); with --size, its subfolder n=NUMBER/")
    ] = None,
) -> int:
    """Build FMUs."""
    # All are found before the first is built: a misspelt name must not cost a compilation.
    targets = add_robot_options(
        targets or [], prescribe, leave_out, limits=limits, balance_inertia=balance_inertia, floating_base=floating_base
    )
    chosen = targets or declared_components()
    chosen = [component.__name__ for component in find("all")] if chosen is None else chosen
    named = [(t, component) for t in chosen for component in find(t)]
    sizes = dict([size] if size else [])
    folder = output or fmus_directory()
    if as_modelica:
        if (backend, platforms, fmi, arrays, size) != ("auto", "host", "2", True, None):
            raise typer.BadParameter("--backend, --platforms, --fmi, --no-arrays, --size are of FMUs; omit --modelica")
        return _write_modelica(
            [component for _, component in named], folder, whole=not targets, standard_library=standard_library
        )
    if standard_library:
        raise typer.BadParameter("--standard-library is of Modelica text; give --modelica, too")
    for _, component in named:
        reserve_fmu(component, folder, **sizes)
    names = [(target, component.__name__) for target, component in named]
    how = {"backend": backend, "platforms": platforms, "arrays": arrays}
    versions: list[Fmi] = ["2", "3"] if fmi == "both" else [fmi]
    left_out: list[BackEndError] = []
    for built in _map_on_all_cores(partial(_build_one, folder, sizes, versions, how), names):
        for path in built:
            if isinstance(path, BackEndError):
                left_out.append(path)
            else:
                print(relative_to_working_directory(path), flush=True)
    for error in left_out:
        print(f"left out: {error}", file=sys.stderr)
    return 2 if targets and left_out else 0  # what is named has to be there


def _write_modelica(components: list[type[Component]], folder: Path, *, whole: bool, standard_library: bool) -> int:
    """Write ``NAME.mo`` for each component, or the package of all; return the exit status."""
    from liaisons_exchange.modelica_text import modelica, modelica_library

    if whole:
        texts = {"Liaisons": modelica_library(components, standard_library=standard_library)}
    else:
        texts = {c.__name__: modelica(c, standard_library=standard_library) for c in components}
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        path = folder / f"{name}.mo"
        path.write_text(text, encoding="utf-8")
        print(relative_to_working_directory(path), flush=True)
    return 0


def _build_one(
    folder: Path, sizes: dict[str, object], versions: list[Fmi], how: dict[str, Any], name: tuple[str, str]
) -> list[Path | BackEndError]:
    """Build the FMUs of a component; return their paths, or the reason why a back end cannot."""
    target, class_name = name
    (component,) = (component for component in find(target) if component.__name__ == class_name)
    try:
        return [*build_versions(component, folder, versions, sizes, **how)]
    except BackEndError as error:
        return [error]


def _map_on_all_cores(function: Callable[[S], T], tasks: list[S]) -> Iterator[T]:
    """Yield a function of each task, computed on all cores; results and errors come in the order of the tasks."""
    count = min(os.cpu_count() or 1, len(tasks) // 2)  # a process takes as long to begin as an FMU to be built
    if count < 2:
        yield from map(function, tasks)
        return
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _prepare_worker, (os.getpid(),)) as pool:
        try:
            # pool.map cancels those that wait, to which a thread of the pool would report that its processes have ended
            for future in [pool.submit(function, task) for task in tasks]:
                yield future.result()
        except BaseException:
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def _prepare_worker(parent: int) -> None:
    """Make this process end with its parent, and ignore interrupts."""
    die_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends them


def _component_row(component: type[Component]) -> dict[str, str]:
    """Row of a component in the table of ``liaisons list``."""
    from liaisons.language import Coordinate, MechanicalComponent, Mechanism, declarations_of

    moving = component if issubclass(component, MechanicalComponent) else None
    whole = "" if issubclass(component, Mechanism) else "n"  # a chain has one a link
    free = [f"{c.name}[{c.size or whole}]".removesuffix("[]") for c in declarations_of(component, Coordinate)]
    free += [orientation.name for orientation in component.orientations] if issubclass(component, Mechanism) else []
    return {
        "name": component.__name__,
        "free": ", ".join(free) or "-",
        "active": ", ".join(c.name for c in moving.actives) or "-" if moving else "-",
        "what it is": component.summary(),
    }


def declared_components() -> list[str] | None:
    """Components that ``fmus/fmus.toml`` lists, paths relative to it; None if there is no such file.

    :raises ProjectError: if it has no such list.
    """
    declaration = Path("fmus", "fmus.toml")
    try:
        declared = tomllib.loads(declaration.read_text(encoding="utf-8"))["components"]
        return [str(declaration.parent / name) if name.endswith(".py") else name for name in declared]
    except FileNotFoundError:
        return None
    except (tomllib.TOMLDecodeError, KeyError, AttributeError, TypeError) as error:
        raise ProjectError(f'{declaration}: {error}; write components = ["Pendulum", ...]') from None
