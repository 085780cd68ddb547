"""What an archive of a stranger may not do: end in a traceback, fill memory or disk, leave something behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import hostile
import pytest
from making import FmuPaths, rewritten, wait_for

from liaisons.base import cache
from liaisons.base.archive import Archive
from liaisons.cosim import System, simulate
from liaisons.cosim import instances as trial
from liaisons.errors import SimulationError
from liaisons.mechanics import assemble

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="peak memory by POSIX; names that Windows has not")

_MOST_MEMORY = 500e6  # bytes
_UNIT = 1 if sys.platform == "darwin" else 1024  # of the peak memory that the system reports
_LIAISONS = [sys.executable, "-c", "from liaisons_tools.cli import main; raise SystemExit(main())"]

# Each archive is simulated by a process of its own, forked from this one, which has imported everything.
_DRIVER = """
import json, os, sys, traceback
from liaisons_exchange import ssp
from liaisons.cosim import System, simulate
from liaisons.errors import LiaisonsError

def message(path):
    try:
        if path.endswith(".ssp"):
            ssp.read(path, System).simulate(1.0, 0.5)
        else:
            simulate(path)
    except LiaisonsError as error:
        return str(error)
    except BaseException:
        return traceback.format_exc()
    return "accepted"

for path in iter(sys.stdin.readline, ""):
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(write, message(path.strip()).encode())
        os._exit(0)
    os.close(write)
    with open(read, "rb") as pipe:
        words = pipe.read().decode()
    _, status, usage = os.wait4(child, 0)
    print(json.dumps([words, status, usage.ru_maxrss, os.listdir(os.environ["TMPDIR"])]), flush=True)
"""


# The same for commands, with their environment; the second stream is kept in a file.
_COMMANDS_DRIVER = """
import atexit, json, os, sys, traceback
from liaisons_tools.cli import check, main, simulate

for line in iter(sys.stdin.readline, ""):
    words, environment, errors = json.loads(line)
    child = os.fork()
    if child == 0:
        os.environ |= environment
        for stream, path in enumerate([os.devnull, os.devnull, errors]):
            os.dup2(os.open(path, os.O_RDWR | os.O_CREAT), stream)
        status = 1
        try:
            status = main(words)
            atexit._run_exitfuncs()
        except BaseException:
            traceback.print_exc()
        sys.stderr.flush()
        os._exit(status)
    _, status, usage = os.wait4(child, 0)
    print(json.dumps([os.waitstatus_to_exitcode(status), usage.ru_maxrss]), flush=True)
