"""Little FMUs, written in C and compiled here: what the composition layer does with them can be seen exactly."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest

from liaisons.cosim.compiled import library as compiled
from liaisons.fmu import build
from liaisons.library import catalogue
from liaisons.mechanics import assemble

sys.path.insert(0, str(Path(__file__).parent))  # modules beside the tests

from making import FmuPaths, packed

UNITS = {
    "m": {"m": 1},
    "mm": {"m": 1, "factor": 0.001},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "kg": {"kg": 1},
    "rad": {"rad": 1},
}


@dataclass(frozen=True)
class V:
    """A variable; ``needs`` are the inputs that it depends on directly."""

    name: str
    causality: str
    unit: str = ""
    start: float | str | None = None
    kind: str = "Real"
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Source:
    """What a test FMU is made of: ``outputs`` and ``step`` are C with the variables' names, ``t`` and ``h``."""

    variables: tuple[V, ...]
    outputs: str = ""
    step: str = ""
    exit_initialization: str = ""
    instantiate: str = ""
    options: str = 'canHandleVariableCommunicationStepSize="true"'
    experiment: str = ""
    code: str = ""


CUBIC = Source(
    (V("y", "output"), V("y_dot", "output"), V("y_ddot", "output")),
    outputs="y = t * t * t; y_dot = 3 * t * t; y_ddot = 6 * t;",
)

# a smooth signal of which it gives the value only
WAVE = Source((V("y", "output"),), outputs="y = sin(3 * t + 0.7);")

# a force that jumps, of which it says nothing
JUMP = Source((V("y", "output", "N"),), outputs="y = t > 0.505 ? 5 : 0;")

# an active coordinate that says what it is given: length_force depends on it directly, seen is what a step began with
SPRING = Source(
    (
        V("stiffness", "parameter", "", 2.0),
        V("length", "input", "m", 0.0),
        V("length_dot", "input", "m/s", 0.0),
        V("length_ddot", "input", "m/s2", 0.0),
        V("length_force", "output", "N", needs=("length",)),
        V("seen", "output", "m"),
        V("seen_dot", "output", "m/s"),
        V("input_reconstruction", "parameter", start="1", kind="Integer"),
    ),
    outputs="length_force = stiffness * length; seen = memory[0]; seen_dot = memory[1];",
    step="memory[0] = length; memory[1] = length_dot;",
)

# a free coordinate; exact under constant force
MASS = Source(
    (
        V("mass", "parameter", "kg", 1.0),
        V("q_0", "parameter", "m", 0.0),
        V("q_dot_0", "parameter", "m/s", 0.0),
        V("q_force", "input", "N", 0.0),
        V("q_load", "input", "N", 0.0),
        V("q", "output", "m"),
        V("q_dot", "output", "m/s"),
        V("q_ddot", "output", "m/s2", needs=("q_force", "q_load")),
        V("input_reconstruction", "parameter", start="1", kind="Integer"),
    ),
    outputs="q = q_0 + memory[0]; q_dot = q_dot_0 + memory[1]; q_ddot = (q_force - q_load) / mass;",
    step="double a = (q_force - q_load) / mass; "
    "memory[0] += (q_dot_0 + memory[1]) * h + a * h * h / 2; memory[1] += a * h;",
)

GOES_BACK = 'canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"'

# the same two from another maker: inputs are held over a step, it can go back, and gives no derivatives
CART = replace(MASS, variables=MASS.variables[:-1], options=GOES_BACK)
BUFFER = replace(SPRING, variables=SPRING.variables[:-1], options=GOES_BACK)

CRASHING = Source(
    (V("x", "output"),), outputs="x = 0;", code="__attribute__((constructor)) static void crash(void) { abort(); }"
)

CRASHING_LATER = Source(
    (V("when", "parameter", start=0, kind="Integer"), V("x", "output")),
    outputs="x = 0;",
    code="#include <signal.h>",
    exit_initialization="if (when == 1) raise(SIGSEGV);",
    step="if (when == 2) raise(SIGSEGV);",
)
CRASHING_AT_ONCE = replace(CRASHING_LATER, exit_initialization="", step="", instantiate="raise(SIGSEGV);")

# never returns from the step that begins at this time, and says which process that is; slow before
HANGING = Source(
    (V("first", "parameter", start=0, kind="Integer"), V("x", "output")),
    outputs="x = t;",
    code="#include <unistd.h>",
    step='usleep(10000); if (t >= first) { FILE *mark = fopen(getenv("HANGS"), "w"); fprintf(mark, "%d.", getpid()); '
    "fclose(mark); for (;;) pause(); }",
)

# ends its process in this step, or does not come back from it, and says at the begin which process that is
FRAGILE = Source(
    (
        V("u", "input", "", 0.0),
        V("last", "parameter", start=0, kind="Integer"),
        V("how", "parameter", start=0, kind="Integer"),
        V("x", "output"),
    ),
    outputs="x = t;",
    code="""#include <signal.h>
#include <unistd.h>
static void mark(void) {
    const char *path = getenv("FRAGILE");
    FILE *file = path ? fopen(path, "w") : NULL;
    if (file) { fprintf(file, "%d", getpid()); fclose(file); }
}
static void perish(int how) {
    if (how == 0) *(volatile int *)8 = 1;
    if (how == 1) abort();
    if (how == 2) exit(3);
    if (how == 3) raise(SIGFPE);
    mark();
    for (;;) pause();
}""",
    step="if (++memory[0] == last) perish(how);",
    options=GOES_BACK,
)

