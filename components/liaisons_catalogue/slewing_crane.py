"""The slewing crane."""

from liaisons.linkages import Body, BodyPoint, Linkage, Prismatic, Revolute, Universal, ground


class SlewingCrane(Linkage):
    """Crane whose tower and trolley an operator moves; rope and load swing freely.

    The tower slews by φ, and the trolley is at the radius R.  The load has the moments of inertia I_t across and I_a
    along the rope, and its centre of mass is l below the trolley.  At a constant rate Ω it hangs outwards at the angle
    α::

        tan α = Ω² (R + (l + (I_t - I_a)/(m l)) sin α)/g

    Source: Euler's equations of the load about the trolley; R. C. Hibbeler, Dynamics, ch. 21.
    """

    tower = Body(mass=8000.0, inertia=(4e5, 4e5, 1e5), centre=(0, 0, 12))
    trolley = Body(mass=400.0)
    load = Body(mass=1000.0, inertia=(500.0, 500.0, 300.0), centre=(0, 0, -20))
    slew = Revolute(ground, tower, axis="z", prescribed=True)
    travel = Prismatic(tower, trolley, axis="x", at=(0, 0, 24), prescribed=True, start=8.0)
    rope = Universal(trolley, load, damping=0.02)
    hook = BodyPoint(load, at=(0, 0, -20))

    from liaisons_catalogue.solutions.slewing_crane import steady_deflection
