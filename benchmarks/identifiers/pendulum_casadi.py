"""The pendulum, from its equation by hand, by CasADi and IPOPT: Gauss-Newton, four steps of Runge-Kutta a point."""

import casadi as ca
from numpy.typing import NDArray

STEPS = 4


def solve(times: NDArray, angles: NDArray, start: dict[str, float], noise: float) -> dict[str, float]:
    """Length, friction and first angle."""
    x, p = ca.MX.sym("x", 2), ca.MX.sym("p", 2)
    rate = ca.Function("rate", [x, p], [ca.vertcat(x[1], -9.81 / p[0] * ca.sin(x[0]) - p[1] * x[1])])
    h, end = times[1] / STEPS, x
    for _ in range(STEPS):
        k1 = rate(end, p)
        k2 = rate(end + h / 2 * k1, p)
        k3 = rate(end + h / 2 * k2, p)
        k4 = rate(end + h * k3, p)
        end = end + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    point = ca.Function("point", [x, p], [end]).expand()
    unknown = ca.MX.sym("unknown", 3)
    states = point.mapaccum(len(times) - 1)(ca.vertcat(unknown[2], 0), unknown[:2])
    residuals = (ca.horzcat(unknown[2], states[0, :]).T - angles) / noise
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
    values = solver(x0=[*start.values()], lbx=[1e-3, 0, -ca.inf])["x"].full().ravel()
    return dict(zip(start, values, strict=True))
