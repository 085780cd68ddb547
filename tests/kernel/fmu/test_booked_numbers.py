"""Functions of large models that take what they book from the outputs: the C against the functions of the model."""

from __future__ import annotations

import ctypes as c
import subprocess
from math import pi
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons import Body, Linkage, Revolute, ground
from liaisons.base.compiler import system_compiler
from liaisons.fmu.code import source_files
from liaisons.mechanics import Model, assemble

Doubles = c.POINTER(c.c_double)


def arm(count: int, prescribed: tuple[int, ...]) -> type[Linkage]:
    """Bodies in a row on hinges at right angles."""
    bodies = [Body(2.0, (0.02, 0.03, 0.025), (0, 0, 0.15)) for _ in range(count)]
    members: dict[str, Any] = {"__doc__": "An arm."} | {f"body_{i}": body for i, body in enumerate(bodies)}
    for i, (parent, child) in enumerate(zip([ground, *bodies], bodies, strict=False)):
        place = {"at": (0, 0, 0.3), "rotation": ((-1) ** i * pi / 2, 0, 0)} if i else {}
        members[f"joint_{i}"] = Revolute(parent, child, prescribed=i in prescribed, **place)
    return type("Arm", (Linkage,), members)


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Model, c.CDLL]:
    """Model of an arm with seven axes, of which two are prescribed, and its compiled functions."""
    model, folder = assemble(arm(7, (1, 4))), tmp_path_factory.mktemp("arm")
    for name, content in source_files(model, "{}", "3").items():
        (folder / name).write_bytes(content)
    if (compiler := system_compiler()) is None:
        pytest.skip("no C compiler")
    # The functions are static.
    command = [*compiler, "-shared", "-fPIC", "-O0", "-Dstatic=", "model.c", "-o", "model.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return model, c.CDLL(str(folder / "model.so"))


def called(library: c.CDLL, name: str, arguments: list[np.ndarray], sizes: list[int]) -> list[np.ndarray]:
    results = [np.full(size, np.nan) for size in sizes]
    pointers = [
        (Doubles * len(columns))(*(column.ctypes.data_as(Doubles) for column in columns))
        for columns in (arguments, results)
    ]
    space = np.zeros(100000)
    assert getattr(library, name)(*pointers, None, space.ctypes.data_as(Doubles), 0) == 0
    return results


@pytest.mark.parametrize("name", ["jump", "remember"])
@pytest.mark.variants(core=0)
def test_booked_numbers_and_their_derivatives(generated: tuple[Model, c.CDLL], name: str) -> None:
    model, library = generated
    function: ca.Function = getattr(model, name)
    rng = np.random.default_rng(1)
    arguments = [rng.uniform(0.5, 1.5, function.numel_in(i)) for i in range(function.n_in())]
    sizes = [argument.size for argument in arguments]
    expected = np.array(function(*arguments)).ravel()
    (value,) = called(library, name, arguments, [expected.size])
    assert np.isfinite(value).all()
    np.testing.assert_allclose(value, expected, rtol=1e-13)
    if name == "jump":
        return  # FMI has no derivatives of it
    symbols, directions = function.sx_in(), [rng.normal(size=size) for size in sizes]
    slope = ca.Function("J", symbols, [ca.jacobian(function(*symbols), ca.vertcat(*symbols))])
    J = np.array(slope(*arguments))
    (forward,) = called(library, f"{name}_forward", [*arguments, expected, *directions], [expected.size])
    np.testing.assert_allclose(forward, J @ np.concatenate(directions), rtol=1e-11)
    weights = rng.normal(size=expected.size)
    reverse = called(library, f"{name}_reverse", [*arguments, expected, weights], sizes)
    np.testing.assert_allclose(np.concatenate(reverse), weights @ J, rtol=1e-11, atol=1e-12)


def test_their_code_is_short(generated: tuple[Model, c.CDLL]) -> None:
    """The outputs' code once, not once for each function that books the energy: 600 kB for all functions in FMI 3."""
    model, _ = generated
    assert model.remember.n_instructions() > 500
    text = source_files(model, "{}", "3")["model.c"].decode()
    assert len(text) < 600e3
    for name in ("jump", "remember", "remember_forward", "remember_reverse"):
        _, _, body = text.partition(f"int {name}(")
        assert "calculate_reverse(" in body[:700] or "(arguments, all, integers, reals, memory);" in body[:700]
