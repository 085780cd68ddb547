"""The frame of the command line, and what several of its commands share."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from liaisons.base.files import check_writable
from liaisons.base.version import __version__
from liaisons.errors import SimulationError
from liaisons.library import component_names, components, is_robot, variables
from liaisons.scenario_files import scenario_claim, scenario_documentation, scenario_files, scenario_themes

if TYPE_CHECKING:
    from liaisons import Verdict

_WIDTH = 100
"""Width of output that does not go to a terminal."""
_FAILURES = ("FAIL", "ERROR")
"""Words of verdicts that are red where there are colours."""


def _examples(lines: str) -> str:
    """Epilog of a help text that shows examples."""
    return "\b\nexamples:\n" + "".join(f"  {line}\n" for line in cleandoc(lines).splitlines())


application = typer.Typer(
    help="From one Lagrangian with active constraints to verified FMUs.",
    epilog=_examples("""
        liaisons list                                   components and scenarios
        liaisons list kapitza                           ... those that have this word
        liaisons text K122                              a number of the two texts, and what verifies it
        liaisons run pumped_swing                       a claim, its FMUs, its verdict, its figure
        liaisons run --all
        liaisons build Pendulum                         writes fmus/Pendulum.fmu
        liaisons build my_component.py                  ... from a file of yours
        liaisons simulate Pendulum --set theta_0=3 --stop 20 --plot
        liaisons animate Pendulum --output swing.gif    ... as a film
        liaisons show Pendulum                          ... live, in the browser
        liaisons plan goal.toml                         the motion of an operator that reaches a goal at least cost
        liaisons identify fit.toml                      parameters from measurements, and how sure they are
        liaisons sweep Pendulum --over theta_0=0.1:3:50 --keep theta:max
        liaisons compare mine.csv theirs.csv            differences, signal by signal
        liaisons check fmus/Pendulum.fmu                validators and invariants, for any FMU
        liaisons new my_mechanics                       a package of components that all commands find
    """),
    result_callback=lambda status, **_: (
        print(end="", flush=True) or status
    ),  # a closed pipe must show here, not at exit
    context_settings={"max_content_width": _WIDTH},
    rich_markup_mode=None,  # plain help, which every terminal shows
    pretty_exceptions_enable=False,
)


def command(examples: str, **options: Any) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Decorator that makes a command of a function: its docstring is the help, its result the exit status.

    :param examples: lines of a shell.
    :param options: further ones of ``typer.Typer.command``.
    """
    return application.command(epilog=_examples(examples), **options)


def _print_version(requested: bool) -> None:
    """Print the version and exit, if requested."""
    if requested:
        print(f"liaisons {__version__}")
        raise typer.Exit


@application.callback()
def accept_global_options(
    *,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="show the version")
    ] = False,
    _debug: Annotated[bool, typer.Option("--debug", help="show the traceback of an error")] = False,
) -> None:
    """Accept the options before a command; ``main`` has removed ``--debug`` already."""


def terminal_width() -> int:
    """Columns of the terminal, or of output that does not go to one."""
    return shutil.get_terminal_size((_WIDTH, 0)).columns


def print_table(rows: Iterable[Verdict | Mapping[str, object]]) -> None:
    """Print a table at most as wide as the terminal, with failures in red where there are colours."""
    from liaisons.check import table

    text = table(rows, terminal_width())
    if not any(word in text for word in _FAILURES):
        print(text)
        return
    from rich.console import Console  # takes as long as a tenth of a simulation
    from rich.text import Text

    coloured = Text(text)
    coloured.highlight_words(_FAILURES, "bold red")
    Console().print(coloured, soft_wrap=True)


def print_verdicts(verdicts: Sequence[Verdict]) -> int:
    """Print a table of verdicts; return the exit status, 1 if one fails."""
    print_table(verdicts)
    return 0 if all(verdict.passed for verdict in verdicts) else 1


def flag(names: str, words: str) -> Any:
    """Typer option without a value."""
    return typer.Option(names, help=words)


def print_scenarios(words: Sequence[str] = ()) -> bool:
    """Print the claims of the scenarios, a table for each theme; return whether there are any.

    :param words: beginnings of words that name and docstring of a scenario have, all of them.
    """
    files = scenario_files()
    found = False
    for name, (title, scenarios) in scenario_themes().items():
        chosen = [s for s in scenarios if has_words(f"{s} {scenario_documentation(files[s])}", words)]
        if chosen or not words:
            found = True
            print(f"\n{title}: liaisons run --theme {name}\n")
            print_table({"scenario": s, "claim": scenario_claim(files[s])} for s in chosen)
    return found


def has_words(text: str, words: Iterable[str]) -> bool:
    """Whether words of a text begin with all of these; capitals do not matter, and a name is several words."""
    text = re.sub(r"(?<=[a-z])(?=[A-Z])|_", " ", text).casefold()
    return all(re.search(rf"\b{re.escape(word.replace('_', ' ').casefold())}", text) for word in words)


def subject_argument(metavar: str, words: str = "a file, or a component, whose FMU is built if needed") -> Any:
    """Typer argument that names the FMU, component or system of a command, completed by names of components."""
    return typer.Argument(metavar=metavar, help=words, autocompletion=component_names)


