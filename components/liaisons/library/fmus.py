"""Components by their names, files or classes, and the FMUs that are built from them."""

from __future__ import annotations

import inspect
import os
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeGuard
from weakref import WeakKeyDictionary

from liaisons.base.archive import file_identity
from liaisons.base.arguments import check_integer, shown
from liaisons.base.compiler import Backend, BuildSettings, Fmi, Platforms
from liaisons.base.folders import fmus_directory
from liaisons.base.logs import logger
from liaisons.base.project import ProjectError, load_module
from liaisons.base.published import load_published_component, own_components, published_components, publishers
from liaisons.errors import LiaisonsError, suggestion
from liaisons.library.unchanged import is_unchanged, note_unchanged

if TYPE_CHECKING:
    from liaisons.language import Component
    from liaisons.mechanics import Equations, Model

Target: TypeAlias = "str | Path | type[Component]"
"""A component: its name in the catalogue or in an installed package (``"Pendulum"``), its file (``"my_component.py"``,
``"my_component.py:Name"``) or its class; a robot's file, with joints that an operator prescribes
(``"robot.urdf:shoulder,elbow"``, MJCF ``"robot.xml"``), with stops at the limits of its joints
(``"robot.urdf:limits"``, ``"robot.urdf:shoulder:limits"``), with balanced inertia (``"robot.urdf:balance-inertia"``),
with a root that moves freely (``"robot.urdf:floating-base"``), without what a linkage cannot
(``"robot.xml:leave-out=viscosity"``), in this order.  Where FMUs are taken, also the path of one."""

_built: dict[tuple[type[Component], str, Path], tuple[Path, tuple[int, ...]]] = {}
"""FMUs that are up to date in this process, and the status of these files."""
_files: WeakKeyDictionary[type[Component], Path] = WeakKeyDictionary()
"""The files that components were loaded from."""
_ROBOT = re.compile(
    r"(.*\.(?:urdf|xml))(?::(.*?))??(:limits)?(:balance-inertia)?(:floating-base)?(?::leave-out=(.*))?", re.IGNORECASE
)
_owners: dict[tuple[Path, str], str] = {}
"""Folder and name of an FMU -> origin of the component that this process has built into it."""


def catalogue() -> dict[str, type[Component]]:
    """Components of :mod:`liaisons.models` by name, operators last."""
    from liaisons.language import Operator

    all_of_them = [_published_component(name) for name in own_components()]
    return {c.__name__: c for c in sorted(all_of_them, key=lambda c: (issubclass(c, Operator), c.__name__))}


def catalogue_names() -> frozenset[str]:
    """Names of the catalogue's components, without an import."""
    return frozenset(own_components())


def component_names() -> list[str]:
    """Sorted names of the components in the catalogue and in packages, without an import."""
    return sorted({name for entries in published_components().values() for name in entries})


def is_named(name: object) -> bool:
    """Whether the catalogue or a package has a component of this name, without an import."""
    return bool(publishers(name))


def is_target(word: object) -> bool:
    """Whether a word names a component or an FMU: a name, a class, or the path of a source or an FMU."""
    name = str(word)
    return isinstance(word, type) or name.endswith(".fmu") or _is_source(name) or is_named(name)


def is_robot(word: str) -> bool:
    """Whether a word names a robot's file, URDF or MJCF."""
    return bool(_ROBOT.fullmatch(word))


def variables(target: str) -> list[tuple[str, str, str]]:
    """Name, causality and start value of each variable of a named component or an FMU; empty for other words."""
    from liaisons.fmu_files import read_description

    try:
        if is_named(target):
            every = (scalar for v in component(target)().layout().variables for scalar in v.elements())
            return [(v.name, v.causality, "" if v.start is None else f"{v.start:g}") for v in every]
        described = read_description(Path(target)).attributes
    except LiaisonsError:
        return []
    return [(name, v["causality"], v.get("start", "")) for name, v in described.items()]


