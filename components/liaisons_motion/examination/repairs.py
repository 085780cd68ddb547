"""Causes of a difference: the single changes of the source with which equations and closed form agree."""

from __future__ import annotations

import ast
import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from time import perf_counter
from types import MethodType, ModuleType
from typing import Any, final
from zlib import crc32

import casadi as ca
import numpy as np

from liaisons.closed_forms import ClosedForm
from liaisons.language import Component, Mechanism
from liaisons_motion.examination.edits import Edit, edits_of, unit_edits
from liaisons_motion.examination.motions import EquationsOfMotion
from liaisons_motion.examination.statements import odd_factors, statements
from liaisons_motion.examination.terms import missing_terms
from liaisons_motion.examination.trials import Trial, solution_of, times_of, trials_of

_ENERGIES = ("kinetic_energy", "potential_energy", "lagrangian", "dissipation_function")
_FURTHER = 2
"""Ranks after the first repair that are still tried: less likely changes explain nothing more."""
_MOST = 10_000
"""Calls of the derivatives after which a motion with a change is given up."""
_EARLY = 7
"""Times of the first trial at which most changes are seen to repair nothing."""


@final
@dataclass(frozen=True)
class Cause:
    """A line that may be wrong, what to write instead, and why.

    :param evidence: what was measured with the change.
    """

    file: str
    line: int
    written: str
    instead: str
    evidence: str

    def __str__(self) -> str:
        return f"{Path(self.file).name}:{self.line}: {self.instead}  for  {self.written}: {self.evidence}"


@final
class Source:
    """A component's class in the source of its module, for changed copies of it.

    :raises OSError: if there is no such file or class.
    """

    def __init__(self, file: str, name: str) -> None:
        self.file, self.name = file, name
        self.tree = ast.parse(Path(file).read_text(encoding="utf-8"))
        classes = [n for n in ast.walk(self.tree) if isinstance(n, ast.ClassDef) and n.name == name]
        if not classes:
            raise OSError(f"{file} has no class {name}")
        self.declared = classes[0]

    @classmethod
    def of(cls, component: type[Component]) -> Source:
        """Source of a component."""
        return cls(inspect.getsourcefile(component) or "", component.__name__)

    @cached_property
    def component(self) -> Any:
        """The component as it is declared."""
        return self._globals[self.name]

    @cached_property
    def _globals(self) -> dict[str, Any]:
        return self._namespace()

    def changed(self) -> type[Component]:
        """The component that the tree declares now; raises what its declaration raises."""
        return self._namespace()[self.name]

    def method(self, name: str) -> Any:
        """A method as the tree has it now, without decorators."""
        [statement] = [s for s in self.declared.body if isinstance(s, ast.FunctionDef) and s.name == name]
        plain = copy(statement)
        plain.decorator_list = []
        namespace = dict(self._globals)
        exec(compile(ast.Module([plain], []), self.file, "exec"), namespace)
        return namespace[name]

    def mechanism(self, method: str) -> Any:
        """An instance with one method as the tree has it now; empty: with all that it declares now."""
        if not method:
            return self.changed()()
        mechanism = self.component()
        setattr(mechanism, method, MethodType(self.method(method), mechanism))
        return mechanism

    def energies(self, method: str) -> bytes:
        """Lagrangian and dissipation at two sets of values, with one of these methods as the tree has it."""
        mechanism = self.mechanism(method)
        column = ca.vertcat(*(ca.SX(getattr(mechanism, name)()) for name in ("lagrangian", "dissipation_function")))
        symbols = sorted(ca.symvar(column), key=str)
        evaluate = ca.Function("energies", symbols, [column])
        numbers = [evaluate(*(0.4 + (crc32(f"{k}{s}".encode()) % 997) / 1994 for s in symbols)) for k in (0, 1)]
        return np.round(np.array(numbers, dtype=float), 9).tobytes()

    def _namespace(self) -> dict[str, Any]:
        module = ModuleType(Path(self.file).stem)
        module.__file__ = self.file
        exec(compile(self.tree, self.file, "exec"), module.__dict__)
        return module.__dict__


