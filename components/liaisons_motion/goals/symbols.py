"""The variables of a goal's mechanism in CasADi, with the numbers and sizes that they have at the start."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.algebra import stack
from liaisons.base.arguments import check_finite, name_dictionary, shown
from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.base.port_names import port_names
from liaisons.base.units import ANY, NUMBER, powers
from liaisons.composition import model_of
from liaisons.errors import PlanError, suggestion
from liaisons.expressions import nonzero_states
from liaisons.language import MechanicalComponent
from liaisons.library import component
from liaisons.mechanics import Model
from liaisons_motion.goals.goal import Goal, Readings

_SUBSTEPS = 32
"""Runge-Kutta steps in an interval or a communication step: of order four, they leave 1e-10 of a smooth motion."""
_WIDE_STATES = 24
"""Number of states far and near."""
_SCALES = (-2, 4)
"""Range of the powers of ten of their distances, in units of sizes."""


@dataclass(frozen=True, eq=False)
class GoalSymbols:
    """Symbols of the state and of σ, σ̇, σ̈, expressions of them, and their values at the start."""

    rounding: ClassVar = 1e-10  # values below this, in units of their sizes, count as 0

    goal: Goal
    component: Any
    model: Model
    parameters: dict[str, float]
    inputs: dict[str, Any]
    start: Mapping[str, Any]  # values of the goal, by scalars, and orientations as given; nothing for an expression
    start_parameters: Mapping[str, str]  # parameters that are start values, by coordinates and rates
    initial_sigma: Floats
    quaternions: Mapping[str, tuple[str, ...]]  # states, by orientations
    state_names: tuple[str, ...]  # of the mechanism
    state: ca.SX
    motion: tuple[ca.SX, ca.SX, ca.SX]  # σ, σ̇, σ̈; behind the moved coordinates forces, whose rates act on nothing
    sizes: Mapping[str, float]  # by variables
    time: float  # [s]
    energy: float  # [J]
    memory: tuple[float, ...]  # of the model: modes of its contacts; else 0

    @property
    def name(self) -> str:
        """Name of the component."""
        return self.component.__name__

    @property
    def arguments(self) -> list[ca.SX]:
        """Symbols of the state, σ, σ̇ and σ̈, four columns."""
        return [self.state, *self.motion]

    @property
    def motion_symbols(self) -> dict[str, ca.SX]:
        """Symbols of σ, σ̇, σ̈ and of forces by the names of the FMU's variables."""
        names = [(i, port_names(move)[:3]) for i, move in enumerate(self.goal.moves)]
        symbols = {name: x[i] for i, triple in names for name, x in zip(triple, self.motion, strict=True)}
        return symbols | by_name(self.goal.controls, ca.vertsplit(self.motion[0])[len(names) :])

    @property
    def model_arguments(self) -> tuple[Any, ...]:
        """Arguments of the model's functions: time, states, inputs, parameters and memory."""
        y = ca.vertcat(self.state, 0, 0)
        return (
            0,
            y,
            stack((self.inputs | self.motion_symbols).values()),
            stack(self.parameters.values()),
            ca.DM(self.memory),
        )

    @cached_property
    def rates(self) -> ca.SX:
        """Rates of the state, as expressions."""
        function = self.model.derivatives
        return ca.densify(function(*self.model_arguments[: function.n_in()])[: len(self.state_names)])

    @cached_property
    def initial_state(self) -> ca.SX:
        """The state at the start, as an expression of symbols for its start values."""
        inputs = self.inputs | {name: self.motion_symbols[name] for name in self.goal.driven}
        for move in self.goal.moves:
            _, rate, acceleration = port_names(move)[:3]
            inputs |= {rate: _finite_number(f"{self.name}: {move}", self.start.get(rate) or 0.0), acceleration: 0.0}
        states = zip(self.state_names, ca.vertsplit(self.state), strict=True)
        own = {self.start_parameters[name]: x for name, x in states if name in self.start_parameters}
        first = self.model.start(0, stack(inputs.values()), stack((self.parameters | own).values()))[0]
        return ca.densify(first[: len(self.state_names)])

    @cached_property
    def signals(self) -> Readings:
        """Expressions of all variables of the FMU, by name."""
        z = ca.vertsplit(self.model.outputs_function(*self.model_arguments))
        signals = {v.name: value for v, value in zip(self.model.outputs, z, strict=True)}
        signals |= by_name(self.state_names, ca.vertsplit(self.state))
        values = self.inputs | self.motion_symbols | self.parameters
        return Readings(self.name, signals | {name: ca.SX(value) for name, value in values.items()})

    @property
    def state_sizes(self) -> Floats:
        """Typical magnitudes of the states."""
        return np.array([self.sizes.get(name, 1.0) for name in self.state_names])

    @property
    def motion_sizes(self) -> list[Floats]:
        """Typical magnitudes of σ, σ̇ and σ̈."""
        sizes = np.array([self.sizes[name] for name in self.goal.driven])
        return [sizes / self.time**n for n in range(3)]

    @property
    def initial_sigma_sizes(self) -> Floats:
        """Absolute values of σ at the start; sizes where it is 0.

        Nearby states keep the signs of σ.
        """
        return np.where(self.initial_sigma == 0, self.motion_sizes[0], np.abs(self.initial_sigma))

    @property
    def relative_rates(self) -> ca.SX:
        """Rates of the state divided by their sizes."""
        return self.rates / (self.state_sizes / self.time)

    @property
    def forces(self) -> ca.SX:
        """Operator forces of the moved coordinates."""
        return ca.vertcat(*(self.signals[f"{name}_force"] for name in self.goal.moves))

    @property
    def mass(self) -> ca.SX:
        """Effective mass Θ of the moved coordinates."""
        if not self.goal.moves:
            return ca.SX(0, 0)
        return ca.jacobian(self.forces, self.motion[2][: len(self.goal.moves)])

    @cached_property
    def first_state(self) -> Floats:
        """Values of the state at the start."""
        return self.evaluate(self.initial_state, 0.0).ravel()

    def evaluate(self, expression: ca.SX, spread: float, seed: int = 0) -> Floats:
        """Values of an expression at a random state near the start.

        :param spread: radius of the neighbourhood, in units of sizes; 0: at the start.
        """
        rng, (centres, sizes) = np.random.default_rng(seed), self._centres_and_sizes
        point = centres + spread * rng.uniform(-1, 1, centres.shape) * sizes
        function = ca.Function("evaluate", [ca.vertcat(*self.arguments)], [expression])
        return np.atleast_2d(np.array(function(point)))

    @property
    def _centres_and_sizes(self) -> tuple[Floats, Floats]:
        """Start values of state, σ, σ̇ and σ̈, with the distances of nearby states from them."""
        still, starts = np.zeros(len(self.goal.driven)), self.start_parameters
        state = [self.parameters.get(starts.get(name, ""), 0.0) for name in self.state_names]  # no momenta
        sizes = (self.state_sizes, 0.5 * self.initial_sigma_sizes, *(3 * size for size in self.motion_sizes[1:]))
        return np.concatenate([state, self.initial_sigma, still, still]), np.concatenate(sizes)

    def scaled_jacobian(self, expression: ca.SX, symbols: ca.SX) -> ca.SX:
        """Derivatives of an expression by symbols in units of their sizes."""
        names, chosen = ([x.name() for x in ca.vertsplit(ca.vertcat(*xs))] for xs in (self.arguments, [symbols]))
        sizes = by_name(names, np.concatenate([self.state_sizes, *self.motion_sizes]))
        return ca.jacobian(expression, symbols) @ ca.diag(ca.DM([sizes[name] for name in chosen]))

    def dependencies(self, expression: ca.SX, symbols: ca.SX) -> NDArray[np.bool_]:
        """Whether rows of an expression depend on symbols, (rows, symbols), anywhere.

        Terms may cancel, so that the structure of the expression is not enough; what seems not to depend nearby is
        looked at in states of all sizes, and on every branch of its conditions.

        :param expression: in units of its size.
        """
        jacobian = self.scaled_jacobian(expression, symbols)
        depends = np.zeros(jacobian.shape, dtype=bool)
        if jacobian.nnz() == 0:
            return depends
        rows, columns = map(np.array, jacobian.sparsity().get_triplet())
        entries = ca.SX(ca.Sparsity.dense(len(rows), 1), jacobian.nz[:])
        nearby = [np.abs(self.evaluate(entries, 0.3, seed)).ravel() for seed in range(1, 4)]
        found = np.any([values > self.rounding for values in nearby], axis=0)
        left = np.flatnonzero(~found)
        if left.size:
            rng, (centres, sizes) = np.random.default_rng(0), self._centres_and_sizes
            scales = 10 ** rng.uniform(*_SCALES, (len(centres), _WIDE_STATES))
            states = centres[:, None] + scales * rng.uniform(-1, 1, scales.shape) * sizes[:, None]
            found[left] = nonzero_states(entries[left.tolist()], ca.vertcat(*self.arguments), states) >= 0
        depends[rows[found], columns[found]] = True
        return depends

    def depends(self, expression: ca.SX, symbols: ca.SX) -> bool:
        """Whether an expression depends on any of the symbols.

        :param expression: in units of its size.
        """
        return bool(self.dependencies(expression, symbols).any())

    def vanishes(self, expression: ca.SX) -> bool:
        """Whether an expression, divided by its size, is 0 at all nearby states."""
        everything = ca.vertcat(*self.motion, self.state)
        return not self.depends(expression, everything) and abs(self.evaluate(expression, 0.3).item()) < self.rounding

    def value_range(self, label: str, name: str, value: Any) -> tuple[float, float]:
        """Least and greatest value, from one number, or from two, of which None is infinite.

        :raises PlanError: if the value is neither, or the range is empty.
        """
        return _value_range(self.name, label, name, value)

    def values_by_element(self, label: str, values: object, variables: Sequence[str] | None = None) -> dict[str, Any]:
        """Values by the names of scalars, from names of scalars and of arrays.

        :param variables: names of the scalars; None: of all variables of the model.
        :raises PlanError: unless the values have names, and lists the lengths of their arrays.
        """
        names = [v.name for v in self.model.variables] if variables is None else variables
        return _values_by_element(label, values, names)

    def unit_quaternion(self, name: str, value: Any) -> Floats:
        """The quaternion of an orientation, divided by its norm.

        :raises PlanError: unless the value is four numbers, not all 0.
        """
        return _unit_quaternion(f"{self.name}: {name}", value)

    def magnitude(self, expression: ca.SX) -> float:
        """Typical magnitude of a scalar: median norm of its value and gradient at nearby states; else 1."""
        scaled_jacobian = self.scaled_jacobian(expression, ca.vertcat(*self.arguments))
        column = ca.densify(ca.horzcat(expression, scaled_jacobian))
        values = np.array([np.linalg.norm(self.evaluate(column, 0.5, seed)) for seed in range(1, 10)])
        finite_ones = values[np.isfinite(values)]
        return float(np.median(finite_ones)) or 1.0 if finite_ones.size else 1.0


