"""Robots' files on the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from liaisons import Result
from liaisons.library import components

from .conftest import Cli, Runs, is_misuse

ROBOTS = Path(__file__).parents[2] / "kernel/language" / "robots"


@pytest.mark.parametrize("name", ["ur5.urdf", "panda.xml"])
@pytest.mark.variants(core=0)
def test_build_and_simulate_take_a_robots_file(liaisons: Cli, name: str, tmp_path: Path) -> None:
    joints = {"ur5.urdf": "shoulder_pan,elbow", "panda.xml": "joint1,joint4"}[name]
    first = joints.partition(",")[0]
    built = liaisons("build", ROBOTS / name, "--prescribe", joints)
    assert built.status == 0, built.err
    assert Path(built.out.strip()) == Path("fmus", f"{Path(name).stem}.fmu")
    assert "left out: " in built.err
    words = ("--prescribe", joints, "--input", f"{first}=0.1*sin(t)", "--stop", "0.1", "--step", "0.01")
    simulated = liaisons("simulate", ROBOTS / name, *words, "--record", f"{first}_force,energy_balance")
    assert simulated.status == 0, simulated.err
    assert f"{first}_force" in simulated.out
    assert list(tmp_path.rglob("*.fmu")) == [tmp_path / "fmus" / f"{Path(name).stem}.fmu"]


@pytest.mark.variants(core=0)
def test_equations_and_show_take_a_robots_file(runs: Runs, tmp_path: Path) -> None:
    leg = ROBOTS / "a1_leg.urdf"
    free, shown = runs("equations", leg), runs("equations", leg, "--prescribe", "FL_hip_joint,FL_thigh_joint")
    assert "Power of the operators" in shown
    assert "Power of the operators" not in free
    assert shown == runs("equations", f"{leg}:FL_hip_joint,FL_thigh_joint")
    arm = ROBOTS / "ur5.urdf"
    runs("show", arm, "--prescribe", "elbow", "--input", "elbow=0.1*t", "--no-open", "--output", "arm.html")
    assert "shoulder_lift" in (tmp_path / "arm.html").read_text(encoding="utf-8")


SLIDER = """<robot name="Slider">
<link name="rail"/>
<link name="block"><inertial><mass value="2"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="rail"/><child link="block"/>
  <axis xyz="0 0 1"/><limit lower="-0.5" upper="0.5"/></joint>
</robot>"""


@pytest.mark.variants(core=0)
def test_limits_of_a_robots_joints_become_stops(runs: Runs, tmp_path: Path) -> None:
    """A block falls onto the lower limit of its rail, and without it beyond."""
    file = tmp_path / "slider.urdf"
    file.write_text(SLIDER)
    words = ("--stop", "1", "--step", "0.01", "--csv", "fall.csv", "--limits")
    ends = []
    for options in (words, words[:-1]):
        runs("simulate", file, *options)
        ends.append(Result.from_csv(tmp_path / "fall.csv")["slide"][-1])
    assert ends == pytest.approx([-0.5, -9.81 / 2], abs=1e-7)
    assert "slide_above" in runs("equations", file, "--limits")
    runs("show", file, "--limits", "--no-open", "--output", "slider.html")
    assert "slide_above" in (tmp_path / "slider.html").read_text(encoding="utf-8")
    assert "slide_above" in vars(*components(f"{file}:limits"))
    assert "slide_above" not in vars(*components(f"{file}:slide"))


def test_inertia_is_balanced_if_requested(liaisons: Cli, tmp_path: Path) -> None:
    inertia = '<mass value="2"/><inertia ixx="1" iyy="1" izz="4"/>'
    (tmp_path / "odd.urdf").write_text(SLIDER.replace('<mass value="2"/>', inertia))
    refused = liaisons("equations", "odd.urdf")
    assert is_misuse(refused, "odd.urdf: line 3: Slider.block: inertia = ", "or --balance-inertia takes their mean")
    balanced = liaisons("equations", "odd.urdf", "--balance-inertia")
    assert balanced.status == 0, balanced.err
    assert "left out: inertia of link 'block' as printed: its principal moments are balanced" in balanced.err
    both: Any = components(f"{tmp_path / 'odd.urdf'}:slide:limits:balance-inertia")[0]
    assert (both.slide.maximum, both.block_inertia_zz.start) == (0.5, 2)


def test_a_root_moves_freely_and_a_medium_is_left_out_if_requested(liaisons: Cli, tmp_path: Path) -> None:
    (tmp_path / "slider.urdf").write_text(
        SLIDER.replace(
            'name="rail"/>',
            'name="rail"><inertial><mass value="3"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>',
        )
    )
    floating = liaisons("equations", "slider.urdf", "--floating-base")
    assert floating.status == 0, floating.err
    assert "m_rail" in floating.out
    both: Any = components(f"{tmp_path / 'slider.urdf'}:slide:floating-base")[0]
    assert [s.name for s in both.actives] == ["slide"]
    assert "floating_base_x" in [q.name for q in both.coordinates]
    world = '<worldbody><body><joint name="j"/><geom size="1"/></body></worldbody>'
    (tmp_path / "swim.xml").write_text(f'<mujoco><option density="9" viscosity="1"/>{world}</mujoco>')
    refused = liaisons("equations", "swim.xml", "--leave-out", "density")
    assert is_misuse(refused, "swim.xml: line 1: <option>: viscosity = 1: ", "--leave-out viscosity")
    listed = liaisons("equations", "swim.xml", "--leave-out", "density, viscosity")
    assert listed.status == 0, listed.err
    assert "left out: viscosity of <option>, on request" in listed.err
    assert is_misuse(liaisons("equations", "swim.xml", "--floating-base"), "floating-base is for URDF files")
    assert is_misuse(liaisons("equations", "Pendulum", "--leave-out", "density"), "are of a robot's file")


def test_misuse(liaisons: Cli) -> None:
    assert is_misuse(liaisons("build", ROBOTS / "ur5.urdf", "--prescribe", "elbo"), "did you mean 'elbow'")
    assert is_misuse(
        liaisons("build", "Pendulum", "--prescribe", "theta"), "--prescribe and --limits are of a robot's file"
    )
    assert is_misuse(liaisons("simulate", "Pendulum", "--limits"), "--limits are of a robot's file")
    assert is_misuse(liaisons("equations", "no.urdf"), "no.urdf")
    assert is_misuse(liaisons("simulate", "no.xml"), "no.xml")
