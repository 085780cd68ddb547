"""Functions of a motion, made when they are needed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import final

import casadi as ca
import numpy as np

from liaisons.algebra import stack
from liaisons.expressions import Program
from liaisons.mechanics import Model
from liaisons_motion.derivatives.compiled_steps import CompiledSteps
from liaisons_motion.derivatives.contacts import Contacts
from liaisons_motion.ensembles import Members, model_with_operators
from liaisons_motion.right_hand_sides import ContinuousModel, RightHandSide


@final
class MotionFunctions:
    """Functions of one motion, each made when it is needed: steps, start, events and signals."""

    def __init__(self, moved: ContinuousModel, equations: RightHandSide) -> None:
        """Take the model with its operators, and the equations of the motion."""
        self.model, self._moved, self._equations = moved.model, moved, equations
        self._t, self._k, self._s, self._y = equations.symbols
        self.contacts = None if equations.contacts is None else Contacts(equations)
        self.steps = CompiledSteps(equations, self.contacts)
        self.condition_texts, self.out_of_reach = equations.condition_texts, equations.out_of_reach
        self.prescribed_values = equations.prescribed_values
        self.prescribed_names, self.states = tuple(equations.prescribed), self._y.numel()

    @cached_property
    def state_moving_inputs(self) -> set[str]:
        """Names of the active coordinates that move states when they jump."""
        from liaisons.fmu import jump_effects

        effects, active = jump_effects(self.model), [a.value for a in self.model.active]
        moving = np.isin(active, self.prescribed_names)
        carries = effects.moves | effects.mixes[:, moving].any(axis=1)
        return {name for name, carried in zip(active, carries, strict=True) if carried}

    @cached_property
    def members(self) -> Members:
        """An instance of the core of the motion's FMU, whose contacts it records."""
        return Members(model_with_operators(self._moved), 1)

    @cached_property
    def start(self) -> ca.Function:
        """Function (k, s) -> first state, and nominal values."""
        return _function([self._k, self._s], self._equations.start, self._equations.sizes)

    @cached_property
    def start_derivatives(self) -> ca.Function:
        """Function (k, s) -> derivatives of the first state by k."""
        return _function([self._k, self._s], ca.jacobian(self._equations.start, self._k))

    @cached_property
    def events(self) -> ca.Function:
        """Function (t, k, s) -> next instants of events, and their derivatives by k."""
        instants = self._equations.events
        return _function([self._t, self._k, self._s], instants, ca.jacobian(instants, self._k))

    @cached_property
    def prescribed(self) -> ca.Function:
        """Function (t, k, s) -> values of the prescribed active coordinates."""
        return _function([self._t, self._k, self._s], stack(self._equations.prescribed.values()))

    @cached_property
    def state_after_event(self) -> ca.Function | None:
        """Function (t, k, s, y, t before, s before) -> state after an event, derivatives by k, y and instant."""
        landed, (t, s) = self._equations.landed, self._equations.before
        if landed is None:
            return None
        of_time = ca.jacobian(landed, self._t) + ca.jacobian(landed, t)
        by = (ca.jacobian(landed, x) for x in (self._k, self._y))
        return _function([*self._equations.symbols, t, s], landed, *by, of_time)

    @cached_property
    def outputs(self) -> Program:
        """Program of the signals."""
        return Program.of(self._equations.symbols, [self._equations.outputs])

    @cached_property
    def conditions(self) -> Program:
        """Program of the numbers that must stay > 0."""
        return Program.of(self._equations.symbols, [self._equations.conditions])

    @cached_property
    def output_rates(self) -> Program:
        """Program of the time derivatives of the signals."""
        along = ca.jtimes(self._equations.outputs, ca.vertcat(self._t, self._y), ca.vertcat(1, self._equations.rates))
        return Program.of(self._equations.symbols, [along])

    @cached_property
    def output_slopes(self) -> tuple[list[tuple[int, int]], Program]:
        """Pairs (signal, value or state, states behind values), and the program of their partial derivatives."""
        slopes = ca.jacobian(self._equations.outputs, ca.vertcat(self._k, self._y))
        where = list(zip(*slopes.sparsity().get_triplet(), strict=True))
        return where, Program.of(self._equations.symbols, [slopes.nz[:]])


def _function(inputs: Sequence[ca.SX], *outputs: ca.SX) -> ca.Function:
    """CasADi function with common subexpressions shared."""
    return ca.Function("function", list(inputs), ca.cse([ca.densify(output) for output in outputs]))


@lru_cache(maxsize=32)
def motion_functions(
    model: Model,
    *,
    moving: tuple[tuple[str, Model], ...],
    names: tuple[str, ...],
    shared: tuple[str, ...],
    record: tuple[str, ...],
    driven: tuple[str, ...],
) -> MotionFunctions:
    """Functions of a motion; those of the last 32 motions are cached."""
    moved = ContinuousModel(model, dict(moving))
    return MotionFunctions(moved, moved.right_hand_side(lanes=names, shared=shared, record=record, driven=driven))
