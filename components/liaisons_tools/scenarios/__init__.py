"""A scenario is a claim: a file that simulates FMUs, says what has to hold, and draws it.

::

    \"\"\"A pendulum keeps time only for small swings: its period grows to 4K(sin θ_0/2)/Ω.\"\"\"

    @scenario
    def main(claim: Claims) -> None:
        solver = within(1e-7, "rad", because="amplification below 100 over 60 s, tolerance 1e-10")
        (axis,) = panels(("a large swing", "t [s]", "θ [rad]"))
        run = simulate("Pendulum", stop_time=60.0, step_size=0.02, tolerance=1e-10, theta_0=3.0)
        exact = Pendulum.exact(run.time, theta_0=3.0)
        claim("θ(t) is Jacobi's elliptic function", run["theta"], exact["theta"], solver)
        axis.plot(run.time, run["theta"], label="FMU")
        dots(axis, run.time, exact["theta"], label="elliptic functions")

``main`` comes last in its file, which then is a program: ``python scenarios/NAME.py`` and ``liaisons run NAME`` do the
same.  The first paragraph of the file's docstring is what the scenario claims as a whole.

* ``claim(text, got, expected, bound)``: the largest difference stays within the bound.  Two mappings are compared by
  the names of what is expected: ``claim("x, y", run, exact, bound)``.
* ``claim.below(text, got, limit, bound)``: nothing exceeds the limit, but for the bound.
* ``claim.order(text, sizes, errors, order, bound)``: errors grow as the sizes to this power.
* ``claim.energy(text, *runs, tolerance=...)``: what was gained came through the ports; the bound follows.
* ``within(tolerance, unit, because=...)``: a bound with its reason; one bound may serve several claims.
* ``panels((title, x label, y label), ...)``: axes of the one figure; with a fourth entry, the z label, in space.
  Legends are put below the panels and the figure is saved when ``main`` is done.
* ``dots(axis, x, y, label=...)``: what the curve has to pass through.
* ``simulate("Pendulum", length=operator("Sinusoid", amplitude=0.1))``: an operator as the value of a coordinate.
* ``def lesson() -> Lesson``, before ``main``: question, live page and answer, for ``liaisons show NAME`` and
  the site.
* ``crossings(time, signal, rate)``, ``frequencies(cosines, step)``, ``slope``: what is read off a motion.
"""

from liaisons.check import slope, table
from liaisons_tools.scenarios.claims import Bound, Claims, within
from liaisons_tools.scenarios.drawing import dots, panels
from liaisons_tools.scenarios.lesson import Lesson, lessons, load_lesson
from liaisons_tools.scenarios.running import Outcome, Scenario, execute, load, names, report, scenario

__all__ = [
    "Bound",
    "Claims",
    "Lesson",
    "Outcome",
    "Scenario",
    "dots",
    "execute",
    "lessons",
    "load",
    "load_lesson",
    "names",
    "panels",
    "report",
    "scenario",
    "slope",
    "table",
    "within",
]
