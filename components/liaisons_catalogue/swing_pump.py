"""The operator of a swing that closes the loop: it watches the swing and moves the length."""

import casadi as ca

from liaisons.base.units import ANY
from liaisons.language import Input, InternalState, Operator, Parameter


class SwingPump(Operator):
    """Length that pumps a swing: short on the way up, long on the way down, filtered to be smooth.

    The swinger rises at the lowest point and crouches at the turning points (M 8.1): the wanted length is ``low`` while
    |θ| grows, θ θ' > 0, and ``high`` while it falls.  Three first-order filters in a row, each

        x_i' = rate (x_{i-1} - x_i),    y = low + (high - low) x_3

    make y, y_dot and y_ddot continuous.  x [1] is the depth of the crouch: 0 when standing (low) and 1 when crouched
    (high); rate [1/s] should be several times the swing's own Ω.
    """

    low = Parameter(0.95, ANY, "shortest length, standing")
    high = Parameter(1.05, ANY, "greatest length, crouched")
    rate = Parameter(30.0, "1/s", "rate of each of the three filters", above=0)
    theta = Input("rad", "angle of the swing from the downward vertical", start=0.1)
    theta_dot = Input("rad/s", "rate of this angle", start=0.1)
    crouch_1 = InternalState("1", "wanted crouch after one filter", start=1.0)
    crouch_2 = InternalState("1", "wanted crouch after two filters", start=1.0)
    crouch_3 = InternalState("1", "crouch, 0 stands, 1 is down", start=1.0)

    def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - time enters through the swing alone
        return self.low + (self.high - self.low) * self.crouch_3

    def internal_rates(self) -> dict[str, ca.SX]:
        crouched = ca.if_else(self.theta * self.theta_dot > 0, 0, 1)
        stages = (crouched, self.crouch_1, self.crouch_2, self.crouch_3)
        return {f"crouch_{i}": self.rate * (stages[i - 1] - stages[i]) for i in (1, 2, 3)}
