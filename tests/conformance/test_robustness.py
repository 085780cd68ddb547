"""What an FMU stands: any call in any order, crowds, threads, long runs; under valgrind and sanitizers too."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from trial import (
    COMPONENTS,
    HEADERS,
    SOURCES,
    compile_library,
    compile_program,
    every_component,
    every_version,
    reals,
    rows,
    run,
    some_components,
)

CALLS = 20_000  # at random, a run; some hundred times as many by hand
SMALL = 50_000  # bytes of generated C
# Functions that are there because the standard asks for them, and that are refused wherever they are called.
ALWAYS_REFUSED = {
    "2": {"Instantiate", "CancelStep", "GetStatus", "GetIntegerStatus", "GetStringStatus"},
    "3": {
        *("InstantiateModelExchange", "InstantiateCoSimulation", "InstantiateScheduledExecution"),
        *("EvaluateDiscreteStates", "ActivateModelPartition"),
        *("GetNumberOfVariableDependencies", "GetVariableDependencies"),
        *("EnterConfigurationMode", "ExitConfigurationMode", "SetUInt64"),  # without structural sizes
    },
}
NEVER_REFUSED = {"GetTypesPlatform", "GetVersion", "FreeInstance"}
MEMORY = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
THREADS = ("-fsanitize=thread",)

linux_only = pytest.mark.skipif(sys.platform != "linux", reason="the programs need POSIX")


@pytest.fixture(scope="session")
def ran(program, trial) -> Callable[..., str]:
    """Run one of our programs with an FMU: ``ran("fuzz", "Pendulum", "2", 1, CALLS)``."""

    def go(command: str, name: str, version: str, *arguments: object, under: tuple[str, ...] = (), **how: Any) -> str:
        it = trial(name, version)
        return run(*under, program(command), it.library, it.plan, *map(str, arguments), **how)

    return go


@pytest.fixture(scope="session")
def sanitized(program, trial) -> Callable[..., str]:
    """Run one of our programs and the FMU's own sources, both compiled with a sanitizer; it ends at the first fault."""

    @cache
    def library(name: str, version: str, flags: tuple[str, ...]) -> Path:
        return compile_library(trial(name, version), flags[0].removeprefix("-fsanitize="), ["-g", "-O1", *flags])

    def ran(flags: tuple[str, ...], command: str, name: str, version: str, *arguments: str) -> str:
        options = {"ASAN_OPTIONS": "detect_leaks=1", "TSAN_OPTIONS": "halt_on_error=1"}
        executable = program(command, *flags)
        return run(
            executable, library(name, version, flags), trial(name, version).plan, *arguments, environment=options
        )

    return ran


# ---- any call in any order ---------------------------------------------------------------------------------------


@linux_only
@every_version
@every_component
def test_calls_at_random(ran, name, version) -> None:
    """None crashes, hangs, is wrongly taken or refused, or leaves a trace when it is refused; see fuzz.c."""
    ran("fuzz", name, version, len(name), CALLS)


@linux_only
@every_version
def test_calls_at_random_reach_everything(ran, version) -> None:
    counts = counted(ran("fuzz", "Pendulum", version, 1, 10 * CALLS))
    states = [counts.pop(name) for name in ("damaged", "forged")]
    assert len(counts) == (HEADERS / f"fmi{version}Functions.h").read_text().count(f"fmi{version}FullName(fmi")
    assert {name for name, (taken, _) in counts.items() if taken == 0} <= ALWAYS_REFUSED[version]
    assert {name for name, (_, refused) in counts.items() if refused == 0} <= NEVER_REFUSED | ALWAYS_REFUSED[version]
    assert all(refused > 0 for _, refused in states)


@linux_only
@pytest.mark.slow
@every_version
def test_a_million_calls_at_random(ran, version) -> None:
    """No saved state is taken that was damaged, of thousands."""
    counts = counted(ran("fuzz", "Pendulum", version, 7, 2500000, time_out=900))
    damaged, forged = (counts.pop(name) for name in ("damaged", "forged"))
    assert sum(taken + refused for taken, refused in counts.values()) >= 1_000_000
    assert damaged[0] == 0
    assert damaged[1] >= 1000
    assert min(forged) >= 1000  # some of those with a right checksum are as good as any


def counted(printed: str) -> dict[str, tuple[int, int]]:
    """How often each function, and each kind of forged state, was taken and refused."""
    lines = (line.split() for line in printed.splitlines()[:-1])
    return {name: (int(taken), int(refused)) for name, taken, refused in lines}