def goal_symbols(goal: Goal) -> GoalSymbols:
    """Symbols of a goal's mechanism, with their values at the start.

    :raises PlanError: for an unknown name, with the nearest one, or a value that is not allowed.
    """
    declared: Any = component(goal.component)
    name = declared.__name__
    if not issubclass(declared, MechanicalComponent):
        raise PlanError(f"{name} is an operator; plan the motion of a mechanism")
    if not goal.phases:
        remedy = "say with phases=[...] in which order plan takes them; hold and observe the mechanism without them"
        declared.refuse_contacts("what is planned or held", remedy, PlanError)
    flat = model_of(declared, **goal.structure)[0].flat()
    _refuse_moves(goal, name, flat)
    parameters, inputs = _parameters_and_inputs(goal, declared, flat)
    own = {name for parameter in declared.parameters for name in parameter.names}
    start_parameters = {re.sub(r"_0(\[\d+\])?$", r"\1", name): name for name in parameters if name not in own}
    states = tuple(state.name for state in flat.states[:-2])
    quaternions = {orientation.name: orientation.quaternion for orientation in getattr(declared, "orientations", ())}
    rates = set(start_parameters) - set(states)
    start = _start_values(goal, flat, quaternions, {*states, *rates})
    parameters |= {start_parameters[rate]: _finite_number(f"{name}: {rate}", start.get(rate, 0.0)) for rate in rates}
    started = (key for key in states if key in start_parameters and isinstance(start.get(key), (int, float)))
    parameters |= {start_parameters[key]: float(start[key]) for key in started}
    units = {variable.name: variable.unit for variable in (*flat.parameters, *flat.inputs, *flat.outputs)}
    base = _base_scales(goal, units, parameters | inputs)
    return GoalSymbols(
        goal=goal,
        component=declared,
        model=flat,
        parameters=parameters,
        inputs=inputs,
        start=start,
        start_parameters=start_parameters,
        initial_sigma=np.array([range_middle(start.get(name), inputs[name]) for name in goal.driven]),
        quaternions=quaternions,
        state_names=states,
        sizes={name: _unit_size(base, unit) for name, unit in units.items()},
        time=_unit_size(base, "s"),
        energy=_unit_size(base, "J"),
        memory=(0.0,) * len(flat.memory),
        state=ca.vertcat(*(ca.SX.sym(name) for name in states)),
        motion=tuple(ca.SX.sym(name, len(goal.driven)) for name in port_names("sigma")[:3]),  # type: ignore[arg-type]
    )


