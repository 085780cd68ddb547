"""The Furuta pendulum."""

from liaisons.linkages import Body, BodyPoint, Linkage, Revolute, ground


class FurutaPendulum(Linkage):
    """Rotary inverted pendulum: an arm that turns about the vertical, a pendulum at its end about the arm.

    φ is the angle of the arm, θ that of the pendulum from the downward vertical, L the length of the arm, l the
    distance to the pendulum's centre of mass, J_1 the arm's moment of inertia about its axis, J_2 = J + m l² that of
    the pendulum across its rod, and J_3 the one along it::

        (J_1 + m L² + J_2 sin²θ + J_3 cos²θ) φ'' + m L l cos θ θ'' = m L l sin θ θ'² - (J_2 - J_3) sin 2θ θ' φ' + τ
        m L l cos θ φ'' + J_2 θ'' = ½ (J_2 - J_3) sin 2θ φ'² - m g l sin θ

    p_turn is constant while no torque τ acts.

    Source: B. S. Cazzolato, Z. Prime, J. Control Sci. Eng. (2011), eq. 33-34.
    """

    arm = Body(mass=0.3, inertia=(1e-4, 2e-3, 2e-3), centre=(0.1, 0, 0))
    pendulum = Body(mass=0.075, inertia=(1e-4, 1e-4, 1e-6), centre=(0, 0, -0.15))
    turn = Revolute(ground, arm, axis="z", start_rate=1.0)
    swing = Revolute(arm, pendulum, axis="x", at=(0.25, 0, 0), start=1.0)
    bob = BodyPoint(pendulum, at=(0, 0, -0.3))

    from liaisons_catalogue.solutions.furuta_pendulum import exact