# the same, and has a process of its own, which if it is "far" is of another session and has no parent
FORKING = replace(
    FRAGILE,
    variables=(*FRAGILE.variables, V("far", "parameter", start=0, kind="Integer")),
    code=FRAGILE.code
    + """
static void fork_one(int far) {
    FILE *file;
    if (fork()) return;
    if (far && setsid() && fork()) _exit(0);
    file = fopen(getenv("FORKING"), "w");
    fprintf(file, "%d", getpid());
    fclose(file);
    for (;;) pause();
}""",
    exit_initialization='fork_one(far); while (access(getenv("FORKING"), 0)) usleep(1000); usleep(10000);',
)

# warns in a colour, and names the window; its error is longer than a screen
LOUD = Source(
    (V("x", "output"), V("label", "output", kind="String"), V("a\u009b31mb", "output")),
    outputs="x = t;",
    code="static char big[10000001];",
    step=r"""say(m, 1, "\033[31mwarning \033]0;title\007 %g", t);
    memset(big, '!', 10000000);
    big[0] = 27;
    if (t > 0.5) { say(m, 3, "%s", big); return 3; }""",
)

# its outputs are no numbers, x from t = 0.5 s on, y at t = 0.75 s
ENDLESS = Source((V("x", "output"), V("y", "output")), outputs="x = t < 0.5 ? t : NAN; y = t == 0.75 ? -INFINITY : t;")

UNFED = Source((V("u", "input"), V("x", "output", needs=("u",))), outputs="x = u;")

# an FMU of another make: what it is given, and what its last step began with
PROBE = Source(
    (
        V("u", "input", "", 0.0),
        V("echo", "output", needs=("u",)),
        V("seen", "output"),
        V("count", "output", kind="Integer"),
    ),
    outputs="echo = u; seen = memory[0];",
    step="memory[0] = u;",
    experiment='<DefaultExperiment startTime="0" stopTime="0.5" stepSize="0.25" tolerance="1e-3"/>',
)

# every type whose values are numbers, and one whose values are not
DISCRETE = Source(
    (
        V("count", "output", kind="Integer"),
        V("late", "output", kind="Boolean"),
        V("gear", "output", kind="Enumeration"),
        V("label", "output", kind="String"),
        V("twice", "output"),
        V("raised", "parameter", start="false", kind="Boolean"),
        V("lamp[1]", "output", kind="Boolean"),
        V("lamp[2]", "output", kind="Boolean"),
        V("level", "input", start=0, kind="Integer"),
        V("armed", "input", start="false", kind="Boolean"),
        V("seen", "output", needs=("level", "armed")),
        V("word", "input", start="early", kind="String"),
    ),
    outputs="v[0] = -4 * t; v[1] = v[3] = t > 0.5; v[2] = 1 + (t > 0.25); v[4] = 2 * t; v[6] = 1; v[7] = v[5]; "
    "v[10] = v[8] + 10 * v[9];",
    options='canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"',
    experiment='<DefaultExperiment stopTime="1" stepSize="0.25"/>',
)

# fails when it is told to; its messages are variadic
FAULTY = Source(
    (
        V("limit", "parameter", "", 0.0),
        V("time_of_failure", "parameter", "", 1e9),
        V("status", "parameter", start="2", kind="Integer"),
        V("flag", "parameter", start="false", kind="Boolean"),
        V("label", "parameter", start="none", kind="String"),
        V("u", "input", "mm", 0.0),
        V("x", "output"),
        V("hidden", "local"),
    ),
    outputs="x = t;",
    step='if (t + h > time_of_failure) { say(m, status, "%s %g is beyond", "time", t + h); return status; }',
    exit_initialization='if (limit < 0) { say(m, 3, "limit = %g must be >= 0", limit); return 3; }',
    options="",
)

# refuses long steps, and can go back
HASTY = Source(
    (V("longest", "parameter", "", 0.1), V("status", "parameter", start="2", kind="Integer"), V("x", "output")),
    outputs="x = t;",
    step='if (h > longest) { say(m, status, "%g s are too long", h); return status; }',
    options=GOES_BACK,
)

# ends the simulation when it gets there
FINITE = Source(
    (V("last", "parameter", "", 0.6), V("x", "output")),
    outputs="x = m->end > 0 ? m->end : t;",
    step="if (t + h >= last) { m->end = last; return 2; }",
    options=GOES_BACK,
)

# ends the simulation in the step to 0.75 s, and says that it got to where no step leads
ASTRAY = Source(
    (V("where", "parameter", "", 1e9), V("x", "output")),
    outputs="x = t;",
    step="if (t + h > 0.6) { m->end = where; return 2; }",
)

