"""The crane by Rockit, from equations by hand."""

from casadi import cos, sin
from rockit import DirectCollocation, Ocp


def solve(intervals: int) -> float:
    """∫ a² dt of the trolley."""
    ocp = Ocp(T=3.0)
    x, v, angle, rate = (ocp.state() for _ in range(4))
    a = ocp.control(order=4)
    ocp.set_der(x, v)
    ocp.set_der(v, a)
    ocp.set_der(angle, rate)
    ocp.set_der(rate, -(9.81 * sin(angle) + a * cos(angle)) / 2.0)
    for state, first, last in ((x, 0, 0.8), (v, 0, 0), (angle, 0, 0), (rate, 0, 0)):
        ocp.subject_to(ocp.at_t0(state) == first)
        ocp.subject_to(ocp.at_tf(state) == last)
    ocp.add_objective(ocp.integral(a**2))
    ocp.solver("ipopt", {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10}})
    ocp.method(DirectCollocation(N=intervals, degree=5, scheme="legendre"))
    return ocp.solve().value(ocp.objective)
