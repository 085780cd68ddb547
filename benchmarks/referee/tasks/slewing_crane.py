"""A crane that slews while its trolley travels: the load is a rigid body on a universal joint."""

from math import pi

from sympy.physics.mechanics import ReferenceFrame, dynamicsymbols, inertia

from referee.equations import lagrange
from referee.task import GRAVITY, sinusoid

MASS, TROLLEY, ROPE, ACROSS, ALONG, TOWER = 1000.0, 400.0, 20.0, 500.0, 300.0, 1e5
across, along, slew, travel = dynamicsymbols("rope_x rope_y slew travel")
ground = ReferenceFrame("ground")
tower = ground.orientnew("tower", "Axis", (slew, ground.z))
load = tower.orientnew("load", "Body", (across, along, 0), "XYZ")
trolley = travel * tower.x
place = trolley - ROPE * load.z
velocity, spin = place.dt(ground), load.ang_vel_in(ground)
kinetic = TOWER * dynamicsymbols("slew", 1) ** 2 + TROLLEY * trolley.dt(ground).dot(trolley.dt(ground))
kinetic += MASS * velocity.dot(velocity) + inertia(load, ACROSS, ACROSS, ALONG).dot(spin).dot(spin)
TASK = lagrange(
    "slewing crane",
    6.4,
    kinetic / 2 - MASS * GRAVITY * place.dot(ground.z),
    {across: (0.05, 0.0), along: (-0.03, 0.0)},
    {slew: sinusoid(0.3, 0.3, 0.8, -pi / 2), travel: sinusoid(8.0, 1.5, 0.6)},
    component="SlewingCrane",
    parameters={"rope_damping": 0.0},
)