"""


class Outcome(NamedTuple):
    """What became of an archive; memory in bytes."""

    message: str
    status: int
    memory: int
    left: list[str]


CASES = [("fmu", name) for name in hostile.FMUS] + [("ssp", name) for name in hostile.SSPS]


def _made(kind: str, name: str, folder: Path) -> tuple[Path, str]:
    """An archive, and what is said of it."""
    words, write = (hostile.FMUS if kind == "fmu" else hostile.SSPS)[name]
    path = folder / f"bad.{kind}"
    write(path)
    return path, words


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for passing files, of this test's own, and a cache likewise."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return folder


@contextmanager
def _driven(code: str, **environment: str) -> Iterator[Callable[[str], Any]]:
    """A process that answers a line with a line of JSON."""
    command, variables = [sys.executable, "-c", code], {**os.environ, **environment}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=variables, text=True) as driver:
        asked, said = driver.stdin, driver.stdout
        assert asked is not None
        assert said is not None

        def ask(line: str) -> Any:
            asked.write(f"{line}\n")
            asked.flush()
            return json.loads(said.readline())

        yield ask
        asked.close()


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[Path], Outcome]]:
    """Simulates an archive in Python."""
    with _driven(_DRIVER, TMPDIR=str(tmp_path_factory.mktemp("temporary"))) as ask:

        def run(path: Path) -> Outcome:
            message, status, memory, left = ask(str(path))
            return Outcome(message, status, memory * _UNIT, left)

        yield run


@pytest.fixture(scope="module")
def forked() -> Iterator[Callable[..., tuple[int, int, str]]]:
    """Status, peak memory and errors of a command in a fork: starting Python costs more than most of them."""
    with _driven(_COMMANDS_DRIVER) as ask:

        def run(words: list[str], errors: Path) -> tuple[int, int, str]:
            environment = {name: os.environ[name] for name in ("TMPDIR", "XDG_CACHE_HOME")}
            status, memory = ask(json.dumps([words, environment, str(errors)]))
            return status, memory, errors.read_text()

        yield run


def _started(words: list[str]) -> tuple[int, int, str]:
    """The same of a process that is started."""
    command = [sys.executable, "-c", _MEASURE, *_LIAISONS, *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600.0, check=True)
    status, memory = map(int, done.stdout.split())
    return status, memory, done.stderr


@pytest.mark.parametrize(
    ("kind", "name"),
    [pytest.param(kind, name, marks=[pytest.mark.slow] * (name in hostile.SLOW)) for kind, name in CASES],
)
def test_in_python(kind: str, name: str, tmp_path: Path, outcome: Callable[[Path], Outcome]) -> None:
    path, words = _made(kind, name, tmp_path)
    message, status, memory, left = outcome(path)
    assert "Traceback" not in message
    assert words in message
    assert str(path) in message or path.name in message or "the library of x.fmu" in message
    assert message.isprintable()
    assert status == 0
    assert memory < _MOST_MEMORY
    assert left == []


_COMMANDS = [
    (*case, action) for case in CASES for action in ("simulate", "check") if (case[0], action) != ("ssp", "check")
]
_FAST = [
    *(("fmu", "bomb", "simulate"), ("fmu", "bomb", "check"), ("fmu", "entities", "check")),
    *(("fmu", "negative dimension", "simulate"), ("ssp", "3000 nested systems", "simulate")),
    ("ssp", "bomb in the FMU", "simulate"),
]
_READ = {"two to the sixtieth ways", "circle of connectors"}
"""But for a parameter, of which they are told first, and that they do not say when to end."""
# A process that is started counts the memory of the one that starts it as its own; this one is small.
_MEASURE = """
import resource, subprocess, sys
done = subprocess.run(sys.argv[1:], capture_output=True)
sys.stderr.buffer.write(done.stderr)
print(done.returncode, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


@pytest.mark.parametrize(
    "case",
    [pytest.param(it, id="-".join(it), marks=[] if it in _FAST else [pytest.mark.slow]) for it in _COMMANDS],
)
def test_on_the_command_line(
    case: tuple[str, str, str], tmp_path: Path, temporary: Path, forked: Callable[..., tuple[int, int, str]]
) -> None:
    kind, name, action = case
    path, _ = _made(kind, name, tmp_path)
    words = [action, str(path)]
    status, memory, errors = _started(words) if case in _FAST else forked(words, tmp_path / "errors")
    assert status == 2
    *warned, line = errors.splitlines()
    assert line.startswith("liaisons: error: ")
    expected = ("fits nothing and is ignored", "does not say when to end") if name in _READ else ()
    assert all(words in warning for words, warning in zip(expected, warned, strict=True))
    assert memory * _UNIT < _MOST_MEMORY
    assert list(temporary.iterdir()) == []


def test_limit_can_be_raised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "Big.fmu"
    hostile.text(hostile.GOOD, hostile.Member(b"resources/a", b"a" * 1000))(path)
    monkeypatch.setenv("LIAISONS_UNPACKED_LIMIT", "900")
    with pytest.raises(SimulationError, match=r"Big.fmu takes \d+ bytes unpacked, more than the limit of 900; .*raise"):
        System("s").add("a", path)
    monkeypatch.setenv("LIAISONS_UNPACKED_LIMIT", "1e4")
    System("s").add("a", path)
    for words in ("much", "nan", "0", "inf"):
        monkeypatch.setenv("LIAISONS_UNPACKED_LIMIT", words)
        with pytest.raises(SimulationError, match=rf"LIAISONS_UNPACKED_LIMIT = '{words}': give a number of bytes"):
            Archive(path)


def test_what_is_extracted(tmp_path: Path) -> None:
    path = tmp_path / "Whole.fmu"
    more = (hostile.Member(b"resources/empty/"), hostile.Member(b"sources/a.c", b"?"), hostile.Member(b"a/b/c", b"abc"))
    hostile.text(hostile.GOOD, *more)(path)
    with Archive(path) as archive:
        folder = archive.extract(tmp_path / "folder", excluded_prefixes=("sources/",))
    found = sorted(str(file.relative_to(folder)) for file in folder.rglob("*"))
    assert [name for name in found if not name.startswith("binaries")] == [
        *("a", "a/b", "a/b/c", "modelDescription.xml", "resources", "resources/empty"),
    ]
    assert (folder / "a/b/c").read_bytes() == b"abc"


# ---- the trial in a process of its own


def test_name_of_our_tool_is_no_letter_of_safe_conduct(fmu: FmuPaths, tmp_path: Path, temporary: Path) -> None:

    def change(name: str, data: bytes) -> tuple[str, bytes]:
        if name.startswith("binaries/"):
            data = data[: len(data) * 2 // 3]
        return name, data.replace(b"<fmiModelDescription", b'<fmiModelDescription generationTool="liaisons"')

    path = rewritten(fmu("Cubic"), tmp_path / "Half.fmu", change)
    command = [*_LIAISONS, "simulate", str(path), "--stop", "1", "--step", "0.5"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("liaisons: error: Half: ")
    assert done.stderr.count("\n") == 1
    assert list(temporary.iterdir()) == []


@pytest.fixture
def trials(monkeypatch: pytest.MonkeyPatch, temporary: Path) -> list[object]:  # noqa: ARG001 - its cache is empty
    """A list that grows by every trial; nothing is remembered at the begin."""
    made: list[object] = []
    names = "_in_fork", "_in_interpreter"
    for name, start in ((name, getattr(trial, name)) for name in names):

        def counted(*arguments: object, start: Any = start) -> object:
            made.append(arguments[0])
            return start(*arguments)

        monkeypatch.setattr(trial, name, counted)
    monkeypatch.setattr(cache, "_entries", {})
    return made


def _again(path: Path, **starts: Any) -> None:
    """Simulate as a new process would, that knows nothing but the cache."""
    cache._entries.clear()
    path.touch()  # so that it is read anew
    simulate(path, stop_time=1.0, step_size=0.5, **starts)


def test_fmu_is_tried_once_for_all_processes_and_for_each_setting(fmu: FmuPaths, trials: list[object]) -> None:
    path = fmu("Crashing_later")
    _again(path)
    assert len(trials) == 1
    _again(path)
    assert len(trials) == 1
    with pytest.raises(SimulationError, match="crashes"):
        _again(path, when=2)
    with pytest.raises(SimulationError, match="crashes"):  # what has crashed is not remembered
        _again(path, when=2)
    assert len(trials) == 3


@pytest.mark.variants(core=0)
def test_fmu_that_was_built_here_is_not_tried(trials: list[object], tmp_path: Path) -> None:
    from liaisons import build
    from liaisons.library import catalogue

    path = build(assemble(catalogue()["Sinusoid"]), tmp_path / "fmus")
    _again(path)
    assert trials == []
    with path.open("ab") as file:  # any change
        file.write(b"\0")
    _again(path)
    assert len(trials) == 1


def test_cache_that_cannot_be_used(fmu: FmuPaths, trials: list[object], temporary: Path) -> None:
    entries = temporary.parent / "cache" / "liaisons" / "entries"
    entries.parent.mkdir(parents=True)
    entries.write_text("a file, where a folder is wanted", encoding="utf-8")
    _again(fmu("Cubic"))
    _again(fmu("Cubic"))
    assert len(trials) == 2
    entries.unlink()
    _again(fmu("Cubic"))
    _again(fmu("Cubic"))
    assert len(trials) == 3
    for entry in entries.iterdir():
        entry.write_bytes(b"\xff\xfe")
    _again(fmu("Cubic"))
    assert len(trials) == 4


def test_cache_does_not_grow_without_bounds(monkeypatch: pytest.MonkeyPatch, temporary: Path) -> None:
    monkeypatch.setattr(cache, "_entries", {})
    monkeypatch.setattr(cache, "_LARGEST", 20 * (cache._BLOCK + 32))
    entries, keys = temporary.parent / "cache" / "liaisons" / "entries", [f"{k:064x}" for k in range(50)]
    for second, key in enumerate(keys):
        cache.add_trusted_fmu(key)
        os.utime(entries / key, (second, second))
    stored = {path.name for path in entries.iterdir()}
    assert {*keys[-20:]} <= stored
    assert len(stored) < 24  # removed after each eighth of the limit


def test_user_without_a_home_has_a_cache_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path) -> Path:
        raise RuntimeError(f"{path}: no home")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "expanduser", refuse)
    monkeypatch.setattr(cache, "_entries", {})
    assert cache.folder() == Path(os.devnull) / "liaisons"
    cache.write_entry("key", b"content")
    assert cache.read_entry("key") == b"content"


# ---- how a run may end


class _Hanging:
    """A command that simulates an FMU that never returns from its first step, in its trial, or from its third."""

    def __init__(self, fmu: Path, mark: Path, *, first: int) -> None:
        command = [*_LIAISONS, "simulate", str(fmu), "--stop", "1000", "--step", "1", "--set", f"first={first}"]
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE)
        self._mark = mark

    def stands(self) -> bool:
        """Whether it hangs by now."""
        assert self.process.poll() is None
        return self._mark.exists() and self._mark.read_text().endswith(".")

    def hanging_process(self) -> int:
        """The one that does not go on: that of the trial, or the command itself."""
        return int(self._mark.read_text()[:-1])


