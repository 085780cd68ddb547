"""The examination of a component: verdicts with their reasons, causes of what is wrong, and what was not checked."""

from __future__ import annotations

import ast
import inspect
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from textwrap import dedent
from time import perf_counter
from typing import Any, final

import casadi as ca
import numpy as np

from liaisons import Verdict, verdict
from liaisons.base.arguments import check_positive
from liaisons.closed_forms import ClosedForm
from liaisons.errors import ComponentError, InvalidValueError, LiaisonsError
from liaisons.language import Component, Friction, Mechanism, Parameter
from liaisons.library import Target
from liaisons.library import component as component_of
from liaisons_motion.examination.motions import EquationsOfMotion
from liaisons_motion.examination.repairs import Cause, causes, causes_of_refusal, causes_of_statements
from liaisons_motion.examination.statements import statements
from liaisons_motion.examination.trials import Trial, trials_of

_SEED = 20
_TRIALS = 3
"""Sets of values beside the declared ones: two that agree by chance are rare, a third one costs little."""

_LEAST = 4.0
"""Time after which no further set of values is tried, and least time for the docstring's formulas [s]."""


@final
@dataclass(frozen=True)
class Examination:
    """What was found of a component.

    :ivar causes: single changes with which all agrees, the likeliest first; none where all holds.
    :ivar unchecked: what was not checked, and why.
    :ivar is_loaded: whether the component's declarations were accepted.
    """

    component: str
    verdicts: tuple[Verdict, ...]
    causes: tuple[Cause, ...] = ()
    unchecked: tuple[str, ...] = ()
    is_loaded: bool = True

    @property
    def passed(self) -> bool:
        """Whether all verdicts hold."""
        return all(one.passed for one in self.verdicts)

    def as_dictionary(self) -> dict[str, Any]:
        """All of it as numbers, texts, lists and dictionaries, for programs; an infinite error is None."""
        verdicts = [
            {**asdict(one), "error": one.error if np.isfinite(one.error) else None, "passed": one.passed}
            for one in self.verdicts
        ]
        return {
            "component": self.component,
            "passed": self.passed,
            "verdicts": verdicts,
            "causes": [asdict(cause) for cause in self.causes],
            "unchecked": list(self.unchecked),
        }


@final
@dataclass(frozen=True)
class _Report:
    """Verdicts and notes as they are made."""

    verdicts: list[Verdict] = field(default_factory=list[Verdict])
    unchecked: list[str] = field(default_factory=list[str])

    def add(self, claim: str, error: float, tolerance: float, reason: str) -> None:
        self.verdicts.append(verdict(claim, error=error, tolerance=tolerance, reason=reason))


def check_component(component: Target, *, seconds: float = 12.0) -> Examination:
    """Examine a component: its declarations, energies, equations and closed form against each other.

    :param component: name, file or class.
    :param seconds: time after which the search for causes ends [s].
    :raises LiaisonsError: if there is no such component.  The refusal of a file's declarations is a verdict.
    """
    check_positive("check_component: seconds", seconds, InvalidValueError)
    end, report = perf_counter() + seconds, _Report()
    try:
        declared = component_of(component)
    except LiaisonsError as error:
        path = Path(component) if isinstance(component, (str, Path)) else Path()
        if path.suffix != ".py" or not path.is_file():
            raise
        return _examination_of_refused(path, error, end)
    equations: EquationsOfMotion | None = None
    try:
        equations = EquationsOfMotion(declared)
    except ComponentError as error:
        report.unchecked.append(f"motion: {error}; its FMU is")
    if issubclass(declared, Mechanism):
        _check_declarations(declared, report)
        _check_energies(declared, report)
    closed: Any = getattr(declared, "exact", None)
    trials, explained = list[Trial](), list[Cause]()
    if _is_checkable(closed, report) and equations is not None:
        trials, explained = _check_closed_form(declared, closed, equations, report, end)
    if issubclass(declared, Mechanism) and (stated := statements(declared())):
        if not explained and not all(stated.values()) and all(one.passed for one in report.verdicts):
            end = max(end, perf_counter() + _LEAST)
            explained = causes_of_statements(declared, closed if trials else None, trials, stated, end)
        _check_statements(stated, report, is_explained=bool(explained))
    return Examination(declared.__name__, tuple(report.verdicts), tuple(explained), tuple(report.unchecked))


def _examination_of_refused(path: Path, error: Exception, end: float) -> Examination:
    """Why a file's component cannot be loaded, and what would let it."""
    report = _Report()
    report.add(f"it can be loaded: {error}", math.inf, 0.0, "a component is checked when it is declared")
    with suppress(OSError, SyntaxError, UnicodeDecodeError):
        for declared in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(declared, ast.ClassDef):
                _check_names(declared, report)
    return Examination(path.stem, tuple(report.verdicts), tuple(causes_of_refusal(str(path), end)), is_loaded=False)


def _is_checkable(closed: Any, report: _Report) -> bool:
    """Whether there is a closed form of time."""
    if closed is None:
        report.unchecked.append("closed form: none is called exact")
    elif not isinstance(closed, ClosedForm) or "self" in closed.arguments:
        claim = 'exact is a closed form: write @closed_form("which solution"), @staticmethod, def exact(t, at)'
        report.add(claim, math.inf, 0.0, "it is called with times and values, beside the class")
    elif closed.arguments != ("t",):
        report.unchecked.append(f"closed form: it takes {', '.join(closed.arguments)}; exact(t, at) is checked")
    else:
        return True
    return False


