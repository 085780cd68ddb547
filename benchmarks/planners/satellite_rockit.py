"""The satellite by Rockit, from equations by hand."""

from casadi import sumsqr, vertcat
from rockit import DirectCollocation, Ocp

J, WHEEL = 10.0, 0.1


def solve(intervals: int) -> float:
    """∫ ½ φ'·Θφ' dt of two wheels."""
    ocp = Ocp(T=2.0)
    q = ocp.state(4)
    wheels = ocp.control(2, order=4)
    wx, wy = -WHEEL / J * wheels[0], -WHEEL / J * wheels[1]
    ocp.set_der(
        q, vertcat(-q[1] * wx - q[2] * wy, q[0] * wx - q[3] * wy, q[0] * wy + q[3] * wx, q[1] * wy - q[2] * wx) / 2
    )
    ocp.subject_to(ocp.at_t0(q) == vertcat(1, 0, 0, 0))
    ocp.subject_to(ocp.at_tf(q[:3]) == 0)
    ocp.set_initial(wheels, vertcat(300, 300))
    ocp.add_objective(ocp.integral((WHEEL - WHEEL**2 / J) * sumsqr(wheels) / 2))
    ocp.solver("ipopt", {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10}})
    ocp.method(DirectCollocation(N=intervals, degree=5, scheme="legendre"))
    return ocp.solve().value(ocp.objective)
