"""An operator: a source of σ(t), with its two derivatives taken from one expression."""

from __future__ import annotations

import inspect
from abc import abstractmethod

import casadi as ca

from liaisons import units
from liaisons.mechanics.component import Component, call, scalar
from liaisons.mechanics.model import Model, Port, PortMember, Variable

_TRIPLE = ("y", "y_dot", "y_ddot")


class Operator(Component, abstract=True):
    """Source of a signal y(t) and its derivatives, for an active port; abstract.

    A subclass declares parameters and defines :meth:`signal`; where the signal is not smooth, :meth:`events`.
    The outputs ``y``, ``y_dot``, ``y_ddot`` carry no unit: they take that of the port they are connected to.

    :raises ComponentError: when the subclass is defined, for an unknown symbol or a wrong size.
    """

    clock: ca.SX

    def __init__(self) -> None:
        super().__init__()
        self.clock = ca.SX.sym("t")

    @abstractmethod
    def signal(self, t: ca.SX) -> ca.SX:
        """y as an expression of time and the parameters."""

    def events(self) -> list[ca.SX]:
        """Instants at which y or one of its first two derivatives is not smooth."""
        return []

    @classmethod
    def variable_names(cls) -> list[str]:
        return [*(p.name for p in cls.parameters), *_TRIPLE]

    @classmethod
    def _check(cls) -> None:
        picture = cls()
        scalar(cls, "signal", call(picture, "signal", picture.clock), picture.symbols | {"t": picture.clock})
        for i, instant in enumerate(call(picture, "events")):
            scalar(cls, f"events[{i}]", instant, picture.symbols)

    @classmethod
    def model(cls) -> Model:
        picture = cls()
        t, k = picture.clock, picture.parameter_column
        y = ca.SX(picture.signal(t))
        y_dot = ca.jacobian(y, t)
        triple = ca.vertcat(y, y_dot, ca.jacobian(y_dot, t))
        events = picture.events()
        none = ca.SX(0, 1)
        x = u = memory = none  # an operator has no state, no input and nothing to remember
        texts = ("signal", "first derivative of the signal", "second derivative of the signal")
        return Model(
            name=cls.__name__,
            description=cls.summary(),
            documentation=inspect.getdoc(cls) or cls.__name__,
            parameters=tuple(p.variable("parameter", "tunable" if p.tunable else "fixed") for p in cls.parameters),
            inputs=(),
            outputs=tuple(
                Variable(name, units.ANY, text, "output", "continuous")
                for name, text in zip(_TRIPLE, texts, strict=True)
            ),
            states=(),
            memory=(),
            start=ca.Function("start", [t, u, k], [none, none]),
            derivatives=ca.Function("derivatives", [t, x, u, k], [none]),
            outputs_function=ca.Function("outputs", [t, x, u, k, memory], [ca.densify(triple)]),
            jump=ca.Function("jump", [t, x, u, k, memory], [none]),
            remember=ca.Function("remember", [t, x, u, k, memory], [none]),
            nominals=ca.Function("nominals", [t, x, u, k], [none]),
            conditions=ca.Function("conditions", [t, x, u, k], [none]),
            condition_texts=(),
            events=ca.Function("events", [k], [ca.vertcat(*events) if events else none]),
            ports=(Port("y", "signal", tuple(map(PortMember, ("s", "v", "a"), _TRIPLE))),),
            experiment=cls.experiment,
            equations={"y": str(y)},
        )
