"""What users call: a component's name, file or class stands for its FMU, which is built if need be.

Below this storey there are FMU files only.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, Self, TypeVar, final

from numpy.typing import ArrayLike

from liaisons import cosim, ssp, sweeps
from liaisons.flattening import flatten
from liaisons.library import Target, fmu_file

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


simulate = _of_component(cosim.simulate)
sweep = _of_system(sweeps.sweep)


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

    :param name: used in messages, results and figures.
    """

    def add(self, name: str, fmu: Target, /, **starts: ArrayLike) -> cosim.Part:
        """Put an FMU into the system.

        :param name: name of this component; no dot, and not taken yet.
        :param fmu: path of an FMU; or a component by its name (``"Pendulum"``), file or class.
        :param starts: values of parameters and inputs at the start, where they differ from the FMU's.
        :returns: a handle; ``handle["length"]`` is one of its ports, to be connected.
        :raises ProjectError: if there is no such file or component.
        :raises SimulationError: if the name will not do, the file cannot be used here, or a start value is unknown,
            cannot be set, or has the wrong type.
        """
        return super().add(name, fmu_file(fmu), **starts)

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
