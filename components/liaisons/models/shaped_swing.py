"""The general swing: any system that turns in one piece about an axis, from four functions of its shape."""

from collections.abc import Mapping

from liaisons.language import ActiveCoordinate
from liaisons.models.general_swing import GeneralSwing
from liaisons.models.shape_functions import Function, component_of_shape


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

        Crouching = marle_swing(
            I=lambda length=1.0: 60 * length**2,
            J=lambda length: 0,
            g=lambda length: 60,
            D=lambda length: 60 * 9.81 * length,
        )

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
