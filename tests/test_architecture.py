"""What the layout promises: arrows that point one way, short files, claims in docstrings, no heavy imports."""

import ast
import inspect
import pkgutil
import re
import subprocess
import sys
import tomllib
from collections import Counter
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import pytest

import liaisons
from liaisons.fmu.code import source_files
from liaisons.mechanics import assemble
from liaisons.models import Pendulum

ROOT = Path(__file__).resolve().parents[1]
PUBLIC: list[str] = vars(liaisons)["__all__"]
COMPONENTS = sorted((ROOT / "components/liaisons_catalogue").glob("[!_]*.py"))
SCENARIOS = sorted((ROOT / "scenarios").glob("[!_]*.py"))


def python(code: str) -> str:
    """Standard output of a fresh interpreter."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("line", ["from liaisons import System, simulate, verdict", "import liaisons_tools.scenarios"])
def test_simulating_imports_neither_symbols_nor_diagrams(line: str) -> None:
    assert python(f"import sys; {line}; print({{'casadi', 'matplotlib'}} & set(sys.modules))") == "set()\n"


def test_import_alone_is_light() -> None:
    assert python("import sys, liaisons; print({'numpy', 'casadi', 'fmpy'} & set(sys.modules))") == "set()\n"


EXTENSIONS = (
    *("chains", "closed_forms", "composition", "contacts", "coupling_estimate", "impacts", "isolation"),
    *("linearization", "linkages", "model_exchange", "python_fmu", "reference_results", "sampled_functions"),
    "typed_formulas",
)


def test_the_kernel_derives_without_extensions() -> None:
    """A mechanism and its C need none; what was imported from the language before is still there, by its old name."""
    loaded = f"{{f'liaisons.{{name}}' for name in {EXTENSIONS}}} & set(sys.modules)"
    code = f"""
import sys
import liaisons.language as language
from liaisons.fmu.code import source_files
from liaisons.mechanics import assemble

class Mass(language.Mechanism):
    mass = language.Parameter(1.0, "kg", "mass", above=0)
    x = language.Coordinate("m", "position")

    def kinetic_energy(self):
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self):
        return 0 * self.x

source_files(assemble(Mass), "")
print({loaded})

class Rod(language.Linkage):
    rod = language.Body(1.0, 1.0, (0, 0, 1))
    hinge = language.Revolute(language.ground, rod, axis="y", limits=(-1, 1))

