"""Loops in C against CasADi's functions of the same chains, and their derivatives against CasADi's own."""

from __future__ import annotations

import ctypes as c
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from handmade import ring
from numpy.typing import NDArray

from liaisons.base.compiler import system_compiler
from liaisons.chains import Chain
from liaisons.chains.loops import preamble
from liaisons.fmu import coupled_state_count
from liaisons.fmu.code import model_code
from liaisons.fmu.dependencies import initial_dependencies, running_dependencies, states_that_jump
from liaisons.fmu.functions import DIFFERENTIATED
from liaisons.language import ActiveCoordinate, Coordinate, Joint, Parameter, point
from liaisons.mechanics import Code, Model, assemble
from liaisons.models import DrivenChain, OscillatorChain, PendulumChain

GUID = "{00000000-0000-0000-0000-000000000000}"
WARNINGS = ["-Wall", "-Wextra", "-pedantic", "-Werror", "-Wno-unused-parameter"]
ROUNDING = 1e-12
"""Of some hundred terms of order 1, summed in another order; relative to the largest number of a result."""


class PendulumRow(Chain):
    """Pendulums in a row, coupled by sines: neighbours matter, but cost too much to be calculated twice."""

    inertia = Parameter(1.2, "kg.m2", "moment of inertia of each pendulum", above=0)
    stiffness = Parameter(0.8, "N.m", "of what couples them")
    friction = Parameter(0.1, "1/s", "coefficient of friction")
    weight = Parameter(1.0, "N.m", "moment of the weight, horizontal")
    phi = Coordinate("rad", "angles", start=(0.5, -0.2))
    joint = Joint("rad", "x")

    def tip(self) -> dict[str, ca.SX]:
        return {"x": self.phi}

    def kinetic_energy(self) -> ca.SX:
        return self.inertia / 2 * self.dot(self.phi) ** 2

    def potential_energy(self) -> ca.SX:
        return -self.weight * ca.cos(self.phi)

    def bond_energy(self) -> ca.SX:
        return self.stiffness * (1 - ca.cos(self.phi - self.joint["x"]))

    def bond_dissipation(self) -> ca.SX:
        return self.friction * self.inertia / 2 * (self.dot(self.phi) - self.dot(self.joint["x"])) ** 2

    def friction_coefficient(self) -> ca.SX:
        return self.friction


class Arm(Chain):
    """Telescopes hung on each other: two coordinates a link, inertia that depends on them, a moved base, friction."""

    mass = Parameter(1.3, "kg", "mass of each body", above=0)
    friction = Parameter(0.3, "1/s", "coefficient of friction", minimum=0)
    angle = Coordinate("rad", "absolute angle", start=0.3)
    reach = Coordinate("m", "length of the link", start=1.0)
    lift = ActiveCoordinate("m", "height of the base")
    width = Parameter(1.0, "m", "of the parabola that the base moves on", above=0)
    gravity = Parameter(9.81, "m/s2", "gravitational acceleration")
    stiffness = Parameter(2.0, "N/m", "of each link")
    joint = Joint("m", "x", "z")

    @point("m", "the far end of each link")
    def end(self) -> dict[str, ca.SX]:
        x, z = self.joint["x"], self.joint["z"]
        return {"x": x + self.reach * ca.sin(self.angle), "z": z - self.reach * ca.cos(self.angle)}

    def base(self) -> dict[str, ca.SX]:
        return {"x": self.lift**2 / self.width, "z": self.lift}

    def tip(self) -> Mapping[str, ca.SX]:
        return self.end

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.end)

    def potential_energy(self) -> ca.SX:
        return self.gravity * self.mass * self.end["z"] + self.stiffness / 2 * (self.reach - self.width) ** 2

    def friction_coefficient(self) -> ca.SX:
        return self.friction


def references(model: Model) -> dict[str, ca.Function]:
    """What the loops have to agree with, by the names of core.h."""
    found = {name: getattr(model, name) for name in ("start", "derivatives", "jump", "remember", "nominals")}
    found |= {"calculate": model.outputs_function, "motion": model.derivatives}
    for name in ("start", "calculate", "remember"):
        found |= {f"{name}_forward": found[name].forward(1), f"{name}_reverse": found[name].reverse(1)}
    return found


