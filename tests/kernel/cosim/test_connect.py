"""What fits what, and what is said when it does not."""

from __future__ import annotations

import pytest
from making import FmuPaths, wired

from liaisons.cosim import System
from liaisons.errors import ConnectError, SimulationError


def _joined(system: System) -> list[str]:
    return [line.strip() for line in repr(system).splitlines() if "->" in line]


@pytest.fixture
def system(fmu: FmuPaths) -> System:
    names = "cubic", "spring", "mass", "probe", "faulty", "discrete", "points", "upper", "lower"
    return wired(**{name: fmu("Points" if name in {"upper", "lower"} else name.capitalize()) for name in names})


def _connect(system: System, *links: str) -> list[str]:
    """What connections these are, ``"one.port other.port"`` each."""
    for link in links:
        one, other = (end.split(".") for end in link.split())
        system.connect(system.parts[one[0]][one[1]], system.parts[other[0]][other[1]])
    return _joined(system)


_DOTS = "", "_dot", "_ddot"


def test_signal_onto_active_coordinate_is_a_triple(system: System) -> None:
    expected = [f"cubic.y{dots} -> spring.length{dots}" for dots in _DOTS]
    assert _connect(system, "cubic.y spring.length") == expected


@pytest.mark.parametrize("link", ["mass.q spring.length", "spring.length mass.q"])
def test_free_coordinate_and_active_coordinate_couple_both_ways(system: System, link: str) -> None:
    forth = [f"mass.q{dots} -> spring.length{dots}" for dots in _DOTS]
    assert _connect(system, link) == [*forth, "spring.length_force -> mass.q_load"]


def test_points_connect_axis_by_axis_both_ways(system: System) -> None:
    assert _connect(system, "upper.bob lower.pivot") == [
        line
        for axis in "xz"
        for line in [
            *(f"upper.bob_{axis}{dots} -> lower.pivot_{axis}{dots}" for dots in _DOTS),
            f"lower.pivot_{axis}_force -> upper.bob_{axis}_load",
        ]
    ]


def test_suffix_stands_before_the_index(system: System) -> None:
    triple = system.parts["points"]["theta[3]"].triple() or ()
    assert [end.name for end in triple] == ["theta[3]", "theta_dot[3]", "theta_ddot[3]"]


def test_single_variables(system: System) -> None:
    found = _connect(system, "cubic.y probe.u", "probe.echo spring.length_dot")
    assert found == ["cubic.y -> probe.u", "probe.echo -> spring.length_dot"]


@pytest.mark.parametrize(
    ("link", "words"),
    [
        ("spring.seen mass.q_force", ["spring.seen [m]", "mass.q_force [N]", "different kinds"]),
        ("spring.seen mass.q", ["spring.seen (output)", "mass.q (output)", "an output, the other an input"]),
        ("spring.seen mass.mass", ["mass.mass (parameter)", "set where its component is added"]),
        ("cubic.y discrete.level", ["cubic.y (Real)", "discrete.level (Integer)", "of the same type"]),
        ("discrete.late discrete.level", ["discrete.late (Boolean)", "discrete.level (Integer)"]),
        ("discrete.late mass.q_force", ["discrete.late (Boolean)", "mass.q_force (Real)"]),
        ("discrete.gear probe.u", ["discrete.gear (Enumeration)", "probe.u (Real)"]),
        ("discrete.label probe.u", ["discrete.label (String)", "probe.u (Real)"]),
        ("faulty.hidden probe.u", ["faulty.hidden (local)", "probe.u (input)"]),
        ("spring.lenght mass.q", ["Spring.fmu has no variable 'lenght'; did you mean 'length'"]),
        ("points.bobb mass.q", ["Points.fmu has no variable 'bobb'; did you mean 'bob'?"]),
        ("points.bob cubic.y", ["points.bob has the port components x, z, cubic.y has none"]),
    ],
)
def test_what_does_not_fit_is_said_with_both_ends(system: System, link: str, words: list[str]) -> None:
    with pytest.raises(ConnectError) as caught:
        _connect(system, link)
    assert all(word in str(caught.value) for word in words)
    assert _joined(system) == []


def test_input_has_one_source_and_nothing_is_connected_by_halves(system: System) -> None:
    _connect(system, "probe.echo spring.length_ddot")
    with pytest.raises(ConnectError, match=r"cubic\.y_ddot .* spring\.length_ddot: probe\.echo feeds it already"):
        _connect(system, "cubic.y spring.length")
    assert _joined(system) == ["probe.echo -> spring.length_ddot"]


def test_end_of_another_system_is_refused(system: System, fmu: FmuPaths) -> None:
    stranger = System("other").add("spring", fmu("Spring"))
    with pytest.raises(ConnectError, match=r"spring\.seen is not a component of wired"):
        system.connect(stranger["seen"], system.parts["spring"]["length"])


@pytest.mark.parametrize("name", ["", "a.b"])
def test_component_names_that_will_not_do(system: System, fmu: FmuPaths, name: str) -> None:
    with pytest.raises(SimulationError, match="must not be empty or have a dot"):
        system.add(name, fmu("Cubic"))


def test_component_name_is_taken_once(system: System, fmu: FmuPaths) -> None:
    with pytest.raises(SimulationError, match="already"):
        system.add("cubic", fmu("Cubic"))


@pytest.mark.parametrize(
    ("starts", "words"),
    [
        ({"limt": 1.0}, "no variable 'limt'; did you mean 'limit'"),
        ({"x": 1.0}, r"bad\.x = 1\.0: causality 'output'"),
        ({"hidden": 1.0}, r"bad\.hidden = 1\.0: causality 'local'"),
        ({"limit": float("nan")}, r"bad\.limit = nan: expected a finite number"),
        ({"limit": "high"}, r"bad\.limit = 'high': expected a number, got str"),
        ({"limit": True}, r"bad\.limit = True: expected a number, got bool"),
        ({"status": 2.5}, r"bad\.status = 2\.5: expected an integer, got float"),
        ({"flag": 1}, r"bad\.flag = 1: expected True or False, got int"),
        ({"label": 1}, r"bad\.label = 1: expected a string, got int"),
    ],
)
def test_start_values_that_will_not_do(system: System, fmu: FmuPaths, starts: dict[str, float], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        system.add("bad", fmu("Faulty"), start_values=starts)