def signal_completions(ctx: typer.Context, incomplete: str) -> list[str]:
    """Completions of ``NAME,...`` by the variables of the command's component."""
    before, comma, _ = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name, *_ in _subject_variables(ctx)]


def _assignment_completions(ctx: typer.Context) -> list[str]:
    """Completions of ``NAME=VALUE`` by the component's parameters and inputs with their default values."""
    return [
        f"{name}={start}" for name, causality, start in _subject_variables(ctx) if causality in ("parameter", "input")
    ]


def _subject_variables(ctx: typer.Context) -> list[tuple[str, str, str]]:
    """Name, causality and start value of the variables of the command's component."""
    words = [ctx.params.get("fmu"), *ctx.args]  # the latter while an option lacks its value
    return variables(next(filter(None, words), ""))


def option(metavar: str, words: str, *names: str, **more: Any) -> Any:
    """Typer option with a value."""
    return typer.Option(*names, metavar=metavar, help=words, **more)


def repeated_option(metavar: str, words: str, *names: str, **more: Any) -> Any:
    """Typer option that may be given several times, whose value is a list."""
    return option(metavar, words, *names, default_factory=list, show_default=False, **more)


def parse_assignment(text: str) -> tuple[str, float | bool | str]:
    """Name and value, a number, a truth value or a string, of ``NAME=VALUE``."""
    name, _, value = text.partition("=")
    if not (name and value):
        raise typer.BadParameter(f"{text!r}: write NAME=VALUE, for example theta_0=0.5")
    if value in {"true", "false"}:
        return name, value == "true"
    for number in (int, float):
        try:
            return name, number(value)
        except ValueError:
            continue
    return name, value  # a string variable's; the FMU's description decides


def add_robot_options(words: Sequence[str], prescribe: str, leave_out: str = "", **options: bool) -> list[str]:
    """Words of a command, robots' files with --prescribe and further options appended; print what these files lose.

    :param options: flags, limits, balance_inertia and floating_base.
    """
    if (prescribe or leave_out or any(options.values())) and not any(map(is_robot, words)):
        raise typer.BadParameter(
            "--prescribe and --limits are of a robot's file, .urdf or .xml; a joint of a class has prescribed=True, "
            "limits=(low, high)"
        )
    flags = "".join(f":{name.replace('_', '-')}" for name, is_set in options.items() if is_set)
    ending = f":{prescribe}" * bool(prescribe) + flags + f":leave-out={leave_out}" * bool(leave_out)
    targets = [f"{word}{ending}" if is_robot(word) else word for word in words]
    for target in filter(is_robot, targets):
        for line in getattr(components(target)[0], "left_out", ()):
            print(f"left out: {line}", file=sys.stderr)
    return targets


Number = float | None
Size = Annotated[
    Any, option("n=NUMBER", "number of links of a chain (default: as declared)", "--size", parser=parse_assignment)
]

Prescribe = Annotated[
    str, option("JOINT,...", "in URDF and MJCF files: joints that an operator prescribes", "--prescribe")
]

Limits = Annotated[bool, flag("--limits", "in URDF and MJCF files: make joint limits stops")]

BalanceInertia = Annotated[
    bool, flag("--balance-inertia", "in robots' files: replace impossible moments of inertia by their mean")
]

FloatingBase = Annotated[bool, flag("--floating-base", "in URDF files: let the root link move freely")]

LeaveOut = Annotated[
    str, option("NAME,...", "in URDF and MJCF files: leave out features that affect the motion", "--leave-out")
]

Output = Annotated[
    Path | None, option("DIR", "folder for all files that are written (default: here)", "--output", "-o")
]

# The options of every simulation.
Starts = Annotated[
    list[Any],
    repeated_option(
        "NAME=VALUE",
        "start value of a parameter or input (COMPONENT.NAME of a system); may be given several times",
        "--set",
        parser=parse_assignment,
        autocompletion=_assignment_completions,
    ),
]
Inputs = Annotated[
    list[str],
    repeated_option(
        "NAME=EXPRESSION|FILE.csv",
        "move inputs: one by an expression of the time t (its rates are derived), or several by a table with a column "
        "time, a column for each input, and columns of rates if they are known; may be given several times",
        "--input",
    ),
]
Join = Annotated[
    Literal["quintic", "pchip", "linear"],
    option(
        "quintic|pchip|linear",
        "interpolation of tables without rates: smooth, overshoots near steps; acceleration jumps; rate jumps",
    ),
]
Smoothing = Annotated[
    Number,
    option("D", "fit noisy tables without rates by splines with knots D seconds apart", parser=float),
]
Start = Annotated[Number, option("T", "begin [s] (default: the FMU's, else 0)", parser=float)]
Stop = Annotated[Number, option("T", "end [s] (default: the FMU's)", parser=float)]
Step = Annotated[Number, option("H", "communication step [s] (default: the FMU's)", parser=float)]
Tolerance = Annotated[Number, option("R", "relative tolerance (default: the FMU's)", parser=float)]


def check_figure_writable(path: Path | None) -> None:
    """Raise a SimulationError for a figure that cannot be written."""
    if path is not None:
        from matplotlib.figure import Figure

        check_writable(path)
        kinds = Figure().canvas.get_supported_filetypes()
        if (path.suffix[1:].lower() or "png") not in kinds:
            raise SimulationError(f"{path}: no figure ends so; choose one of {', '.join(sorted(kinds))}")
