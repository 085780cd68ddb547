"""Arrays of FMI 2.0, which are scalars with an index, and of both versions in descriptions and results."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from making import read
from numpy.testing import assert_array_equal

from liaisons.cosim import Result, SystemComponent
from liaisons.errors import SimulationError

Describe = Callable[..., Any]


LONGEST = 1000
"""Elements up to which an array is recorded by default."""

FIRST = 5000
"""Value reference of the first variable; they fall from there."""


def _scalar(reference: int, name: str, causality: str, unit: str) -> str:
    variability = "fixed" if causality == "parameter" else "continuous"
    start = "" if causality == "output" else 'start="0"'
    return (
        f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
        f'variability="{variability}"><Real unit="{unit}" {start}/></ScalarVariable>'
    )


@pytest.fixture
def described(tmp_path: Path) -> Describe:
    """An FMU of FMI 2.0 with these variables: ``(name, causality, unit)``; inputs and parameters start at 0."""

    def make(*variables: tuple[str, str, str], structure: str = "") -> Any:
        listed = "".join(_scalar(FIRST - k, *variable) for k, variable in enumerate(variables))
        path = tmp_path / "Described.fmu"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(
                "modelDescription.xml",
                '<fmiModelDescription fmiVersion="2.0" modelName="D" guid="1"><CoSimulation modelIdentifier="D"/>'
                f"<ModelVariables>{listed}</ModelVariables><ModelStructure>{structure}</ModelStructure>"
                "</fmiModelDescription>",
            )
            archive.writestr(f"binaries/{fmpy.platform_tuple}/D{fmpy.sharedLibraryExtension}", "")
        return read(path)

    return make


def _row(name: str, count: int, causality: str = "output", unit: str = "m") -> list[tuple[str, str, str]]:
    return [(f"{name}[{i}]", causality, unit) for i in range(1, count + 1)]


def test_elements_are_found_in_any_mixture(described: Describe) -> None:
    mixed = [v for pair in zip(_row("x", 3), _row("v", 3, unit="m/s"), strict=True) for v in pair]
    fmu = described(*mixed, ("alone", "output", "m"))
    assert fmu.arrays == {"x": (3,), "v": (3,)}
    assert list(fmu.variables) == ["x[1]", "x[2]", "x[3]", "v[1]", "v[2]", "v[3]", "alone"]
    assert len(fmu.variables) == 7
    # references as in the file, where the two take turns
    assert [fmu.variables[f"x[{i}]"].reference for i in (1, 2, 3)] == [FIRST, FIRST - 2, FIRST - 4]
    assert [fmu.variables[f"v[{i}]"].unit for i in (1, 3)] == ["m/s", "m/s"]
    assert list(fmu.variables.entry("v").references) == [FIRST - 1, FIRST - 3, FIRST - 5]


def test_matrix(described: Describe) -> None:
    fmu = described(*((f"m[{i},{j}]", "parameter", "") for i in (1, 2) for j in (1, 2, 3)))
    assert fmu.arrays == {"m": (2, 3)}
    assert fmu.variables["m[2,1]"].reference == FIRST - 3
    assert "m[3,1]" not in fmu.variables
    given = SystemComponent.read("d", fmu.path, {"m": [[1, 2, 3], [4, 5, 6]], "m[2,1]": 7}).starts
    assert given == {"m": (1.0, 2.0, 3.0, 7.0, 5.0, 6.0)}
    with pytest.raises(SimulationError, match=r"d\.m = .*: 3×2 values, but the array has 2×3"):
        SystemComponent.read("d", fmu.path, {"m": np.zeros((3, 2))})


@pytest.mark.parametrize(
    "names",
    [
        ["x[1]", "x[3]"],
        ["x[2]", "x[1]"],
        ["x[0]", "x[1]"],
        ["x[1,1]", "x[1,2]", "x[2,1]"],
        ["x[1]", "x[2]", "x"],
        ["x", "x[1]", "x[2]"],
    ],
)
def test_what_is_no_array_stays_as_it_is(described: Describe, names: list[str]) -> None:
    fmu = described(*((name, "output", "m") for name in names))
    assert fmu.arrays == {}
    assert {name: fmu.variables[name].reference for name in fmu.variables} == {
        name: FIRST - k for k, name in enumerate(names)
    }


def test_elements_that_differ_are_no_array(described: Describe) -> None:
    fmu = described(("x[1]", "output", "m"), ("x[2]", "output", "rad"))
    assert [fmu.variables[name].unit for name in ("x[1]", "x[2]")] == ["m", "rad"]
    assert "x" not in {name for name, shape in fmu.arrays.items() if shape != (1,)}


def test_dependencies_are_of_elements(described: Describe) -> None:
    unknowns = "".join(f'<Unknown index="{4 + i}" dependencies="{i} 1"/>' for i in (1, 2, 3))
    variables = [*_row("u", 3, "input"), ("p", "parameter", ""), *_row("y", 3)]
    fmu = described(*variables, structure=f"<Outputs>{unknowns}</Outputs>")
    depends = [[fmu.depends(f"y[{i}]", f"u[{j}]") for j in (1, 2, 3)] for i in (1, 2, 3)]
    assert depends == [[True, False, False], [True, True, False], [True, False, True]]


def test_long_arrays_are_recorded_on_request_only(described: Describe) -> None:
    fmu = described(*_row("short", LONGEST), *_row("long", LONGEST + 1), ("one", "output", "m"))
    assert fmu.recorded() == [*(f"short[{i}]" for i in range(1, LONGEST + 1)), "one"]
    assert len(fmu.reals("output")) == 2 * LONGEST + 2


def test_nearest_name_knows_arrays(described: Describe) -> None:
    fmu = described(*_row("theta", 100))
    assert fmu.unknown_variable_message("tetha").endswith("has no variable 'tetha'; did you mean 'theta'?")
    assert fmu.unknown_variable_message("tetha[7]").endswith("did you mean 'theta[7]'?")
    assert fmu.unknown_variable_message("theta[101]").endswith("the array has theta[1] to theta[100]")


def _result(*names: str) -> Result:
    time = np.arange(4.0)
    return Result("row", time, names, np.array([time + 10 * k for k in range(len(names))]), dict.fromkeys(names, "m"))


def test_result_gives_whole_arrays() -> None:
    result = _result("c.x[1]", "c.x[2]", "c.x[3]", "c.y")
    assert_array_equal(result["c.x"], result.time[:, None] + [0, 10, 20])
    assert_array_equal(result["c.x[2]"], result.time + 10)
    assert result.entries == ("c.x", "c.y")
    assert result.units["c.x"] == "m"
    assert "c.x (3) [m], c.y [m]" in repr(result)
    with pytest.raises(ValueError, match="read-only"):
        result["c.x"][0, 0] = 1.0
    with pytest.raises(SimulationError, match=r"no signal 'c\.z'; did you mean 'c\.[xy]'\?"):
        result["c.z"]


def test_result_of_mixed_order_and_of_matrices() -> None:
    mixed = _result("x[1]", "v[1]", "x[2]", "v[2]")
    assert_array_equal(mixed["v"], mixed.time[:, None] + [10, 30])
    matrix = _result(*(f"m[{i},{j}]" for i in (1, 2) for j in (1, 2, 3)))
    assert matrix["m"].shape == (4, 2, 3)
    assert_array_equal(matrix["m"][:, 1, 0], matrix["m[2,1]"])


def test_incomplete_array_is_none() -> None:
    result = _result("x[1]", "x[3]")
    assert result.entries == ("x[1]", "x[3]")
    with pytest.raises(SimulationError, match="no signal 'x'"):
        result["x"]


def test_arrays_survive_files_and_are_drawn_as_one(tmp_path: Path) -> None:
    result = _result("x[1]", "x[2]", "y")
    result.to_csv(tmp_path / "row.csv")
    assert_array_equal(Result.from_csv(tmp_path / "row.csv")["x"], result["x"])
    (axes,) = result.plot(path=tmp_path / "row.png").axes
    assert len(axes.lines) == 3
    assert axes.get_legend_handles_labels()[1] == ["x (2)", "y"]
