"""Systems written as SSP archives and read again."""

from __future__ import annotations

import errno
import gc
import math
import os
import re
import shutil
import zipfile
from ctypes import c_double
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from making import FmuPaths, described, members, read
from numpy.testing import assert_array_equal
from schemas import validated

from liaisons import System, start, sweep
from liaisons.base.folders import temporary_folder
from liaisons.cosim import DefaultExperiment, make_instance, simulate
from liaisons.errors import SimulationError
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import Pendulum
from liaisons_exchange import ssp

Form = Literal["portable", "full"]

FORMS: tuple[Form, ...] = ("portable", "full")
H = 0.25


@pytest.fixture
def system(fmu: FmuPaths) -> System:
    """A mass on a spring, both ways; a probe of one variable that is part of a port; all types of start values."""
    made = System('mass & "spring"')
    mass = made.add("the mass", fmu("Mass"), mass=2 / 3, q_0=0.1, q_dot_0=1e-300, input_reconstruction=0)
    spring = made.add("spring", fmu("Spring"), stiffness=np.float64(1 / 3), length_ddot=0.7)
    faulty = made.add("faulty", fmu("Faulty"), label="a <name>", flag=False, status=3)
    probe = made.add("probe", fmu("Probe"), u=0.3)
    made.add("alone", fmu("Probe"))
    made.connect(mass["q"], spring["length"])
    made.connect(spring["seen_dot"], probe["u"])
    assert faulty.starts == {"label": "a <name>", "flag": False, "status": 3}
    return made


@pytest.mark.parametrize("form", FORMS)
def test_round_trip_gives_the_same_bits(system: System, tmp_path: Path, form: Form) -> None:
    system.write_ssp(tmp_path / "system.ssp", form=form)
    again = System.from_ssp(tmp_path / "system.ssp")
    renamed = {system.name: again.name} | ({"the mass": "the_mass"} if form == "portable" else {})
    expected = repr(system)
    for name, identifier in renamed.items():
        expected = expected.replace(name, identifier)
    assert repr(again) == expected  # components, start values, connections
    for coupling in ("jacobi", "gauss-seidel"):
        first, second = (s.simulate(2.0, H, coupling=coupling) for s in (system, again))
        units = {name.replace("the mass", renamed.get("the mass", "the mass")): u for name, u in first.units.items()}
        assert dict(second.units) == units
        assert_array_equal(second.values, first.values)


@pytest.mark.parametrize("form", FORMS)
def test_both_ways_of_a_port_are_known_again(system: System, tmp_path: Path, form: Form) -> None:
    system.write_ssp(tmp_path / "system.ssp", form=form)
    again = System.from_ssp(tmp_path / "system.ssp")
    assert [link.is_reaction for link in again._connections.values()] == [
        link.is_reaction for link in system._connections.values()
    ]
    assert sum(link.is_reaction for link in again._connections.values()) == 1


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("times", [(0.1, 2.1, 0.05), (0.0, 10 / 3, 1 / 3)])
def test_experiment_is_kept(system: System, tmp_path: Path, form: Form, times: tuple[float, float, float]) -> None:
    path, given = tmp_path / "system.ssp", dict(zip(("start_time", "stop_time", "step_size"), times, strict=True))
    assert _experiment(system, path, form=form, **given) == DefaultExperiment(*times)
    assert _experiment(System.from_ssp(path), path, form=form) == DefaultExperiment(*times)


def _experiment(system: System, path: Path, **given: Any) -> DefaultExperiment:
    system.write_ssp(path, **given)
    return ssp.read(path, System).experiment


