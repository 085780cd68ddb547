"""Python FMU: a component through pythonfmu, stepped by CasADi functions at run time.

Contents of the archive beside modelDescription.xml and documentation::

    binaries/linux64/NAME.so, binaries/win64/NAME.dll     pythonfmu's wrapper around a Python interpreter
    resources/slavemodule.txt, resources/liaisons_slave_*.py    what the wrapper imports
    resources/liaisons_runtime_*/                         our slave (python_runtime), without liaisons
    resources/component.json                              variables and serialized CasADi functions
    resources/requirements.txt                            what the host's Python has to have
    resources/pythonfmu/                                  pythonfmu itself, with its licence

The host needs Python with numpy and casadi.  Inside a Python process the wrapper uses that interpreter; any other
host has to load a Python that has them beforehand (Linux: ``LD_PRELOAD=libpython3.11.so``, and ``PYTHONPATH`` with
the packages).  pythonfmu 0.7.0 brings binaries for Linux and Windows on x86_64, knows no directional derivatives and
no derivatives of inputs, and its wrapper passes on no message unless the importer switches logging on.
"""

from __future__ import annotations

import hashlib
import json
from importlib import metadata, resources
from pathlib import Path

from liaisons.fmu import extra_members, first_reference, jump_effects, memory_index, model_description, start_rates
from liaisons.mechanics import Model
from liaisons.python_fmu.python_functions import allowed_range, initial_numbers, slave_functions

_DEPENDENCIES = b"""\
Python 3.11 or later with the packages of resources/requirements.txt.  Inside a Python process that interpreter is used;
another host loads one beforehand, on Linux: LD_PRELOAD=libpython3.11.so, and PYTHONPATH with the packages.
"""
_LIMIT = "it is taken as the limit of an ever faster motion"
_PROJECTED = "the state is put back onto the constraints"
_BINARY_SUFFIXES = (".so", ".dll", ".dylib")

# The module that pythonfmu's wrapper imports once and executes at each instantiation.  The wrapper (0.7.0) releases
# the module's dictionary each time without owning it; unless something holds on to it, it is gone after a few.
_MODULE = """\
from {package}.slave import Slave, held

held.append(globals())
"""


def python_members(model: Model, guid: str) -> dict[str, bytes]:
    """All members of the Python FMU of a model, by path; the same bytes for the same arguments."""
    members = {
        "modelDescription.xml": model_description(model, guid=guid, backend="python"),
        "documentation/externalDependencies.txt": _DEPENDENCIES,
        **extra_members(model, "2"),
        "resources/component.json": _component_table(model, guid),
    }
    return members | _runtime_members() | _pythonfmu_members(model.name)


def _component_table(model: Model, guid: str) -> bytes:
    """JSON table that ``python_runtime.component`` reads."""
    names = [variable.name for variable in model.inputs]
    active = [[names.index(name) for name in (s.value, s.rate, s.acceleration)] for s in model.active]
    settable, first = model.parameters + model.inputs, first_reference(model) + len(model.parameters)
    document = {
        "guid": guid,
        "names": [item.name for item in (*model.dimensions, *model.variables)] + ["input_reconstruction"],
        "first": first_reference(model),
        "sizes": [size.count for size in model.dimensions],
        "domains": [(*allowed_range(variable), variable.domain() or "finite") for variable in settable],
        "fixed": [variable.variability == "fixed" for variable in settable],
        "impulses": [first + i for i, variable in enumerate(model.inputs) if variable.variability == "discrete"],
        "never_0": [first + value for value, _, _ in active if not model.inputs[value].allows(0.0)],
        "active": [
            [*numbers, memory_index(model, f"{s.value}_derived")]
            for numbers, s in zip(active, model.active, strict=True)
        ],
        "warnings": _prescribed_motion_warnings(model),
        "start_rates": start_rates(model),
        "condition_texts": model.condition_texts,
        "reaches": [(reach.text, reach.prescribed) for reach in model.reaches],
        "lasting": len(model.condition_texts) - model.start_only,
        "numbers": initial_numbers(model),
        "functions": {name: f.serialize() for name, f in slave_functions(model, active).items()},
    }
    return json.dumps(document, indent=1, allow_nan=False).encode()


def _prescribed_motion_warnings(model: Model) -> list[tuple[int, list[str]]]:
    """Return, for each prescribed coordinate, the memory index of its mismatch and texts of warnings.

    They are of a contradiction of value and rates, of a jump, of a missing acceleration, and of missing rates.
    """
    effects = jump_effects(model)
    stay = "coordinates and momenta stay as they are" if model.project is None else _PROJECTED
    warnings = []
    for s, limited in zip(model.active, effects.move_states & effects.have_limit, strict=True):
        contradiction = (
            f"{s.value}, {s.rate} and {s.acceleration} contradict each other: at t = {{t:.9g}}, after a step, "
            f"{s.value} is off by {{mismatch:.6g}} from what they said"
        )
        jump = (
            f"{s.value} jumps by {{mismatch:.6g}} at t = {{t:.9g}}, of which {s.rate} and {s.acceleration} "
            f"say nothing: {_LIMIT if limited else stay}"
        )
        missing = (
            f"{what} while {moves} changes, at t = {{t:.9g}}: from now on derived from what {moves} has at "
            "communication points; set what is missing, or input_reconstruction = 0 (hold)"
            for what, moves in (
                (f"{s.acceleration} stays 0", s.rate),
                (f"{s.rate} and {s.acceleration} stay 0", s.value),
            )
        )
        warnings.append((memory_index(model, f"{s.value}_mismatch"), [contradiction, jump, *missing]))
    return warnings


def _runtime_members() -> dict[str, bytes]:
    """Files of our slave, by path; a hash in their names keeps FMUs of several versions apart."""
    folder = resources.files("liaisons.python_fmu") / "python_runtime"
    sources = {item.name: item.read_bytes() for item in folder.iterdir() if item.name.endswith(".py")}
    version = hashlib.sha256(b"".join(sources[name] for name in sorted(sources))).hexdigest()[:12]
    package, module = f"liaisons_runtime_{version}", f"liaisons_slave_{version}"
    members = {f"resources/{package}/{name}": text for name, text in sources.items()}
    members[f"resources/{module}.py"] = _MODULE.format(package=package).encode()
    members["resources/slavemodule.txt"] = module.encode()
    members["resources/requirements.txt"] = b"casadi>=3.8\nnumpy>=2.0\n"  # for `pythonfmu deploy`
    return members


def _pythonfmu_members(identifier: str) -> dict[str, bytes]:
    """Files of pythonfmu by path: its package, and its binaries for all platforms."""
    import pythonfmu

    folder = Path(pythonfmu.__file__).parent
    members = {f"resources/pythonfmu/{path.name}": path.read_bytes() for path in folder.glob("*.py")}
    for path in (folder / "resources" / "binaries").rglob("*"):
        if path.suffix in _BINARY_SUFFIXES:
            members[f"binaries/{path.parent.name}/{identifier}{path.suffix}"] = path.read_bytes()
    for file in metadata.files("pythonfmu") or ():
        if file.name == "LICENSE":
            members["resources/pythonfmu/LICENSE"] = file.read_binary()
    return members
