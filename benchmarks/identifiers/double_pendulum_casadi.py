"""The double pendulum, from equations by hand, by CasADi and IPOPT: Gauss-Newton, eight Runge-Kutta steps a point."""

import casadi as ca
from numpy.typing import NDArray

STEPS = 8


def solve(times: NDArray, angles: NDArray, start: dict[str, float], noise: float) -> dict[str, float]:
    """Lengths, second mass, first angles."""
    x, p = ca.SX.sym("x", 4), ca.SX.sym("p", 3)
    one, two, one_dot, two_dot = ca.vertsplit(x)
    l_1, l_2, m_2 = ca.vertsplit(p)
    m = 1 + m_2
    sine, cosine = ca.sin(one - two), ca.cos(one - two)
    force_1 = -m * 9.81 * ca.sin(one) - m_2 * l_2 * two_dot**2 * sine
    force_2 = -9.81 * ca.sin(two) + l_1 * one_dot**2 * sine
    one_ddot = (force_1 - m_2 * cosine * force_2) / (l_1 * (m - m_2 * cosine**2))
    two_ddot = (force_2 - l_1 * cosine * one_ddot) / l_2
    rate = ca.Function("rate", [x, p], [ca.vertcat(one_dot, two_dot, one_ddot, two_ddot)])
    h, end = times[1] / STEPS, x
    for _ in range(STEPS):
        k1 = rate(end, p)
        k2 = rate(end + h / 2 * k1, p)
        k3 = rate(end + h / 2 * k2, p)
        k4 = rate(end + h * k3, p)
        end = end + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    point = ca.Function("point", [x, p], [end])
    unknown = ca.MX.sym("unknown", 5)
    first = ca.vertcat(unknown[3:], 0, 0)
    states = ca.horzcat(first, point.mapaccum(len(times) - 1)(first, unknown[:3]))
    residuals = ca.vec(states[:2, :] - angles) / noise
    jacobian = ca.jacobian(residuals, unknown)
    factor = ca.MX.sym("factor")
    hessian = ca.Function(
        "hessian",
        [unknown, ca.MX(0, 1), factor, ca.MX(0, 1)],
        [factor * ca.triu(jacobian.T @ jacobian)],
        ["x", "p", "lam_f", "lam_g"],
        ["triu_hess_gamma_x_x"],
    )
    options = {"hess_lag": hessian, "print_time": False, "ipopt": {"print_level": 0, "sb": "yes"}}
    solver = ca.nlpsol("solver", "ipopt", {"x": unknown, "f": ca.sumsqr(residuals) / 2}, options)
    values = solver(x0=[*start.values()], lbx=[1e-3, 1e-3, 1e-3, -ca.inf, -ca.inf])["x"].full().ravel()
    return dict(zip(start, values, strict=True))
