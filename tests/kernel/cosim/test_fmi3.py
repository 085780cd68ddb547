"""FMUs of FMI 3.0: arrays, other number types, roll-back, derivatives."""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import Array, c_double
from pathlib import Path

import fmpy
import numpy as np
import pytest
from making import packed, read
from numpy.testing import assert_array_equal

from liaisons.cosim import IncompleteError, System, simulate
from liaisons.cosim.instances.fmi3 import CoSimulation3
from liaisons.errors import ConnectError, RefusedError, SimulationError
from liaisons.fmu_files import Scalar
from liaisons_tools.sweeps import sweep

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def row(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU of row.c."""
    code, description = (HERE / "row.c").read_text(), (HERE / "row.xml").read_text()
    return packed(tmp_path_factory.mktemp("fmi3"), "Row", code, description, fmpy.platform_tuple)


def _numbers(*values: float) -> Array[c_double]:
    return (c_double * len(values))(*values)


@pytest.fixture
def instance(row: Path, tmp_path: Path) -> Iterator[CoSimulation3]:
    fmu = read(row)
    fmpy.extract(row, tmp_path)
    with CoSimulation3("row", fmu, tmp_path) as made:
        made.initialize({}, 1e-6, 0.0, 1.0)
        made.exit_initialization()
        yield made


def _variables(row: Path, *names: str) -> list[Scalar]:
    fmu = read(row)
    return [fmu.variables[name] for name in names]


def test_whatever_has_numbers_is_recorded(row: Path) -> None:
    result = simulate(row)
    assert result["steps"].tolist() == [0, -1, -2, -3, -4]
    assert [result[f"moved[{i}]"].tolist() for i in (1, 2)] == [[0] * 5, [0, 1, 1, 1, 1]]
    assert simulate(row, record="moved[2]").values.tolist() == [[0, 1, 1, 1, 1]]
    with pytest.raises(SimulationError, match=r"Row\.bytes is Binary and cannot be recorded"):
        simulate(row, record="bytes")


def test_description(row: Path) -> None:
    fmu = read(row)
    assert (
        fmu.version,
        fmu.guid,
        fmu.can_get_and_set_state,
        fmu.provides_directional_derivatives,
        fmu.output_derivative_order,
    ) == (
        3,
        "{row}",
        True,
        True,
        1,
    )
    assert fmu.arrays == dict.fromkeys(("gain", "u", "y", "s"), (3,)) | dict.fromkeys(("v", "w", "moved"), (2,))
    rows = [f"{name}[{i}]" for name in "ys" for i in (1, 2, 3)]
    assert fmu.reals("output") == [*rows, "single", "also_single", "calls", "w[1]", "w[2]"]
    assert [fmu.variables[f"gain[{i}]"].start for i in (1, 2, 3)] == ["1", "2", "3"]
    assert fmu.variables["u[2]"].unit == "m/s"  # from its type
    assert fmu.variables["label"].start == "none"
    assert (fmu.variables["u[3]"].reference, fmu.variables["u[3]"].position) == (2, 2)
    assert fmu.depends("y[1]", "u[1]")
    assert not fmu.depends("s[1]", "u[1]")
    assert fmu.depends("calls", "u[1]")  # it does not say
    assert not fmu.depends("s[2]", "u[2]", initially=True)  # it has a start value of its own


def test_whole_arrays_go_through_as_they_are(instance: CoSimulation3, row: Path) -> None:
    given, seen = _numbers(1, 2, 3), _numbers(*[0] * 4)
    assert instance.setter(_variables(row, "u[1]", "u[2]", "u[3]"), given)() == 0
    assert instance.getter(_variables(row, "y[1]", "y[2]", "y[3]", "calls"), seen)() == 0
    assert list(seen) == [1, 4, 9, 1]


def test_elements_in_any_order_and_single_precision(instance: CoSimulation3, row: Path) -> None:
    set_two = instance.setter(_variables(row, "u[3]", "u[1]"), given := _numbers(5, 7))
    seen = _numbers(0, 0, 0, 0)
    get = instance.getter(_variables(row, "y[3]", "single", "u[2]", "y[1]"), seen)
    set_one = instance.setter(_variables(row, "u[2]"), _numbers(11))
    assert (set_two(), set_one()) == (0, 0)
    time, size = c_double(0), c_double(0.5)
    assert instance.stepper(time, size)() == 0
    assert get() == 0
    assert list(seen) == [15, 3.5, 11, 7]
    given[0] = 1
    assert (set_two(), get()) == (0, 0)
    assert list(seen) == [3, 3.5, 11, 7]  # what is not named keeps its value


def test_derivatives(instance: CoSimulation3, row: Path) -> None:
    seed, product = _numbers(10, 1), _numbers(0, 0)
    unknowns, knowns = _variables(row, "y[3]", "y[2]"), _variables(row, "u[2]", "u[3]")
    assert instance.directional_derivatives(unknowns, knowns, seed, product)() == 0
    assert list(product) == [3, 20]
    instance.setter(_variables(row, "u[2]"), _numbers(4))()
    slopes = _numbers(0, 0)
    assert instance.output_derivatives(_variables(row, "s[2]", "s[1]"), [1, 1], slopes)() == 0
    assert list(slopes) == [8, 0]


@pytest.mark.parametrize(
    "given",
    [
        {"gain": [4, 5, 6]},
        {"gain": 4.0, "gain[2]": 5.0, "gain[3]": 6.0},
        {"gain[1]": 4.0, "gain[2]": 5.0, "gain[3]": 6.0},
    ],
)
def test_start_values_of_arrays(row: Path, given: dict[str, object]) -> None:
    result = simulate(row, **given, u=1.0)  # type: ignore[arg-type]
    assert result["s"].shape == (5, 3)
    assert_array_equal(result["s"], np.outer(result.time, [4, 5, 6]))
    assert_array_equal(result["s[2]"], 5 * result.time)


def test_structural_parameters_are_set(row: Path) -> None:
    result = simulate(row, v=[1.0, 2.0, 3.0], m=3)  # in whatever order
    assert_array_equal(result["w"], np.outer(result.time, [1, 2, 3]))
    assert simulate(row, v=1.0)["w"].shape == (5, 2)
    assert simulate(row, start_values={"m": 3, "v[2]": 5.0})["w"][-1].tolist() == [1, 5, 1]  # v starts from 1
    assert simulate(row, m=1, deep=False)["w"].tolist() == [[-1.0]] * 5
    with pytest.raises(SimulationError, match=r"Row\.v = \[1\.0, 2\.0, 3\.0\]: 3 values, but the array has 4"):
        simulate(row, m=4, v=[1.0, 2.0, 3.0])
    with pytest.raises(SimulationError, match=r"fmi3SetUInt64 of m = 9 returned Error: no size"):
        simulate(row, m=9)
    with pytest.raises(SimulationError, match=r"Row\.m = 3: a size is the same in all cases; sweep each on its own"):
        sweep(row, {"m": [3]}, keep={"w[1]": "w[1]"})


def test_integers_are_connected_where_all_their_values_fit(row: Path) -> None:
    system = System("rows")
    one, two = system.add("one", row), system.add("two", row, tiny=-5)
    with pytest.raises(ConnectError, match=r"one\.steps \(Int16\) and two\.tiny \(Int8\) cannot be connected"):
        system.connect(one["steps"], two["tiny"])
    system.connect(one["steps"], two["u[3]"])
    result = system.simulate(1.0, 0.25)
    assert result["two.y[3]"].tolist() == [0, -3, -6, -9, -12]  # gain[3] is 3
    assert result["two.tiny"].tolist() == [-5] * 5


def test_other_types_reach_the_fmu(row: Path) -> None:
    with pytest.raises(RefusedError, match=r"fmi3ExitInitializationMode returned Error: flag is set, count = -7"):
        simulate(row, flag=True, count=-7, label="a")
    with pytest.raises(SimulationError, match=r"label = two words$"):
        simulate(row, flag=True, label="two words")


@pytest.mark.usefixtures("either_loop")
def test_arrays_connect_whole_and_by_element(row: Path) -> None:
    system = System("rows")
    one, two = system.add("one", row, u=1.0), system.add("two", row)
    system.connect(one["y"], two["u"])
    result = system.simulate(1.0, 0.25)
    assert_array_equal(result["two.s"], np.outer(result.time, [1, 4, 9]))
    assert result.units["two.s[1]"] == "m"
    other = System("elements")
    one, two = other.add("one", row, u=1.0), other.add("two", row, u=[0.0, 0.0, 7.0])
    other.connect(one["y[3]"], two["u[1]"])
    assert_array_equal(other.simulate(1.0, 0.25)["two.y"][-1], [3, 0, 21])
    with pytest.raises(ConnectError, match=r"one\.y.*two\.u\[2\]"):
        other.connect(one["y"], two["u[2]"])


@pytest.mark.usefixtures("either_loop")
def test_fmu_that_ends_the_simulation_ends_it(row: Path, caplog: pytest.LogCaptureFixture) -> None:
    result = simulate(row, limit=0.6, u=1.0)
    assert result.time.tolist() == [0.0, 0.25, 0.5, 0.75]  # it asks for it at the end of the step
    assert result["s[1]"].tolist() == result.time.tolist()
    assert "Row ends the simulation at t = 0.75 s of 1 s" in caplog.text


def test_failing_step_says_why(row: Path) -> None:
    with pytest.raises(IncompleteError, match=r"fmi3DoStep .* returned Error: t = 1024 is too late"):
        simulate(row, stop_time=1024, step_size=512)


@pytest.mark.variants(core=9)
@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"gain": [1.0, 2.0]}, r"Row\.gain = \[1\.0, 2\.0\]: 2 values, but the array has 3"),
        ({"gain": [1.0, 2.0, np.nan]}, r"Row\.gain\[3\] = nan: expected a finite number"),
        ({"gain": [1.0, 2.0, "x"]}, r"Row\.gain\[3\] = 'x': expected a number, got str"),
        ({"gain[4]": 1.0}, r"Row\.fmu has no variable 'gain\[4\]'; the array has gain\[1\] to gain\[3\]"),
        ({"gian": 1.0}, r"did you mean 'gain'"),
        ({"gian[2]": 1.0}, r"did you mean 'gain\[2\]'"),
        ({"n": 4}, r"Row\.n = 4: causality 'structuralParameter', so it is fixed and cannot be set"),
        ({"bytes": "a"}, r"Row\.bytes = 'a': Binary variables cannot be set"),
        ({"count": 70000}, r"Row\.count = 70000: outside Int16"),
    ],
)
def test_start_values_that_will_not_do(row: Path, given: dict[str, object], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        simulate(row, **given)  # type: ignore[arg-type]