Start = Callable[[int], _Hanging]


@pytest.fixture
def hanging(fmu: FmuPaths, temporary: Path, monkeypatch: pytest.MonkeyPatch) -> Start:
    """Starts such a command."""
    mark = temporary.parent / "mark"
    monkeypatch.setenv("HANGS", str(mark))
    return lambda first: _Hanging(fmu("Hanging"), mark, first=first)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("first", [0, 2])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_command_that_is_ended_while_an_fmu_hangs(
    hanging: Start, first: int, number: signal.Signals, temporary: Path
) -> None:
    command = hanging(first)
    wait_for(command.stands)
    assert list(temporary.iterdir()) != []
    command.process.send_signal(number)
    _, said = command.process.communicate(timeout=60.0)
    wait_for(lambda: not list(temporary.iterdir()))
    if number == signal.SIGTERM:
        assert command.process.returncode == 128 + number
        assert b"Traceback" not in said
        wait_for(lambda: not _runs(command.hanging_process()))


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
@pytest.mark.variants(core=0)
def test_command_that_is_ended_in_the_middle(
    hanging: Start, number: signal.Signals, status: int, temporary: Path
) -> None:
    command = hanging(10**9)
    wait_for(lambda: any(temporary.glob("*/0/modelDescription.xml")))
    time.sleep(1.0)  # somewhere in the run
    command.process.send_signal(number)
    _, said = command.process.communicate(timeout=60.0)
    assert command.process.returncode == status
    assert b"Traceback" not in said
    assert list(temporary.iterdir()) == []  # at once