def components(target: Target) -> list[type[Component]]:
    """All components that a name, file or class stands for.

    :param target: ``all`` are those of the catalogue, ``my_component.py`` those of a file.
    :raises ProjectError: for an unknown name, a file that cannot be loaded or has no component in it, or something
        else.
    """
    from liaisons.language import Component

    if isinstance(target, type):
        if not _is_concrete(target):
            reason = "is abstract" if issubclass(target, Component) else "is not a component"
            raise ProjectError(
                f"the class {target.__name__} {reason}; derive one from liaisons.Mechanism, Operator or Sampled"
            )
        return [target]
    if not isinstance(target, (str, os.PathLike)):
        raise ProjectError(
            _no_component_message(target, "is not a component; give its name ('Pendulum'), its file or its class")
        )
    robot = _ROBOT.fullmatch(str(target))
    return [_robot_component(*robot.groups(""))] if robot else _components_of_word(str(target))


def _components_of_word(target: str) -> list[type[Component]]:
    file, separator, name = target.rpartition(".py:")
    if not separator and not target.endswith(".py"):
        if target == "all":
            return list(catalogue().values())
        if target.endswith(".fmu"):
            raise ProjectError(f"{target} is not a component; give the file or class that this FMU was built from")
        if not is_named(target):
            raise ProjectError(f"no component is called {target!r}{suggestion(target, component_names())}")
        return [_published_component(target)]
    path = Path(f"{file}.py" if separator else target)
    module = load_module(path)
    defined = vars(module).items()  # without what it imports
    classes = {name: value for name, value in defined if _is_concrete(value) and value.__module__ == module.__name__}
    _files.update(dict.fromkeys(classes.values(), path.resolve()))
    if not classes:
        raise ProjectError(f"{path} defines no component; derive a class from liaisons.Mechanism, Operator or Sampled")
    if separator and name not in classes:
        raise ProjectError(f"{path} defines no component called {name!r}{suggestion(name, classes)}")
    return [classes[name]] if separator else list(classes.values())


def _catalogue_component(name: str) -> type[Component] | None:
    """The catalogue's component of this name, or None; no other one is imported."""
    return _published_component(name) if name in own_components() else None


def _published_component(name: str) -> type[Component]:
    label, value = load_published_component(name)
    if not _is_concrete(value) or value.__name__ != name.rpartition(":")[2]:
        raise ProjectError(f"{label} is {shown(value)}; publish a Mechanism or Operator by the name of its class")
    return value


def _robot_component(path: str, prescribe: str, *options: str) -> type[Component]:
    from liaisons import Linkage

    limits, balance, floating, leave_out = options
    more: Any = {"limits": bool(limits), "balance_inertia": bool(balance), "leave_out": _words(leave_out)}
    if path.lower().endswith(".urdf"):
        robot = Linkage.from_urdf(path, _words(prescribe), floating_base=bool(floating), **more)
    elif floating:
        raise ProjectError(f"{path}: floating-base is for URDF files; in MJCF a body of the world has a <freejoint>")
    else:
        robot = Linkage.from_mjcf(path, _words(prescribe), **more)
    _files[robot] = Path(path).resolve()
    return robot


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


def component(target: Target) -> type[Component]:
    """Component that a name, file or class stands for.

    :raises ProjectError: as :func:`components` does, or if a file has several.
    """
    classes = components(target)
    if len(classes) > 1:
        where = "" if target == "all" else f"{target}:"
        choices = ", ".join(f"{where}{component.__name__}" for component in classes)
        raise ProjectError(f"{target} defines several components; name one: {choices}")
    return classes[0]


def has_size(component: type[Component]) -> bool:
    """Whether a component has a structural size n."""
    from liaisons.language import Size

    return isinstance(getattr(component, "n", None), Size)


def model(component: type[Component], **sizes: object) -> Model:
    """Model of a component, with the declared structural size or another one.

    :raises ProjectError: if the component has no size of that name.
    :raises ComponentError: if it cannot be derived, or a size is not a whole number or too small.
    """
    from liaisons.mechanics import assemble

    if not sizes:
        return assemble(component)
    if not has_size(component) or set(sizes) != {"n"}:
        text = ", ".join(f"{name} = {size!r}" for name, size in sizes.items())
        raise ProjectError(f"{component.__name__}: {text}: only chains and arrays have a size, and it is called n")
    check_integer(f"{component.__name__}: n", sizes["n"], ProjectError)
    return assemble(component, sizes["n"])


