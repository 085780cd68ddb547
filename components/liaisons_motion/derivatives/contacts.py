"""What contacts do to a motion at an event: C code, and expressions for derivatives.

The core of the motion's FMU finds events, settles them and writes down what it did (``contact_record.h``);
``contact_run.c`` replays that.  Its entries hold the modes in which impulses are a smooth function of the state before
them.  Where a number by which modes are chosen is 0 there is a derivative along those directions only in which it stays
0; that is an entry, too.
"""

from __future__ import annotations

import re
from enum import IntEnum
from functools import cached_property
from importlib import resources
from typing import final

import casadi as ca
import numpy as np

from liaisons.algebra import stack
from liaisons.base.contact_limits import HEADER
from liaisons_motion.right_hand_sides import RightHandSide, c_function

Kind = IntEnum(
    "Kind",
    "LAST RESTORED STEP SETTLED STRUCK CAME_TO_REST GRAZED WEAK_GAP WEAK_RATE WEAK_IMPACT WEAK_REST",
    start=-3,
)
"""Of entries: the end of a segment; a map that puts the drift of what is held to 0; a step; and from 0 on as in
``contact_record.h``, where a map is an impact, and others are numbers of a contact that must stay 0."""
_HEAD = """
enum {{ CONTACTS = {contacts}, GAPS = {gaps}, MEMORY = {memory}, FLAGS = 3 * CONTACTS, I = {indicators} }};
enum {{ LAST = -3, RESTORED, STEP }};
static const long NORMALS[CONTACTS] = {{{normals}}}; /* gaps that bound dry friction, or -1 */
typedef struct {{
    long kind, row, which, record; /* row of shared values; contact; recorded time */
    double t, h;                   /* instant; size of a step, or scale of a number that must stay 0 */
    double moved[4];               /* start and size of a step by the last event, and by the end of the segment */
    double flags[FLAGS];           /* what is held; directions of what slides; which gaps approach */
}} Entry;
"""


