"""A pendulum as one writes an FMU at first: the inputs are held during a step."""

from math import cos, sin

from pythonfmu3 import Float64, Fmi3Causality, Fmi3Slave, Fmi3StepResult

GRAVITY = 9.81


class PendulumFmu(Fmi3Slave):
    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        self.time = 0.0
        self.theta, self.omega, self.length, self.x, self.z = 0.0, 0.0, 1.0, 0.0, 0.0
        self.start = 0.0
        self.before = (1.0, 0.0, 0.0)
        self.rates = (0.0, 0.0, 0.0)
        self.register_variable(Float64("time", causality=Fmi3Causality.independent))
        for name in ("length", "x", "z", "start"):
            self.register_variable(Float64(name, causality=Fmi3Causality.input))
        for name in ("theta", "omega"):
            self.register_variable(Float64(name, causality=Fmi3Causality.output))

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        now = (self.length, self.x, self.z)
        rates = tuple((b - a) / step_size for a, b in zip(self.before, now, strict=True))
        _, x_ddot, z_ddot = ((b - a) / step_size for a, b in zip(self.rates, rates, strict=True))
        self.before, self.rates = now, rates
        if current_time == 0.0:
            self.theta, self.rates = self.start, rates
        gravity = (GRAVITY + z_ddot) * sin(self.theta) + x_ddot * cos(self.theta)
        self.omega -= step_size * (gravity + 2 * rates[0] * self.omega) / self.length
        self.theta += step_size * self.omega
        return Fmi3StepResult()