def derive(target: Target) -> Equations:
    """Equations of motion of a mechanism as CasADi expressions; :func:`liaisons.equations` displays them.

    :param target: its name, file or class.
    :raises ProjectError: if it names no mechanism, or several.
    :raises ComponentError: if it cannot be derived.
    """
    from liaisons import mechanics
    from liaisons.language import Mechanism

    class_ = component(target)
    if not issubclass(class_, Mechanism):
        raise ProjectError(f"{class_.__name__} is not a Mechanism; equations({class_.__name__!r}) shows what it obeys")
    return mechanics.derive(class_)


def build(
    target: Target | Model,
    output: Path | str | None = None,
    *,
    backend: Backend = "auto",
    platforms: Platforms = "host",
    fmi: Fmi = "2",
    arrays: bool = True,
) -> Path:
    """Build the FMU of a component, unless the file is up to date.

    :param target: name, file or class of a component, or a model (``assemble(PendulumChain, 20)``).
    :param output: folder, ``fmus/`` unless given; in it the file is ``NAME.fmu``, of FMI 3.0 ``fmi3/NAME.fmu``,
        without arrays ``fmi3/scalars/NAME.fmu``, of the Python back end ``python/NAME.fmu``.
    :param backend: ``"native"``: generated C; ``"python"``: pythonfmu; ``"auto"``: native where there is a C compiler.
    :param platforms: binaries for this machine; ``"all"``: for Linux, Windows and macOS; ``"wasm"``: for this machine,
        and, experimental, a WebAssembly component (FMI 3.0). Both are of the native back end and need ziglang.
    :param fmi: ``"2"``: FMI 2.0; ``"3"``: FMI 3.0 (native back end).
    :param arrays: False: in FMI 3.0 the elements of arrays are variables, ``theta[1]``, as they are in FMI 2.0, for
        importers that do not know arrays.
    :returns: path of the FMU.
    :raises ProjectError: if the target names no component or several, or one whose FMU would take the place of
        another component's.
    :raises ComponentError: if it cannot be derived.
    :raises BuildError: if it cannot be compiled or written; then nothing is written.
    """
    from liaisons import fmu
    from liaisons.mechanics import Model

    folder = BuildSettings(output, backend=backend, platforms=platforms, fmi=fmi, arrays=arrays).folder
    if isinstance(target, Model):
        derived, shipped = target, _catalogue_component(target.name)
        if shipped is not None and inspect.getdoc(shipped) != derived.documentation:  # a model does not know its class
            _refuse_catalogue_name(derived.name, f"the model {derived.name}", folder.resolve())
    else:
        chosen = component(target)
        reserve_fmu(chosen, folder)
        derived = model(chosen)
    return fmu.build(derived, output, backend=backend, platforms=platforms, fmi=fmi, arrays=arrays)


def fmu_path(target: Target, backend: Backend = "auto", **sizes: object) -> Path:
    """Path of the FMU of one component, built first if it is missing or out of date.

    :param backend: as for :func:`build`.
    :param sizes: structural sizes, for example ``n=100``; such FMUs go to a folder of their own, ``fmus/n=100/``.
    :raises ProjectError: if the component has no such size; else as :func:`build` does.
    """
    from liaisons.fmu import build

    class_ = component(target)
    sized = model(class_, **sizes) if sizes else None
    folder = _sized_folder(fmus_directory(), sizes)
    key = (class_, str(backend), folder)
    path, seen = _built.get(key, (None, None))
    if path is None or not path.is_file() or seen != file_identity(path):
        reserve_fmu(class_, folder)
        path = build(sized or model(class_), folder, backend=backend)
        _built[key] = path, file_identity(path)
        name = class_.__name__
        plain = not sizes and backend == "auto" and path == folder / f"{name}.fmu"
        if plain and class_ is _catalogue_component(name):
            note_unchanged(path)
    return path


def build_versions(
    component: type[Component], folder: Path, versions: Iterable[Fmi], sizes: Mapping[str, object], **how: Any
) -> list[Path]:
    """Paths of the FMUs of a component, built in some versions of FMI; :func:`reserve_fmu` comes before.

    :param folder: that of the sizes is in it.
    :param how: ``backend``, ``platforms`` and ``arrays`` of :func:`build`.
    """
    from liaisons.fmu import build

    sized = model(component, **sizes)
    return [build(sized, _sized_folder(folder, sizes), fmi=fmi, **how) for fmi in versions]


