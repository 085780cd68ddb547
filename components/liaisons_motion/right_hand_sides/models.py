"""Models in continuous time, with the operators that move them: from a subject to its right-hand side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, final

from liaisons import assemble
from liaisons.base.arguments import name_dictionary
from liaisons.errors import ComponentError, InvalidValueError, LiaisonsError, suggestion
from liaisons.language import Component, Operator, Variable
from liaisons.library import Target, component
from liaisons.mechanics import Model
from liaisons_motion.right_hand_sides.right_hand_side import (
    RightHandSide,
    checked_output_rows,
    domain_gaps,
    right_hand_side,
)

if TYPE_CHECKING:
    from liaisons import System

INTEGRALS = ("work", "dissipated")
"""States that no motion depends on; integrated only for outputs that need them."""


@final
@dataclass(frozen=True, eq=False)
class ContinuousModel:
    """A model in continuous time, with arrays element by element, and the operators that move it.

    :param model: without its operators.
    :param moving: active coordinate -> model of the operator that moves it.
    :param starts: start values of an FMU that differ from those that its component declares.
    """

    model: Model
    moving: Mapping[str, Model] = field(default_factory=dict)
    starts: Mapping[str, float] = field(default_factory=dict)

    def moved_by(self, operators: Mapping[str, Target] | None, error: type[LiaisonsError] = InvalidValueError) -> Self:
        """The model with operators.

        :param operators: active coordinate -> operator by its name, file or class; None: none.
        :raises ComponentError: if one is no function of time, or what it is put onto is not active.
        """
        model, moving = self.model, dict[str, Model]()
        active = [a.value for a in model.active]
        for name, target in name_dictionary("operators", {} if operators is None else operators, error).items():
            operator = component(target)
            if name not in active:
                raise ComponentError(
                    f"operators: {model.name} has no active coordinate {name!r}{suggestion(name, active)}"
                )
            if not (isinstance(operator, type) and issubclass(operator, Operator)):
                raise ComponentError(f"operators: {name} = {operator!r} is no Operator; give the class, e.g. Sinusoid")
            moving[name] = _flat_model(operator)
            if moving[name].states or moving[name].inputs:
                raise ComponentError(
                    f"operators: {operator.__name__} on {name} closes a loop; "
                    "in an ensemble an operator is a function of time"
                )
        return replace(self, moving=moving)

    @property
    def variables(self) -> dict[str, Variable]:
        """Parameters and inputs that can be set, by name; those of operators as ``"length.amplitude"``."""
        model, moving = self.model, self.moving
        driven = {name for a in model.active if a.value in moving for name in (a.value, a.rate, a.acceleration)}
        own = {v.name: v for v in (*model.parameters, *model.inputs) if v.name not in driven}
        return own | {f"{name}.{p.name}": p for name, operator in moving.items() for p in operator.parameters}

    @property
    def coordinates_and_momenta(self) -> list[str]:
        """Names of the states on which the motion depends."""
        return [state.name for state in self.model.states if state.name.rpartition(".")[2] not in INTEGRALS]

    def check_outputs(self, record: Iterable[str]) -> None:
        """Raise a ComponentError if a name to be recorded is no output."""
        checked_output_rows(self.model, record)

    def domain_gaps(self, name: str, value: Any) -> list[Any]:
        """Expressions or numbers that are > 0 while a variable that can be set has a value in its domain."""
        return domain_gaps(self.variables[name], value)

    def right_hand_side(
        self,
        *,
        lanes: Iterable[str],
        shared: Iterable[str],
        record: Sequence[str],
        start_time: float = 0.0,
        driven: Sequence[str] | None = None,
    ) -> RightHandSide:
        """Expressions of the motion, reduced to the states on which recorded outputs depend.

        :param lanes: names of the values that differ between the cases, in the order of their column.
        :param shared: names of the values that all cases share.
        :param record: names of outputs.
        :param driven: inputs and active coordinates that are polynomials of degree :data:`DEGREE` in time.  If not
            None, further shared values are the start time, the instant from which the polynomials count, and their
            coefficients, the constant ones first.
        :raises ComponentError: for an unknown output, outputs that no state moves, or a function that is not made of
            scalar operations.
        """
        options: dict[str, Any] = {"lanes": lanes, "shared": shared, "record": record}
        return right_hand_side(self.model, self.moving, **options, start_time=start_time, driven=driven)


@lru_cache(maxsize=32)
def _flat_model(declared: type[Component]) -> Model:
    """Model of a component whose variables are scalars: each element of an array is one."""
    return assemble(declared).flat()


def continuous_model(
    subject: Target | Model | System,
    task: str,
    remedy: str,
    error: type[LiaisonsError] = ComponentError,
    *,
    allow_contacts: bool = False,
    allow_fmus: bool = False,
) -> ContinuousModel:
    """Model of a component or a system in continuous time, with arrays element by element.

    :param task: what needs the model, for the error; ``remedy``: what the user may do instead.
    :param allow_fmus: whether the path of an FMU of ours stands for its component with the start values in it.
    :raises LiaisonsError: for samples, and for contacts unless they are allowed.
    """
    declared, starts = _declared_and_starts(subject, allow_fmus=allow_fmus)
    if not allow_contacts:
        declared.refuse_contacts(task, remedy, error)
    if isinstance(declared, type):
        declared.refuse_samples(task, remedy, error)
    found = ContinuousModel(declared.flat() if isinstance(declared, Model) else _flat_model(declared))
    settings = found.variables.values() if starts else ()
    return replace(found, starts={v.name: starts[v.name] for v in settings if starts[v.name] != v.start})


def _declared_and_starts(
    subject: Target | Model | System, *, allow_fmus: bool
) -> tuple[Model | type[Component], Mapping[str, float]]:
    """Component or model of a subject, and all start values in an FMU; FMUs and systems are loaded for these alone."""
    if isinstance(subject, Model):
        return subject, {}
    is_fmu = isinstance(subject, (str, Path)) and allow_fmus and Path(subject).suffix == ".fmu"
    if isinstance(subject, (str, Path, type)) and not is_fmu:
        return component(subject), {}
    from liaisons import System
    from liaisons.composition import model_of

    return model_of(subject) if is_fmu or isinstance(subject, System) else (component(subject), {})