def _check_declarations(declared: type[Mechanism], report: _Report) -> None:
    """Each parameter of the class is used by it, outside of its closed form."""
    try:
        tree = ast.parse(dedent(inspect.getsource(declared)))
    except (OSError, TypeError, SyntaxError):
        report.unchecked.append("declarations: there is no source")
        return
    used = {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute) and ast.unparse(n.value) == "self"}
    for statement in (s for whole in tree.body if isinstance(whole, ast.ClassDef) for s in whole.body):
        is_declared = isinstance(statement, ast.Assign) and _is_parameter(statement.value)
        constants = (n for n in ast.walk(statement) if isinstance(n, ast.Constant) and not is_declared)
        used |= {str(n.value) for n in constants}  # of decorators, by name
    assigned = {ast.unparse(n.targets[0]) for n in ast.walk(tree) if isinstance(n, ast.Assign)}
    items = {name: item for name, item in vars(declared).items() if name in assigned}
    own = [n for n, item in items.items() if isinstance(item, Parameter) and not isinstance(item, Friction)]
    inherited = {str(symbol) for symbol in ca.symvar(declared().lagrangian())}
    unused = [name for name in own if name not in used | inherited]
    claim = f"each parameter is used{': ' + ', '.join(unused) + ' not' if unused else ''}"
    report.add(claim, float(len(unused)), 0.0, "a parameter that nothing depends on is forgotten in an energy")
    for whole in tree.body:
        if isinstance(whole, ast.ClassDef):
            _check_names(whole, report)


def _is_parameter(value: ast.expr) -> bool:
    return isinstance(value, ast.Call) and ast.unparse(value.func).endswith("Parameter")


def _check_names(declared: ast.ClassDef, report: _Report) -> None:
    """No declaration or method of a class is hidden by a later one of the same name."""
    lines = dict[str, list[int]]()
    for one in declared.body:
        if isinstance(one, ast.FunctionDef) and any("." in ast.unparse(d) for d in one.decorator_list):
            continue  # of a property
        targets = one.targets if isinstance(one, ast.Assign) else []
        names = [one.name] if isinstance(one, ast.FunctionDef) else [ast.unparse(target) for target in targets]
        for name in names:
            lines.setdefault(name, []).append(one.lineno)
    twice = [f"{name} in lines {', '.join(map(str, at))}" for name, at in lines.items() if len(at) > 1]
    if twice:
        claim = f"{declared.name} declares each name once: {'; '.join(twice)} of the class"
        report.add(claim, float(len(twice)), 0.0, "the last one hides those before it")


def _check_energies(declared: type[Mechanism], report: _Report) -> None:
    """The kinetic energy is positive wherever the motion may go, at seeded random states."""
    if not declared.has_energies():
        report.unchecked.append("kinetic energy: the component declares a Lagrangian alone")
        return
    mechanism = declared()
    kinetic = mechanism.kinetic_energy()
    symbols = ca.symvar(kinetic)
    evaluate, random = ca.Function("kinetic", symbols, [kinetic]), np.random.default_rng(_SEED)
    starts = mechanism.start_values()
    moving = {str(s) for part in (mechanism.free.q, mechanism.active.s) for s in ca.vertsplit(part)}
    rows = [_random_values([str(s) for s in symbols], starts, moving, random) for _ in range(100)]
    values = np.array([float(evaluate(*row)) for row in rows])
    size = max(float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0)), 1e-300)
    least = float(np.min(values[np.isfinite(values)], initial=0.0))
    reason = "rounding of a sum of squares, at 100 random states"
    report.add("T >= 0", max(0.0, -least / size), 1e-12, reason)


def _random_values(
    names: Sequence[str], starts: dict[str, float], moving: set[str], random: np.random.Generator
) -> list[float]:
    """Random rates and positions, parameters near their declared values."""
    near, anywhere = random.uniform(0.7, 1.3, len(names)), random.normal(size=len(names))
    at_rest = {name for name in moving if not starts.get(name)}
    return [
        float(starts[name] * near[k]) if name in starts and name not in at_rest else float(anywhere[k])
        for k, name in enumerate(names)
    ]


def _check_closed_form(
    declared: type[Component], closed: ClosedForm, equations: EquationsOfMotion, report: _Report, end: float
) -> tuple[list[Trial], list[Cause]]:
    """The closed form is the motion by the equations, at the declared values and at others that it covers."""
    trials = list[Trial]()
    reason = "rounding 1e-8 of its size, and ten times the error of the integration"
    try:
        trials += trials_of(equations, closed, _SEED, _TRIALS, perf_counter() + _LEAST)
    except Exception as error:  # noqa: BLE001 - a closed form may raise anything: that is what is found
        reason = "it is called with the declared values, and with those of experiment's reference"
        report.add(f"exact can be evaluated: {type(error).__name__}: {error}", math.inf, 0.0, reason)
        return [], causes(declared, closed, equations, (), end)
    differences: dict[str, float] = {}
    for trial in trials:
        for name, difference in trial.differences().items():
            differences[name] = max(difference, differences.get(name, 0.0))
    for name, difference in differences.items():
        report.add(f"{name} is what exact says, at {len(trials)} sets of values", difference, 1.0, reason)
    if not differences:
        report.unchecked.append("closed form: the motion is too uncertain to be compared")
    is_wrong = any(difference > 1 for difference in differences.values())
    return trials, causes(declared, closed, equations, trials, end) if is_wrong else []


def _check_statements(stated: Mapping[str, bool], report: _Report, *, is_explained: bool) -> None:
    """What the docstring states of the motion holds; if nothing explains why not, it may be said of a regime."""
    for text, holds in stated.items():
        if holds or is_explained:
            reason = "rounding, at 3 states; accelerations are Lagrange's"
            report.add(f"docstring: {text}", 0.0 if holds else math.inf, 1e-9, reason)
        else:
            report.unchecked.append(f"docstring: {text}, which does not hold at all states")