def test_default_experiments_count_in_every_run(component: FmuPaths, tmp_path: Path) -> None:
    """As what the caller would say: the tolerance of an FMU, and start, stop and step size of an archive."""
    loose = described(component("Pendulum"), tmp_path / "P.fmu", lambda text: _with_tolerance(text, b"1e-3"))
    said: dict[str, Any] = {"start_time": 0.5, "stop_time": 2.5, "step_size": 0.25}
    system = System("alone")
    system.add("P", loose, theta_0=1.0)
    expected = System("told")
    expected.add("P", component("Pendulum"), theta_0=1.0)
    told, exact = (expected.simulate(**said, tolerance=t)["P.theta"] for t in (1e-3, 1e-12))
    assert max(abs(told - exact)) > 1e-9  # so that the tolerance shows
    system.write_ssp(tmp_path / "alone.ssp", **said)
    archive = System.from_ssp(tmp_path / "alone.ssp")
    found = {
        "simulate": simulate(loose, theta_0=1.0, **said)["theta"],
        "System.simulate": system.simulate(**said)["P.theta"],
        "archive": archive.simulate()["P.theta"],
        "a copy": archive.with_start_values({}).simulate()["P.theta"],
        "sweep": [float(sweep(archive, {"P.mass": [1.0]}, "P.theta", workers=1)["P.theta"][0])],
    }
    starts = {
        "start": lambda: start(loose, start_time=0.5, step_size=0.25, theta_0=1.0),
        "System.start": lambda: system.start(start_time=0.5, step_size=0.25),
        "archive, stepped": archive.start,
        "its path": lambda: start(tmp_path / "alone.ssp"),
    }
    for name, begin in starts.items():
        with begin() as run:
            for _ in range(8):
                run.step()
            assert run.time == 2.5
            found[name] = run.result[f"{'' if name == 'start' else 'P.'}theta"]
    for name, values in found.items():
        assert_array_equal(values, told[-len(values) :], err_msg=name)


def _with_tolerance(description: bytes, tolerance: bytes) -> bytes:
    text, count = re.subn(rb'(<DefaultExperiment[^>]*tolerance=")[^"]*', rb"\g<1>" + tolerance, description)
    assert count == 1
    return text


def test_experiment_is_that_of_the_last_run_else_that_of_the_fmus(component: FmuPaths, tmp_path: Path) -> None:
    path = tmp_path / "pumped.ssp"
    made = System("pumped")
    pendulum, sinusoid = (made.add(name, component(name)) for name in ("Pendulum", "Sinusoid"))
    made.connect(sinusoid["y"], pendulum["pivot_x"])
    own = [read(component(name)).experiment for name in ("Pendulum", "Sinusoid")]
    longest, finest = max(e.stop_time or 0 for e in own), min(e.step_size or 1 for e in own)
    assert _experiment(made, path) == DefaultExperiment(0.0, longest, finest)
    made.simulate(3.0, 0.25, start_time=1.0)
    assert _experiment(made, path) == DefaultExperiment(1.0, 3.0, 0.25)
    assert _experiment(made, path, stop_time=0.5) == DefaultExperiment(0.0, 0.5, 0.25)
    assert _experiment(made, path, step_size=0.5) == DefaultExperiment(1.0, 3.0, 0.5)
    assert _experiment(made, path, start_time=longest + 1) == DefaultExperiment(longest + 1, None, 0.25)
    made.simulate(times=[0.0, 0.1, 0.4])
    assert _experiment(made, path) == DefaultExperiment(0.0, 0.4, 0.1)


@pytest.mark.parametrize("form", FORMS)
def test_archives_pass_the_schemas(system: System, tmp_path: Path, form: Form) -> None:
    count = validated(system, tmp_path, form, stop_time=2.0, step_size=H)
    assert count == (5 if form == "portable" else 3)


def test_portable_is_what_old_readers_take(system: System, tmp_path: Path) -> None:
    system.write_ssp(tmp_path / "system.ssp", step_size=H)
    written = members(tmp_path / "system.ssp")
    text, values = written["SystemStructure.ssd"].decode(), written["resources/the_mass.ssv"].decode()
    root = ElementTree.fromstring(text)
    assert root.get("version") == "1.0"
    # prefixes are literal, connections from element to element, no connectors of the system, no mapping
    assert all(f"<{tag}" in text for tag in ("ssd:System", "ssd:Component", "ssc:Real", "osp:FixedStepAlgorithm"))
    assert all(word in values for word in ("<ssv:ParameterSet", 'name="initialValues"', "<ssv:Real value="))
    used, defined = re.findall(r'<ssv:Real[^>]* unit="(.*?)"', values), re.findall(r'<ssc:Unit name="(.*?)"', values)
    assert len(set(used)) > 1
    assert set(used) == set(defined)
    connections = [element for element in root.iter() if element.tag.endswith("}Connection")]
    assert len(connections) == 5
    assert all(c.get("startElement") and c.get("endElement") for c in connections)
    (outer,) = (element for element in root if element.tag.endswith("}System"))
    assert not any(child.tag.endswith("}Connectors") for child in outer)
    assert not any(name.endswith(".ssm") for name in written)
    # an input that nothing feeds is no connector: importers would set it to 0
    assert 'name="q_force"' not in text