LATE = Source(
    (V("x", "output"),), outputs="x = t;", experiment='<DefaultExperiment startTime="2" stopTime="3" stepSize="0.5"/>'
)

# names only: two points in the plane, and an array
POINTS = Source(
    tuple(
        V(f"{name}{dots}{index}", causality, f"m{unit}", 0.0 if causality == "input" else None)
        for name, causality, index in (
            ("bob_x", "output", ""),
            ("bob_z", "output", ""),
            ("pivot_x", "input", ""),
            ("pivot_z", "input", ""),
            ("theta", "output", "[3]"),
        )
        for dots, unit in (("", ""), ("_dot", "/s"), ("_ddot", "/s2"))
    )
    + tuple(V(f"bob_{axis}_load", "input", "N", 0.0) for axis in "xz")
    + tuple(V(f"pivot_{axis}_force", "output", "N") for axis in "xz"),
)

MUTE = Source((V("x", "output"),), instantiate='say(m, 3, "no licence for %s", m->name); return 3;')

_C = (Path(__file__).parent / "little.c.in").read_text(encoding="utf-8")


def _attributes(**values: object) -> str:
    return "".join(f" {name}={quoteattr(str(value))}" for name, value in values.items() if value not in {None, ""})


def _description(name: str, source: Source) -> str:
    numbers = {v.name: k for k, v in enumerate(source.variables, 1)}
    variables, outputs = "", ""
    for k, v in enumerate(source.variables):
        variability = "fixed" if v.causality == "parameter" else "discrete" if v.kind != "Real" else "continuous"
        value = f"<{v.kind}{_attributes(unit=v.unit, start=v.start)}/>"
        shape = _attributes(name=v.name, valueReference=k, causality=v.causality, variability=variability)
        variables += f"<ScalarVariable{shape}>{value}</ScalarVariable>"
        if v.causality == "output":
            needs = " ".join(str(numbers[need]) for need in v.needs)
            outputs += f'<Unknown index="{k + 1}" dependencies="{needs}"/>'
    units = "".join(f"<Unit{_attributes(name=n)}><BaseUnit{_attributes(**b)}/></Unit>" for n, b in UNITS.items())
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{name}">
<CoSimulation modelIdentifier="{name}" {source.options}/>
<UnitDefinitions>{units}</UnitDefinitions>
{source.experiment}
<ModelVariables>{variables}</ModelVariables>
<ModelStructure><Outputs>{outputs}</Outputs><InitialUnknowns>{outputs}</InitialUnknowns></ModelStructure>
</fmiModelDescription>"""


def little_fmu(directory: Path, name: str) -> Path:
    """Build one of the FMUs above by its name."""
    return _build(directory, name, globals()[name.upper()])


def _build(directory: Path, name: str, source: Source) -> Path:
    starts = [(k, v.start) for k, v in enumerate(source.variables) if isinstance(v.start, float) or v.kind == "Integer"]
    replacements = {
        "defines": "\n".join(
            f"#define {v.name} {f'((int)v[{k}])' if v.kind == 'Integer' else f'v[{k}]'}"
            for k, v in enumerate(source.variables)
            if v.name.isidentifier()
        ),
        "code": source.code,
        "starts": " ".join(f"m->v[{k}] = {start};" for k, start in starts if start is not None),
        "outputs": source.outputs,
        "step": source.step,
        "exit_initialization": source.exit_initialization,
        "instantiate": source.instantiate,
    }
    code = _C
    for key, text in replacements.items():
        code = code.replace(f"@{key}@", text)
    return packed(directory, name, code, _description(name, source))


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> FmuPaths:
    """Path of one of the FMUs above by its name; compiled when first asked for."""
    directory = tmp_path_factory.mktemp("fmus")

    def path(name: str) -> Path:
        there = directory / f"{name}.fmu"
        return there if there.exists() else little_fmu(directory, name)

    return path


@pytest.fixture
def trace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], list[str]]:
    """All calls that the FMUs have seen since the test began, as ``"instance call"``."""
    file = tmp_path / "trace.txt"
    monkeypatch.setenv("FMU_TRACE", str(file))
    monkeypatch.setattr("liaisons.cosim.running.run.try_to_start", lambda *_: None)  # the trial would be traced, too
    return lambda: file.read_text().splitlines() if file.exists() else []


@pytest.fixture(params=["compiled", "Python"])
def either_loop(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """The test runs twice: communication steps by compiled code, and by Python."""
    if request.param == "Python":
        monkeypatch.setattr(compiled, "step_library", lambda **_: None)


@pytest.fixture(scope="session")
def component(tmp_path_factory: pytest.TempPathFactory) -> FmuPaths:
    """FMU of a component: native where there is a compiler, ``"python/..."`` in any case by the Python back end.

    ``"fmi3/..."`` is of FMI 3.0.
    """
    directory = tmp_path_factory.mktemp("components")

    @cache
    def path(name: str) -> Path:
        kind, _, plain = name.rpartition("/")
        folder, fmi = (directory / "fmi3", "3") if kind == "fmi3" else (directory, "2")
        return build(assemble(catalogue()[plain]), folder, backend="python" if kind == "python" else "auto", fmi=fmi)

    return path
