"""The same as ``plain_python_pendulum.py``, for pythonfmu3."""

from math import sin

from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Fmi3StepResult


class PlainPythonPendulum3(Fmi3Slave):
    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        self.time = 0.0
        self.theta = 0.1
        self.p_theta = 0.0
        self.register_variable(Float64("time", causality=Fmi3Causality.independent))
        self.register_variable(Float64("theta", causality=Fmi3Causality.output))
        self.register_variable(Float64("p_theta", causality=Fmi3Causality.output))

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:  # noqa: ARG002 - pythonfmu3's signature
        h, theta, p = step_size, self.theta, self.p_theta
        a1, b1 = p, -9.81 * sin(theta)
        a2, b2 = p + h / 2 * b1, -9.81 * sin(theta + h / 2 * a1)
        a3, b3 = p + h / 2 * b2, -9.81 * sin(theta + h / 2 * a2)
        a4, b4 = p + h * b3, -9.81 * sin(theta + h * a3)
        self.theta = theta + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        self.p_theta = p + h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
        return Fmi3StepResult()