def _start_values(
    goal: Goal, flat: Model, quaternions: Mapping[str, Sequence[str]], own: Collection[str]
) -> dict[str, Any]:
    """Values of a goal's start by the names of scalars, those of attitudes among them.

    :param own: states, and rates at the start.
    :raises PlanError: for another name, or a value that is not allowed.
    """
    name, values = component(goal.component).__name__, {} if goal.is_expression(goal.start) else goal.start
    start = _values_by_element(f"{name}: start", values, [v.name for v in flat.variables])
    oriented = [(axes, _unit_quaternion(f"{name}: {q}", start[q])) for q, axes in quaternions.items() if q in start]
    start |= {axis: float(x) for axes, unit in oriented for axis, x in zip(axes, unit, strict=True)}
    moved = {end for move in goal.moves for end in port_names(move)[:2]} | {*goal.controls}
    variables_at_start = {*own, *moved, *quaternions}
    for key in start:
        if key not in variables_at_start:
            raise PlanError(f"{name}: start has no {key!r}{suggestion(key, variables_at_start)}")
    for key in moved & start.keys():
        if start[key] is not None:
            _value_range(name, "start", key, start[key])
    return start


def _values_by_element(label: str, values: object, variables: Sequence[str]) -> dict[str, Any]:
    """Values by the names of scalars, from names of scalars and of arrays.

    :raises PlanError: unless the values have names, and lists the lengths of their arrays.
    """
    by_element: dict[str, Any] = {}
    for name, value in name_dictionary(label, values, PlanError).items():
        scalars = [variable for variable in variables if variable.startswith(f"{name}[")]
        if not scalars:
            by_element[name] = value
            continue
        several = value if isinstance(value, (list, tuple, np.ndarray)) else [value] * len(scalars)
        if len(several) != len(scalars):
            raise PlanError(f"{label} of {name} has {len(several)} values; give {len(scalars)}")
        by_element |= by_name(scalars, several)
    return by_element