def compiled(codes: Mapping[str, Code], folder: Path, *flags: str) -> c.CDLL:
    """The functions, each exported as ``call_NAME(arguments, results, work)``."""
    compiler = system_compiler()
    if compiler is None:
        pytest.skip("no C compiler")
    calls = [
        f"int call_{name}(const double **a, double **r, double *w) {{ return {name}(a, r, NULL, w, 0); }}"
        for name in codes
    ]
    functions = [preamble(codes.values()), *(code.text for code in codes.values())]
    texts = ["#include <math.h>", "#include <stddef.h>", *functions, *calls]
    (folder / "loops.c").write_text("\n".join([*texts, ""]))
    common = ["-std=c99", "-O2", "-fno-math-errno", "-ffp-contract=off", "-fPIC", "-shared"]  # as FMUs are
    command = [*compiler, *common, *WARNINGS, *flags, "loops.c", "-o", "loops.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return c.CDLL(str(folder / "loops.so"))


def called(
    function: Callable[..., int], arguments: Sequence[NDArray], sizes: Sequence[int], work: int
) -> list[NDArray]:
    """Results; what is not written stays NaN, and what is read of the work space before it is written is NaN too."""
    pointer = c.POINTER(c.c_double)
    results, space = [np.full(size, np.nan) for size in sizes], np.full(work + 1, np.nan)

    def array(columns: Sequence[NDArray]) -> Any:
        return (pointer * len(columns))(*(column.ctypes.data_as(pointer) for column in columns))

    assert function(array(arguments), array(results), space.ctypes.data_as(pointer)) == 0
    return results


def loops_of(model: Model, *, adjoint: bool) -> Mapping[str, Code]:
    """C code of a chain's functions and of their derivatives, by member of ``Model`` in core.h."""
    assert model.loops is not None
    return model.loops.code(coupled_state_count(model), DIFFERENTIATED, adjoint=adjoint)


CHAINS = [(OscillatorChain, n) for n in (2, 3, 4, 700)]  # 700: sums of several blocks
CHAINS += [(DrivenChain, 2), (DrivenChain, 9), (PendulumRow, 2), (PendulumRow, 300), (PendulumChain, 2)]
CHAINS += [(PendulumChain, 12), (Arm, 3)]


@pytest.mark.parametrize(("component", "n"), CHAINS)
def test_loops_agree_with_casadi(component: type[Chain], n: int, tmp_path: Path) -> None:
    model = assemble(component, n)
    codes = loops_of(model, adjoint=True)
    # The long ones take gcc seconds when it optimises; that these are right when optimised is shown by their FMUs.
    library = compiled(codes, tmp_path, *(() if component in (OscillatorChain, DrivenChain) else ("-O0",)))
    expected = references(model)
    assert codes.keys() == expected.keys()
    rng = np.random.default_rng(n)
    for name, function in expected.items():
        arguments = [rng.uniform(0.4, 1.3, function.numel_in(i)) for i in range(function.n_in())]
        values = [np.asarray(x).ravel() for x in function.call([ca.DM(x) for x in arguments])]
        if name == "motion":
            values = [values[0][: coupled_state_count(model)]]
        sizes = [value.size for value in values]
        found = called(getattr(library, f"call_{name}"), arguments, sizes, codes[name].reals)
        for numbers, value in zip(found, values, strict=True):
            scale = max(1.0, np.max(np.abs(value), initial=0.0))
            np.testing.assert_allclose(numbers, value, rtol=0, atol=ROUNDING * scale, err_msg=name)


def test_masses_in_a_row_need_neither_sweeps_nor_work_space() -> None:
    """Their mass matrix is diagonal: one loop over independent links, which compilers vectorise."""
    model = assemble(OscillatorChain, 1000)
    codes = loops_of(model, adjoint=True)
    assert all(code.reals == 0 for code in codes.values())
    assert codes["derivatives"].text.count("i < ") == 1
    assert len(preamble(codes.values())) + len(codes["derivatives"].text) < 20_000


def test_sines_are_calculated_once_a_link() -> None:
    model = assemble(PendulumChain, 50)
    text = loops_of(model, adjoint=False)["derivatives"].text
    assert text.count(" sin(") == text.count(" cos(") == 1
    assert text.count("for (") == 3  # inward, outward, inward


@pytest.mark.parametrize(
    ("model_of", "numbers", "longer"),
    [
        (partial(assemble, OscillatorChain), (10, 10_000), 1.05),
        (partial(assemble, PendulumChain), (10, 1000), 1.05),
        (ring, (3, 100_000), 1.1),
    ],
    ids=["masses", "pendulums", "maps"],
)
def test_code_is_as_long_for_any_chain(model_of, numbers, longer, tmp_path: Path) -> None:
    """Only digits are added, but for the picture, which is of 200 links at most; without warnings."""
    models = (replace(model_of(n), draw=None, drawn=()) for n in numbers)
    small, large = (model_code(model, GUID, "3") for model in models)
    assert len(large) < longer * len(small)
    compiler = system_compiler()
    if compiler is not None:
        (tmp_path / "model.c").write_text(large)
        kernel = Path(__file__).parents[3] / "components" / "liaisons"
        headers = [f"-I{kernel / folder}" for folder in ("fmu/runtime", "base")]
        flags = ["-std=c99", *WARNINGS[:4], *headers, "-fsyntax-only"]
        subprocess.run([*compiler, *flags, tmp_path / "model.c"], check=True)


@pytest.mark.parametrize("component", [OscillatorChain, DrivenChain, PendulumChain, PendulumRow])
def test_dependencies_are_those_of_the_functions(component: type[Chain]) -> None:
    """The same, whether a short chain stands for the long one or not."""
    model = assemble(component, 3)
    plain = replace(model, loops=None)
    np.testing.assert_array_equal(running_dependencies(model), running_dependencies(plain))
    np.testing.assert_array_equal(initial_dependencies(model), initial_dependencies(plain))
    moved = {"work"} if model.active else set()  # what an operator moves may jump
    assert states_that_jump(model) == states_that_jump(plain) == moved
    assert coupled_state_count(model) == coupled_state_count(plain) == 6
