"""A pendulum as one writes it at first with CasADi's integrators for pythonfmu."""

import casadi as ca
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Real, String


class CasadiPendulum(Fmi2Slave):
    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        self.theta = 0.1
        self.p_theta = 0.0
        self.plugin = "cvodes"
        self.rebuilt = False
        self.integrator: ca.Function | None = None
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
        self.register_variable(Real("theta", causality=Fmi2Causality.output))
        self.register_variable(Real("p_theta", causality=Fmi2Causality.output))
        self.register_variable(String("plugin", **fixed))
        self.register_variable(Boolean("rebuilt", **fixed))

    def build(self, step_size: float) -> ca.Function:
        theta, p_theta = ca.SX.sym("theta"), ca.SX.sym("p_theta")
        equations = {"x": ca.vertcat(theta, p_theta), "ode": ca.vertcat(p_theta, -9.81 * ca.sin(theta))}
        return ca.integrator("integrator", self.plugin, equations, 0, step_size)

    def do_step(self, current_time: float, step_size: float) -> bool:  # noqa: ARG002 - pythonfmu's signature
        if self.integrator is None or self.rebuilt:
            self.integrator = self.build(step_size)
        end = self.integrator(x0=[self.theta, self.p_theta])["xf"]
        self.theta, self.p_theta = float(end[0]), float(end[1])
        return True
