"""Ports as an FMU's terminals say them, whatever its variables are called."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from making import FmuPaths, described, members, read, rewritten, wired
from numpy.testing import assert_allclose, assert_array_equal

from liaisons import compare, simulate
from liaisons.errors import ConnectError
from liaisons.fmu_files import Array, Scalar, Terminals, Variables

MASS = {"q": "alpha", "q_dot": "beta", "q_ddot": "gamma", "q_load": "delta"}
SPRING = {"length": "one", "length_dot": "two", "length_ddot": "three", "length_force": "four"}
CUBIC = {"y": "s", "y_dot": "v", "y_ddot": "a"}
Renamed = Callable[..., Path]
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"


def _terminal(name: str, members: Mapping[str, str], flow: str = "signal", kind: str = "x", rule: str = "plug") -> str:
    lines = (
        f'<TerminalMemberVariable memberName="{member}" variableName="{variable}" '
        f'variableKind="{flow if member in {"f", "tau"} else "signal"}"/>'
        for member, variable in members.items()
    )
    return f'<Terminal name="{name}" matchingRule="{rule}" terminalKind="{kind}">{"".join(lines)}</Terminal>'


def _document(*terminals: str) -> str:
    content = "".join(terminals)
    return f'<fmiTerminalsAndIcons fmiVersion="3.0"><Terminals>{content}</Terminals></fmiTerminalsAndIcons>'


def _members(names: dict[str, str], motion: str = "sva", force: str = "f") -> dict[str, str]:
    return dict(zip([*motion, force], names.values(), strict=False))


@pytest.fixture
def renamed(fmu: FmuPaths, tmp_path: Path) -> Renamed:
    """An FMU whose variables have other names, with these terminals."""

    def make(source: str, names: dict[str, str], terminals: str, target: str | None = None) -> Path:
        def change(content: bytes) -> bytes:
            for usual, other in names.items():
                content, count = re.subn(rf'(?<= name="){usual}(?=")'.encode(), other.encode(), content)
                assert count == 1
            return content

        path = described(fmu(source), tmp_path / f"{target or source}.fmu", change)
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr(TERMINALS, terminals)
        return path

    return make


@pytest.fixture
def mass(renamed: Renamed) -> Path:
    return renamed("Mass", MASS, _document(_terminal("slider", _members(MASS), "outflow")))


@pytest.fixture
def spring(renamed: Renamed) -> Path:
    return renamed("Spring", SPRING, _document(_terminal("end", _members(SPRING), "inflow")))


def _oscillation(mass: Path, spring: Path, link: str) -> Any:
    return wired(link, mass=(mass, {"q_0": 1.0}), spring=spring)


def test_a_port_whose_members_are_called_anything_is_connected_and_drawn(mass: Path, spring: Path) -> None:
    system = _oscillation(mass, spring, "mass.slider -> spring.end")
    expected = [("alpha", "one"), ("beta", "two"), ("gamma", "three")]
    assert [(c.source.name, c.target.name) for c in system.connections] == [*expected, ("four", "delta")]
    assert [c.is_reaction for c in system.connections] == [False, False, False, True]
    by_value = _oscillation(mass, spring, "spring.one -> mass.alpha")
    assert [*map(str, by_value.connections)] == [*map(str, system.connections)]
    picture = system.diagram().svg
    assert picture.count('marker-end="url') == picture.count('marker-start="url') == 1
    assert ">alpha<" in picture
    assert ">beta<" not in picture


def test_what_it_does_is_the_same_to_the_last_bit(fmu: FmuPaths, mass: Path, spring: Path) -> None:
    """Coupling treats value, rate and acceleration as one curve, whatever they are called."""
    usual = _oscillation(fmu("Mass"), fmu("Spring"), "mass.q -> spring.length")
    other = _oscillation(mass, spring, "mass.slider -> spring.end")
    one, two = (system.simulate(stop_time=1.0, step_size=0.01) for system in (usual, other))
    for name, called in MASS.items():
        assert_array_equal(one[f"mass.{name}"], two[f"mass.{called}"])
    assert_array_equal(one.coupling_error, two.coupling_error)


@pytest.mark.parametrize("name", ["end", "one"])
def test_a_function_that_returns_three_numbers_drives_it(spring: Path, name: str) -> None:
    result = simulate(spring, inputs={name: lambda t: (t**2, 2 * t, 2.0)}, stop_time=1.0, step_size=0.25)
    assert_allclose([result[n][-1] for n in ("one", "two", "three", "four")], [1.0, 2.0, 2.0, 2.0], rtol=1e-14)


def test_results_are_compared_by_its_rates_and_drawn_by_its_names(renamed: Renamed) -> None:
    path = renamed("Cubic", CUBIC, _document(_terminal("signal", _members(CUBIC))))
    coarse, fine = (simulate(path, stop_time=1.0, step_size=step) for step in (0.2, 0.03125))
    assert coarse.ports["s"][:3] == ("s", "v", "a")
    comparison = compare(coarse, fine)
    assert [comparison[name].method for name in "sva"] == ["Hermite", "linear", "linear"]


def _found(path: Path, name: str) -> Any:
    return read(path).terminals.get(name)


def test_a_rotation_has_other_member_names(renamed: Renamed) -> None:
    members = {"phi": "s", "w": "v", "a": "a"}
    joint = _found(renamed("Cubic", CUBIC, _document(_terminal("joint", members))), "joint")
    assert joint.motion == ("s", "v", "a")
    assert joint.force is None


def test_a_point_is_a_terminal_of_terminals(renamed: Renamed) -> None:
    def point(name: str, terminal: str) -> str:
        return _document(f'<Terminal name="{name}" matchingRule="bus">{terminal}</Terminal>')

    mass = renamed("Mass", MASS, point("tip", _terminal("z", _members(MASS), "outflow")))
    spring = renamed("Spring", SPRING, point("foot", _terminal("z", _members(SPRING), "inflow")))
    system = _oscillation(mass, spring, "mass.tip -> spring.foot")
    assert len(system.connections) == 4
    assert ">tip<" in system.diagram().svg
    with pytest.raises(ConnectError, match=r"mass\.tip is a terminal, not a variable"):
        system.parts["mass"]["tip"].elements()
    other = renamed("Cubic", CUBIC, point("tip", _terminal("x", _members(CUBIC))), "Other")
    with pytest.raises(ConnectError, match=r"other\.tip has the port components x, spring\.foot has z"):
        wired("other.tip -> spring.foot", other=other, spring=spring)


FLANGE = {"q": "position", "q_load": "push"}
ROD = {"length": "distance", "length_force": "pull"}


@pytest.mark.parametrize(("flow", "sign"), [("outflow", 1.0), ("inflow", -1.0)])
def test_terminals_of_other_tools_connect_by_members(renamed: Renamed, flow: str, sign: float) -> None:
    """Of flows into both components one is the opposite of the other, as in Kirchhoff's law."""
    flange = renamed("Mass", FLANGE, _document(_terminal("flange", _members(FLANGE, "x", "F"), "")))
    rod = renamed("Spring", ROD, _document(_terminal("flange", _members(ROD, "x", "F"), "")))
    flange = _replaced(flange, b'memberName="F" variableName="push" variableKind="signal"', flow)
    rod = _replaced(rod, b'memberName="F" variableName="pull" variableKind="signal"', "inflow")
    system = wired("mass.flange -> spring.flange", mass=flange, spring=rod)
    ends = [(c.source.name, c.target.name, c.conversion.factor) for c in system.connections]
    assert ends == [("position", "distance", 1.0), ("pull", "push", sign)]


