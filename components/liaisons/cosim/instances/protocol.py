"""Instances of FMUs: the protocol, and the part that FMI 2.0 and 3.0 share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_double
from typing import Any, ClassVar, Self

from liaisons.cosim.compiled.calls import Action, Call, Numbers, Vector
from liaisons.errors import SimulationError
from liaisons.fmu_files import Scalar, Starts

INTERMEDIATE_INSTANTS = 5
"""Number of instants inside a step at which an FMU of ours takes inputs: its fifths, the end among them."""

Scalars = Sequence[Scalar]


class Instance(ABC):
    """An instance of an FMU; a context manager that terminates and frees it.

    Callers use only the capabilities that its :class:`Fmu` declares.

    :ivar name: name of the component, used as instance name and in messages.
    :ivar functions: names of the FMI functions of prepared calls, by action.
    """

    name: str
    functions: ClassVar[Mapping[Action, str]]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def initialize(self, starts: Starts, tolerance: float | None, start_time: float, stop_time: float) -> None:
        """Set start values, and enter initialization mode; in another run, the caller has restored the state before it.

        :param tolerance: relative tolerance of the FMU's solver; None: its default.
        :param stop_time: [s]; infinite: the FMU is told none.
        """

    @abstractmethod
    def assign(self, name: str, value: Any) -> None:
        """Set a start value, converted by :func:`liaisons.fmu_files.checked_starts`."""

    @abstractmethod
    def exit_initialization(self) -> None:
        """Exit initialization mode; steps may follow."""

    @abstractmethod
    def getter(self, variables: Scalars, values: Numbers) -> Call:
        """Call that reads variables into a buffer, one value for each."""

    @abstractmethod
    def setter(self, variables: Scalars, values: Numbers) -> Call:
        """Call that sets variables from a buffer, one value for each."""

    @abstractmethod
    def stepper(self, time: c_double, size: c_double) -> Call:
        """Call that makes a communication step; the buffers have its start and its size [s] when it is made."""

    @abstractmethod
    def save_and_restore_calls(self) -> tuple[Call, Call]:
        """Call that saves the state of the FMU, and call that restores it, any number of times."""

    def directional_derivatives(self, unknowns: Scalars, knowns: Scalars, seed: Numbers, values: Numbers) -> Call:
        """Call that writes the Jacobian of unknowns with respect to knowns, times the seed, to the values.

        Only where :attr:`Fmu.provides_directional_derivatives` is true.
        """
        raise NotImplementedError

    def output_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        """Call that reads derivatives of outputs by time into a buffer; ``orders`` has the order of each.

        Only where :attr:`Fmu.output_derivative_order` is as high.
        """
        raise NotImplementedError

    def input_derivatives(self, variables: Scalars, orders: Sequence[int], values: Numbers) -> Call:
        """Call that sets derivatives of inputs at the start of the next step; ``orders`` has the order of each.

        Only where :attr:`Fmu.input_derivatives` is true.
        """
        raise NotImplementedError

    def prepare_intermediate_inputs(self, variables: Scalars, values: Vector) -> Call:
        """Let the FMU read inputs from an array inside each step; returns a call to be made before the step.

        Only where :attr:`Fmu.takes_intermediate_inputs` is true and the instance requests
        intermediate updates.

        :param values: values at the fifths of the step, shape (INTERMEDIATE_INSTANTS, len(variables)).
        """
        raise NotImplementedError

    @property
    def continuous_states(self) -> tuple[Vector, Vector]:
        """Values of the continuous states, and their nominal values.

        Only where :attr:`Fmu.is_model_exchange` is true, as the next two.
        """
        raise NotImplementedError

    @property
    def has_events(self) -> bool:
        """Whether the FMU has event indicators or a next time event."""
        raise NotImplementedError

    def set_time_and_states(self, time: float, states: Vector) -> None:
        """Set a time [s] and continuous states, without handling events.

        :raises RefusedError: if the FMU discards them.
        """
        raise NotImplementedError

    def prepare_call(self, action: Action, function: Callable[..., Any], *arguments: object) -> Call:
        """Call of a function with arguments; :meth:`failure` makes its errors."""
        return Call(function, *arguments).set_failure(action, self.failure)

    @abstractmethod
    def failure(self, action: Action, status: int, when: str) -> SimulationError:
        """Error for the status of a prepared call, with function, time and messages of the FMU."""

    @abstractmethod
    def close(self) -> None:
        """Terminate and free the FMU, as far as FMI allows in its state; safe to repeat."""

    def release(self) -> None:
        """Do as :meth:`close` does, and raise a SimulationError if a process of its own crashes meanwhile."""
        self.close()


Instances = Mapping[str, Instance]
"""Instances by the names of their components."""