@linux_only
@pytest.mark.variants(quick=1, core=0)
@every_version
@pytest.mark.parametrize(
    "name",
    ["Pendulum", "CartesianPendulum", "SwingPump", "SmoothStep", pytest.param("SpatialCat", marks=pytest.mark.slow)],
)
def test_calls_at_random_under_sanitizers(sanitized, name, version) -> None:
    sanitized(MEMORY, "fuzz", name, version, "1", str(CALLS))


@linux_only
@pytest.mark.variants(core=0)
@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("Pendulum", "2"),
        ("StringPendulum", "3"),
        *(pytest.param(name, "3", marks=pytest.mark.slow) for name in COMPONENTS if name != "StringPendulum"),
    ],
)
def test_undefined_behaviour_that_clang_sees(trial, tmp_path, name, version) -> None:
    """It knows of some that gcc lets pass: offsets of a null pointer."""
    if not shutil.which("clang"):
        pytest.skip("clang is not installed")
    flags, cc = ("-fsanitize=undefined", "-fno-sanitize-recover=all", "-O0"), ["clang"]
    executable = compile_program([SOURCES / "fuzz.c", SOURCES / "fmu.c"], tmp_path / "fuzz", flags, cc)
    run(executable, compile_library(trial(name, version), "clang", flags, cc), trial(name, version).plan, "3", "5000")


@linux_only
@pytest.mark.slow
@every_version
@every_component
def test_many_calls_at_random(ran, sanitized, trial, name, version) -> None:
    # Most of what can be wrong is in the sources that all FMUs share: small models get to it in a tenth of the time.
    small = (trial(name, version).folder / "sources" / "model.c").stat().st_size < SMALL
    for seed in range(2, 12):
        ran("fuzz", name, version, seed, (25 if small else 10) * CALLS, time_out=900)
    sanitized(MEMORY, "fuzz", name, version, "12", str(10 * CALLS))


# ---- many instances ----------------------------------------------------------------------------------------------


@every_version
@some_components
def test_two_thousand_instances_do_not_know_of_each_other(ran, name, version) -> None:
    ran("host", name, version, "crowd", 2000)


@linux_only
@every_version
@some_components
def test_threads_do_not_know_of_each_other(ran, name, version) -> None:
    """The results are those of a single thread to the last bit."""
    ran("host", name, version, "threads", 16)


@linux_only
@every_version
@pytest.mark.parametrize("name", ["Pendulum"])
@pytest.mark.variants(quick=1, core=0)
def test_threads_share_no_memory(sanitized, name, version) -> None:
    sanitized(THREADS, "host", name, version, "threads", "8")


# ---- memory ------------------------------------------------------------------------------------------------------


@linux_only
@every_version
@some_components
@pytest.mark.variants(quick=1, core=0)
def test_lives_under_sanitizers(sanitized, tmp_path, name, version) -> None:
    for command in (("life", str(tmp_path / "state")), ("exchange",), ("crowd", "5"), ("lives", "6")):
        sanitized(MEMORY, "host", name, version, *command)


@linux_only
@every_version
@pytest.mark.parametrize("name", ["Pendulum", "SpatialCat"])
@pytest.mark.variants(quick=1, core=0)
def test_lives_under_valgrind(ran, tmp_path, name, version) -> None:
    """No invalid access, no number that was never written, no leak in the binary as it is delivered."""
    if not shutil.which("valgrind"):
        pytest.skip("valgrind is not installed")
    valgrind = ("valgrind", "--quiet", "--leak-check=full", "--error-exitcode=9")
    for command in (("life", tmp_path / "state"), ("exchange",), ("crowd", 3), ("lives", 6)):
        ran("host", name, version, *command, under=valgrind)


# ---- long runs ---------------------------------------------------------------------------------------------------


@linux_only
@pytest.mark.slow
@every_version
def test_ten_million_steps(ran, trial, version) -> None:
    printed = ran("host", "Pendulum", version, "long", 10000000, time_out=900)
    growth = float(printed.split()[0])
    (largest,) = rows(printed)
    names = [variable.name for variable in reals(trial("Pendulum", version).description, "output")]
    energy, balance = (largest[names.index(name)] for name in ("energy", "energy_balance"))
    # From the hundredth part of the run on no page more than the loader's own: one lost byte a step would be 10 MB.
    assert growth <= 64  # kB
    # Local errors of 0.02 * 1e-8, whose signs change with the swing, add up as in a random walk.
    assert balance <= 1e7**0.5 * 0.02 * 1e-8 * energy