model = assemble(Rod)
print(len(model.contacts), sorted({loaded}))
"""
    assert python(code) == "set()\n2 ['liaisons.contacts', 'liaisons.linkages']\n"


def test_every_public_name_is_there() -> None:
    assert {name for name in PUBLIC if getattr(liaisons, name, None) is None} == set()
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = liaisons.no_such_name  # type: ignore[attr-defined]


def test_what_one_begins_with_fits_on_a_screen() -> None:
    """The other public names are in the groups that ``dir`` shows, types of what functions return, or commands."""
    shown = dir(liaisons)
    assert len(shown) <= 40
    assert set(shown) <= set(PUBLIC)
    groups = [module for name in shown if inspect.ismodule(module := getattr(liaisons, name))]
    grouped = {name for module in groups for name in getattr(module, "__all__", dir(module))}
    returned = {"Controller", "DisplayedEquations", "Examination", "LivePage", "Observer", "Plan"}
    commands = {"check_component", "check_fmu"}
    assert set(PUBLIC) - {*shown} - grouped == {"__date__", "formulas", "live", *returned, *commands}
    for name in ("declarations", "joints", "shapes", "signals"):
        module = getattr(liaisons, name)
        assert all(getattr(liaisons, item) is getattr(module, item) for item in module.__all__)


def test_layers() -> None:
    done = subprocess.run(
        [Path(sys.executable).parent / "lint-imports", "--no-cache"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_dataclasses_are_frozen() -> None:
    """But for these, to which their makers add."""
    changing = {"_Node", "_Elements", "Section", "Drawing", "_Link", "_Piece"}
    for path in (ROOT / "components").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and node.name not in changing:
                decorators = [ast.unparse(decorator) for decorator in node.decorator_list]
                assert all("frozen=True" in text for text in decorators if text.startswith("dataclass")), node.name


def test_one_constant_has_one_docstring() -> None:
    """Only the numbers of one enumeration share theirs."""
    for path in (ROOT / "components").rglob("*.py"):
        body = ast.parse(path.read_text(encoding="utf-8")).body
        for node, following in pairwise(body):
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Tuple):
                documented = isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant)
                assert not documented or ast.unparse(node.value).startswith("range("), f"{path}:{node.lineno}"


def test_one_name_is_one_thing() -> None:
    """No class is called like another one, no module like what its package exports."""
    package, defined = ROOT / "components", Counter[str]()
    for path in package.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        defined.update(n.name for n in tree.body if isinstance(n, ast.ClassDef) and not n.name.startswith("_"))
        if path.name == "__init__.py":
            exported = {a.name for n in tree.body if isinstance(n, ast.ImportFrom) for a in n.names}
            assert not exported & {module.stem for module in path.parent.glob("*.py")}, path
    twice = {name for name, count in defined.items() if count > 1}
    # What users call a system takes components, too; the runtime inside Python FMUs is a world of its own.
    assert twice <= {"System", "Call"}


def test_the_map_for_newcomers_names_what_is_there() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("## The map")[2].partition("\n## ")[0]
    stations = [str(station) for last in (12, 5, 12) for station in range(1, last + 1)]
    assert re.findall(r"^(\d+)\. ", text, re.MULTILINE) == stations

    names = re.findall(r"`((?:[a-z_]+\.)+[A-Za-z_.]+)`", text)
    for name in names:
        assert name.endswith((".c", ".h", ".py")) or pkgutil.resolve_name(f"liaisons.{name}"), name

    pendulum = assemble(Pendulum)
    sources = source_files(pendulum, "{}", "2") | source_files(pendulum, "{}", "3")
    functions = re.findall(r"`(\w+)`\s+(?:in|of)\s+`(\w+\.c)`", text)
    assert len(functions) == 7
    for function, file in functions:
        assert re.search(rf"^\w.*\b{function}\(", sources[file].decode(), re.MULTILINE), f"{function} in {file}"

    (block,) = re.findall(r"```\n(.*?)```", text, re.DOTALL)
    storeys = [set(line.partition("  ")[0].split()) for line in block.splitlines()]
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    full = [layer.split(" | ") for contract in contracts for layer in contract.get("layers", ())]
    layers = [{name.partition(".")[2] for name in layer} for layer in full]
    order = [number for storey in storeys for number, layer in enumerate(layers) if storey <= layer]
    assert len(order) == len(storeys)
    assert order == sorted(order)
    assert {*rooms()} - {*older_names()} == {name for layer in full for name in layer}


def rooms() -> set[str]:
    """Packages and modules of the kernel and of the wings, by their whole names."""
    folders = [path for path in (ROOT / "components").iterdir() if (path / "__init__.py").exists()]
    inside = {path for folder in folders for path in (*folder.glob("*/__init__.py"), *folder.glob("[!_]*.py"))}
    names = {path.parent if path.stem == "__init__" else path.with_suffix("") for path in inside}
    return {f"{path.parent.name}.{path.name}" for path in names if path.parent.name != "liaisons_catalogue"}


def older_names() -> dict[str, str]:
    """The table of components/README.md: older name of a room -> its name."""
    text = (ROOT / "components/README.md").read_text(encoding="utf-8").partition("## Older names")[2]
    return dict(re.findall(r"^\| `(liaisons\.\w+)` \| `([\w.]+)` \|$", text, re.MULTILINE))


def test_rooms_of_wings_have_their_older_names() -> None:
    """A module by its older name is the module, not a copy."""
    assert len(older_names()) >= 17
    for old, new in older_names().items():
        text = (ROOT / "components" / old.replace(".", "/") / "__init__.py").read_text(encoding="utf-8")
        assert f"``{new}``" in text
        assert "rename(__name__, " in text
    assert import_module("liaisons.planning.plans") is import_module("liaisons_motion.planning.plans")
    assert import_module("liaisons.planning").plan is import_module("liaisons_motion.planning").plan


def test_a_room_is_entered_by_its_door() -> None:
    """Each room of the kernel and of the wings has a contract in tests/walls.toml, without exceptions."""
    walls = tomllib.loads((ROOT / "tests/walls.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    packages = {room for room in rooms() if (ROOT / "components" / room.replace(".", "/")).is_dir()}
    protected = {module.removesuffix(".*") for contract in walls for module in contract["protected_modules"]}
    assert packages - {*older_names()} - {"liaisons.base"} <= protected
    assert not any("ignore_imports" in contract for contract in walls)
    done = subprocess.run(
        [Path(sys.executable).parent / "lint-imports", "--no-cache", "tests/walls.toml"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.variants(core=0)
def test_who_sends_an_interrupt_makes_sure_that_it_arrives() -> None:
    """The suite is started in the background of a shell, too, which has it ignore interrupts."""
    functions = [
        node
        for path in sorted((ROOT / "tests").rglob("test_*.py"))
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef)
    ]
    sending = [node for node in functions if any(getattr(part, "attr", "") == "SIGINT" for part in ast.walk(node))]
    assert sending
    assert [node.name for node in sending if "interruptible" not in ast.unparse(node)] == []


@pytest.mark.variants(quick=None)
@pytest.mark.parametrize("path", COMPONENTS, ids=lambda path: path.stem)
def test_a_component_is_one_short_file(path: Path) -> None:
    # A screen or two; what solves its equations and is longer has its place in solutions/.
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 100


@pytest.mark.variants(quick=None)
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_a_scenario_states_its_claim_and_uses_the_public_api(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 90
    tree = ast.parse(text)
    documentation = ast.get_docstring(tree)
    assert documentation
    assert documentation.split("\n\n")[0].rstrip().endswith(".")
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module}
    assert {m for m in modules if m.partition(".")[0] == "liaisons"} <= {
        "liaisons",
        *(f"liaisons.{group}" for group in ("declarations", "joints", "shapes", "signals")),
        "liaisons.models",
        "liaisons.scenarios",
    }
    assert "casadi" not in modules


@pytest.mark.parametrize("room", ["cli", "scenarios", "modelica_text", "formulas"])
def test_a_room_outside_takes_few_names_of_the_kernel_by_its_doors(room: str) -> None:
    """Beside ``from liaisons import ...`` and declarations; what is missing there is to be added there."""
    kernel = {
        "algebra",
        "check",
        "cosim",
        "expressions",
        "fmu",
        "fmu_files",
        "interface",
        "library",
        "mechanics",
        "results",
    }
    taken = {
        (node.module or "", alias.name)
        for path in (Path(liaisons.__file__).parent / room).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[1:2]
        for alias in node.names
    }
    from_kernel = {(module, name) for module, name in taken if module.split(".")[1] in kernel}
    inside = {name for module, name in taken if module.count(".") > 1 and module.split(".")[1] not in {room, "base"}}
    assert (inside, from_kernel if len(from_kernel) > 12 else set()) == (set(), set())