def _replaced(path: Path, member: bytes, flow: str) -> Path:
    assert members(path)[TERMINALS].count(member) == 1
    other = member.replace(b"signal", flow.encode())
    return rewritten(path, path, lambda name, data: (name, data.replace(member, other)))


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"kind": "rotation"}, r"mass\.flange \(x\) and spring\.flange \(rotation\).* differ in kind"),
        ({"members": {"x": "distance"}}, r"mass\.flange has the members x, F, spring\.flange has x"),
        ({"members": {"y": "distance"}, "rule": "bus"}, r"has the members x, F, spring\.flange has y"),
    ],
)
def test_terminals_that_do_not_match_are_refused(renamed: Renamed, other: dict[str, Any], words: str) -> None:
    flange = renamed("Mass", FLANGE, _document(_terminal("flange", _members(FLANGE, "x", "F"))))
    members = _members(ROD, "x", "F")
    rod = renamed("Spring", ROD, _document(_terminal("flange", **{"members": members, **other})))
    with pytest.raises(ConnectError, match=words):
        wired("mass.flange -> spring.flange", mass=flange, spring=rod)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no element found"),
        ("<fmiTerminalsAndIcons><Terminals>", "no element found"),
        ("<!DOCTYPE x [<!ENTITY y 'z'>]><fmiTerminalsAndIcons/>", "document type"),
        ("<other/>", "its root is not fmiTerminalsAndIcons"),
        (_document(_terminal("flange", {"s": "nothing"})), "'nothing' that does not exist"),
        (_document("<Terminal/>"), "a Terminal has no attribute 'name'"),
        (_document("<Terminal name='t'><TerminalMemberVariable/></Terminal>"), "has no attribute 'variableName'"),
        ("<fmiTerminalsAndIcons>" * 300, "nested more than 200 deep"),
    ],
)
def test_from_a_broken_file_of_terminals_follows_a_warning_and_ports_by_names(
    renamed: Renamed, caplog: pytest.LogCaptureFixture, text: str, reason: str
) -> None:
    path = renamed("Mass", {}, text)
    assert read(path).terminals.port("q_load").motion == ("q", "q_dot", "q_ddot")  # type: ignore[union-attr]
    (message,) = [record.getMessage() for record in caplog.records]
    assert reason in message
    assert f"{path}: its {TERMINALS} is not used" in message


