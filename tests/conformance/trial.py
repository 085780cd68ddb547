"""What it takes to put an FMU through a program in C: the program, the FMU's library, and a plan of what it has."""

from __future__ import annotations

import hashlib
import subprocess
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import fmpy
import numpy as np
import pytest
from fmpy.model_description import ModelDescription, ModelVariable
from numpy.typing import NDArray

from liaisons.base import compiler
from liaisons.models import CATALOGUE

Version = Literal["2", "3"]  # of FMI

COMPONENTS = {component.__name__: component for component in CATALOGUE}
VERSIONS: tuple[Version, ...] = get_args(Version)
SOURCES = Path(__file__).parent
HEADERS = Path(fmpy.__file__).parent / "c-code"
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror")

every_version = pytest.mark.parametrize("version", VERSIONS, ids=[f"fmi{v}" for v in VERSIONS])
every_component = pytest.mark.parametrize("name", COMPONENTS)
# Free and driven, constrained, rotating with quaternions, with events, and without any state.
some_components = pytest.mark.parametrize(
    "name", ["Pendulum", "CartesianPendulum", "SpatialCat", "SwingPump", "SmoothStep"]
)


@dataclass(frozen=True, slots=True)
class Trial:
    """An FMU that is unpacked."""

    description: ModelDescription
    folder: Path
    library: Path
    plan: Path

    @property
    def step(self) -> float:
        """The communication step of the trials [s]."""
        return step_size(self.description)


def unpack(fmu: Path, folder: Path, platform: tuple[str, str] | None = None) -> Trial:
    """Unpack an FMU and write its plan; platform: folder in ``binaries`` and extension, else those of this machine."""
    description = fmpy.read_model_description(str(fmu), validate=False)
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    host = fmpy.platform if major_version(description) == "2" else fmpy.platform_tuple
    directory, extension = platform or (host, fmpy.sharedLibraryExtension)
    plan = folder / "plan"
    plan.write_text(plan_text(description))
    return Trial(description, folder, folder / "binaries" / directory / f"{description.modelName}{extension}", plan)


# ---- what the FMU has --------------------------------------------------------------------------------------------


def plan_text(description: ModelDescription) -> str:
    """The words that ``read_plan`` in fmu.c reads."""
    token = description.guid or description.instantiationToken
    states = sum(elements(unknown.variable) for unknown in description.derivatives if unknown.variable)
    groups = [group(title, reals(description, title)) for title in ("parameter", "input", "output")]
    groups.append(group("local", reals(description, "local", "calculatedParameter", "independent")))
    for title, types in (("integer", {"Integer", "Int32"}), ("size", {"UInt64"})):
        groups.append(group(title, [v for v in description.modelVariables if v.type in types and not calculated(v)]))
    for title, types in (("count", {"Integer", "Int32"}), ("truth", {"Boolean"})):
        groups.append(group(title, [v for v in description.modelVariables if v.type in types and calculated(v)]))
    indicators = sum(elements(unknown.variable) for unknown in description.eventIndicators if unknown.variable)
    numbers = f"{step_size(description)!r} {states} {indicators or description.numberOfEventIndicators}"
    head = f"{major_version(description)} {token} {numbers}"
    return "\n".join([head, *groups, *calls(major_version(description)), ""])


def calls(version: str) -> list[str]:
    """Where the standard allows each function, and where only we do, in model exchange and in co-simulation: bits."""
    bits = dict(zip("IZETSUC", (1, 2, 4, 8, 16, 64, 128), strict=True))
    lines = ["calls"]
    for name, (exchange, simulation) in standard_calls().items():
        places = (dict(zip("CIZETU", exchange, strict=True)), dict(zip("CIZSEgsU", simulation, strict=True)))
        masks = [
            sum(32 if kind and column == "E" else bits.get(column, 0) for column in row if row[column] == letter)
            for kind, row in enumerate(places)
            for letter in "xt"
        ]
        if name.startswith(f"fmi{version}"):
            lines.append(" ".join([name[4:], *map(str, masks)]))
    lines += [f"{name} 255 0 255 0" for name in ("GetTypesPlatform", "GetVersion", "FreeInstance")]
    return lines


