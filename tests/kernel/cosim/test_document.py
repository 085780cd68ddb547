"""Systems as data: pickled, changed and run."""

from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest
from making import FmuPaths

from liaisons import System
from liaisons.cosim import SystemDocument, checked_simulation, run_to_end


@pytest.fixture
def system(component: FmuPaths) -> System:
    """An oscillator whose support a Ramp moves, from a deflection of 1 m."""
    system = System("moved")
    mass = system.add("mass", component("Oscillator"), x_0=1.0)
    ramp = system.add("ramp", component("Ramp"), rate=0.5)
    system.connect(ramp["y"], mass["support"])
    return system


def test_a_document_of_another_process_runs_to_the_same_bits(system: System) -> None:
    document = pickle.loads(pickle.dumps(system.document))
    again = System.from_document(document)
    assert (again.name, list(again.parts), [*map(str, again.connections)]) == (
        system.name,
        list(system.parts),
        [*map(str, system.connections)],
    )
    here, there = (one.simulate(2.0, 0.1) for one in (system, again))
    assert np.array_equal(here.values, there.values)
    assert np.array_equal(here.values, run_to_end(checked_simulation(document, 2.0, 0.1)).values)


def test_a_document_stays_as_it_is(system: System, component: FmuPaths) -> None:
    document = system.document
    other = system.add("other", component("Oscillator"))
    system.connect(system.parts["ramp"]["y"], other["support"])
    assert list(document.parts) == ["mass", "ramp"]
    assert all(connection.target.part.name == "mass" for connection in document.connections)
    with pytest.raises(AttributeError):
        document.name = "x"  # type: ignore[misc]


def test_what_is_connected_in_a_copy_is_not_in_the_system(system: System, component: FmuPaths) -> None:
    other = system.add("other", component("Oscillator"))
    copy, count = system.with_start_values({"mass.x_0": 0.5}), len(system.connections)
    copy.connect(copy.parts["ramp"]["y"], copy.parts["other"]["support"])
    assert len(copy.connections) == 2 * count
    assert len(system.connections) == count
    assert (system.parts["mass"].starts["x_0"], copy.parts["mass"].starts["x_0"]) == (1.0, 0.5)
    assert system.parts["other"] is other


def test_names_of_one_fmu_have_no_prefix(component: FmuPaths) -> None:
    document = SystemDocument.of_fmu(component("Oscillator"), {"x_0": 0.25})
    assert document.reference("input", "x_force") == ("Oscillator", "x_force")
    result = run_to_end(checked_simulation(document, 0.1, 0.1, record="x"))
    assert result.names == ("x",)
    assert result["x"][0] == 0.25


@pytest.mark.parametrize("method", ["simulate", "start"])
@pytest.mark.parametrize("name", ["also", "endless", "stop_tim"])
def test_what_is_no_setting_is_refused_by_name(system: System, method: str, name: str) -> None:
    with pytest.raises(TypeError, match=rf"System\.{method}\(\) got an unexpected keyword argument '{name}'"):
        getattr(system, method)(1.0, 0.1, **{name: True})


def test_what_is_no_setting_of_a_document_is_refused_by_name(system: System) -> None:
    with pytest.raises(TypeError, match=r"checked_simulation\(\) got an unexpected keyword argument 'tolerence'"):
        checked_simulation(system.document, 1.0, 0.1, tolerence=1e-9)  # type: ignore[call-arg]


def test_components_that_are_connected_are_one_group_of_the_picture(system: System, component: FmuPaths) -> None:
    other, last = (system.add(name, component("Oscillator")) for name in ("other", "last"))
    scene = system.document.scene
    assert list(scene.parts) == ["mass.", "ramp.", "other.", "last."]
    assert scene.groups == [[0, 1], [2], [3]]
    system.connect(last["x"], other["support"])
    system.connect(system.parts["ramp"]["y"], last["support"])
    assert system.document.scene.groups == [[0, 1, 2, 3]]


def test_a_load_that_is_fed_alone_lacks_no_rates(component: FmuPaths) -> None:
    system = System("pushed")
    mass, ramp = system.add("mass", component("Oscillator")), system.add("ramp", component("Ramp"))
    system.connect(ramp["y"], mass["x_load"])
    simulation = checked_simulation(system.document, 0.2, 0.1, coupling="gauss-seidel")
    assert simulation.parts["mass"].starts["input_reconstruction"] == 2  # known at both ends of a step
    assert simulation.warnings == ()


def test_one_room_alone_knows_files() -> None:
    code = "from liaisons.cosim import System\ntry: {}\nexcept Exception as error: print(error)"
    for call, words in (
        ("System('x').add('a', 'Pendulum')", "Pendulum: no such file"),
        ("System.from_ssp('x.ssp')", "liaisons.cosim alone runs FMUs; take System from liaisons"),
    ):
        done = subprocess.run([sys.executable, "-c", code.format(call)], capture_output=True, text=True, check=True)
        assert words in done.stdout
