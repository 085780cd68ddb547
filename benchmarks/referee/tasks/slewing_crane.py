"""A crane that slews while its trolley travels: the load is a rigid body on a universal joint."""

from math import pi

from sympy import Matrix, rot_axis1, rot_axis2

from referee.equations import TIME, Lagrange, coordinates
from referee.task import GRAVITY, sinusoid

MASS, TROLLEY, ROPE, ACROSS, ALONG, TOWER = 1000.0, 400.0, 20.0, 500.0, 300.0, 1e5
across, along, slew, travel = coordinates("rope_x rope_y slew travel")
rate = slew.diff(TIME)

# Vectors in axes of the tower, which turn.
attitude = rot_axis1(-across) * rot_axis2(-along)
place = Matrix([travel, 0, 0]) + attitude * Matrix([0, 0, -ROPE])
turning = Matrix([[0, -rate, 0], [rate, 0, 0], [0, 0, 0]])
velocity = place.diff(TIME) + turning * place
spin = attitude.T * (attitude.diff(TIME) + turning * attitude)  # in axes of the load
kinetic = TOWER * rate**2 + TROLLEY * (travel.diff(TIME) ** 2 + (travel * rate) ** 2) + MASS * velocity.dot(velocity)
kinetic += ACROSS * (spin[2, 1] ** 2 + spin[0, 2] ** 2) + ALONG * spin[1, 0] ** 2
TASK = Lagrange(
    kinetic / 2 - MASS * GRAVITY * place[2],
    {across: (0.05, 0.0), along: (-0.03, 0.0)},
    {slew: sinusoid(0.3, 0.3, 0.8, -pi / 2), travel: sinusoid(8.0, 1.5, 0.6)},
).task("slewing crane", 6.4, component="SlewingCrane", parameters={"rope_damping": 0.0})
