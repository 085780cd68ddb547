"""What ``check_component`` says of right and of wrong components; the texts are frozen, see README.md."""

import hashlib
import json
import tomllib
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from liaisons import ActiveCoordinate, Coordinate, LiaisonsError, Mechanism, Parameter, check_component
from liaisons.library import catalogue, component
from liaisons.testing import component_test
from liaisons_motion.examination.motions import EquationsOfMotion
from liaisons_motion.examination.statements import odd_factors, statements
from liaisons_motion.examination.trials import trials_of
from liaisons_tools.cli import main

HERE = Path(__file__).parent
MECHANISMS = sorted((HERE / "mechanisms").glob("*.py"))
FAULTS = {fault["mechanism"]: fault for fault in tomllib.loads((HERE / "faults.toml").read_text())["fault"]}


def wrong(name: str, folder: Path) -> tuple[Path, int]:
    """The file of a mechanism with its wrong line, and the number of that line."""
    text, fault = (HERE / f"mechanisms/{name}.py").read_text(), FAULTS[name]
    path = folder / f"{name}.py"
    path.write_text(text.replace(fault["right"], fault["wrong"]))
    return path, text[: text.index(fault["right"])].count("\n") + 1


def test_the_texts_are_those_that_were_frozen() -> None:
    for line in (HERE / "hashes.txt").read_text().splitlines():
        digest, name = line.split()
        assert hashlib.sha256((HERE / name).read_bytes()).hexdigest() == digest, name
    assert len(MECHANISMS) == len(FAULTS) == 40


@pytest.mark.variants(quick=6, core=1)
@pytest.mark.parametrize("path", MECHANISMS, ids=lambda path: path.stem)
def test_a_right_component_is_not_accused(path: Path) -> None:
    examination = check_component(path)
    assert examination.passed, [str(verdict) for verdict in examination.verdicts]
    assert not examination.causes
    assert any("what exact says" in verdict.claim for verdict in examination.verdicts)


@pytest.mark.variants(quick=6, core=0)
@pytest.mark.parametrize(
    "name",
    [
        "damped_spring",  # a factor in the closed form
        "morse_oscillator",  # another branch of the closed form
        "atwood",  # a term that is missing in T
        "moved_base",  # friction on the absolute velocity
        "ring_bead",  # a constraint that is lost: it cannot be loaded
        "three_discs",  # a wrong unit: likewise
        "hinged_halves",  # a rate that the closed form does not need: the docstring's conserved momentum does
    ],
)
def test_a_wrong_line_is_among_the_first_two_causes(name: str, tmp_path: Path) -> None:
    path, line = wrong(name, tmp_path)
    examination = check_component(path, seconds=60)
    assert not examination.passed
    assert line in [cause.line for cause in examination.causes[:2]], [str(cause) for cause in examination.causes]


@pytest.mark.slow
def test_faults_are_found_and_named(tmp_path: Path) -> None:
    """As is asked of the project: of 40 at least 38 are found, and 34 named by their line."""
    found, named = set[str](), set[str]()
    for name in FAULTS:
        path, line = wrong(name, tmp_path)
        examination = check_component(path, seconds=60)
        found |= set() if examination.passed else {name}
        named |= {name} if line in [cause.line for cause in examination.causes[:2]] else set()
    assert len(found) >= 38, sorted(set(FAULTS) - found)
    assert len(named) >= 34, sorted(set(FAULTS) - named)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(catalogue()))
def test_no_component_of_the_catalogue_is_accused(name: str) -> None:
    examination = check_component(name)
    assert examination.passed, [str(verdict) for verdict in examination.verdicts]


def test_formulas_of_the_docstring_are_read() -> None:
    class Sled(Mechanism):
        """Sled m on a spring k, in wind at the speed w' of an operator: m x'' = -k x - 2 c (x' - w').

        T = ½ m x'², n = c/m: x'' = -k x/m - n (x' - w').  At m x'' = 7 it
        rests at x = 0, and (k + m) w is not said to be constant.
        m w' is constant; the momentum m x' stays what it was; p_x = m x'; 2 V = k x² sin²(w/k) + k x² cos² w/k.
        """

        mass = Parameter(2.0, "kg", "mass", above=0)
        stiffness = Parameter(3.0, "N/m", "stiffness", above=0)
        damper = Parameter(0.5, "N.s/m", "damper", symbol="c")
        x = Coordinate("m", "position")
        wind = ActiveCoordinate("m", "way of the air", symbol="w")

        def kinetic_energy(self) -> ca.SX:
            return self.mass / 2 * self.dot(self.x) ** 2

        def potential_energy(self) -> ca.SX:
            return self.stiffness / 2 * self.x**2

        def dissipation_function(self) -> ca.SX:
            return self.damper / 2 * self.dot(self.x - self.wind) ** 2

    class Doubled(Sled):
        """The same with a mass and a spring of another factor."""

        def kinetic_energy(self) -> ca.SX:
            return self.mass * self.dot(self.x) ** 2

        def potential_energy(self) -> ca.SX:
            return self.stiffness * self.x**2

    assert (odd_factors(Sled()), odd_factors(Doubled())) == (0, 2)
    assert statements(Sled()) == {
        "m x'' = -k x - 2 c (x' - w')": False,
        "T = ½ m x'²": True,
        "x'' = -k x/m - n (x' - w')": True,
        "m w' is constant": False,
        "m x' stays what it was": False,
        "p_x = m x'": True,
        "2 V = k x² sin²(w/k) + k x² cos² w/k": False,
    }