def causes(
    component: type[Component],
    closed: ClosedForm,
    equations: EquationsOfMotion,
    trials: Sequence[Trial],
    end: float,
) -> list[Cause]:
    """Single changes with which equations and closed form agree at all trials, the likeliest first.

    :param trials: none if the closed form raised at the declared values.
    :param end: value of ``perf_counter`` at which the search ends.
    """
    try:
        stated = statements(component()) if issubclass(component, Mechanism) else {}
        search = _Search(Source.of(component), closed.__name__, closed, equations, trials, stated)
    except (OSError, SyntaxError):
        return []
    name = closed.__name__
    edits = edits_of(search.source.declared, _alike(component), [name])
    if trials:
        edits += missing_terms(search.source.declared, component)
    edits.sort(key=lambda edit: (edit.method != name, edit.rank))
    repairs = list[_Repair]()
    for edit in edits:
        ranks = [other.edit.rank for other in repairs if (other.edit.method == name) is (edit.method == name)]
        if perf_counter() > end or (ranks and edit.rank > min(ranks) + _FURTHER):
            continue
        worst = search.difference_with(edit)
        if worst is not None and worst <= 1:
            gained, odd = ((), 0) if edit.method == name else search.evidence_with(edit)
            repairs.append(_Repair(edit, worst, gained, odd))
    return [_cause(search.source, repair, trials) for repair in _ranked(repairs, name)]


def causes_of_statements(
    component: type[Component],
    closed: ClosedForm | None,
    trials: Sequence[Trial],
    stated: Mapping[str, bool],
    end: float,
) -> list[Cause]:
    """Single changes with which more of what the docstring states holds, and all else still does.

    :param closed: the closed form, which agrees with the equations at all trials; None without one.
    :param end: value of ``perf_counter`` at which the search ends.
    """
    try:
        source = Source.of(component)
        equations = EquationsOfMotion(component) if trials else None
    except (OSError, SyntaxError):
        return []
    name = closed.__name__ if closed else "exact"
    search = _Search(source, name, closed, equations, trials, stated)
    edits = edits_of(source.declared, _alike(component), [name])
    edits += missing_terms(source.declared, component)
    repairs = list[_Repair]()
    for edit in sorted(edits, key=lambda edit: edit.rank):
        if perf_counter() > end or (repairs and edit.rank > repairs[0].edit.rank + _FURTHER):
            break
        if edit.method == name:
            continue
        gained, odd = search.evidence_with(edit)
        if sum(gained) > 0 and search.is_harmless(edit):
            repairs.append(_Repair(edit, 0.0, gained, odd))
    return [_cause(source, repair, trials) for repair in _ranked(repairs, name)]


def causes_of_refusal(file: str, end: float) -> list[Cause]:
    """Single changes with which a file's one component can be loaded, and agrees with its closed form if it has one.

    :param end: value of ``perf_counter`` at which the search ends.
    """
    try:
        tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    except (OSError, SyntaxError, UnicodeDecodeError):
        return []
    names = [statement.name for statement in tree.body if isinstance(statement, ast.ClassDef)]
    if len(names) != 1:
        return []
    search = _Search(Source(file, names[0]), "exact", None, None, ())
    declared = search.source.declared
    edits = sorted([*edits_of(declared, lambda _: (), ["exact"]), *unit_edits(declared)], key=lambda edit: edit.rank)
    repairs = list[_Repair]()
    for edit in edits:
        if perf_counter() > end or (repairs and edit.rank > repairs[0].edit.rank + _FURTHER):
            break
        worst = search.difference_with(edit)
        if worst is not None and worst <= 1:
            repairs.append(_Repair(edit, worst))
    return [_cause(search.source, repair, ()) for repair in _ranked(repairs, "exact")]


@final
@dataclass(frozen=True)
class _Repair:
    """A change with which all agrees, the largest difference then, and what the docstring states: 1 gained, -1 lost."""

    edit: Edit
    worst: float
    statements: Sequence[int] = ()
    odd: int = 0  # factors that are not ½ before squares


