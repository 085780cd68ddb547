"""What fits what, and what is said when it does not."""

from __future__ import annotations

import pytest
from making import FmuPaths

from liaisons.cosim import Part, System
from liaisons.cosim.connections import connect
from liaisons.errors import ConnectError, SimulationError


@pytest.fixture
def system() -> System:
    return System("test")


def _joined(system: System) -> list[str]:
    return [line.strip() for line in repr(system).splitlines() if "->" in line]


@pytest.fixture
def cubic(system: System, fmu: FmuPaths) -> Part:
    return system.add("cubic", fmu("Cubic"))


@pytest.fixture
def spring(system: System, fmu: FmuPaths) -> Part:
    return system.add("spring", fmu("Spring"))


@pytest.fixture
def mass(system: System, fmu: FmuPaths) -> Part:
    return system.add("mass", fmu("Mass"))


@pytest.fixture
def probe(system: System, fmu: FmuPaths) -> Part:
    return system.add("probe", fmu("Probe"))


def test_signal_onto_active_coordinate_is_a_triple(system: System, cubic: Part, spring: Part) -> None:
    system.connect(cubic["y"], spring["length"])
    assert _joined(system) == [
        "cubic.y -> spring.length",
        "cubic.y_dot -> spring.length_dot",
        "cubic.y_ddot -> spring.length_ddot",
    ]


@pytest.mark.parametrize("swapped", [False, True])
def test_free_coordinate_and_active_coordinate_couple_both_ways(
    system: System, mass: Part, spring: Part, swapped: bool
) -> None:
    ends = (spring["length"], mass["q"]) if swapped else (mass["q"], spring["length"])
    system.connect(*ends)
    assert _joined(system) == [
        "mass.q -> spring.length",
        "mass.q_dot -> spring.length_dot",
        "mass.q_ddot -> spring.length_ddot",
        "spring.length_force -> mass.q_load",
    ]


def test_points_connect_axis_by_axis_both_ways(system: System, fmu: FmuPaths) -> None:
    upper, lower = system.add("upper", fmu("Points")), system.add("lower", fmu("Points"))
    system.connect(upper["bob"], lower["pivot"])
    assert _joined(system) == [
        f"{source} -> {target}"
        for axis in "xz"
        for source, target in [
            *((f"upper.bob_{axis}{dots}", f"lower.pivot_{axis}{dots}") for dots in ("", "_dot", "_ddot")),
            (f"lower.pivot_{axis}_force", f"upper.bob_{axis}_load"),
        ]
    ]


def test_suffix_stands_before_the_index(system: System, fmu: FmuPaths) -> None:
    points = system.add("points", fmu("Points"))
    assert [end.name for end in points["theta[3]"].triple() or ()] == ["theta[3]", "theta_dot[3]", "theta_ddot[3]"]


def test_single_variables(system: System, cubic: Part, probe: Part, spring: Part) -> None:
    system.connect(cubic["y"], probe["u"])
    system.connect(probe["echo"], spring["length_dot"])
    assert _joined(system) == ["cubic.y -> probe.u", "probe.echo -> spring.length_dot"]


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        (("spring", "seen"), ("mass", "q_force"), ["spring.seen [m]", "mass.q_force [N]", "different kinds"]),
        (("spring", "seen"), ("faulty", "u"), ["spring.seen [m]", "faulty.u [mm]", "factor 1000"]),
        (
            ("spring", "seen"),
            ("mass", "q"),
            ["spring.seen (output)", "mass.q (output)", "an output, the other an input"],
        ),
        (("spring", "seen"), ("mass", "mass"), ["mass.mass (parameter)", "set where its component is added"]),
        (("probe", "count"), ("mass", "q_force"), ["probe.count is Integer", "mass.q_force"]),
        (("faulty", "hidden"), ("probe", "u"), ["faulty.hidden (local)", "probe.u (input)"]),
    ],
)
def test_what_does_not_fit_is_said_with_both_ends(
    system: System, fmu: FmuPaths, one: tuple[str, str], other: tuple[str, str], words: list[str]
) -> None:
    parts = {name: system.add(name, fmu(name.capitalize())) for name in ("spring", "mass", "probe", "faulty")}
    with pytest.raises(ConnectError) as caught:
        system.connect(parts[one[0]][one[1]], parts[other[0]][other[1]])
    assert all(word in str(caught.value) for word in words)
    assert _joined(system) == []


def test_unknown_variable_is_answered_with_the_nearest(spring: Part) -> None:
    with pytest.raises(ConnectError, match=r"Spring\.fmu has no variable 'lenght'; did you mean 'length'"):
        spring["lenght"]


def test_unknown_variable_is_answered_with_the_nearest_point(system: System, fmu: FmuPaths) -> None:
    points = system.add("points", fmu("Points"))
    with pytest.raises(ConnectError, match=r"Points\.fmu has no variable 'bobb'; did you mean 'bob'\?"):
        points["bobb"]


def test_input_has_one_source_and_nothing_is_connected_by_halves(
    system: System, cubic: Part, probe: Part, spring: Part
) -> None:
    system.connect(probe["echo"], spring["length_ddot"])
    with pytest.raises(ConnectError, match=r"cubic\.y_ddot .* spring\.length_ddot: probe\.echo feeds it already"):
        system.connect(cubic["y"], spring["length"])
    assert _joined(system) == ["probe.echo -> spring.length_ddot"]


def test_end_of_another_system_is_refused(system: System, spring: Part, fmu: FmuPaths) -> None:
    stranger = System("other").add("spring", fmu("Spring"))
    with pytest.raises(ConnectError, match=r"spring\.seen is no component of test"):
        system.connect(stranger["seen"], spring["length"])


def test_points_with_different_axes_are_refused(system: System, fmu: FmuPaths, cubic: Part) -> None:
    points = system.add("points", fmu("Points"))
    with pytest.raises(ConnectError, match=r"points\.bob has the port components x, z, cubic\.y has none"):
        connect(points["bob"], cubic["y"])


@pytest.mark.parametrize("name", ["", "a.b"])
def test_component_names_that_will_not_do(system: System, fmu: FmuPaths, name: str) -> None:
    with pytest.raises(SimulationError, match="must not be empty or have a dot"):
        system.add(name, fmu("Cubic"))


@pytest.mark.usefixtures("cubic")
def test_component_name_is_taken_once(system: System, fmu: FmuPaths) -> None:
    with pytest.raises(SimulationError, match="already"):
        system.add("cubic", fmu("Cubic"))


@pytest.mark.parametrize(
    ("starts", "words"),
    [
        ({"limt": 1.0}, "no variable 'limt'; did you mean 'limit'"),
        ({"x": 1.0}, r"faulty\.x = 1\.0: causality 'output'"),
        ({"hidden": 1.0}, r"faulty\.hidden = 1\.0: causality 'local'"),
        ({"limit": float("nan")}, r"faulty\.limit = nan: expected a finite number"),
        ({"limit": "high"}, r"faulty\.limit = 'high': expected a number, got str"),
        ({"limit": True}, r"faulty\.limit = True: expected a number, got bool"),
        ({"status": 2.5}, r"faulty\.status = 2\.5: expected an integer, got float"),
        ({"flag": 1}, r"faulty\.flag = 1: expected True or False, got int"),
        ({"label": 1}, r"faulty\.label = 1: expected a string, got int"),
    ],
)
def test_start_values_that_will_not_do(system: System, fmu: FmuPaths, starts: dict[str, float], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        system.add("faulty", fmu("Faulty"), **starts)