def range_middle(value: Any, default: float) -> float:
    """The middle of the finite ends of a range; a number itself; the default for None, or without finite ends."""
    if value is None:
        return default
    if isinstance(value, (tuple, list)):
        ends = [x for x in value if x is not None and np.isfinite(x)]
        return float(np.mean(ends)) if ends else default
    return float(value)


def _refuse_moves(goal: Goal, owner: str, flat: Model) -> None:
    """Raise an error unless the moved coordinates are active ones, each named once."""
    actives = [active.value for active in flat.active]
    _refuse_controls(goal, owner, flat)
    if not actives and not goal.controls:
        forces = [v.name for v in flat.inputs if v.name.endswith("_force")]
        remedy = f"; give forces, controls={forces}" * bool(forces)
        raise PlanError(f"{owner} has no active coordinate: there is nothing that an operator could move{remedy}")
    for name in goal.moves:
        if name not in actives:
            is_free = name in {state.name for state in flat.states}
            hint = f": it moves freely; moves takes {', '.join(actives)}" if is_free else suggestion(name, actives)
            raise PlanError(f"{owner}: moves = {name!r} is no active coordinate{hint}")
    if len(set(goal.moves)) < len(goal.moves) or not goal.driven:
        raise PlanError(f"{owner}: moves = {shown(list(goal.moves))}: name each coordinate once")


def _refuse_controls(goal: Goal, owner: str, flat: Model) -> None:
    """Raise an error unless the controls are inputs that prescribe no coordinate, each named once."""
    prescribed = {name for active in flat.active for name in (active.value, active.rate, active.acceleration)}
    forces = [v.name for v in flat.inputs if v.name not in prescribed and not v.name.endswith("_impulse")]
    for name in goal.controls:
        if name not in forces:
            hint = f": it is prescribed; give moves={name!r}" if name in prescribed else suggestion(name, forces)
            raise PlanError(f"{owner}: controls = {name!r} is no input force{hint}")
    if len(set(goal.controls)) < len(goal.controls):
        raise PlanError(f"{owner}: controls = {shown(list(goal.controls))}: name each force once")