@final
class Contacts:
    """Contacts of a motion: unilateral liaisons, then dry friction."""

    def __init__(self, equations: RightHandSide) -> None:
        """Take the equations of the motion."""
        assert equations.contacts is not None
        self._equations, self._contacts = equations, equations.contacts
        self.names, self.gaps = self._contacts.names, self._contacts.gaps
        self.count, self.indicators = len(self.names), self._contacts.indicators
        self.remembered = self.count + 2 * self.gaps
        self._normals = self._contacts.normals
        self.flags = ca.SX.sym("flags", 3 * self.count)
        self._held, self._direction, self._approaching = ca.vertsplit(self.flags, self.count)
        floats = {"t": (), "h": (), "moved": (4,), "flags": (3 * self.count,)}
        self.entry = np.dtype(
            [*((name, "l") for name in ("kind", "row", "which", "record")), *((n, "d", s) for n, s in floats.items())]
        )

    # ---- C code

    def entry_declarations(self) -> str:
        """C declarations of the entries and of the counts of contacts."""
        return _runtime_text("contact_record.h") + _HEAD.format(
            contacts=self.count,
            gaps=self.gaps,
            memory=self.remembered,
            indicators=self.indicators.numel(),
            normals=", ".join(map(str, self._normals)),
        )

    def event_code(self) -> str:
        """C code that takes steps through events, see ``contact_run.c``."""
        point = [*self._equations.c_arguments(packed=False), (self.flags, "flags")]
        maps = (c_function(name, point, [(value, "result")]) for name, value in self.states_after_events.items())
        functions_code = (line for function in maps for line in function)
        head = [HEADER.read_text("utf-8"), _runtime_text("complementarity.h"), self.entry_declarations()]
        return "\n".join([*head, *functions_code, packaged_c_file("contact_run")])

    # ---- expressions

    @cached_property
    def states_after_events(self) -> dict[str, ca.SX]:
        """State after an impact, or without drift, as expressions in a point and flags, by C function."""
        contacts, none = self._contacts, ca.SX.zeros(self.count)
        numbers, frictions = contacts.numbers, none[self.gaps :]
        closed, gaps = ca.vertcat(self._held[: self.gaps], frictions), ca.vertcat(numbers["gap"], frictions)
        impulses, shifts = self._forces(numbers["v"], self._held, none), self._forces(gaps, closed, none)
        symbols, moves = ca.vertcat(contacts.impulses, contacts.shifts), ca.vertcat(impulses, shifts[: self.gaps])
        struck = self._forces(self._rates_with_rebound(), self._held, self._direction)
        return {
            "struck": ca.substitute(contacts.pushed, contacts.impulses, struck),
            "restored": ca.substitute(contacts.restored, symbols, moves),
        }

    @cached_property
    def condition_derivatives(self) -> dict[int, ca.Function]:
        """Derivatives, one row a contact, of the numbers that must stay 0 in entries of a kind, by that kind.

        Functions (t, k, s, y, flags) -> (contacts, 1 + values + states).
        """
        numbers, (t, k, s, y) = self._contacts.numbers, self._equations.symbols
        values = {
            Kind.WEAK_GAP: numbers["gap"],
            Kind.WEAK_RATE: numbers["v"],
            Kind.WEAK_IMPACT: self._slacks(self._rates_with_rebound(), numbers["slide"], impulses=True),
            Kind.WEAK_REST: self._slacks(numbers["a"], numbers["stick"], impulses=False),
        }
        slopes = {kind: ca.jacobian(value, ca.vertcat(t, k, y)) for kind, value in values.items()}
        point = [t, k, s, y, self.flags]
        return {kind: ca.Function("slopes", point, ca.cse([ca.densify(x)])) for kind, x in slopes.items()}

    def _rates_with_rebound(self) -> ca.SX:
        """Rates v (1 + e) that impulses have to stop: v at gaps that approach with restitution e, else v."""
        numbers = self._contacts.numbers
        rebound = ca.vertcat(numbers["restitution"], ca.SX.zeros(self.count - self.gaps))
        return numbers["v"] * (1 + self._approaching * rebound)

    def _forces(self, rate: ca.SX, held: ca.SX, direction: ca.SX, *, impulses: bool = True) -> ca.SX:
        """Forces x of contacts in modes, with G x = -rate where a contact is held."""
        acting = [0.0 if impulses and normal < 0 else 1.0 for normal in self._normals]
        slide = ca.vertcat(ca.SX.zeros(self.gaps), self._contacts.numbers["slide"])
        drag = -ca.DM(acting) * direction * slide
        return self._contacts.compliance.forces(rate, held, drag, self._normals)[0]

    def _slacks(self, rate: ca.SX, bound: ca.SX, *, impulses: bool) -> ca.SX:
        """Slacks of the conditions of consistent modes, >= 0, as in C.

        :param rate: without the forces.
        """
        x, G = self._forces(rate, self._held, self._direction, impulses=impulses), self._contacts.compliance.matrix
        after, rows = rate + G @ x, list[ca.SX]()
        for i, normal in enumerate(self._normals):
            least = bound[i - self.gaps] * (x[normal] if normal >= 0 else 1) if i >= self.gaps else 0
            force, moves = (least - ca.fabs(x[i]), self._direction[i]) if i >= self.gaps else (x[i], 1 - self._held[i])
            rows.append(self._held[i] * force * G[i, i] + moves * after[i])
        return stack(rows)


def _runtime_text(name: str) -> str:
    """C code of a file of the runtime of FMUs, without its ``#include "..."``."""
    code = (resources.files("liaisons.fmu") / "runtime" / name).read_text("utf-8")
    return re.sub(r'^#include ".*"$', "", code, flags=re.MULTILINE)


def packaged_c_file(name: str) -> str:
    """Text of a C file of this package, without its ending ``.c``."""
    return (resources.files("liaisons_motion.derivatives") / f"{name}.c").read_text("utf-8")
