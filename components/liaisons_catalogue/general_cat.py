"""Any body that changes its shape in free fall."""

from collections.abc import Mapping

import casadi as ca

from liaisons.language import ActiveCoordinate, Box, Orientation, Shapes, assertion, unchecked
from liaisons_catalogue.shape_functions import NUMBERS, Function, ShapedMechanism, component_of_shape, smallest_pivot


class GeneralCat(ShapedMechanism, abstract=True):
    """Falling cat of any shape s, which the operator prescribes, seen from its centre of mass.

    With the moment of inertia I about the centre of mass in a frame of the body, the connection A, the effective mass Θ
    of the shapes, and ω and H = R I (ω + A s') as in :class:`SpatialCat`::

        L = ½ (ω + A(s) s')·I(s) (ω + A(s) s') + ½ s'·Θ(s) s'        M eq. 58, without the centre of mass
        H, the angular momentum about the centre of mass, is constant in the inertial frame

    Without angular momentum ω = -A s', however fast the shape changes.

    Source: M 8.2, eq. 57-60.
    """

    attitude = Orientation("attitude of the body's frame", start="momentum")

    def picture(self) -> Shapes:
        return [Box({}, self.attitude.matrix, (1.0, 0.6, 0.3))]

    @property
    def _inertia(self) -> ca.SX:
        return self._value_of("inertia", 3, 3)

    @unchecked(NUMBERS)
    def kinetic_energy(self) -> ca.SX:
        s_dot, count = self.active.s_dot, len(self.actives)
        turning = self.attitude.rate + self._value_of("connection", 3, count) @ s_dot
        return (
            ca.bilin(self._inertia, turning, turning) + ca.bilin(self._value_of("mass", count, count), s_dot, s_dot)
        ) / 2

    @assertion("the moment of inertia must stay positive definite", unchecked=NUMBERS)
    def definite(self) -> ca.SX:
        return smallest_pivot(self._inertia)


def marle_cat(
    inertia: Function,
    connection: Function,
    mass: Function,
    *,
    shape: Mapping[str, ActiveCoordinate] | None = None,
    name: str = "MarleCat",
) -> type[GeneralCat]:
    """Make the cat of M 8.2 as a component, from three functions of the shape.

    Each function is called with the shape coordinates, one argument each, and returns numbers or CasADi expressions.

    :param inertia: moment of inertia I about the centre of mass, in the frame of the body, (3, 3) [kg.m2].
    :param connection: A, (3, number of shape coordinates): without angular momentum ω = -A s'.
    :param mass: effective mass Θ of the shapes, (a, a): energy ½ s'·Θ s' of a change without angular momentum.
    :param shape: names and declarations of the shape coordinates.  Without it they are the arguments of ``inertia``,
        with their default values (else 0) as start and no unit of their own.
    :param name: name of the component and of its FMU.
    :returns: a class as if it were written where ``inertia`` was defined; see :class:`GeneralCat`.
    :raises ComponentError: if a function returns the wrong size, a name is taken, or I is not positive definite at the
        start.
    """
    functions = {"inertia": inertia, "connection": connection, "mass": mass}
    return component_of_shape(GeneralCat, functions, shape, name)
