"""A mechanism beside a motion, from one communication point to the next, to first order in what it is off.

The linearisation is that of the equations that the FMUs have, along the motion as they perform it: within a step a
correction of σ is the polynomial that the mechanism makes of what it is told.  So the matrices of a step are exact,
sampling and all, up to the tolerance with which they are integrated.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import svd

from liaisons.arguments import shown
from liaisons.language import Orientation
from liaisons.models.regulator import READINGS
from liaisons.operators.feedback import Array, Step
from liaisons.operators.problems import Goal, GoalSymbols, PlanError

_POWERS = np.arange(6)
_UNIT = np.linalg.inv(
    np.vstack([np.diag([1.0, 1.0, 2.0, 0.0, 0.0, 0.0])[:3], _POWERS**0, _POWERS, _POWERS * (_POWERS - 1.0)])
)
"""Value, rate and acceleration at 0 and 1 -> coefficients of the polynomial of degree five."""


_PLAIN = {"": "rad", "1": "rad", "deg": "rad"}
_PARTS = 32
"""Into so many parts a step is divided: of fourth order, these leave 1e-10."""


class Sampled:
    """The mechanism of a goal, sampled: its coordinates start, and are moved, as the goal says of the start.

    :param asked: names of what is moved that has to be held, even if it enters nothing.
    :param time: in what time [s] states change by their sizes where no free motion says so.
    :param longest: a free motion of which a radian takes longer [s] does not.
    :ivar states: names: the mechanism's that what moves acts on, or depends on; σ where it is held; σ̇, σ̈.
    :ivar names: those of the mechanism.
    :ivar free: coordinates that are held.
    """

    def __init__(self, goal: Goal, asked: Container[str], *, interpolate: bool, time: float, longest: float) -> None:
        self.reader = reader = GoalSymbols(goal)
        self.interpolate, self.name, self.moves = interpolate, reader.name, goal.moves
        self.is_constrained = any(v.name.endswith("_residual") for v in reader.model.outputs)
        given = reader.given
        for turn, axes in reader.turns.items():
            if turn in given:
                unit = np.array(given[turn], dtype=float)
                if unit.shape != (4,) or not np.linalg.norm(unit) > 0:
                    raise PlanError(f"{self.name}: {turn} = {shown(given[turn])}: give four numbers, not all 0")
                unit /= np.linalg.norm(unit)
                reader.k |= {reader.starts[axis]: float(x) for axis, x in zip(axes, unit, strict=True)}
        y = np.array([reader.k[reader.starts[n]] if n in reader.starts else 0.0 for n in reader.x_names])
        self.sigma = np.zeros((len(self.moves), 3))
        self.sigma[:, 0] = reader.s_start
        self.sigma[:, 1] = [float(given.get(f"{m}_dot", 0.0)) for m in self.moves]
        symbols = [reader.y, reader.s, reader.v, reader.a]
        self._usual_time, self._longest = time, longest
        self.start = np.array(ca.Function("start", symbols, [reader.start_state])(y, *self.sigma.T)).ravel()
        self.places = self._coupled()
        self.names = [reader.x_names[i] for i in self.places]
        self.turns = {turn: axes for turn, axes in reader.turns.items() if set(axes) <= set(self.names)}
        keeps = [m in asked or reader.depends(reader.relative_rates, reader.s[i]) for i, m in enumerate(self.moves)]
        self.kept = [m for m, keep in zip(self.moves, keeps, strict=True) if keep]
        n, c = len(self.names), len(self.moves)
        self.rows = [*range(n), *(n + i for i, keep in enumerate(keeps) if keep), *range(n + c, n + 3 * c)]
        free = (n for n in self.names if n in reader.starts and n not in Orientation.momenta)
        self.free = (*free, *self.kept)
        self.states = (*self.names, *self.kept, *(f"{m}{end}" for end in ("_dot", "_ddot") for m in self.moves))
        if len(self.states) > READINGS:
            many = f"{len(self.states)} states are more than the {READINGS} that a Regulator reads"
            raise PlanError(f"{self.name}: {many}")

    @cached_property
    def frequency(self) -> float:
        """Greatest one [1/s] of the free motion about the start, also of falling and damping; 0: there is none."""
        n = len(self.names)
        A = np.array(self._slopes(self.start[self.places], *self.sigma.T))[:, 1 : 1 + n]
        if self.is_constrained:  # along the constraints
            A = np.array(self._projection(self.start, *self.sigma.T))[:, 1 : 1 + n] @ A
        found = np.abs(np.linalg.eigvals(A))
        return float(np.max(found, initial=0.0))

    @cached_property
    def moves_freely(self) -> bool:
        """Whether a free motion sets a time."""
        return self.frequency * self._longest > 1

    @cached_property
    def time(self) -> float:
        """In what time [s] states change by their sizes: that of one radian of the free motion, if there is any."""
        return 1 / self.frequency if self.moves_freely else self._usual_time

    @cached_property
    def sizes(self) -> Array:
        """Of the states: all that is compared, weighted and called small is divided by them, whatever the units are.

        Coordinates of one unit have one size, such that the kinetic energy of all is alike: an angle's is 1, a length's
        that at which the mass has the angles' moment of inertia.  Rates, accelerations and momenta follow with
        :attr:`time`.
        """
        coordinates, momenta, _ = self._start_sizes
        of_names = [coordinates.get(name, momenta.get(name, 1.0)) for name in self.names]
        of_moves = np.array([coordinates[m] for m in self.moves])
        return np.concatenate([of_names, *(of_moves / self.time**n for n in range(3))])[self.rows]

    @property
    def energy(self) -> float:
        """Kinetic, of what moves by its size in :attr:`time` [J]."""
        return self._start_sizes[2]

    @property
    def of_pushes(self) -> Array:
        """Sizes of the accelerations that are chosen."""
        return self.sizes[-len(self.moves) :]

    @cached_property
    def start_sizes(self) -> dict[str, float]:
        """Sizes of what has start values: coordinates, rates, σ, σ̇ and σ̈."""
        coordinates, *_ = self._start_sizes
        found = dict(coordinates)
        found |= {name: coordinates[of] / self.time for name, of in self._rates.items()}
        return found | {f"{m}_ddot": coordinates[m] / self.time**2 for m in self.moves}

    @property
    def _rates(self) -> dict[str, str]:
        """Rates that have start values, σ̇ among them, and the coordinates whose rates they are; of turns themselves."""
        reader = self.reader
        names = [n for n in reader.starts if n not in reader.x_names]
        known = {*reader.x_names, *reader.starts}
        found = {n: n.replace("_dot", "", 1) if n.replace("_dot", "", 1) in known else n for n in names}
        return found | {f"{m}_dot": m for m in self.moves}

    @cached_property
    def _start_sizes(self) -> tuple[dict[str, float], dict[str, float], float]:
        """Of the coordinates, σ and turns; of the momenta; and of the energy [J]."""
        reader, model = self.reader, self.reader.model
        rates = self._rates
        unit = {v.name: v.unit for v in model.variables}

        def of(name: str) -> str:  # of a coordinate or a turn
            return _PLAIN.get(unit.get(name, "1").removesuffix("/s"), unit.get(name, "1").removesuffix("/s"))

        energy = [v.name for v in model.outputs].index("kinetic_energy")
        still = reader.k | {reader.starts[name]: 0.0 for name in rates if name in reader.starts}
        resting_inputs = reader.u | dict(zip(self.moves, self.sigma[:, 0], strict=True))
        resting_inputs |= {f"{m}{end}": 0.0 for m in self.moves for end in ("_dot", "_ddot")}

        def moving(rate: str) -> tuple[float, Array]:
            """Twice the kinetic energy, and the states, where one rate is 1."""
            k = still | ({reader.starts[rate]: 1.0} if rate in reader.starts else {})
            u = resting_inputs | ({rate: 1.0} if rate in resting_inputs else {})
            columns = [list(u.values()), list(k.values())]
            y, memory = model.start(0.0, *columns)
            z = model.outputs_function(0.0, y, *columns, memory)
            return 2 * float(z[energy]), np.array(y).ravel()[: len(reader.x_names)]

        found = {rate: moving(rate) for rate in rates}
        inertia: dict[str, list[float]] = {}
        for rate, name in rates.items():
            inertia.setdefault(of(name), []).append(found[rate][0])
        mean = {
            u: float(np.exp(np.mean(np.log(np.array(m)[np.array(m) > 0])))) for u, m in inertia.items() if max(m) > 0
        }
        values = dict(zip(reader.x_names, self.start, strict=True)) | dict(
            zip(self.moves, self.sigma[:, 0], strict=True)
        )
        far = {u: max(abs(values.get(name, 0.0)) for name in rates.values() if of(name) == u) or 1.0 for u in inertia}
        first = "rad" if "rad" in mean else next(iter(mean), "rad")
        whole = mean.get(first, 1.0) * (1.0 if first == "rad" else far.get(first, 1.0) ** 2)
        by_unit = {u: 1.0 if u == "rad" else np.sqrt(whole / mean[u]) if u in mean else far[u] for u in inertia}
        coordinates = {name: float(by_unit[of(name)]) for name in rates.values()}
        changes = np.array([np.abs(y) * coordinates[rates[rate]] / self.time for rate, (_, y) in found.items()])
        sizes = np.max(changes, axis=0, initial=0.0)
        momenta = {
            name: float(size) if size > 0 else whole / self.time
            for name, size in zip(reader.x_names, sizes, strict=True)
            if name not in coordinates and not any(name in axes for axes in reader.turns.values())
        }
        return coordinates, momenta, float(whole / self.time**2)

    @property
    def cyclic(self) -> list[str]:
        """Coordinates that enter nothing, so that a motion goes on alike wherever they are."""
        reader = self.reader
        enters = reader.acts(reader.relative_rates[self.places], reader.y[self.places])
        return [name for i, name in enumerate(self.names) if not enters[:, i].any() and name in self.free]

    def _coupled(self) -> list[int]:
        """Places of the states that what moves acts on, and of those on which they depend."""
        reader = self.reader
        acts = reader.acts(reader.relative_rates, ca.vertcat(reader.y, reader.s, reader.v))
        n = len(reader.x_names)
        among, found = acts[:, :n], acts[:, n:].any(axis=1)
        for _ in range(n):
            found = found | among[:, found].any(axis=1)
        for _ in range(n):
            found = found | among[found].any(axis=0)
        return [int(i) for i in np.flatnonzero(found)]

    @cached_property
    def _slopes(self) -> ca.Function:
        """(y, σ, σ̇, σ̈) -> rates and their derivatives with respect to each of these, side by side.

        Where there are constraints, those of the state that is put back onto them: off the constraints rates depend on
        how fast these are kept [1/s], which is a matter of integration and would be a stiffness where motions are slow.
        """
        reader = self.reader
        others = [i for i in range(len(reader.x_names)) if i not in self.places]
        rates = ca.substitute(reader.rates[self.places], reader.y[others], ca.DM(self.start[others]))
        y, s, v, a = symbols = [reader.y[self.places], reader.s, reader.v, reader.a]
        slopes = [ca.jacobian(rates, symbol) for symbol in symbols]
        found = ca.Function("slopes", [y, s, v, a], [ca.densify(ca.horzcat(rates, *slopes))], {"cse": True})
        if not self.is_constrained:
            return found
        n, c = y.shape[0], s.shape[0]
        columns = y, s, v, a = [ca.MX.sym("y", n), *(ca.MX.sym(name, c) for name in ("s", "v", "a"))]
        whole = ca.MX(ca.DM(self.start))
        whole[self.places] = y
        put_back, *onto = ca.horzsplit(self._projection(whole, s, v, a), [0, 1, 1 + n, 1 + n + c, 1 + n + 2 * c])
        rates, of_y, *of_sigma = ca.horzsplit(found(put_back, s, v, a), [0, 1, *range(1 + n, 2 + n + 3 * c, c)])
        led = [of_y @ by + of for by, of in zip(onto, [ca.MX(n, n), *of_sigma[:2]], strict=True)]
        return ca.Function("slopes", columns, [ca.horzcat(rates, *led, of_sigma[2])])

    def rates(self, y: Array, sigma: Array) -> Array:
        """Of the mechanism's states, σ and its two rates being (moves, 3)."""
        return np.array(self._slopes(y, *sigma.T))[:, 0]

    def steps(
        self, times: Array, planned: Array, period: float, start: Array | None = None
    ) -> tuple[Array, list[Step]]:
        """What is held and what becomes of being off it.

        :param times: communication points (N + 1).
        :param planned: σ, σ̇, σ̈ there, (moves, 3, N + 1).
        :param period: of the regulators.
        :param start: the mechanism's states at the first of them; as the goal says unless given.
        :returns: the states (states, N + 1), and matrices of the N steps, both sides divided by sizes; what chooses are
            accelerations w, one a move.
        """
        y, found, steps = self.start[self.places] if start is None else start, [], []
        for k, H in enumerate(np.diff(times)):
            found.append(y)
            y, step = self._step(y, planned[:, :, k : k + 2], float(H), period)
            steps.append(step)
        reference = np.vstack([np.transpose([*found, y]), *(planned[:, i] for i in range(3))])
        return reference[self.rows], steps

    @cached_property
    def _substep(self) -> ca.Function:
        """A step by Runge and Kutta's method: the states, and how they change with those at its begin."""
        n, c = len(self.names), len(self.moves)
        z, u, way = ca.MX.sym("z", n, 1 + n + 6 * c), ca.MX.sym("u"), ca.MX.sym("way", 6, c)
        ends, H = ca.MX.sym("ends", 6, 6), ca.MX.sym("H")

        def rates(u: ca.MX, z: ca.MX) -> ca.MX:
            orders = ((p, [p * u ** max(p - 1, 0) / H, p * (p - 1) * u ** max(p - 2, 0) / H**2]) for p in range(6))
            bases = ca.horzcat(*(ca.vertcat(u**p, *rates) for p, rates in orders))  # (orders, powers)
            slopes = self._slopes(z[:, 0], *ca.vertsplit(bases @ way))
            of_time, of_y, *of_sigma = ca.horzsplit(slopes, [0, 1, *range(1 + n, 2 + n + 3 * c, c)])
            forced = (
                sum((x * of for x, of in zip(ca.vertsplit(basis), of_sigma, strict=True)), ca.MX(n, c))
                for basis in ca.horzsplit(bases @ ends)
            )
            return H * ca.horzcat(of_time, of_y @ z[:, 1:] + ca.horzcat(ca.MX(n, n), *forced))

        h, k = 1 / _PARTS, [rates(u, z)]
        for part in (h / 2, h / 2, h):
            k.append(rates(u + part, z + part * k[-1]))
        after = z + h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
        return ca.Function("substep", [z, u, way, ends, H], [after]).mapaccum(_PARTS)

    def _step(self, y: Array, planned: Array, H: float, period: float) -> tuple[Array, Step]:
        n, c = len(self.names), len(self.moves)
        scale = np.array([1.0, H, H**2])
        ends = _UNIT * np.tile(scale, 2)
        if not self.interpolate:
            ends = np.hstack([np.diag([1.0, 1.0, 0.5, 0, 0, 0])[:, :3] * scale, np.zeros((6, 3))])
        way = ends @ np.vstack([*planned.transpose(2, 1, 0)])  # (powers, moves)
        begin = np.hstack([y[:, None], np.eye(n), np.zeros((n, 6 * c))])
        parts = np.arange(_PARTS)[None] / _PARTS
        found = np.array(
            self._substep(begin, parts, *(np.tile(x, _PARTS) for x in (way, ends)), np.full((1, _PARTS), H))
        )
        y, off = np.hsplit(found[:, -begin.shape[1] :], [1])
        M, N = _followed(H, period, c)
        before, after = off[:, n : n + 3 * c], off[:, n + 3 * c :]
        A = np.block([[off[:, :n], before + after @ M], [np.zeros((3 * c, n)), M]])
        A, B = A[np.ix_(self.rows, self.rows)], np.vstack([after @ N, N])[self.rows]
        return y.ravel(), (A * self.sizes / self.sizes[:, None], B * self.of_pushes / self.sizes[:, None])

    def directions(self, reference: Array, sigma: Array) -> Array:
        """Columns along which the states can differ from (states,): of a quaternion only turns, and along constraints.

        They are divided by sizes.

        :param sigma: σ and its two rates there, (moves, 3).
        """
        if self.is_constrained:
            return self._tangents(reference[: len(self.names)], sigma)
        D = np.eye(len(self.states))
        for axes in self.turns.values():
            i, *_ = places = [self.states.index(axis) for axis in axes]
            w, x, y, z = reference[places]
            D[np.ix_(places, places[1:])] = np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) / 2
            D = np.delete(D, i, axis=1)
        return D

    def _tangents(self, y: Array, sigma: Array) -> Array:
        """Directions along the constraints, on which the mechanism is put back wherever it is led."""
        n, c = len(self.names), len(self.moves)
        slopes = np.array(self._projection(self.whole(y), *sigma.T))[:, 1:]
        of_moves = np.array([self._start_sizes[0][m] for m in self.moves])
        sizes = np.concatenate([self.sizes[:n], of_moves, of_moves / self.time])
        slopes *= sizes / sizes[:n, None]
        along: Any = svd(slopes[:, :n])
        D = np.zeros((n + 3 * c, n + 3 * c))
        D[:n], D[n:, n:] = np.hstack([along[0], slopes[:, n:], np.zeros((n, c))]), np.eye(3 * c)
        left = [i for i, size in enumerate(along[1]) if size > 0.5]  # a projection's are 1 or more, or 0
        return D[np.ix_(self.rows, [*left, *(row for row in self.rows if row >= n)])]

    @cached_property
    def _projection(self) -> ca.Function:
        """(y, σ, σ̇, σ̈) -> what is put back onto the constraints, and its derivatives by y, σ and σ̇, side by side."""
        reader, project = self.reader, self.reader.model.project
        assert project is not None  # there are constraints
        u = dict(reader.u)
        for i, m in enumerate(self.moves):
            u |= {m: reader.s[i], f"{m}_dot": reader.v[i], f"{m}_ddot": reader.a[i]}
        columns = (ca.vertcat(ca.SX(0, 1), *of.values()) for of in (u, reader.k))
        put_back = project(0, ca.vertcat(reader.y, 0, 0), *columns)[self.places]
        slopes = [ca.jacobian(put_back, x) for x in (reader.y[self.places], reader.s, reader.v)]
        columns = [reader.y, reader.s, reader.v, reader.a]
        return ca.Function("projection", columns, [ca.densify(ca.horzcat(put_back, *slopes))])

    def whole(self, y: Array) -> Array:
        """All states of the mechanism, those that are left out as at the start."""
        found = self.start.copy()
        found[self.places] = y
        return found

    def rates_off(self, reference: Array, sigma: Array, directions: Array) -> Array:
        """How the rates of the mechanism's states differ along directions, (names, directions)."""
        n, c = len(self.names), len(self.moves)
        slopes = np.array(self._slopes(reference[:n], *sigma.T))[:, 1:]
        return slopes[:, [row for row in self.rows if row < n + 3 * c]] @ (self.sizes[:, None] * directions)

    def forces(self, y: Array, sigma: Array) -> tuple[Array, Array]:
        """Forces of what moves, and their effective mass."""
        reader = self.reader
        forces = ca.vertcat(*(reader.signals[f"{m}_force"] for m in self.moves))
        found: Any = ca.Function(
            "forces", [reader.y, reader.s, reader.v, reader.a], [forces, ca.jacobian(forces, reader.a)]
        )
        return tuple(np.array(value) for value in found(self.whole(y), *sigma.T))  # type: ignore[return-value]


def _followed(H: float, period: float, count: int) -> Step:
    """Corrections, their rates and accelerations after a step: the rate of the latter is (w - x'') / period."""
    e = np.exp(-H / period)
    gone = period * (1 - e)
    way = period * (H - gone)
    M, N = np.array([[1, H, way], [0, 1, gone], [0, 0, e]]), np.array([[H**2 / 2 - way], [H - gone], [1 - e]])
    one = np.eye(count)
    return np.asarray(np.kron(M, one), dtype=float), np.asarray(np.kron(N, one), dtype=float)


def reduced(steps: Sequence[Step], directions: Sequence[Array]) -> list[Step]:
    """Matrices of steps in the directions in which the states can differ, at both ends of each."""
    back = [np.linalg.pinv(D) for D in directions[1:]]
    return [(b @ A @ D, b @ B) for (A, B), D, b in zip(steps, directions[:-1], back, strict=True)]