def standard_calls() -> dict[str, tuple[str, str]]:
    """calls.txt: by function the letters of model exchange and of co-simulation."""
    types = (
        "Float32",
        "Float64",
        *(f"{u}Int{n}" for u in ("", "U") for n in (8, 16, 32, 64)),
        "Boolean",
        "String",
        "Binary",
    )
    found = {}
    for line in (SOURCES / "calls.txt").read_text().splitlines():
        if line.startswith("fmi"):
            name, *letters = line.split()
            for kind in types if "{Type}" in name else [""]:
                for way in ["Get", "Set"] if "{Way}" in name else [""]:
                    full = name.replace("{Type}", kind).replace("{Way}", way)
                    found[full] = ("".join(letters[:6]), "".join(letters[6:]))
    return found


def major_version(description: ModelDescription) -> str:
    """``"2"`` or ``"3"``."""
    return (description.fmiVersion or "")[:1]


def group(title: str, variables: Sequence[ModelVariable]) -> str:
    """Title, number of variables and of their elements, references and sizes, start values (0 if there are none)."""
    values = np.concatenate([start_values(variable) for variable in variables]) if variables else ()
    places = [f"{variable.valueReference} {elements(variable)}" for variable in variables]
    return " ".join([title, str(len(variables)), str(len(values)), *places, *(repr(float(v)) for v in values)])


def step_size(description: ModelDescription) -> float:
    """A communication step of whole microseconds; forty are some part of the default experiment [s]."""
    experiment = description.defaultExperiment
    return min(round(float((experiment and experiment.stopTime) or 1.0) / 40, 6), 0.05)


def reals(description: ModelDescription, *causalities: str) -> list[ModelVariable]:
    """The variables of type Real or Float64 with these causalities."""
    return [v for v in description.modelVariables if v.type in {"Real", "Float64"} and v.causality in causalities]


def calculated(variable: ModelVariable) -> bool:
    """Whether it is read only: the integers that are set are parameters, and structural sizes are constants."""
    return variable.causality == "output"


def elements(variable: ModelVariable) -> int:
    """1 of a scalar; of an array, how many."""
    return int(np.prod(variable.shape or ()))


def start_values(variable: ModelVariable) -> NDArray:
    """One value for each element."""
    return np.broadcast_to(np.array((variable.start or "0").split(), dtype=float), elements(variable))


# ---- programs ----------------------------------------------------------------------------------------------------


def compile_program(
    sources: Iterable[Path], output: Path, flags: Iterable[str] = (), cc: Sequence[str] | None = None
) -> Path:
    """Compile a C program of ours, without a warning."""
    cc = cc or compiler.system_compiler() or compiler.zig_compiler()
    assert cc is not None
    libraries = [] if output.suffix == ".exe" else ["-lm", "-ldl", "-lpthread"]
    run(*cc, *STRICT, "-O1", "-g", f"-I{HEADERS}", *flags, *sources, "-o", output, *libraries)
    return output


def compile_library(trial: Trial, name: str, flags: Sequence[str], cc: Sequence[str] | None = None) -> Path:
    """Compile the FMU's own sources anew, without a warning, with other flags; what all FMUs have alike, once."""
    cc = cc or compiler.system_compiler() or compiler.zig_compiler()
    assert cc is not None
    library, folder = trial.folder / f"{name}.so", trial.folder / "sources"
    contents = {path.name: path.read_bytes() for path in folder.glob("*.[ch]")}
    objects = trial.folder.parent / "objects"
    objects.mkdir(exist_ok=True)
    compiled = []
    for source in sorted(folder.glob("*.c")):
        content = repr((*cc, *flags, compiler._file_and_headers(source.name, contents)))
        compiled.append(objects / f"{hashlib.sha256(content.encode()).hexdigest()}.o")
        if not compiled[-1].exists():
            run(*cc, *STRICT, "-fPIC", *flags, "-c", source, "-o", compiled[-1])
    run(*cc, *STRICT, "-fPIC", "-shared", *flags, *compiled, "-o", library, "-lm")
    return library


def run(
    *command: str | Path,
    time_out: float = 300.0,
    environment: dict[str, str] | None = None,
    folder: Path | None = None,
) -> str:
    """What a program prints that ends well within this time [s]."""
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=time_out,
        env=environment,
        cwd=folder,
        check=False,
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def rows(printed: str) -> NDArray:
    """The numbers that host.c prints, bit by bit; shape (rows, outputs)."""
    lines = [line.split()[1:] for line in printed.splitlines()]
    return np.array([[int(word, 16) for word in line] for line in lines], dtype=np.uint64).view(np.float64)