@pytest.mark.parametrize("kind", ["", "fmi3/", "python/"])
def test_our_fmus_say_their_ports(component: FmuPaths, kind: str) -> None:
    """The names of their variables say the same."""
    fmu = read(component(f"{kind}Pendulum"))
    by_name = Terminals(fmu.variables)
    assert not fmu.terminals.renamed
    assert fmu.terminals.named.keys() == {"theta", "length", "pivot", "bob"} <= by_name.named.keys()
    for name in ("theta", "length", "length_force", "pivot_x_ddot", "bob_z", "bob_z_load"):
        one, two = fmu.terminals.port(name), by_name.port(name)
        assert one is not None
        assert two is not None
        assert (one.motion, one.force, one.point) == (two.motion, two.force, two.point)
        assert one.kind.startswith("_liaisons_")


def test_elements_of_an_array_are_ports_as_it_is() -> None:
    """FMI 2.0 has terminals of short arrays only, FMI 3.0 those of whole arrays."""
    names = ("bob_x", "bob_x_dot", "bob_x_ddot", "bob_x_load")
    arrays = {name: _array(name, "input" if name.endswith("load") else "output") for name in names}
    terminals = Terminals(Variables(arrays))
    port, point = terminals.port("bob_x_dot[200]"), terminals.get("bob[200]")
    assert port is not None
    assert port.motion == ("bob_x[200]", "bob_x_dot[200]", "bob_x_ddot[200]")
    assert port.force == "bob_x_load[200]"
    assert point is not None
    assert point.nested["x"] == port
    arrays["bob_x_ddot"] = replace(arrays["bob_x_ddot"], shape=(100, 2))
    assert Terminals(Variables(arrays)).port("bob_x") is None


def _array(name: str, causality: str) -> Array:
    like = Scalar(name, 0, "Real", "Float64", causality, settable=False, start=None, unit="m")
    return Array(like, (200,), (0,), (), (0,), is_variable=True)