def test_full_has_what_ssp_2_offers(system: System, tmp_path: Path) -> None:
    system.write_ssp(tmp_path / "system.ssp", form="full", stop_time=3.0)
    written = members(tmp_path / "system.ssp")
    text, page = written["SystemStructure.ssd"].decode(), written["documentation/index.html"].decode()
    assert {"resources/parameters.ssv", "resources/parameters.ssm"} <= written.keys()
    assert 'version="2.0"' in text
    assert "ssc:Float64" in text
    assert 'startConnector="the mass_q_force" endElement="the mass" endConnector="q_force"' in text
    assert 'source="documentation/index.html"' in text
    assert "mass &amp; &quot;spring&quot;" in page
    assert "<td>spring.length_force</td><td>the mass.q_load</td><td>N</td>" in page


def test_equal_systems_are_equal_files(system: System, tmp_path: Path) -> None:
    for name in ("one.ssp", "two.ssp"):
        system.write_ssp(tmp_path / name)
    assert (tmp_path / "one.ssp").read_bytes() == (tmp_path / "two.ssp").read_bytes()


def test_one_fmu_is_stored_once_and_two_of_one_name_apart(fmu: FmuPaths, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    other = tmp_path / "other" / "Cubic.fmu"
    other.write_bytes(fmu("Spring").read_bytes())
    made = System("names")
    for name, path in (("a", fmu("Cubic")), ("b", fmu("Cubic")), ("c", other)):
        made.add(name, path)
    made.write_ssp(tmp_path / "names.ssp")
    fmus = [name for name in members(tmp_path / "names.ssp") if name.endswith(".fmu")]
    assert fmus == ["resources/Cubic.fmu", "resources/Cubic_2.fmu"]
    assert "length_force" in repr(System.from_ssp(tmp_path / "names.ssp").parts["c"].fmu.reals("output"))


def test_unpacked_files_go_with_the_system(system: System, tmp_path: Path) -> None:
    system.write_ssp(tmp_path / "system.ssp")
    again = System.from_ssp(tmp_path / "system.ssp")
    path = again.parts["spring"].fmu.path
    assert path.exists()
    other = again.with_start_values({"spring.stiffness": 0.5})
    del again
    gc.collect()
    assert path.exists()
    del other
    gc.collect()
    assert not path.exists()


@pytest.mark.parametrize("refusals", [1, 2])
def test_a_folder_that_is_busy_is_removed_later(monkeypatch: pytest.MonkeyPatch, refusals: int) -> None:
    """TemporaryDirectory ignores errors: what it left stayed until the end of the process."""
    left, remove = [OSError(errno.EBUSY, "busy")] * refusals, os.rmdir

    def rmdir(*arguments: Any, **keywords: Any) -> None:
        if left:
            raise left.pop()
        remove(*arguments, **keywords)

    with temporary_folder() as folder:
        (folder / "0").mkdir()
        (folder / "0" / "file").write_text("")
        monkeypatch.setattr(os, "rmdir", rmdir)
    assert (left, folder.exists()) == ([], False)


@pytest.fixture(params=["native, FMI 2.0", "native, FMI 3.0", "Python"])
def pendulum(request: pytest.FixtureRequest, component: FmuPaths, tmp_path: Path) -> Path:
    if request.param == "native, FMI 3.0":
        return build(assemble(Pendulum), tmp_path / "3", backend="native", fmi="3")
    return component("python/Pendulum" if request.param == "Python" else "Pendulum")


STARTS: dict[str, Any] = {"theta_0": 0.1 + 0.2, "mass": 5.0, "length": 2.0, "input_reconstruction": 0}


def _baked(path: Path, folder: Path, **starts: Any) -> Path:
    """The FMU out of a portable archive with these start values."""
    system = System("baked")
    system.add("it", path, **starts)
    folder.mkdir(exist_ok=True)
    return _extracted(system, "it", folder)


def _extracted(system: System, part: str, folder: Path) -> Path:
    """The FMU of a component, as it is in a portable archive."""
    system.write_ssp(folder / "system.ssp")
    path = folder / f"{part}.fmu"
    path.write_bytes(members(folder / "system.ssp")[f"resources/{part}.fmu"])
    return path


def test_start_values_go_into_our_fmus(pendulum: Path, tmp_path: Path) -> None:
    baked = _baked(pendulum, tmp_path, **STARTS)
    assert {name: read(baked).variables[name].start for name in STARTS} == {k: repr(v) for k, v in STARTS.items()}
    assert read(baked).guid != read(pendulum).guid  # some importers take FMUs of one GUID for one
    found = simulate(baked, stop_time=1.0, step_size=0.1)  # no start value is set
    expected = simulate(pendulum, stop_time=1.0, step_size=0.1, **STARTS)
    assert_array_equal(found.values, expected.values)
    # once more, with other ones: those from before stay
    again = _baked(baked, tmp_path / "again", mass=7.0)
    found = simulate(again, stop_time=1.0, step_size=0.1)
    expected = simulate(pendulum, stop_time=1.0, step_size=0.1, **dict(STARTS, mass=7.0))
    assert_array_equal(found.values, expected.values)


def test_reset_goes_back_to_the_start_values_in_the_fmu(component: FmuPaths, tmp_path: Path) -> None:
    fmu = read(_baked(component("Pendulum"), tmp_path, **STARTS))
    folder = fmpy.extract(str(fmu.path), str(tmp_path / "with a blank"))
    slave = FMU2Slave(guid=fmu.guid, modelIdentifier=fmu.identifier, unzipDirectory=folder, instanceName="it")
    slave.instantiate()
    references = list(fmu.variables.entry("mass").references) + list(fmu.variables.entry("theta_0").references)
    slave.setReal(references, [1.0, 1.0])
    slave.reset()
    assert slave.getReal(references) == [STARTS["mass"], STARTS["theta_0"]]
    assert slave.getInteger(list(fmu.variables.entry("input_reconstruction").references)) == [0]
    slave.freeInstance()


def _check_zeros(path: Path, folder: Path, *, ignored: bool) -> None:
    """A pendulum of 2 m, or of 1 m."""
    fmu, buffer, time = read(path), (c_double * 1)(), c_double()
    variables = [fmu.variables["length"]]
    with make_instance("swing", fmu, Path(fmpy.extract(str(path), str(folder)))) as instance:
        get, put = instance.getter(variables, buffer), instance.setter(variables, buffer)
        step = instance.stepper(time, c_double(0.1))

        def put_and_get(value: float) -> float:
            buffer[0] = value
            assert put() == 0
            buffer[0] = math.nan
            assert get() == 0
            return buffer[0]

        instance.initialize({}, None, 0.0, 1.0)
        assert put_and_get(0.0) == (2.0 if ignored else 0.0)
        assert put_and_get(1.0) == 1.0
        instance.exit_initialization()
        assert put_and_get(0.0) == (2.0 if ignored else 0.0)
        assert (step() == 0) == ignored
        assert put_and_get(-1.0) == -1.0
        time.value = 0.1 if ignored else 0.0
        assert step() != 0
        assert put_and_get(0.0) == 0.0  # a step has been done
        assert step() != 0


@pytest.mark.parametrize("kind", ["", "fmi3/", "python/"])
def test_before_the_first_step_zeros_leave_what_must_not_be_zero(
    kind: str, component: FmuPaths, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Some importers set all connected inputs to 0 first; in an archive, not in the FMU that it was made of."""
    plain, system = component(f"{kind}Pendulum"), System("swing")
    swing = system.add("swing", plain, length=2.0)
    system.connect(system.add("motor", component("Sinusoid"), offset=2.0)["y"], swing["length"])
    _check_zeros(_extracted(system, "swing", tmp_path), tmp_path / "written", ignored=True)
    _check_zeros(plain, tmp_path / "plain", ignored=False)
    assert "length = 0 before the first step: it stays 2" in caplog.text


@pytest.mark.parametrize("text", ["r 1 1 3ff", "r x", "q 1 1 0 name", "r 99999 1 0 name", "i 1 1 1 name", "r 1 0 name"])
def test_a_damaged_file_of_start_values_is_refused(text: str, component: FmuPaths, tmp_path: Path) -> None:
    broken = tmp_path / "Pendulum.fmu"
    shutil.copy(component("Pendulum"), broken)
    with zipfile.ZipFile(broken, "a") as new:
        new.writestr("resources/starts.txt", text)
    with pytest.raises(
        SimulationError, match=r"Pendulum: Pendulum\.fmu cannot be instantiated: .*(starts\.txt|reference)"
    ):
        simulate(broken, stop_time=1.0)


def test_what_takes_no_start_values_or_needs_none_is_the_file_itself(fmu: FmuPaths, tmp_path: Path) -> None:
    made = System("foreign")
    made.add("other", fmu("Spring"), stiffness=3.0)
    made.add("plain", fmu("Spring"))
    made.write_ssp(tmp_path / "foreign.ssp")
    fmus = {name: data for name, data in members(tmp_path / "foreign.ssp").items() if name.endswith(".fmu")}
    assert fmus == {"resources/Spring.fmu": fmu("Spring").read_bytes()}


def test_failed_writing_leaves_nothing(system: System, tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match=r"no/where\.ssp: cannot be written"):
        system.write_ssp(tmp_path / "no" / "where.ssp")
    with pytest.raises(SimulationError, match="form = 'tiny': choose one of 'portable', 'full'"):
        system.write_ssp(tmp_path / "system.ssp", form="tiny")  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_portable_archives_are_for_masters_that_step_all_at_once(component: FmuPaths, tmp_path: Path) -> None:
    """They extrapolate, since what interpolates would be an input late; names are identifiers, times round numbers."""
    system = System("2 pumped swings")
    swing = system.add("swing", component("Pendulum"), theta_0=0.05, input_reconstruction=2)
    system.connect(system.add("motor", component("Sinusoid"), offset=1.0)["y"], swing["length"])
    cases: list[tuple[Form, dict[str, float]]]
    cases = [("portable", {"theta_0": 0.05}), ("full", {"theta_0": 0.05, "input_reconstruction": 2})]
    for form, starts in cases:
        path = tmp_path / f"{form}.ssp"
        system.write_ssp(path, form=form, stop_time=2.000000000000001, step_size=0.1 + 0.2)
        again = System.from_ssp(path)
        assert again.parts["swing"].starts == starts
        assert again.name == ("_2_pumped_swings" if form == "portable" else "2 pumped swings")
        assert again.experiment == DefaultExperiment(0.0, 2.0, 0.3)
    assert swing.approximation.takes_end_values  # the system is as it was
    assert b' stopTime="2.0"' in members(tmp_path / "portable.ssp")["SystemStructure.ssd"]


def test_components_of_portable_archives_have_identifiers(component: FmuPaths, tmp_path: Path) -> None:
    path, system = component("Pendulum"), System("names")
    first, second = system.add("an arm", path, theta_0=0.2), system.add("an_arm", path, theta_0=0.3)
    system.connect(first["bob"], second["pivot"])
    system.write_ssp(tmp_path / "names.ssp", stop_time=1.0, step_size=0.01)
    again = System.from_ssp(tmp_path / "names.ssp")
    assert {name: {"theta_0": part.starts["theta_0"]} for name, part in again.parts.items()} == {
        "an_arm_2": {"theta_0": 0.2},
        "an_arm": {"theta_0": 0.3},
    }
    assert [*map(str, again.connections)] == [str(link).replace("an arm", "an_arm_2") for link in system.connections]
    assert list(system.parts) == ["an arm", "an_arm"]  # the system is as it was