@final
@dataclass(frozen=True)
class _Search:
    """What changes are tried on.

    :ivar known: differences by the energies that give them, as many changes give the same.
    """

    source: Source
    name: str  # of the closed form
    closed: Any  # a ClosedForm, which as a descriptor would be taken for a part of this class
    equations: EquationsOfMotion | None
    trials: Sequence[Trial]
    stated: Mapping[str, bool] = field(default_factory=dict[str, bool])
    known: dict[bytes, float] = field(default_factory=dict[bytes, float])

    def difference_with(self, edit: Edit) -> float | None:
        """Largest difference at the trials with a change, relative to the allowed one; None: nothing to compare."""
        take_back = edit.swap()
        try:
            return self._difference(edit.method)
        except Exception:  # noqa: BLE001 - a change may break the component in any way: then it repairs nothing
            return None
        finally:
            take_back()

    def is_harmless(self, edit: Edit) -> bool:
        """Whether the component is accepted with a change, and agrees with its closed form if it has one."""
        if self.trials:
            worst = self.difference_with(edit)
            return worst is not None and worst <= 1
        take_back = edit.swap()
        try:
            self.source.changed()
        except Exception:  # noqa: BLE001 - as above
            return False
        finally:
            take_back()
        return True

    def evidence_with(self, edit: Edit) -> tuple[Sequence[int], int]:
        """For each statement of the docstring 1 if it holds with a change only, -1 if it does without it only.

        Second, how many factors are odd with it.
        """
        if not issubclass(self.source.component, Mechanism):
            return (), 0
        take_back = edit.swap()
        try:
            changed = self.source.mechanism(edit.method)
            holding, odd = statements(changed) if self.stated else {}, odd_factors(changed)
        except Exception:  # noqa: BLE001 - as above
            holding, odd = dict[str, bool](), 0
        finally:
            take_back()
        return [holding.get(text, False) - holds for text, holds in self.stated.items()], odd

    def _difference(self, method: str) -> float | None:
        """The same with the source as it is now, of which one method was changed."""
        source, equations, closed = self.source, self.equations, self.closed
        if equations is None or not self.trials:
            if equations is not None and method == self.name:
                fresh, other = equations, closed.with_function(source.method(method))
            else:
                changed: Any = source.changed()
                fresh, other = EquationsOfMotion(changed), getattr(changed, self.name)
            return _worst(trial.differences() for trial in trials_of(fresh, other, 0, 2))
        t = times_of(equations)
        if method == self.name:
            other = closed.with_function(source.method(method))
            solutions = (solution_of(other, trial.values, equations.declared, t) for trial in self.trials)
            return _worst(trial.differences(one) for trial, one in zip(self.trials, solutions, strict=True))
        energies = source.energies(method) if method in _ENERGIES else b""
        if energies in self.known:
            return self.known[energies]
        fresh = EquationsOfMotion(source.changed())
        trials = (self.trials[0].until(_EARLY), *self.trials)
        times = (t[: len(next(iter(trial.motion.values())))] for trial in trials)
        rows = (fresh.outputs_at(one.values, at, most=_MOST) for one, at in zip(trials, times, strict=True))
        motions = map(fresh.by_name, rows)
        worst = _worst(trial.differences(None, one) for trial, one in zip(trials, motions, strict=True))
        if energies:
            self.known[energies] = worst
        return worst


def _ranked(repairs: Sequence[_Repair], name: str) -> Sequence[_Repair]:
    """One repair a line: those first with which more of the docstring holds, then the first of each side."""
    by_line: dict[int, _Repair] = {}
    for repair in sorted(repairs, key=lambda r: (-sum(r.statements), r.odd, r.edit.rank)):
        by_line.setdefault(repair.edit.line, repair)
    heads = {repair.edit.method == name: repair for repair in reversed(by_line.values())}.values()
    return sorted(by_line.values(), key=lambda r: (-sum(r.statements), r not in heads, r.odd, r.edit.rank))


def _cause(source: Source, repair: _Repair, trials: Sequence[Trial]) -> Cause:
    edit, evidence = repair.edit, list[str]()
    before = max((max(t.differences().values(), default=0.0) for t in trials), default=0.0)
    if before > 1:
        change = f"differences fall from {before:.2g} to {repair.worst:.2g} times what rounding allows"
        evidence.append(f"with it {change}, at {len(trials)} sets of values")
    elif not any(repair.statements):
        evidence.append("with it the component is accepted, and agrees with its closed form if it has one")
    if gained := repair.statements.count(1):
        evidence.append(f"{gained} of the docstring's formulas hold only with it")
    if lost := repair.statements.count(-1):
        evidence.append(f"{lost} of the docstring's formulas no longer hold with it")
    return Cause(source.file, edit.line, edit.written, edit.instead, "; ".join(evidence))


def _worst(differences: Iterable[Mapping[str, float]]) -> float:
    """Largest difference; those after one that is too large are not computed."""
    worst = 0.0
    for one in differences:
        worst = max(worst, *(math.inf if math.isnan(value) else value for value in one.values()))
        if worst > 1:
            break
    return worst


def _alike(component: type[Component]) -> Callable[[str], Sequence[str]]:
    """Names of declarations with the same unit as one; of values of a closed form likewise, and rates for values."""
    units = {v.name: v.unit for v in component().layout().parameters}
    units |= {v.name: v.unit for v in component().layout().inputs}
    for declared in getattr(component, "coordinates", ()):
        units[declared.name] = declared.unit
    units |= {declared.name: "point" for declared in getattr(component, "points", ())}
    starts = {name for name in units if name.endswith("_0")}

    def alike(name: str) -> Sequence[str]:
        if name not in units:
            return ()
        same = [other for other, unit in units.items() if unit == units[name] and other != name]
        return [*same, *sorted(starts - {name, *same})] if name in starts else same

    return alike
