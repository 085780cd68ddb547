"""The four-bar linkage."""

from liaisons.linkages import Body, Linkage, Revolute, ground


class FourBar(Linkage):
    """Loop of four hinges in a plane: a crank that an operator turns, a coupler, a rocker, and the frame.

    Crank, coupler, rocker and frame have the lengths a, b, c and d; φ and ψ are the angles of crank and rocker to the
    frame::

        d/a cos ψ - d/c cos φ + (a² - b² + c² + d²)/(2 a c) = cos (φ - ψ)         Freudenstein

    Three of the five constraints at the pin follow from the others, because all hinges are parallel.

    Source: F. Freudenstein, Trans. ASME 77 (1955).
    """

    crank = Body(mass=1.0, inertia=(0, 0.02, 0.02), centre=(0.25, 0, 0))
    coupler = Body(mass=2.0, inertia=(0, 0.4, 0.4), centre=(0.75, 0, 0))
    rocker = Body(mass=1.5, inertia=(0, 0.2, 0.2), centre=(0.6, 0, 0))
    turn = Revolute(ground, crank, axis="-y", prescribed=True, start=1.0)
    elbow = Revolute(crank, coupler, axis="-y", at=(0.5, 0, 0), start=-0.6)
    swing = Revolute(ground, rocker, axis="-y", at=(1.5, 0, 0), start=1.6)
    pin = Revolute(coupler, rocker, axis="-y", at=(1.5, 0, 0), at_child=(1.2, 0, 0))

    from liaisons_catalogue.solutions.four_bar import freudenstein
