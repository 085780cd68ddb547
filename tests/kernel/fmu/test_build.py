"""Building: reproducible, atomic, self-contained, and clear about what went wrong."""

from __future__ import annotations

import dataclasses
import os
import re
import shutil
import stat
import subprocess
import sys
import time
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import pytest
from driver import CO_SIMULATION, MODEL_EXCHANGE, SCHEDULED_EXECUTION, SIGNATURES, Library, members
from handmade import kick, pendulum

from liaisons.base import compiler
from liaisons.errors import BuildError
from liaisons.fmu import SELDOM_RUN, archive, build
from liaisons.fmu.code import source_files
from liaisons.language import Experiment
from liaisons.mechanics import assemble
from liaisons.models import BouncingBall, Pendulum

needs_zig = pytest.mark.skipif(compiler.zig_compiler() is None, reason="ziglang is not installed")


# ---- the file ----------------------------------------------------------------------------------------------------


@pytest.mark.variants(core=0)
def test_same_bytes_in_another_process_and_folder(every_pendulum, tmp_path) -> None:
    """Sets and hashes of strings have another order in each process."""
    backend = "python" if every_pendulum.python else "native"
    code = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from handmade import pendulum
from liaisons.fmu import build
build(pendulum(), {str(tmp_path)!r}, backend={backend!r}, fmi={every_pendulum.fmi!r})
"""
    environment = {"PYTHONHASHSEED": "12345", "XDG_CACHE_HOME": str(tmp_path / "cache")}  # all is compiled once more
    subprocess.run([sys.executable, "-c", code], check=True, env=os.environ | environment)
    (other,) = tmp_path.rglob("*.fmu")
    assert other.read_bytes() == every_pendulum.path.read_bytes()


def test_members(native_pendulum, folder) -> None:
    fmi = native_pendulum.fmi
    assert native_pendulum.path == folder / ("fmi3" if fmi == "3" else "") / "HandPendulum.fmu"
    names = list(members(native_pendulum.path))
    assert names[0] == "modelDescription.xml"
    assert {native_pendulum.member, "documentation/index.html"} <= {*names}
    sources = {name.removeprefix("sources/") for name in names if name.startswith("sources/")}
    assert sources >= {"model.c", "core.h", "step.c", "solver.c", f"fmi{fmi}.c", "buildDescription.xml"}
    assert sources >= {f"fmi{fmi}Functions.h", f"fmi{fmi}FunctionTypes.h"}
    assert not any(f"fmi{5 - int(fmi)}" in name for name in sources)


def test_archive_holds_no_dates_and_no_owner(pendulum_library) -> None:
    with zipfile.ZipFile(pendulum_library.path) as content:
        assert {info.date_time for info in content.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    library = members(pendulum_library.path)[pendulum_library.member]
    for trace in (b"/tmp", b"/home", b"model.c", os.fsencode(Path.cwd())):
        assert trace not in library


def test_every_function_of_the_standard_is_exported_and_nothing_else(pendulum_library, tmp_path) -> None:
    if not shutil.which("nm"):
        pytest.skip("nm is not installed")
    fmi = pendulum_library.fmi
    with zipfile.ZipFile(pendulum_library.path) as content:
        library = content.extract(pendulum_library.member, tmp_path)
    lines = subprocess.check_output(["nm", "-D", "--defined-only", library], text=True).splitlines()
    names = {line.split()[-1] for line in lines}
    header = (Path(fmpy.__file__).parent / "c-code" / f"fmi{fmi}Functions.h").read_text()
    exported = [line.split()[2] for line in header.splitlines() if line.split()[:1] == [f"FMI{fmi}_Export"]]
    declared = {name.rstrip(";") for name in exported}
    assert names == declared
    life = {f"fmi{fmi}{name}" for name in ("GetVersion", "GetTypesPlatform", "FreeInstance", "Instantiate")}
    life |= {f"fmi3Instantiate{kind}" for kind in (MODEL_EXCHANGE, CO_SIMULATION, SCHEDULED_EXECUTION)}
    assert names - life == {pendulum_library.full(name) for name in SIGNATURES[fmi]}  # the driver knows all


def test_file_can_be_read_by_whom_a_new_file_can_be_read(pendulum_fmu, tmp_path) -> None:
    plain = tmp_path / "plain"
    plain.touch()
    assert stat.S_IMODE(pendulum_fmu.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


@pytest.mark.variants(core=0)
def test_sources_compile_on_their_own(native_pendulum, tmp_path, capfd) -> None:
    """As an importer for another platform does it: unpack, compile what is listed, without a warning."""
    folder = Path(fmpy.extract(str(native_pendulum.path), unzipdir=str(tmp_path / "fmu")))
    files = fmpy.model_description.read_build_description(str(folder))[0].sourceFileSets[0].sourceFiles
    description = ElementTree.parse(folder / "modelDescription.xml")
    if native_pendulum.fmi == "2":
        assert files == [file.attrib["name"] for file in description.findall("CoSimulation/SourceFiles/File")]
    cc = compiler.system_compiler() or compiler.zig_compiler()
    assert cc is not None
    flags = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O2", "-fPIC", "-shared"]
    subprocess.run([*cc, *flags, *files, "-o", tmp_path / "library.so", "-lm"], cwd=folder / "sources", check=True)
    assert capfd.readouterr().err == ""


def test_code_of_contacts_is_compiled_where_there_are_some() -> None:
    with_contacts, without = (source_files(assemble(c), "{}").keys() for c in (BouncingBall, Pendulum))
    only = {"unilateral.c", "complementarity.c", "events.c", "event_search.c"}
    assert (with_contacts - without, without - with_contacts) == (only, {"no_contacts.c"})


def test_documentation(pendulum_fmu) -> None:
    page = members(pendulum_fmu)["documentation/index.html"].decode()
    for text in ("HandPendulum", "By hand.", "theta_force", "N.m", "&gt; 0", "input_reconstruction"):
        assert text in page


# ---- when it is built --------------------------------------------------------------------------------------------


def test_nothing_is_compiled_twice(tmp_path, monkeypatch) -> None:
    fmu = build(kick(), tmp_path, backend="native")
    before = fmu.stat().st_mtime_ns
    monkeypatch.setattr("liaisons.fmu.building.compile_library", lambda *_, **__: pytest.fail("compiled again"))
    assert build(kick(), tmp_path, backend="native") == fmu
    assert fmu.stat().st_mtime_ns == before


def test_gcc_compiles_soonest_what_is_seldom_run(tmp_path, monkeypatch) -> None:
    levels, run = {}, compiler._started_compiler
    monkeypatch.setattr(compiler.cache, "folder", lambda: tmp_path)
    monkeypatch.setattr(compiler.cache, "_entries", {})

    def started(command: list[str], folder: Path) -> subprocess.Popen[str]:
        levels.update(
            {command[command.index("-c") + 1]: [x for x in command if x.startswith("-O")]} if "-c" in command else {}
        )
        return run(command, folder)

    monkeypatch.setattr(compiler, "_started_compiler", started)
    files = {name: f"int {name[0]}(void) {{ return 1; }}\n".encode() for name in ("a.c", "b.c")}
    compiler.compile_library(files, compiler.host_target(), seldom_run=["a.c", "c.c"])
    (cc,) = compiler.system_compiler() or [""]
    assert levels == {"a.c": ["-O2", "-O1"] if "gcc" in Path(cc).resolve().name else ["-O2"], "b.c": ["-O2"]}
    assert {*SELDOM_RUN} < source_files(pendulum(), "{}", "2").keys() | source_files(pendulum(), "{}", "3").keys()


def test_object_files_are_stored_for_other_processes_until_all_are_too_large(tmp_path, monkeypatch) -> None:
    source, commands, run = {"a.c": b"int one(void) { return 1; }\n"}, [], compiler._started_compiler
    monkeypatch.setattr(compiler.cache, "folder", lambda: tmp_path)
    monkeypatch.setattr(compiler, "_started_compiler", lambda *command: commands.append(command) or run(*command))

    def compilers(source: dict[str, bytes]) -> int:
        commands.clear()
        monkeypatch.setattr(compiler.cache, "_entries", {})  # as in another process
        assert compiler.compile_library(source, compiler.host_target())[:4] == library[:4]
        return len(commands)

    library = compiler.compile_library(source, compiler.host_target())
    (stored,) = (tmp_path / "entries").iterdir()
    assert compilers(source) == 1  # only the linker
    monkeypatch.setenv("CPATH", str(tmp_path))
    assert compilers(source) == 2  # headers may be others
    monkeypatch.delenv("CPATH")
    stored.write_bytes(stored.read_bytes()[:-1])
    assert compilers(source) == 2
    monkeypatch.setattr(compiler.cache, "_LARGEST", int(1.5 * (stored.stat().st_size + compiler.cache._BLOCK)))
    assert compilers({"a.c": b"int two(void) { return 2; }\n"}) == 2
    (newest,) = (tmp_path / "entries").iterdir()
    assert newest != stored
    assert compilers(source) == 2


@pytest.mark.parametrize("damage", ["changed model", "cut off", "binary missing"])
def test_what_is_out_of_date_or_damaged_is_built_anew(tmp_path, damage) -> None:
    model = kick()
    fmu = build(model, tmp_path, backend="native")
    good = members(fmu)
    if damage == "changed model":
        model = dataclasses.replace(model, experiment=Experiment(stop_time=7.0))
    elif damage == "cut off":
        fmu.write_bytes(fmu.read_bytes()[:-100])
    else:
        archive.write_archive(fmu, {name: data for name, data in good.items() if not name.startswith("binaries/")})
    build(model, tmp_path, backend="native")
    assert members(fmu).keys() == good.keys()
    assert (members(fmu) == good) == (damage != "changed model")


def test_guid_is_a_hash_of_everything(tmp_path) -> None:
    def guid(fmu: Path) -> str | None:
        return fmpy.read_model_description(str(fmu)).guid

    model = kick()
    one = guid(build(model, tmp_path / "1", backend="native"))
    documented = dataclasses.replace(model, documentation="Other words.")
    assert guid(build(documented, tmp_path / "2", backend="native")) != one
    assert guid(build(model, tmp_path / "3", backend="native")) == one


def test_without_a_compiler_it_is_built_in_python(tmp_path, monkeypatch, caplog) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    monkeypatch.setattr(compiler, "find_spec", lambda _: None)
    fmu = build(pendulum(), tmp_path)
    assert fmu == tmp_path / "python" / "HandPendulum.fmu"
    (record,) = caplog.records
    assert record.message == "FMUs are built in Python: no C compiler is found: pip install 'liaisons[cross]'"
    with pytest.raises(BuildError, match=r"^no C compiler is found: pip install 'liaisons\[cross\]'$"):
        build(pendulum(), tmp_path, backend="native")


# ---- what goes wrong ---------------------------------------------------------------------------------------------


def interrupt(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def test_interrupt_while_writing_leaves_the_old_file(tmp_path, monkeypatch) -> None:
    target = tmp_path / "x.fmu"
    archive.write_archive(target, {"a": b"old"})
    monkeypatch.setattr(zipfile.ZipFile, "writestr", interrupt)
    with pytest.raises(KeyboardInterrupt):
        archive.write_archive(target, {"a": b"new"})
    monkeypatch.undo()
    assert members(target) == {"a": b"old"}
    assert list(tmp_path.iterdir()) == [target]


def test_interrupt_while_compiling_leaves_nothing(tmp_path, monkeypatch) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    monkeypatch.setattr(subprocess.Popen, "communicate", interrupt)
    with pytest.raises(KeyboardInterrupt):
        build(kick(), tmp_path / "out", backend="native")
    assert [*tmp_path.rglob("*")] == [temporary]


def test_a_folder_that_cannot_be_written_is_one_clear_message(tmp_path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(BuildError, match=r"HandKick\.fmu cannot be written: .*; choose another folder with output="):
        build(kick(), tmp_path / "file", backend="native")


def test_first_words_of_the_compiler() -> None:
    with pytest.raises(BuildError, match=r"failed: bad\.c:1:\d+: error: .* \| ") as caught:
        compiler.compile_library({"bad.c": b"int f(void) { return nonsense; }\nint g( {}\n"}, compiler.host_target())
    assert "\n" not in str(caught.value)


def test_time_out_ends_the_whole_process_group(tmp_path, monkeypatch) -> None:
    """The compiler's children too: here a shell that starts another one, which writes its id and sleeps."""
    script = tmp_path / "cc"
    script.write_text(f"#!/bin/sh\nsh -c 'echo $$ > {tmp_path}/id; exec sleep 60' &\nwait\n")
    script.chmod(0o755)
    monkeypatch.setattr(compiler, "system_compiler", lambda: [str(script)])
    monkeypatch.setattr(compiler, "TIME_OUT", 1.0)
    with pytest.raises(BuildError, match="did not end within 1 s"):
        compiler.compile_library({"a.c": b""}, compiler.host_target())
    process = int((tmp_path / "id").read_text())
    for _ in range(100):  # until its parent, whoever that is now, has noticed
        state = Path(f"/proc/{process}/stat")
        if not state.exists() or state.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.05)
    pytest.fail("the compiler's child is still running")


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"backend": "nativ"}, "backend = 'nativ': choose one of 'auto', 'native', 'python'"),
        ({"platforms": "linux"}, "platforms = 'linux': choose one of 'host', 'all', 'wasm'"),
        ({"fmi": "1"}, "fmi = '1': choose one of '2', '3'"),
        ({"backend": "python", "fmi": "3"}, r"FMUs in Python are FMI 2\.0; for FMI 3\.0 take backend='native'"),
    ],
)
def test_choices_that_do_not_exist(tmp_path, choices, message) -> None:
    with pytest.raises(BuildError, match=message):
        build(kick(), tmp_path, **choices)


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_missing_headers_are_named(monkeypatch, fmi) -> None:
    monkeypatch.setattr("liaisons.fmu.code.find_spec", lambda _: None)
    with pytest.raises(BuildError, match=rf"fmi{fmi}Functions\.h is missing in the installed fmpy"):
        source_files(kick(), "{}", fmi)