OWN = '''
from __future__ import annotations

import numpy as np

from liaisons import Coordinate, Mechanism, Parameter, closed_form


class Slider(Mechanism):
    """Mass that slides freely."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    x = Coordinate("m", "position", start=1.0, start_rate=0.5)

    def kinetic_energy(self):
        return self.mass / 2 * self.dot(self.x) ** 2

    @closed_form("the even motion")
    @staticmethod
    def exact(t, at):
        return RESULT
'''


@pytest.mark.parametrize(
    ("result", "says"),
    [
        ('{"z": at.x_0 + at.x_dot_0 * t}', "it gives z, which is no output"),
        ('{"x": at.x_0}', "shape"),
        ("at.x_0 + at.x_dot_0 * t", "it returns ndarray"),
        ('{"x": at.y_0 + 0 * t}', "nothing is called 'y_0'"),
        ('{"x": 1 / 0 + t}', "ZeroDivisionError"),
        ("{}", "it returns nothing"),
        ('{"x": np.sqrt(-at.x_0) + t}', "x is what exact says"),
    ],
)
def test_a_closed_form_that_fails_is_told_with_the_reason(result: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "slider.py"
    path.write_text(OWN.replace("RESULT", result))
    examination = check_component(path, seconds=1)
    [failure] = [verdict for verdict in examination.verdicts if not verdict.passed]
    assert says in failure.claim


@pytest.mark.parametrize(
    ("written", "instead", "says"),
    [
        ('    @closed_form("the even motion")\n', "", "write @closed_form"),
        ('@closed_form("the even motion")', "@closed_form", "write @closed_form"),
        ("exact(t, at)", "exact(self, t, at)", "write @closed_form"),
        ("    x = ", '    drag = Parameter(0.1, "N.s/m", "drag")\n    x = ', "drag not"),
        ("    x = ", '    mass = Parameter(1.0, "kg", "another mass")\n    x = ', "mass in lines"),
        ("    def kinetic", "    def x(self):\n        return self.mass\n\n    def kinetic", "x in lines"),
        ("    def kinetic", "    def __init__(self):\n        self.mass\n\n    def kinetic", r"super().__init__()"),
    ],
)
def test_a_mistake_is_told_with_the_remedy(written: str, instead: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "slider.py"
    text = OWN.replace("RESULT", '{"x": at.x_0 + at.x_dot_0 * t}')
    path.write_text(text)
    assert check_component(path, seconds=1).passed
    path.write_text(text.replace(written, instead))
    claims = [verdict.claim for verdict in check_component(path, seconds=1).verdicts if not verdict.passed]
    assert any(says in claim for claim in claims), claims


def test_values_that_violate_a_condition_of_the_component_are_not_tried() -> None:
    equations = EquationsOfMotion(component("FourierHoop"))
    tried = [*trials_of(equations, getattr(component("FourierHoop"), "exact"), 20, 1)]  # noqa: B009 - of one component
    assert len(tried) == 2
    assert any(tried[1].values[f"cos_{k}"] for k in range(1, 5))
    assert all(np.all(equations.distances(one.values) > 0) for one in tried)


test_pendulum = component_test("Pendulum")


@pytest.mark.variants(core=0)
def test_a_failed_case_names_the_line(tmp_path: Path) -> None:
    path, line = wrong("morse_oscillator", tmp_path)
    test = component_test(path)
    [mark] = test.pytestmark  # type: ignore[attr-defined]
    [verdict] = [one for one in mark.args[1] if not one.passed]
    with pytest.raises(AssertionError, match=rf"morse_oscillator\.py:{line}: "):
        test(verdict)


def test_what_is_no_component_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LiaisonsError, match="Pendulm"):
        check_component("Pendulm")
    with pytest.raises(LiaisonsError, match="no_file"):
        check_component(tmp_path / "no_file.py")


def test_what_is_not_checked_is_named() -> None:
    contacts = check_component("BouncingBall")
    assert [text for text in contacts.unchecked if "contacts" in text]
    assert check_component("Pendulum").unchecked == ()


@pytest.mark.variants(core=0)
def test_the_command_prints_it_for_programs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path, line = wrong("morse_oscillator", tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["check", path.name, "--json"]) == 1
    printed = json.loads(capsys.readouterr().out)
    assert printed["passed"] is False
    assert line in [cause["line"] for cause in printed["component"]["causes"]]
