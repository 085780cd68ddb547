"""Systems of connected FMUs.

::

    system = System("pumped swing")
    swing = system.add("swing", "fmus/Pendulum.fmu", theta_0=0.05)
    motor = system.add("operator", "fmus/Sinusoid.fmu", offset=1.0, amplitude=0.1, angular_frequency=6.26)
    system.connect(motor["y"], swing["length"])
    result = system.simulate(stop_time=60, step_size=0.1)
    result["swing.theta"]
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import final

from numpy.typing import ArrayLike

from liaisons.cosim.component import Component, End, component
from liaisons.cosim.ports import Link, links
from liaisons.cosim.result import Result
from liaisons.cosim.schedule import Coupling, Place
from liaisons.cosim.simulation import communication_points, real, run
from liaisons.errors import ConnectionError, SimulationError, suggestion  # noqa: A004 - the field's word for it


@final
class System:
    """FMUs, connected; :meth:`simulate` runs all of them from the start, as often as it is called.

    :param name: used in messages, results and figures.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._components: dict[str, Component] = {}
        self._links: dict[Place, Link] = {}

    def add(self, name: str, fmu: Path | str, /, **starts: float | bool | str) -> Component:
        """Put an FMU into the system.

        :param name: name of this component; no dot, and not taken yet.
        :param fmu: path of the file.
        :param starts: values of parameters and inputs at the start, where they differ from the FMU's.
        :returns: a handle; ``handle["length"]`` is one of its ends, to be connected.
        :raises SimulationError: if the name will not do, the file cannot be used here, or a start value is unknown,
            cannot be set, or has the wrong type.
        """
        if not name or "." in name:
            raise SimulationError(f"{self.name}: the name {name!r} of a component must not be empty or have a dot")
        if name in self._components:
            raise SimulationError(f"{self.name} has a component {name!r} already; choose another name")
        self._components[name] = component(name, fmu, starts)
        return self._components[name]

    def connect(self, source: End, target: End) -> None:
        """Connect two ends: ports, points, or single variables.

        * a signal or free coordinate with an active coordinate: value, rate and acceleration; from a free coordinate
          or point the force goes back as its load, both directions at once;
        * a named point with another (``upper["bob"]``, ``lower["pivot"]``): all their axes;
        * else an output with an input.

        Which end gives and which takes follows from causality, so their order does not matter.  Nothing is connected
        unless everything fits.

        :raises ConnectionError: if causality or units clash, or an input has a source already; names both ends.
        """
        for end in (source, target):
            if self._components.get(end.component.name) is not end.component:
                raise ConnectionError(f"{end} is no component of {self.name}; connect what its add() has returned")
        joined = links(source, target)
        for link in joined:
            taken = self._links.get(link.target.place)
            if taken is not None:
                raise ConnectionError(
                    f"{link.source} cannot be connected with {link.target}: {taken.source} feeds it already; "
                    "an input has one source"
                )
        self._links |= {link.target.place: link for link in joined}

    def simulate(
        self,
        stop_time: float | None = None,
        step_size: float | None = None,
        *,
        start_time: float = 0.0,
        times: ArrayLike | None = None,
        tolerance: float | None = None,
        coupling: Coupling = "gauss-seidel",
        record: Iterable[str] | None = None,
        progress: bool = False,
    ) -> Result:
        """Simulate from the start; see :mod:`liaisons.cosim.schedule` for what each input holds at which time.

        :param stop_time: end [s].
        :param step_size: distance of the communication points [s], t_i = start_time + i * step_size; the last step is
            shorter if need be.
        :param start_time: begin [s].
        :param times: the communication points themselves [s], increasing, in place of the three above.
        :param tolerance: relative tolerance of the FMUs' solvers; None leaves each its own.
        :param coupling: ``"gauss-seidel"`` steps sources before what they feed, ``"jacobi"`` all from the values at t.
        :param record: names ``"component.variable"``; all real outputs and inputs if None.
        :param progress: show a progress bar on stderr.
        :raises SimulationError: for a bad argument or an FMU that cannot be initialized; after that
            :class:`IncompleteError`, whose ``result`` has what was computed until then.
        :raises Interrupted: on Ctrl-C, at the end of the communication step; a ``KeyboardInterrupt`` with ``result``.
        """
        return run(
            self.name,
            self._components,
            recorded=self._recorded(record),
            times=communication_points(start_time, stop_time, step_size, times),
            links=list(self._links.values()),
            tolerance=tolerance,
            coupling=coupling,
            progress=progress,
        )

    def __repr__(self) -> str:
        lines = [f"System {self.name!r}"]
        lines += [f"  {component}" for component in self._components.values()]
        lines += [f"  {link.source} -> {link.target}" for link in self._links.values()]
        return "\n".join(lines)

    def _recorded(self, record: Iterable[str] | None) -> dict[str, Place]:
        """Name in the result -> what is recorded under it."""
        if record is None:
            places = [(c.name, v) for c in self._components.values() for v in c.fmu.reals("output", "input")]
            return {f"{component}.{variable}": (component, variable) for component, variable in places}
        return {name: self._place(name) for name in record}

    def _place(self, name: str) -> Place:
        owner, _, variable = name.partition(".")
        if owner not in self._components:
            hint = suggestion(owner, self._components)
            raise SimulationError(f"record {name!r}: {self.name} has no component {owner!r}{hint}")
        return real(self._components[owner], variable)