# ---- other platforms ---------------------------------------------------------------------------------------------


@needs_zig
@pytest.mark.slow
def test_all_platforms(tmp_path) -> None:
    """What each file is, by its first bytes; the one for this machine runs, a host build leaves the others alone."""
    fmu = build(pendulum(), tmp_path, backend="native", platforms="all")
    heads = {name: data for name, data in members(fmu).items() if name.startswith("binaries/")}
    kinds = {
        "binaries/linux64/HandPendulum.so": (b"\x7fELF", 18, b"\x3e\x00"),
        "binaries/aarch64-linux/HandPendulum.so": (b"\x7fELF", 18, b"\xb7\x00"),
        "binaries/win64/HandPendulum.dll": (b"MZ", None, b""),
        "binaries/darwin64/HandPendulum.dylib": (b"\xcf\xfa\xed\xfe", 4, b"\x07\x00\x00\x01"),
        "binaries/aarch64-darwin/HandPendulum.dylib": (b"\xcf\xfa\xed\xfe", 4, b"\x0c\x00\x00\x01"),
    }
    assert heads.keys() == kinds.keys()
    for name, (magic, offset, machine) in kinds.items():
        assert heads[name].startswith(magic), name
        if offset is not None:
            assert heads[name][offset:].startswith(machine), name
        assert heads[name].count(b"fmi2DoStep") >= 1
    # glibc 2.17 is what the oldest supported systems have: nothing newer may be asked for.
    versions = {int(v) for v in re.findall(rb"GLIBC_2\.(\d+)", heads["binaries/linux64/HandPendulum.so"])}
    assert max(versions) <= 17
    before = fmu.read_bytes()
    assert build(pendulum(), tmp_path, backend="native").read_bytes() == before
    instance = Library(fmu).start(theta_0=0.5)
    assert instance.step(0.0, 1.0) == 0


@needs_zig
@pytest.mark.slow
def test_zig_where_there_is_no_system_compiler(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(compiler, "system_compiler", lambda: None)
    first = build(kick(), tmp_path / "1", backend="native")
    second = build(kick(), tmp_path / "2", backend="native")
    assert first.read_bytes() == second.read_bytes()
    assert Library(first).start().step(0.0, 1.0) == 0


def test_all_platforms_need_zig(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(compiler, "find_spec", lambda _: None)
    with pytest.raises(
        BuildError, match=r"no C compiler for other platforms is found: pip install 'liaisons\[cross\]'"
    ):
        build(kick(), tmp_path, backend="native", platforms="all")
