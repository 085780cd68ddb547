"""``liaisons check``, on our FMUs and on those of another tool."""

import re
import shutil
import subprocess
from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from pythonfmu.builder import FmuBuilder

from liaisons.check.invariants import _relative_difference
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import Oscillator
from liaisons.results import Result

from .conftest import Cli, Runs

DECAY = '''\
from pythonfmu import DefaultExperiment, Fmi2Causality, Fmi2Slave, Real


class NAME(Fmi2Slave):
    """x' = -x by the explicit Euler method, one step a communication step."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x = 1.0
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=1.0, step_size=0.5)

    def do_step(self, current_time, step_size):
        self.x STEP
        return True
'''


def verdicts(out: str) -> dict[str, str]:
    """Claim -> verdict, by the first words of the claim."""
    rows = [line.split() for line in out.splitlines() if line.endswith(("pass", "FAIL"))]
    return {" ".join(row[:2]): row[-1] for row in rows}


@pytest.mark.parametrize("name", ["Oscillator", "Sinusoid"])
@pytest.mark.parametrize("backend", ["native", "fmi3", "python"])
def test_our_fmus_hold(runs: Runs, tmp_path: Path, name: str, backend: str) -> None:
    fmi3 = ("native", "--fmi", "3") if backend == "fmi3" else (backend,)
    runs("build", name, "--backend", *fmi3)
    claims = ["fmpy's validator", "no prescribed", "all signals", "communication steps", "energy =", "a step"]
    claims.append("results as")
    absent = {"no prescribed", "energy ="} if name == "Sinusoid" else set()
    found = verdicts(runs("check", next(tmp_path.rglob("*.fmu"))))
    assert found == {claim: "pass" for claim in claims if claim not in absent}


@pytest.mark.parametrize(
    ("name", "step", "failing"),
    [  # two names, for a Python process imports a module of one name once
        ("Euler", "*= 1 - step_size", {"fmpy's validator": "1", "communication steps": f"{0.75**4 - 0.5**2:.2g}"}),
        ("Broken", "= float('nan')", {"fmpy's validator": "1", "communication steps": "nan", "all signals": "4"}),
    ],
)
def test_what_does_not_hold_is_named(
    liaisons: Cli, tmp_path: Path, name: str, step: str, failing: dict[str, str]
) -> None:
    """An FMU straight from pythonfmu: its model description lacks InitialUnknowns, its result depends on the step."""
    (tmp_path / f"{name.lower()}.py").write_text(DECAY.replace("NAME", name).replace("STEP", step))
    FmuBuilder.build_FMU(tmp_path / f"{name.lower()}.py", dest=tmp_path)
    reply = liaisons("check", f"{name}.fmu")
    found = verdicts(reply.out)
    assert reply.status == 1
    assert "InitialUnknowns" in reply.out
    assert {claim for claim, word in found.items() if word == "FAIL"} == failing.keys()
    errors = {" ".join(words[:2]): words[-3] for line in reply.out.splitlines() if len(words := line.split()) > 4}
    assert failing.items() <= errors.items()
    assert "communication steps of 0.5 and 0.25 s" in reply.out


def test_default_experiment_that_cannot_be_simulated_is_named(liaisons: Cli, tmp_path: Path) -> None:
    """The schema lets a step of 0 pass; so did FMUs of ours."""
    with ZipFile(build(assemble(Oscillator), tmp_path / "built")) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    description = members["modelDescription.xml"]
    members["modelDescription.xml"] = re.sub(rb' stepSize="[^"]*"', b' stepSize="0.0"', description)
    assert members["modelDescription.xml"] != description
    with ZipFile(tmp_path / "Still.fmu", "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    reply = liaisons("check", "Still.fmu")
    assert reply.status == 1
    assert "DefaultExperiment: stepSize = 0: it must be a number > 0" in reply.out
    assert {claim for claim, word in verdicts(reply.out).items() if word == "FAIL"} == {"fmpy's validator"}


@pytest.mark.parametrize("counting", [0, 1])
def test_outputs_of_every_type(liaisons: Cli, tmp_path: Path, counting: int) -> None:
    """As the Reference-FMUs' Feedthrough; or with a text that counts steps, and so depends on their size."""
    here = Path(__file__).parent
    compiler, library = shutil.which("cc"), tmp_path / f"Feedthrough{fmpy.sharedLibraryExtension}"
    if compiler is None:
        pytest.skip("no C compiler")
    options = ["-shared", "-fPIC", f"-DCOUNTING={counting}", f"-I{Path(fmpy.__file__).parent / 'c-code'}"]
    subprocess.run([compiler, *options, here / "feedthrough.c", "-o", library], check=True)
    with ZipFile(tmp_path / "Feedthrough.fmu", "w") as archive:
        archive.write(here / "feedthrough.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{fmpy.platform_tuple}/{library.name}")
    reply = liaisons("check", "Feedthrough.fmu")
    assert reply.status == counting, reply.out + reply.err
    agree = "FAIL" if counting else "pass"
    assert verdicts(reply.out) == {"fmpy's validator": "pass", "all signals": "pass", "communication steps": agree}


def test_differences_are_relative_to_the_motion() -> None:
    """A signal that is 0 but for rounding, in a unit that no other has, differs by rounding."""
    time = np.linspace(0, 1, 5)

    def result(angle: np.ndarray) -> Result:
        return Result("r", time, ("x", "angle"), np.array([np.cos(time), angle]), {"x": "m", "angle": "rad"})

    assert _relative_difference(result(3e-33 * time), result(-3e-33 * time))[0] < 1e-15
    late = result(0.1 * time + 0.01 * (time == 0.5))
    difference, where = _relative_difference(result(0.1 * time), late)
    assert difference == pytest.approx(0.1)
    assert where == ", at worst angle at t = 0.5 s"
