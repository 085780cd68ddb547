"""Systems of connected FMUs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Self, Unpack, cast, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import as_path, merged_start_values, name_dictionary, shown, start_value_hints
from liaisons.base.compiler import Backend, Fmi, Platforms
from liaisons.base.published import registered
from liaisons.cosim.running.run import Run, run_to_end, start_run
from liaisons.cosim.structure.components import Components, Port, SystemComponent, time_limit
from liaisons.cosim.structure.connections import Connection, scalar_connections
from liaisons.cosim.structure.document import Diagram, FmuTarget, SystemDocument, fmu_file, services
from liaisons.cosim.structure.schedule import Coupling, VariableReference
from liaisons.cosim.structure.simulation import Settings, Simulation, checked_simulation
from liaisons.cosim.structure.sources import Function
from liaisons.errors import ConnectError, InvalidValueError, LiaisonsError, SimulationError, suggestion
from liaisons.fmu_files import DefaultExperiment, SampledFunction
from liaisons.results import Result

DIAGRAMS = "liaisons.system_diagrams"
"""Group of entry points that draw systems: :class:`SystemDocument` -> :class:`Diagram`."""
_SHOWN = 20
"""Number of components, and of connections, that are printed at most."""
_WIDEST = 200
"""Number of characters printed of each at most."""


@final
@dataclass(frozen=True, slots=True)
class OperatorFmu:
    """FMU that prescribes a coordinate, with start values; see :func:`liaisons.operator`."""

    fmu: Path
    start_values: Mapping[str, ArrayLike]


@final
class System:
    """System of connected FMUs; each call of :meth:`simulate` runs all of them from the start.

    ::

        system = System("pumped swing")
        swing = system.add("swing", "Pendulum", theta_0=0.05)
        motor = system.add("operator", "Sinusoid", offset=1.0, amplitude=0.1, angular_frequency=6.26)
        system.connect(motor["y"], swing["length"])
        result = system.simulate(stop_time=60, step_size=0.1)
        result["swing.theta"]

    or, with an operator as the value of a coordinate::

        system.add("swing", "Pendulum", theta_0=0.05, length=operator("Sinusoid", offset=1.0, amplitude=0.1))

    :param name: used in messages, results and figures.
    :ivar experiment: of the last run, or of the archive that was read.
    :ivar defaults: start, stop and step size of the archive that was read, used where a run is given none.
    """

    def __init__(self, name: str) -> None:
        if not isinstance(name, str) or not name:
            raise SimulationError(f"name = {shown(name)}: give the system a name")
        self.name = name
        self._parts: dict[str, SystemComponent] = {}
        self._connections: dict[VariableReference, Connection] = {}
        self.experiment = self.defaults = DefaultExperiment()
        self._files: object = None

    @classmethod
    def from_document(cls, document: SystemDocument) -> Self:
        """System with the components, connections and experiment of a document.

        :raises SimulationError: for what is not a document.
        """
        if not isinstance(document, SystemDocument):
            raise SimulationError(f"document = {shown(document)}: give that of a system, system.document")
        system = cls(document.name)
        system._parts = dict(document.parts)
        system._connections = {connection.target.reference: connection for connection in document.connections}
        system.experiment = system.defaults = document.experiment
        system._files = document.files
        return system

    @classmethod
    def from_ssp(cls, path: Path | str, start_values: Mapping[str, object] | None = None) -> Self:
        """Read an SSP archive (1.0 or 2.0) of any tool, see :func:`liaisons.ssp.read`.

        :param start_values: ``"component.variable"`` -> start value, where it differs from that of the archive.
        """
        return cls.from_document(services().read_ssp(path, start_values))

    @property
    def document(self) -> SystemDocument:
        """The system as data: components, connections and experiment."""
        parts, connections = dict(self._parts), tuple(self._connections.values())
        return SystemDocument(self.name, parts, connections, self.defaults, files=self._files)

    def add(
        self,
        name: str,
        fmu: FmuTarget | SampledFunction,
        /,
        *,
        isolated: bool | float = False,
        start_values: Mapping[str, ArrayLike | OperatorFmu] | None = None,
        **keywords: ArrayLike | OperatorFmu,
    ) -> SystemComponent:
        """Add an FMU or a component to the system.

        :param name: name of this component; no dot, and not taken yet.
        :param fmu: path of an FMU; or a component by its name (``"Pendulum"``), file or class; or a Python function,
            :func:`sampled`.
        :param isolated: run the FMU in a process of its own: if it crashes, exits or hangs, the run ends with the
            partial result and names the call.  A number is the longest time that a call may take [s]; True: a minute.
            This works on Linux; elsewhere the FMU runs in this process, with a warning.
        :param start_values: start values of parameters and inputs by name, where they differ from the FMU's; or an
            :func:`operator`, which is added as ``name_port`` and connected.
        :param keywords: further start values; a keyword that names a setting is the setting.
        :returns: the component; ``component["length"]`` is one of its ports, to be connected.
        :raises SimulationError: if the name is bad, the file cannot be used, or a start value is unknown,
            cannot be set, or has the wrong type.
        :raises ProjectError: if there is no such file or component.
        """
        path = fmu if isinstance(fmu, SampledFunction) else fmu_file(f"{name}: fmu", fmu)
        if not isinstance(name, str) or not name or "." in name:
            raise SimulationError(f"{self.name}: the name {shown(name)} of a component must not be empty or have a dot")
        if name in self._parts:
            raise SimulationError(f"{self.name} has a component {name!r} already; choose another name")
        starts = merged_start_values(f"{self.name}: {name}", start_values, keywords)
        return self._add_part(name, path, starts, isolated=isolated)

    def _add_part(
        self, name: str, fmu: Path | str | SampledFunction, starts: Mapping[str, object], *, isolated: bool | float
    ) -> SystemComponent:
        own: dict[str, object] = {}
        operators: dict[str, OperatorFmu] = {}
        for start, value in starts.items():
            if isinstance(value, OperatorFmu):
                operators[start] = value
            else:
                own[start] = value
        part = self._parts[name] = SystemComponent.read(name, fmu, own, isolated=isolated)
        if isinstance(fmu, SampledFunction):
            self._connect_variables(part, {**fmu.inputs, **fmu.outputs})
        return self.prescribe(name, operators) if operators else part

    def _connect_variables(self, part: SystemComponent, variables: Mapping[str, str]) -> None:
        """Connect ports with variables ``"component.variable"`` of others; on an error, remove the component."""
        before = dict(self._connections)
        try:
            for port, name in variables.items():
                owner, dot, variable = name.partition(".")
                if dot and owner not in self._parts:
                    words = f"{self.name} has no component {owner!r}{suggestion(owner, self._parts)}"
                    raise ConnectError(f"{part.name}: {name}: {words}")
                if dot:
                    self.connect(part[port], self._parts[owner][variable])
        except LiaisonsError:
            del self._parts[part.name]
            self._connections = before
            raise

    def prescribe(self, name: str, operators: Mapping[str, OperatorFmu]) -> SystemComponent:
        """Add operators to the system, and connect them with ports of a component.

        :returns: the component.
        """
        if not isinstance(name, str) or name not in self._parts:
            words = f"{self.name} has no component {shown(name)}{suggestion(str(name), self._parts)}"
            raise ConnectError(words)
        part = self._parts[name]
        for port, value in name_dictionary(f"{self.name}: operators", operators).items():
            if not isinstance(value, OperatorFmu):
                raise ConnectError(f"{self.name}: {port} = {shown(value)} is not an operator(...)")
            own = f"{name}_{port}".replace(".", "_")  # ports of a flattened FMU have dots
            self.connect(self.add(own, value.fmu, start_values=value.start_values)["y"], part[port])
        return part

    def connect(self, source: Port, target: Port) -> None:
        """Connect two ports: triples, points, or single variables.

        * a signal or free coordinate with an active coordinate: value, rate and acceleration; in the other direction,
          the force becomes the load of the free coordinate or point;
        * a named point with another (``upper["bob"]``, ``lower["pivot"]``): all their axes;
        * otherwise an output with an input; if their units differ by a factor or offset, values are converted.

        Source and target follow from causality, so the order of ports does not matter.  Nothing is connected unless
        everything fits.

        :raises ConnectError: if causality or units do not fit, or an input has a source already; the error names both
            ports.
        """
        for port in (source, target):
            if not isinstance(port, Port):
                raise ConnectError(
                    f'{self.name}: {shown(port)} is not a port; connect component["length"] of what add() has returned'
                )
            if self._parts.get(port.part.name) is not port.part:
                raise ConnectError(f"{port} is not a component of {self.name}; connect one that its add() has returned")
        self.join(scalar_connections(source, target))

    def join(self, connections: Iterable[Connection]) -> None:
        """Add scalar connections to the system, all of them or, if one does not fit, none.

        :raises ConnectError: if an input has a source already, and for what is not a connection.
        """
        connections = list(connections) if isinstance(connections, Iterable) else [connections]
        for one in connections:
            if not isinstance(one, Connection):
                raise ConnectError(f"{self.name}: {shown(one)} is not a connection; take those of another system")
        joined: dict[VariableReference, Connection] = {}
        for connection in connections:
            input_ = connection.target.reference
            taken = self._connections.get(input_) or joined.setdefault(input_, connection)
            if taken is not connection:
                ends = f"{connection.source} cannot be connected with {connection.target}"
                cure = "; where two mechanisms hang, a Junction adds their forces" if connection.is_reaction else ""
                raise ConnectError(f"{ends}: {taken.source} feeds it already; an input has one source{cure}")
        self._connections.update(joined)

    def with_start_values(self, start_values: Mapping[str, ArrayLike]) -> Self:
        """Copy of the system with some other start values.

        :param start_values: ``"component.variable"`` -> new start value.
        :raises SimulationError: for an unknown component or variable, or a value that it cannot have.
        """
        return self._changed(self.document.with_start_values(start_values))

    def _changed(self, document: SystemDocument) -> Self:
        """System of a document that was made from that of this one."""
        other = self.from_document(document)
        other.experiment = self.experiment
        return other

    def isolated_copy(self, isolated: bool | float = True) -> Self:
        """Copy of the system whose FMUs run in processes of their own, as :meth:`add` says.

        :raises SimulationError: if ``isolated`` is not a time.
        """
        limit = time_limit(f"{self.name}: isolated =", isolated)
        parts = {name: part.isolated_copy(limit) if limit else part for name, part in self._parts.items()}
        return self._changed(replace(self.document, parts=parts))

    def simulate(
        self,
        stop_time: float | None = None,
        step_size: float | None = None,
        *,
        verify: bool = False,
        progress: bool = False,
        real_time: float | None = None,
        **settings: Unpack[Settings],
    ) -> Result:
        """Simulate the system from start to stop.

        See :mod:`liaisons.cosim.structure.schedule` for what each input holds at which time in explicit coupling, and
        :mod:`liaisons.cosim.coupling` for implicit and waveform coupling.

        :param stop_time: stop [s]; None: the last of ``times``, else that of the archive, without which it is needed.
        :param step_size: distance between communication points [s], t_i = start_time + i * step_size; the last step is
            shorter if need be.  None: that of the archive; without one the shortest in the FMUs' default experiments,
            else a 500th of the time, and in implicit and waveform coupling of FMUs that can restore their states, steps
            between the points are as short as ``coupling_error`` has to be: ``tolerance``, 1e-8.
        :param start_time: start [s]; None: that of the archive, else of the FMUs' default experiments if it is the same
            in all, else 0.
        :param times: the communication points themselves [s], increasing; those that differ by rounding count as one.
        :param tolerance: relative tolerance of the FMUs' solvers; None: that of each FMU's default experiment, or its
            own.
        :param coupling: ``"gauss-seidel"`` steps sources before the FMUs that they feed, ``"jacobi"`` steps all FMUs
            from the values at t: in cycles the error is of first order in H.  ``"implicit"`` and ``"waveform"`` repeat
            each step until inputs and outputs agree at both of its ends; they are of fourth order between our FMUs.
            None: implicit if a port is bidirectional and all FMUs in its cycle can restore their states, or if signals
            into our FMUs form no cycle; otherwise Gauss-Seidel.
        :param error_tolerance: error allowed in a communication step, of what is connected or recorded, relative to
            the largest value of its unit so far; ``step_size`` is then the size of the first attempt, and the result
            has the points that were chosen.  None: the communication points are fixed.
        :param record: a name ``"component.variable"`` or several; None: all outputs and inputs, or the local variables
            of an FMU that has neither.
        :param inputs: ``"component.variable"`` -> function of time [s] that returns the value of the input, or for an
            active coordinate also its two rates, as for :func:`simulate`; None: no functions.
        :param verify: simulate again with half the step size; ``result.error(name)`` is the difference over time.
        :param progress: show a progress bar on stderr.
        :param real_time: simulated seconds per second of the clock, for which the run waits; None: it does not wait.
        :returns: the signals at all communication points, with a warning if an FMU has ended the simulation early.
        :raises SimulationError: for a bad argument or an FMU that cannot be initialized; after that
            :class:`IncompleteError`, whose ``result`` has what was computed until then.
        :raises Interrupted: on Ctrl-C, at the end of the communication step; a ``KeyboardInterrupt`` with ``result``.
        """
        _refuse_unknown("System.simulate", settings)
        simulation = checked_simulation(self.document, stop_time, step_size, **settings)
        start, first, *_ = points = simulation.times
        self.experiment = DefaultExperiment(start, points[-1], first - start if step_size is None else step_size)
        return run_to_end(simulation, verify=verify, progress=progress, real_time=real_time)

    def start(
        self, stop_time: float | None = None, step_size: float | None = None, **settings: Unpack[Settings]
    ) -> Run:
        """Initialize the FMUs for a run that the caller steps.

        Without ``stop_time`` the run has no end.  ``run.fmu("cart")`` is the object of FMPy for an FMU.

        Example::

            with system.start(stop_time=10.0, step_size=0.01) as run:
                while run["cart.x"] < 1:
                    run.step({"cart.x_force": -run["cart.x_dot"]})
            result = run.result

        :param settings: like the first two parameters, those of :meth:`simulate`, except ``verify``, ``progress`` and
            ``real_time``.
        :returns: the run, a context manager that releases the FMUs.
        :raises SimulationError: for a bad argument or an FMU that cannot be initialized.
        """
        _refuse_run_options(settings)
        _refuse_unknown("System.start", settings)
        return start_run(checked_simulation(self.document, stop_time, step_size, endless=True, **settings))

    @property
    def parts(self) -> Components:
        """Components by name."""
        return dict(self._parts)

    @property
    def connections(self) -> tuple[Connection, ...]:
        """Scalar connections, in the order of addition."""
        return tuple(self._connections.values())

    def filled(self) -> Components:
        """Components by name, at least one.

        :raises SimulationError: if there are none.
        """
        return self.document.filled().parts

    def __repr__(self) -> str:
        lines = [f"System {self.name!r}"]
        for several in (self._parts.values(), self._connections.values()):
            texts = [f"  {one}" for one in list(several)[:_SHOWN]]
            lines += [text if len(text) <= _WIDEST else f"{text[:_WIDEST]} ..." for text in texts]
            lines += [f"  and {len(several) - _SHOWN} more"] if len(several) > _SHOWN else []
        return "\n".join(lines)

    def diagram(self, path: Path | str | None = None) -> Diagram:
        """Block diagram: FMUs with ports, connections, and the order in which FMUs are stepped.

        :param path: path of an SVG file to write; None: none is written.
        :returns: the picture, which a notebook shows.
        :raises SimulationError: if the file cannot be written.
        """
        (draw,) = registered(DIAGRAMS)
        drawn: Diagram = draw(self.document)
        if path is not None:
            drawn.write(as_path("diagram: path", path))
        return drawn

    def _repr_html_(self) -> str:
        return self.diagram().svg

    def write_ssp(
        self,
        path: Path | str,
        *,
        form: Literal["portable", "full"] = "portable",
        start_time: float | None = None,
        stop_time: float | None = None,
        step_size: float | None = None,
    ) -> None:
        """Write the system as an archive with its FMUs.

        Unless given, the default experiment is that of the last run, otherwise the longest time and the shortest step
        of the FMUs' default experiments.

        :param form: ``"portable"`` (SSP 1.0, for every importer) or ``"full"`` (SSP 2.0, all features).
        :param start_time: start of the default experiment [s].
        :param stop_time: its end [s].
        :param step_size: its communication step [s], an annotation that some importers read.
        :raises SimulationError: if the system is empty, has what this form cannot express, or the file cannot be
            written.
        """
        times = {"start_time": start_time, "stop_time": stop_time, "step_size": step_size}
        services().write_ssp(self, path, form=form, **times)

    def flatten(
        self,
        output: Path | str | None = None,
        *,
        components: Mapping[str, type[Any]] | None = None,
        backend: Backend = "auto",
        platforms: Platforms = "host",
        fmi: Fmi = "2",
        arrays: bool = True,
    ) -> Path:
        """Build the FMU of the whole system from the equations of motion of our components: no coupling error.

        Its variables have the names of the system's result, ``"swing.theta"``; start values are those of the system.

        :param output: folder; None: ``fmus/flat/``.  The file has the name of the system.
        :param components: components that are not in the catalogue, by the model name of their FMU.
        :param backend: this and the further ones as in :func:`liaisons.build`.
        :returns: path of the FMU.
        :raises SimulationError: if an FMU is none of these components.
        :raises ComponentError: if inputs depend on each other in a way that is not linear.
        :raises BuildError: if the FMU cannot be built.
        """
        form = {"backend": backend, "platforms": platforms, "fmi": fmi, "arrays": arrays}
        return services().flatten(self, output, components=components, **form)


def _refuse_unknown(method: str, settings: Settings) -> None:
    """Raise a TypeError for a keyword of a method that is not a setting, in the words of Python."""
    for name in settings:
        if name not in Settings.__annotations__:
            raise TypeError(f"{method}() got an unexpected keyword argument {name!r}")


def _refuse_run_options(settings: Any) -> None:
    """Remove the settings that only simulate() has from those of a stepped run; refuse them unless they are off.

    :raises SimulationError: naming the setting.
    """
    for name in ("verify", "progress", "real_time"):
        value = settings.pop(name, None)
        if value is not None and (not isinstance(value, (int, float)) or value):
            raise InvalidValueError(f"{name} = {shown(value)}: only simulate() takes it; leave it out")


def _single_simulation(
    fmu: FmuTarget,
    start_values: Mapping[str, ArrayLike | OperatorFmu] | None,
    keywords: Mapping[str, ArrayLike | OperatorFmu],
    *,
    isolated: bool | float,
    stop_time: float | None,
    step_size: float | None,
    endless: bool = False,
    **settings: Unpack[Settings],
) -> Simulation:
    """Simulation of one FMU and its operators, with checked settings.

    :param start_values: of the user.
    :param keywords: further ones.
    :raises SimulationError: for a bad setting, or a start value of an input that its function of time contradicts.
    """
    path = fmu_file("fmu", fmu)
    title, starts = path.stem, merged_start_values(path.stem, start_values, keywords)
    system = System(title or str(path))
    own = system._add_part(title, path, starts, isolated=isolated).fmu  # noqa: SLF001 - its name may have a dot
    with start_value_hints(own.variables):
        simulation = checked_simulation(system.document.as_single(), stop_time, step_size, endless=endless, **settings)
    for drive in simulation.drives:
        for (_, name), first in zip(drive.inputs, drive(simulation.times[0]).tolist(), strict=True):
            if name in starts and not np.allclose(np.asarray(starts[name], dtype=float), first, rtol=1e-9, atol=1e-9):
                words = f"{name} = {shown(starts[name])}: its function in inputs starts with {first:.10g}"
                raise SimulationError(f"{title}.{words}; leave one out")
    return simulation


def simulate(
    fmu: FmuTarget,
    /,
    *,
    stop_time: float | None = None,
    step_size: float | None = None,
    start_time: float | None = None,
    times: ArrayLike | None = None,
    tolerance: float | None = None,
    coupling: Coupling | None = None,
    error_tolerance: float | None = None,
    record: str | Iterable[str] | None = None,
    inputs: Mapping[str, Function] | None = None,
    verify: bool = False,
    progress: bool = False,
    real_time: float | None = None,
    isolated: bool | float = False,
    start_values: Mapping[str, ArrayLike | OperatorFmu] | None = None,
    **keywords: ArrayLike | OperatorFmu,
) -> Result:
    """Simulate one FMU, and the operators that prescribe its coordinates.

    Settings are those of :meth:`System.simulate`; for the first five, None means the value in the FMU's default
    experiment.

    :param fmu: path of an FMU; or a component by its name (``"Pendulum"``), file or class.
    :param stop_time: stop [s].
    :param step_size: distance between communication points [s]; if an FMU of Model Exchange has no value, a 500th of
        the time.
    :param start_time: start [s]; 0 if the FMU has no value.
    :param times: the communication points themselves [s], increasing; those that differ only by rounding count as one.
    :param tolerance: relative tolerance of the solvers; their own if the FMU has no value.
    :param coupling: of the FMU and its operators.
    :param error_tolerance: of a communication step; None: the communication points are fixed.
    :param record: a name of a variable or several; None: all outputs and inputs, or if there are none, the local
        variables.
    :param inputs: name -> function of time [s] that returns its value.  The function of an active coordinate ``s`` may
        return (s, s_dot, s_ddot).  The function is called for the communication points, and its values are set like
        those of a connected source; None: no functions.
    :param verify: simulate again with half the step size; ``result.error(name)`` is the difference over time.
    :param progress: show a progress bar on stderr.
    :param real_time: simulated seconds per second of the clock, for which the run waits; None: it does not wait.
    :param isolated: run the FMU in a process of its own, as in :meth:`System.add`.
    :param start_values: start values of parameters and inputs by name, where they differ from the FMU's; or the
        :func:`operator` of a coordinate.  An input that a function drives starts with the function's value.
    :param keywords: further start values, ``theta_0=0.2``; a keyword that is also a setting is the setting, and a
        variable of such a name has its value in ``start_values``.
    :returns: signals under their own names, ``result["theta"]``.
    :raises SimulationError: as :meth:`System.add` and :meth:`System.simulate` do; so is :class:`Interrupted`.
    """
    simulation = _single_simulation(
        fmu,
        start_values,
        keywords,
        isolated=isolated,
        stop_time=stop_time,
        step_size=step_size,
        start_time=start_time,
        times=times,
        tolerance=tolerance,
        coupling=coupling,
        error_tolerance=error_tolerance,
        record=record,
        inputs=inputs,
    )
    return run_to_end(simulation, verify=verify, progress=progress, real_time=real_time)


def start(
    subject: FmuTarget | System,
    /,
    stop_time: float | None = None,
    step_size: float | None = None,
    *,
    start_time: float | None = None,
    times: ArrayLike | None = None,
    tolerance: float | None = None,
    coupling: Coupling | None = None,
    error_tolerance: float | None = None,
    record: str | Iterable[str] | None = None,
    inputs: Mapping[str, Function] | None = None,
    isolated: bool | float = False,
    start_values: Mapping[str, ArrayLike | OperatorFmu] | None = None,
    **keywords: ArrayLike | OperatorFmu,
) -> Run:
    """Initialize one FMU, and the operators that prescribe its coordinates, or a system, for a run step by step.

    ::

        with start("Pendulum", step_size=0.02, theta_0=0.1) as run:
            while run.time < 10:
                run.step(theta_force=-run["theta_dot"])
        result = run.result

    Arguments are those of :func:`simulate`, except ``verify``, ``progress`` and ``real_time``; without ``stop_time``
    the run has no end.

    :param subject: path of an FMU; or a component by its name, file or class; or a system, or the path of its archive.
    :returns: the run, a context manager that releases the FMUs.
    :raises SimulationError: for a bad argument or an FMU that cannot be initialized.
    """
    settings: Settings = {
        "start_time": start_time,
        "times": times,
        "tolerance": tolerance,
        "coupling": coupling,
        "error_tolerance": error_tolerance,
        "record": record,
        "inputs": inputs,
    }
    if isinstance(subject, (str, Path)) and Path(subject).suffix == ".ssp":
        subject = System.from_ssp(subject)
    if isinstance(subject, System):
        system = subject.with_start_values(cast("Mapping[str, ArrayLike]", start_values or {}))
        system = system.isolated_copy(isolated) if isolated else system
        return system.start(stop_time, step_size, **settings, **cast("Any", keywords))
    _refuse_run_options(keywords)
    span = {"stop_time": stop_time, "step_size": step_size}
    simulation = _single_simulation(
        subject, start_values, keywords, isolated=isolated, endless=True, **span, **settings
    )
    return start_run(simulation)