def _sized_folder(folder: Path, sizes: Mapping[str, object]) -> Path:
    """Subfolder for FMUs with these structural sizes, ``n=100``; the folder itself without any."""
    return folder / "-".join(f"{name}={size}" for name, size in sizes.items())


def reserve_fmu(component: type[Component], folder: Path | str, **sizes: object) -> None:
    """Reserve the name of an FMU in a folder for a component; raise if it is that of another one.

    In ``fmus/`` an FMU of the catalogue is not replaced; in any folder, a process builds one component of a name.  One
    that was edited, or defined once more in a notebook, is still the same.

    :param sizes: structural sizes, whose folder is in this one.
    :raises ProjectError: if it is reserved for another component.
    """
    name, folder = component.__name__, _sized_folder(Path(folder), sizes).resolve()
    file = _files.get(component) or getattr(sys.modules.get(component.__module__), "__file__", None)
    origin = f"{file or component.__module__}:{component.__qualname__}"
    if _catalogue_component(name) not in {None, component}:
        _refuse_catalogue_name(name, origin, folder)
    owner = _owners.setdefault((folder, name), origin)
    if owner != origin:
        raise ProjectError(_name_conflict(name, origin, folder, owner))


def _refuse_catalogue_name(name: str, origin: str, folder: Path) -> None:
    """Raise a ProjectError if a folder is that of the catalogue, and has its FMU; else say what the bare name is."""
    from liaisons.fmu import is_of_catalogue

    if folder.is_relative_to(fmus_directory().resolve()):
        if any(is_of_catalogue(folder / below / f"{name}.fmu") for below in ("", "python", "fmi3", "fmi3/scalars")):
            raise ProjectError(_name_conflict(name, origin, folder, "the catalogue's component of this name"))
        logger.warning("%s: the bare name %s is the catalogue's; this one is meant by its file or class", origin, name)


def _name_conflict(name: str, origin: str, folder: Path, owner: str) -> str:
    """Message that ``<name>.fmu`` is already the FMU of another component, its owner."""
    return f"{origin}: {folder / name}.fmu is the FMU of {owner}; rename the class, or build it into another folder"


def fmu_file(target: Target) -> Path:
    """Path of an FMU, which is built if the target is a component.

    :raises ProjectError: if there is no such file or component; else as :func:`fmu_path` does.
    """
    if isinstance(target, type):
        return fmu_path(target)
    if not isinstance(target, (str, os.PathLike)):
        remedy = "give the path of an FMU, or the name ('Pendulum'), file or class of a component"
        raise ProjectError(_no_component_message(target, f"is neither an FMU nor a component; {remedy}"))
    path = Path(target)
    if path.suffix == ".ssp":
        raise ProjectError(f"{path} is the archive of a whole system; read it with System.from_ssp({str(path)!r})")
    if path.suffix == ".fmu" or (path.is_file() and not _is_source(path.name)):
        return path
    name = str(target)
    if name in own_components():
        unchanged = fmus_directory() / f"{name}.fmu"
        return unchanged if is_unchanged(unchanged) else fmu_path(target)
    if not _is_source(path.name) and not is_named(name):
        raise ProjectError(f"{name!r} is neither a file nor a component{suggestion(name, component_names())}")
    return fmu_path(target)


def _is_source(name: str) -> bool:
    return name.endswith(".py") or ".py:" in name or is_robot(name)


def _no_component_message(target: object, text: str) -> str:
    """Message about an object that is not a component; of a system it says what systems do instead."""
    from liaisons.cosim import System

    if isinstance(target, System):
        return (
            f"{target.name} is a system, not a component; flatten() makes one FMU of it, "
            "sweep() runs it for many values"
        )
    return f"{shown(target)} {text}"


def _is_concrete(value: object) -> TypeGuard[type[Component]]:
    from liaisons.language import Component

    return isinstance(value, type) and issubclass(value, Component) and not value.is_abstract
