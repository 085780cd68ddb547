"""The public functions that take components: the FMU of a name, file or class is built if need be.

The layers below take FMU files; what is registered here lets them take components, too.  Archives, live pages and
formulas are reached by their public names, which are imported when they are first asked for.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

import liaisons
from liaisons.base import cache
from liaisons.base.arguments import as_path, check_finite, merged_start_values, name_dictionary, name_list
from liaisons.base.folders import process_folder
from liaisons.base.project import ProjectError
from liaisons.base.published import registered
from liaisons.cosim import OperatorFmu, Services, System, register, simulate, start
from liaisons.errors import SimulationError
from liaisons.library import Target, component, fmu_file, is_target

if TYPE_CHECKING:
    from liaisons import DisplayedEquations, LivePage
    from liaisons.base.knots import Join
    from liaisons.cosim import Linearization
    from liaisons.mechanics import Model

__all__ = [
    "System",
    "equations",
    "linearize",
    "operator",
    "show",
    "simulate",
    "start",
    "tabulated",
    "with_table",
]

MOST_KNOTS = 100
"""Number of knots in the parameters of a PlannedMotion; more are in a file."""
_KNOT = ("instant", "value", "rate", "acceleration")


def _read_archive(path: Path | str, *arguments: Any) -> Any:
    return liaisons.ssp.read_document(path, *arguments)


def _write_archive(*arguments: Any, **settings: Any) -> None:
    liaisons.ssp.write(*arguments, **settings)


def _composed(system: System) -> Model:
    """Model of a whole system."""
    (composed_model,) = registered("liaisons.system_models")
    return composed_model(system)


def _flatten(*arguments: Any, **settings: Any) -> Path:
    return liaisons.flatten(*arguments, **settings)


register(Services(fmu_file, _read_archive, _write_archive, _flatten))


def show(
    subject: Target | System,
    /,
    *further: Target,
    path: Path | str | None = None,
    start_values: Mapping[str, object] | None = None,
    controls: str | Iterable[str] | None = None,
    plots: str | Iterable[str] | None = None,
    question: str = "",
    **keywords: object,
) -> LivePage:
    """Write a live page: the FMU's own C in a browser, with sliders, picture, plot and energy account.

    :param subject: path of an FMU with C sources of FMI 2.0; or a component by its name, file or class; or a system,
        of which :meth:`System.flatten` makes one FMU where a port takes forces back.
    :param further: components that are shown beside it, ``show("Pendulum", "DoublePendulum")``; the last one may be the
        path.
    :param path: of the page; default: ``NAME.html`` in the working directory.
    :param start_values: start values of an FMU's parameters and inputs by name, where they differ from its own; a
        system has its own.
    :param controls: parameters, inputs and prescribed coordinates that can be changed; None: all.
    :param plots: at most four signals that are plotted, none by ``[]``; None: angles, with a choice of all.
    :param question: text above the picture.
    :param keywords: further start values, operators among them.
    :returns: the page, path-like: ``webbrowser.open(f"file://{page}")``; a notebook displays it.
    :raises ProjectError: if there is no such file or component.
    :raises SimulationError: if an FMU cannot be read or has no such sources, or the file cannot be written; for a
        name in ``controls`` or ``plots`` that the page has not.
    :raises BuildError: if there is no compiler for WebAssembly: ``pip install 'liaisons[cross]'``.
    """
    *subjects, last = subject, *further
    if subjects and path is None and not is_target(last):
        path = cast("Path | str", last)
    else:
        subjects.append(last)
    targets = [target if isinstance(target, System) else fmu_file(target) for target in subjects]
    target = targets[0] if len(targets) == 1 else _unconnected_system(targets)
    page, starts = (
        None if path is None else as_path("show: path", path),
        merged_start_values("show", start_values, keywords),
    )
    contents: Any = {"controls": controls, "plots": plots, "question": question}
    if (
        starts
        or isinstance(target, Path)
        or not (two_way := [c for c in target.connections if c.is_reaction or c.is_impulse])
    ):
        return liaisons.live.write_live_page(target, page, starts, **contents)
    with TemporaryDirectory() as folder:  # a page steps FMUs one after the other, so that forces would be late
        try:
            whole = _flatten(target, folder)
        except SimulationError as error:
            words = f"show: {target.name}: a force goes back by {two_way[0]}, so that its page is one FMU, by flatten()"
            raise SimulationError(f"{words}: {error}") from error
        return liaisons.live.write_live_page(whole, page or liaisons.live.default_page_path(target), {}, **contents)


def _unconnected_system(subjects: list[Path | System]) -> System:
    """System of FMUs without connections; raise a ProjectError for a system among them."""
    if systems := [subject.name for subject in subjects if isinstance(subject, System)]:
        raise ProjectError(f"show: {systems[0]} is a system, which is shown alone")
    paths = [subject for subject in subjects if isinstance(subject, Path)]
    beside = System(" and ".join(dict.fromkeys(path.stem for path in paths)))
    for i, path in enumerate(paths):
        name = re.sub(r"\W", "_", path.stem)
        beside.add(f"{name}_{i + 1}" if name in beside.parts else name, path)
    return beside


def equations(subject: Target | System | Model) -> DisplayedEquations:
    """Equations of a component or system for display: ``equations("Pendulum")["motion"]``.

    :param subject: name, file or class of a component; a system that :meth:`System.flatten` takes; a model.
    :raises ProjectError: if there is no such component.
    :raises ComponentError: if it cannot be derived.
    :raises SimulationError: if a system cannot be flattened.
    """
    from liaisons.mechanics import Model

    if isinstance(subject, (System, Model)):
        return liaisons.formulas.of_model(subject if isinstance(subject, Model) else _composed(subject))
    return liaisons.formulas.of_component(component(subject))


def operator(
    fmu: Target, /, *, start_values: Mapping[str, ArrayLike] | None = None, **keywords: ArrayLike
) -> OperatorFmu:
    """Operator that moves a coordinate: ``simulate("Pendulum", length=operator("Sinusoid", offset=1.0))``.

    :param fmu: path of an FMU with the port ``y``; or a component by its name, file or class.
    :param start_values: its parameters by name, where they differ from the FMU's.
    :param keywords: further ones.
    :raises ProjectError: if there is no such file or component.
    :raises SimulationError: for a name that is given twice.
    """
    path = fmu_file(fmu)
    return OperatorFmu(path, merged_start_values(path.stem, start_values, keywords))


def tabulated(
    times: ArrayLike,
    values: ArrayLike,
    rates: ArrayLike | None = None,
    accelerations: ArrayLike | None = None,
    *,
    join: Join = "quintic",
    smoothing: float | None = None,
) -> OperatorFmu:
    """Operator that follows a table: ``simulate("Pendulum", length=tabulated(t, length))``.

    It is a ``PlannedMotion``, with a polynomial of degree five between successive times.  Rates and accelerations that
    are None follow from the values.  A repeated time is a jump, which becomes a communication point.

    :param times: [s], ascending, shape (n,), n >= 2.
    :param join: ``"quintic"``: a spline with smooth acceleration, which overshoots near steps; ``"pchip"``: cubics that
        rise, fall and rest as the values do, whose acceleration jumps at each time; ``"linear"``: the rate jumps.
    :param smoothing: distance [s] between the knots of the quintic splines that fit noisy values best; None: the curve
        passes through all values.
    :raises SimulationError: if the arguments are not numbers or differ in length, if times do not ascend, or if there
        are too few values to be smoothed.
    """
    from liaisons.base.knots import knots

    table, fmu = knots(times, values, rates, accelerations, join, smoothing=smoothing), fmu_file("PlannedMotion")
    if (missing := MOST_KNOTS - table.shape[1]) >= 0:
        padded = np.pad(table, ((0, 0), (0, missing)), mode="edge")
        return OperatorFmu(fmu, dict(zip(_KNOT, padded, strict=True)))
    return OperatorFmu(with_table(fmu, table), {})


def with_table(fmu: Path, table: NDArray[np.float64]) -> Path:
    """Write a copy of an FMU with a table in its resources; return its path, which lasts until this process ends.

    :param table: columns of the table, (columns, rows).
    :raises SimulationError: for an FMU in Python, which takes none.
    """
    copy = process_folder() / hashlib.sha256(fmu.read_bytes() + table.tobytes()).hexdigest()[:16] / fmu.name
    if not copy.exists():
        copy.parent.mkdir()
        copy.write_bytes(liaisons.ssp.fmu_with_table(fmu, table))
        cache.add_trusted_fmu(cache.digest(copy))
    return copy


def linearize(
    subject: Target,
    at: Mapping[str, ArrayLike] | None = None,
    *,
    inputs: str | Iterable[str] | None = None,
    outputs: str | Iterable[str] | None = None,
    time: float = 0.0,
    method: Literal["directional derivatives", "differences"] | None = None,
) -> Linearization:
    """Linearize the equations of a component or an FMU at a point, which need not be an equilibrium.

    The FMU's directional derivatives are compared with finite differences; if the two disagree, this is an error.

    :param subject: name, file or class of a component, or path of an FMU of Model Exchange; a system is flattened
        first: ``linearize(system.flatten())``.
    :param at: values of states, inputs and parameters by name, where they differ from the start values; of a coordinate
        and its rate those that the motion starts with.
    :param inputs: an input or several, arrays under their names; None: all continuous ones.
    :param outputs: an output or another variable, or several; None: all outputs.
    :param time: [s].
    :param method: None: directional derivatives where there are any.
    :raises ProjectError: if there is no such file or component.
    :raises SimulationError: for an unknown name, a value that the FMU refuses, derivatives that are wrong, or an FMU
        that is not made for Model Exchange.
    """
    path = fmu_file(subject)
    values = name_dictionary("linearize: at", {} if at is None else at)
    check_finite("linearize: time", time)
    chosen_inputs = None if inputs is None else name_list("linearize: inputs", inputs)
    chosen_outputs = None if outputs is None else name_list("linearize: outputs", outputs)
    (fmu_equations,) = registered("liaisons.fmu_equations")
    with fmu_equations(path, values, inputs=chosen_inputs, outputs=chosen_outputs, time=time) as equations:
        return equations.linearization(method)
