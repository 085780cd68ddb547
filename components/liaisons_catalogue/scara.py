"""The SCARA robot."""

from liaisons.linkages import Body, BodyPoint, Linkage, Prismatic, Revolute, ground


class Scara(Linkage):
    """Selective compliance assembly robot arm: two vertical axes, a quill that slides and turns.

    a_1 and a_2 are the lengths of the arms, c_1 and c_2 the distances of their centres of mass, m is the mass of the
    quill, J its moment of inertia, and q_2 the angle of the elbow.  The mass matrix has the elements::

        M_22 = I_2 + m_2 c_2² + m a_2² + J,   h = (m_2 c_2 + m a_2) a_1 cos q_2
        M_12 = M_22 + h,   M_11 = I_1 + m_1 c_1² + (m_2 + m) a_1² + M_22 + 2 h
        shift: m;   turn: J to itself and to both arms

    Source: M. W. Spong, S. Hutchinson, M. Vidyasagar, Robot Modeling and Control, 6.4.
    """

    inner = Body(mass=6.0, inertia=(0.02, 0.08, 0.08), centre=(0.2, 0, 0))
    outer = Body(mass=4.0, inertia=(0.01, 0.04, 0.04), centre=(0.15, 0, 0))
    carriage = Body()
    quill = Body(mass=1.5, inertia=(0.01, 0.01, 0.002))
    shoulder = Revolute(ground, inner, at=(0, 0, 0.5), damping=0.1)
    elbow = Revolute(inner, outer, at=(0.4, 0, 0), start=0.5, damping=0.1)
    shift = Prismatic(outer, carriage, at=(0.3, 0, 0), prescribed=True)
    turn = Revolute(carriage, quill, damping=0.01)
    tool = BodyPoint(quill, at=(0, 0, -0.1))

    from liaisons_catalogue.solutions.scara import mass_matrix
