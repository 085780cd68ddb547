"""Any system that turns in one piece about an axis."""

from collections.abc import Mapping

import casadi as ca

from liaisons.language import ActiveCoordinate, Ball, Coordinate, Rod, Shapes, assertion, output, unchecked
from liaisons_catalogue.shape_functions import NUMBERS, Function, ShapedMechanism, component_of_shape, smallest_pivot


class GeneralSwing(ShapedMechanism, abstract=True):
    """Swing of any shape s, which the operator prescribes; θ is the direction of its centre of mass.

    With the moment of inertia I about the axis, the couplings J_α, the metric g_αβ of the shapes, and the moment of the
    weight D = M g d (total mass, gravity, distance of the centre of mass from the axis)::

        L = ½ I(s) θ'² + Σ J_α(s) θ' s_α' + ½ Σ g_αβ(s) s_α' s_β' + D(s) cos θ        M eq. 56, the ½ restored
        p_θ = I θ' + Σ J_α s_α',    p_θ' = -D sin θ

    θ [rad] angle of the centre of mass from the downward vertical, I [kg.m2], D [N.m]; the units of J_α and g_αβ depend
    on those of s_α.  None of them depends on θ, so X_K = 0 (M 8.4).

    Source: M 8.1, eq. 54-56.
    """

    theta = Coordinate("rad", "angle of the centre of mass from the downward vertical", start=0.5)

    @property
    def _metric(self) -> ca.SX:
        """Metric g of M eq. 55 in the coordinates (θ, s)."""
        count = len(self.actives)
        I, J, g = self._value_of("I"), self._value_of("J", count), self._value_of("g", count, count)  # noqa: E741
        return ca.blockcat([[I, J.T], [J, g]])

    def picture(self) -> Shapes:
        direction = {"x": ca.sin(self.theta), "z": -ca.cos(self.theta)}
        return [Rod({}, direction), Ball(direction)]

    @unchecked(NUMBERS)
    def kinetic_energy(self) -> ca.SX:
        v = ca.vertcat(self.free.q_dot, self.active.s_dot)
        return ca.bilin(self._metric, v, v) / 2

    @unchecked(NUMBERS)
    def potential_energy(self) -> ca.SX:
        return -self.D * ca.cos(self.theta)

    @output("kg.m2", "moment of inertia I about the axis (M eq. 55)", unchecked=NUMBERS)
    def inertia(self) -> ca.SX:
        return self._value_of("I")

    @output(
        "N.m",
        "gravity times total mass times distance of the centre of mass from the axis (M eq. 54)",
        unchecked=NUMBERS,
    )
    def D(self) -> ca.SX:  # noqa: N802
        return self._value_of("D")

    @assertion("the centre of mass must stay off the axis: D > 0", unchecked=NUMBERS)
    def com_off_the_axis(self) -> ca.SX:
        return self.D

    @assertion("the metric of I, J and g must stay positive definite", unchecked=NUMBERS)
    def definite(self) -> ca.SX:
        return smallest_pivot(self._metric)

    from liaisons_catalogue.solutions.general_swing import exact


def marle_swing(
    I: Function,  # noqa: E741 - the symbols of M eq. 54-56
    J: Function,
    g: Function,
    D: Function,
    *,
    shape: Mapping[str, ActiveCoordinate] | None = None,
    name: str = "MarleSwing",
) -> type[GeneralSwing]:
    """Make the swing of M 8.1 as a component, from four functions of the shape.

    Each function is called with the shape coordinates, one argument each, and returns numbers or CasADi expressions::

        I, J, g = (lambda length=1.0: 60 * length**2), (lambda length: 0), (lambda length: 60)
        Crouching = marle_swing(I, J, g, D=lambda length: 60 * 9.81 * length)

    :param I: moment of inertia about the axis [kg.m2].
    :param J: couplings J_α, one for each shape coordinate; a sequence, or a scalar where there is one.
    :param g: metric g_αβ of the shapes, rows of numbers; or a scalar.
    :param D: gravity times total mass times distance of the centre of mass from the axis [N.m].
    :param shape: names and declarations of the shape coordinates.  Without it they are the arguments of ``I``, with
        their default values (else 0) as start and no unit of their own.
    :param name: name of the component and of its FMU.
    :returns: a class as if it were written where ``I`` was defined; see :class:`GeneralSwing`.
    :raises ComponentError: if a function returns the wrong size, a name is taken, or I is not > 0 at the start.
    """
    return component_of_shape(GeneralSwing, {"I": I, "J": J, "g": g, "D": D}, shape, name)