def _parameters_and_inputs(goal: Goal, declared: Any, flat: Model) -> tuple[dict[str, float], dict[str, Any]]:
    """Values of parameters and of inputs by name: those of the goal, others as declared."""
    owner = declared.__name__
    parameters, inputs = ({v.name: v.starts[0] for v in own} for own in (flat.parameters, flat.inputs))
    moved = {name for move in goal.moves for name in port_names(move)[:3]} | {*goal.controls}
    variables = {p.name: p.variable("parameter", "fixed") for p in declared.parameters}
    variables |= {v.name: v for v in flat.inputs if v.name not in variables}
    for name, value in goal.parameters.items():
        if name in moved:
            word = "a control" if name in goal.controls else "moved"
            raise PlanError(f"{owner}: {name} is {word} and cannot have the fixed value {shown(value)}")
        if name not in variables:
            raise PlanError(f"{owner} has no parameter or input {name!r}{suggestion(name, variables)}")
        check_finite(f"{owner}: {name}", value, PlanError)
        if not variables[name].allows(float(value)):
            raise PlanError(f"{owner}: {name} = {value} must be {variables[name].domain()}")
        (parameters if name in parameters else inputs)[name] = float(value)
    return parameters, inputs


def _base_scales(goal: Goal, units: Mapping[str, str], values: Mapping[str, Any]) -> Floats:
    """Sizes of the base units in which the numbers of a goal are nearest to 1, by least squares of logarithms.

    Divided by them, the quantities of a goal are the same in all units, and so is the plan.  Zero, infinity and pure
    numbers do not count.

    :param values: of parameters and inputs.
    :returns: one size a base unit, in the order of :data:`liaisons.base.units.Powers`.
    """
    dictionaries: list[Any] = [names for names in (goal.bounds, goal.start, goal.end) if isinstance(names, Mapping)]
    quantities = [
        (value, units[name])
        for names in (*dictionaries, values)
        for name, entries in names.items()
        for value in (entries if isinstance(entries, (tuple, list)) else [entries])
        if name in units and isinstance(value, (int, float))
    ]
    quantities += [(value, "s") for value in goal.duration]
    logarithms = {
        (abs(value), unit): np.log(abs(float(value)))
        for value, unit in quantities
        if unit != ANY and np.isfinite(value) and value != 0 and any(powers(unit))
    }
    exponents = np.array([powers(unit) for _, unit in logarithms], dtype=float).reshape(-1, len(NUMBER))
    return np.exp(np.linalg.lstsq(exponents, np.array([*logarithms.values()]), rcond=None)[0])


def _unit_size(base: Floats, unit: str) -> float:
    """Size of a quantity with a unit, from those of the base units."""
    return 1.0 if unit == ANY else float(np.prod(base ** np.array(powers(unit), dtype=float)))


def _unit_quaternion(label: str, value: Any) -> Floats:
    """A quaternion divided by its norm.

    :raises PlanError: unless the value is four numbers, not all 0.
    """
    try:
        quaternion = np.array(value, dtype=float)
    except (TypeError, ValueError):
        quaternion = np.zeros(0)
    if quaternion.shape != (4,) or not np.linalg.norm(quaternion) > 0:
        raise PlanError(f"{label} = {shown(value)}: give four numbers, not all 0, a quaternion (w, x, y, z)")
    return quaternion / np.linalg.norm(quaternion)


def _finite_number(label: str, value: Any) -> float:
    """The value as a float.

    :raises PlanError: if it is not one.
    """
    check_finite(label, value, PlanError)
    return float(value)


def _value_range(owner: str, label: str, name: str, value: Any) -> tuple[float, float]:
    """Least and greatest value, from one number, or from two, of which None is infinite.

    :raises PlanError: if the value is neither, or the range is empty.
    """
    label = f"{owner}: {label} of {name} = {shown(value)}"
    value = value.tolist() if isinstance(value, np.ndarray) else value
    if isinstance(value, (tuple, list)):
        if len(value) != 2 or not all(x is None or (isinstance(x, Real) and not np.isnan(float(x))) for x in value):
            raise PlanError(f"{label}: give a number, or two, (low, high)")
        low, high = (-np.inf if value[0] is None else value[0]), (np.inf if value[1] is None else value[1])
    else:
        low = high = _finite_number(f"{owner}: {name}", value)
    if not low <= high:
        raise PlanError(f"{label}: low must not exceed high")
    return float(low), float(high)


def runge_kutta(z: ca.MX, p: ca.MX, rate: ca.MX) -> ca.Function:
    """Function (z, p, duration) -> z after the duration, by steps of the classical Runge-Kutta method."""
    return ca.simpleRK(ca.Function("rate", [z, p], [ca.densify(rate)]), _SUBSTEPS)
