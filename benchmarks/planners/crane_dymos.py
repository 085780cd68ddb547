"""The crane by dymos, from equations by hand."""

import dymos as dm
import numpy as np
import openmdao.api as om


class Rates(om.ExplicitComponent):
    """dx/dt and the cost's integrand."""

    def initialize(self):
        self.options.declare("num_nodes", types=int)

    def setup(self):
        n = self.options["num_nodes"]
        self.add_input("angle", shape=n, units="rad")
        self.add_input("a", shape=n, units="m/s**2")
        self.add_output("rate_dot", shape=n, units="rad/s**2")
        self.add_output("a_squared", shape=n, units="m**2/s**4")
        rows = np.arange(n)
        self.declare_partials("*", "*", rows=rows, cols=rows)

    def compute(self, inputs, outputs):
        angle, a = inputs["angle"], inputs["a"]
        outputs["rate_dot"] = -(9.81 * np.sin(angle) + a * np.cos(angle)) / 2.0
        outputs["a_squared"] = a**2

    def compute_partials(self, inputs, partials):
        angle, a = inputs["angle"], inputs["a"]
        partials["rate_dot", "angle"] = -(9.81 * np.cos(angle) - a * np.sin(angle)) / 2.0
        partials["rate_dot", "a"] = -np.cos(angle) / 2.0
        partials["a_squared", "angle"] = 0.0
        partials["a_squared", "a"] = 2 * a


def solve(intervals):
    """∫ a² dt of the trolley."""
    problem = om.Problem()
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-9, maxiter=300, disp=False)
    problem.driver.declare_coloring(show_summary=False)
    phase = dm.Phase(ode_class=Rates, transcription=dm.Radau(num_segments=intervals, order=5))
    trajectory = problem.model.add_subsystem("trajectory", dm.Trajectory())
    trajectory.add_phase("phase", phase)
    phase.set_time_options(fix_initial=True, fix_duration=True)
    ends = {"fix_initial": True, "fix_final": True, "shape": (1,)}
    phase.add_state("x", rate_source="v", units="m", **ends)
    phase.add_state("v", rate_source="a", units="m/s", **ends)
    phase.add_state("angle", rate_source="rate", targets=["angle"], units="rad", **ends)
    phase.add_state("rate", rate_source="rate_dot", units="rad/s", **ends)
    phase.add_state("cost", rate_source="a_squared", units="m**2/s**3", fix_initial=True, shape=(1,))
    phase.add_control("a", shape=(1,), targets=["a"], units="m/s**2", continuity=True, rate_continuity=False)
    phase.add_objective("cost", loc="final")
    problem.setup()
    phase.set_time_val(initial=0.0, duration=3.0)
    for name, ends in (("x", [0, 0.8]), ("v", [0, 0]), ("angle", [0, 0]), ("rate", [0, 0]), ("cost", [0, 1])):
        phase.set_state_val(name, ends)
    phase.set_control_val("a", [1, -1])
    problem.run_driver()
    return float(problem.get_val("trajectory.phase.states:cost")[-1, 0])
