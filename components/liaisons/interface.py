"""What users call: a component's name, file or class stands for its FMU, which is built if need be.

Below this storey there are FMU files only.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Self, TypeVar, final

from numpy.typing import ArrayLike

from liaisons import cosim, live, ssp, sweeps
from liaisons.arguments import listed, named
from liaisons.flattening import flatten
from liaisons.library import Target, fmu_file

if TYPE_CHECKING:
    from liaisons.language import Component

P = ParamSpec("P")
R = TypeVar("R")


def _of_component(function: Callable[Concatenate[Path | str, P], R]) -> Callable[Concatenate[Target, P], R]:
    """The same function, whose first argument may be a component."""

    @wraps(function)
    def call(fmu: Target, /, *arguments: P.args, **options: P.kwargs) -> R:
        return function(fmu_file(fmu), *arguments, **options)

    _announce(call, "Path | str | type[Component]")
    return call


def _of_system(
    function: Callable[Concatenate[Path | str | cosim.System, P], R],
) -> Callable[Concatenate[Target | cosim.System, P], R]:
    """The same function, whose first argument may be a component; a system stands for itself."""

    @wraps(function)
    def call(subject: Target | cosim.System, /, *arguments: P.args, **options: P.kwargs) -> R:
        found = subject if isinstance(subject, cosim.System) else fmu_file(subject)
        return function(found, *arguments, **options)

    _announce(call, "Path | str | type[Component] | System")
    return call


def _announce(call: Callable[..., object], annotation: str) -> None:
    """Have ``help`` show what the first argument may be here."""
    signature = inspect.signature(call)
    first, *others = signature.parameters.values()
    first = first.replace(kind=first.POSITIONAL_ONLY, annotation=annotation)
    vars(call)["__signature__"] = signature.replace(parameters=[first, *others])


show = _of_system(live.show)
sweep = _of_system(sweeps.sweep)


@final
@dataclass(frozen=True, slots=True)
class OperatorFmu:
    """An FMU that prescribes a coordinate; see :func:`operator`."""

    fmu: Path
    starts: Mapping[str, ArrayLike]
    interpolate: bool


def operator(fmu: Target, /, *, interpolate: bool = True, **starts: ArrayLike) -> OperatorFmu:
    """An operator as the value of a coordinate: ``simulate("Pendulum", length=operator("Sinusoid", offset=1.0))``.

    :param fmu: path of an FMU with the port ``y``; or a component by its name, file or class.
    :param interpolate: between communication points, in sixth order of their distance; not for operators whose rate
        jumps, such as a ``Ramp`` that starts on the way: these are extrapolated from each of the points.
    :param starts: its parameters, where they differ from the FMU's.
    :raises ProjectError: if there is no such file or component.
    """
    return OperatorFmu(fmu_file(fmu), starts, interpolate)


@final
class System(cosim.System):
    """FMUs, connected; :meth:`simulate` runs all of them from the start, as often as it is called.

    ::

        system = System("pumped swing")
        swing = system.add("swing", "Pendulum", theta_0=0.05)
        motor = system.add("operator", "Sinusoid", offset=1.0, amplitude=0.1, angular_frequency=6.26)
        system.connect(motor["y"], swing["length"])
        result = system.simulate(stop_time=60, step_size=0.1)
        result["swing.theta"]

    or, an operator being the value of a coordinate, its first lines in one::

        system.add("swing", "Pendulum", theta_0=0.05, length=operator("Sinusoid", offset=1.0, amplitude=0.1))

    :param name: used in messages, results and figures.
    """

    def add(self, name: str, fmu: Target, /, **starts: ArrayLike | OperatorFmu) -> cosim.Part:
        """Put an FMU into the system.

        :param name: name of this component; no dot, and not taken yet.
        :param fmu: path of an FMU; or a component by its name (``"Pendulum"``), file or class.
        :param starts: values of parameters and inputs at the start, where they differ from the FMU's; or an
            :func:`operator`, which is added as ``name_port``, connected, and followed as it wants to be.
        :returns: a handle; ``handle["length"]`` is one of its ports, to be connected.
        :raises ProjectError: if there is no such file or component.
        :raises SimulationError: if the name will not do, the file cannot be used here, or a start value is unknown,
            cannot be set, or has the wrong type.
        """
        path = fmu_file(fmu)
        operators = {port: value for port, value in starts.items() if isinstance(value, OperatorFmu)}
        given: dict[str, Any] = {start: value for start, value in starts.items() if start not in operators}
        smooth = bool(operators) and all(value.interpolate for value in operators.values())
        if smooth and cosim.Part.of(name, path, {}).reconstruction is not None:
            given.setdefault("input_reconstruction", 2)
        mechanism = super().add(name, path, **given)
        for port, value in operators.items():
            self.connect(super().add(f"{name}_{port}", value.fmu, **value.starts)["y"], mechanism[port])
        return mechanism

    @classmethod
    def from_ssp(cls, path: Path | str) -> Self:
        """Read an SSP archive (1.0 or 2.0), of ours or of another make.

        See :func:`liaisons.ssp.read`.
        """
        return ssp.read(path, cls)

    def write_ssp(self, path: Path | str, **options: Any) -> None:
        """Write the system as an SSP archive with its FMUs, for every importer, or with all that there is to say.

        See :func:`liaisons.ssp.write`.
        """
        ssp.write(self, path, **options)

    def flatten(self, output: Path | str | None = None, **options: Any) -> Path:
        """Build the FMU of the whole system from the equations of motion of our components: no coupling error.

        See :func:`liaisons.flatten`.

        :returns: path of the FMU; its variables are called as in the result of the system.
        """
        return flatten(self, output, **options)


def simulate(
    fmu: Path | str | type[Component],
    /,
    *,
    stop_time: float | None = None,
    step_size: float | None = None,
    start_time: float | None = None,
    times: ArrayLike | None = None,
    tolerance: float | None = None,
    record: str | Iterable[str] | None = None,
    inputs: Mapping[str, Callable[[float], Any]] | None = None,
    **starts: ArrayLike | OperatorFmu,
) -> cosim.Result:
    """Simulate one FMU, and the operators that prescribe its coordinates; what is not given its experiment says.

    :param fmu: path of an FMU; or a component by its name (``"Pendulum"``), file or class.
    :param stop_time: end [s].
    :param step_size: distance of the communication points [s], as in :meth:`System.simulate`.
    :param start_time: begin [s].  (A *parameter* of this name can be set in a :class:`System`.)
    :param times: the communication points themselves [s], increasing, in place of the three above.
    :param tolerance: relative tolerance of the FMU's solver.
    :param record: a name of a real variable or several; all outputs and inputs if None.
    :param inputs: name -> function of time [s] that returns its value.  The function of an active coordinate ``s`` may
        return (s, s_dot, s_ddot).  It is called for the communication points, and what it returns is handed over as
        from a connected source.
    :param starts: values of parameters and inputs at the start, where they differ from the FMU's; or the
        :func:`operator` of a coordinate.
    :returns: signals under their own names, ``result["theta"]``.
    :raises SimulationError: as :meth:`System.add` and :meth:`System.simulate` do; so is :class:`Interrupted`.
    """
    given = {"start_time": start_time, "stop_time": stop_time, "step_size": step_size, "tolerance": tolerance}
    path = fmu_file(fmu)
    if not any(isinstance(value, OperatorFmu) for value in starts.values()):
        return cosim.simulate(path, times=times, record=record, inputs=inputs, **given, **starts)  # type: ignore[arg-type]
    system, prefix = System(path.stem), f"{path.stem}."
    mechanism = system.add(path.stem, path, **starts)
    recorded = mechanism.fmu.recorded() if record is None else listed("record", record)
    for name in ("tolerance",) if times is not None else given:
        given[name] = getattr(mechanism.fmu.experiment, name) if given[name] is None else given[name]

    def own(result: cosim.Result) -> cosim.Result:
        """The result without the prefix of the one mechanism."""
        units = {name.removeprefix(prefix): unit for name, unit in result.units.items()}
        names = tuple(name.removeprefix(prefix) for name in result.names)
        return cosim.Result(result.title, result.time, names, result.values, units)

    try:
        return own(
            system.simulate(
                **given | {"start_time": given["start_time"] or 0.0},  # type: ignore[arg-type]
                times=times,
                record=[prefix + name for name in recorded],
                inputs={prefix + name: function for name, function in named("inputs", inputs or {}).items()},
            )
        )
    except (cosim.IncompleteError, cosim.Interrupted) as error:
        error.result = own(error.result)
        raise
