"""What the motion of each mechanism determines; run as a program it writes the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from liaisons import identify
from liaisons.chains import Chain
from liaisons.language import Component, Mechanism
from liaisons.library import catalogue
from liaisons.mechanics import Model, assemble
from liaisons_motion.derivatives import motion_of

PAGE = Path(__file__).parents[3] / "docs/reference/determined.md"
HEAD = """# Identifiability: what measurements determine

With each fit, `liaisons.identify` reports what the measurements do not determine, which are the null directions of the
information matrix. The table shows this for the mechanisms without contacts. The unknowns are all parameters, the
values at which active coordinates rest, and the start values of the motion if these are independent. In the second
column, all free coordinates are measured over time; in the third, the forces of all operators as well, if there are
any.

| Mechanism | from coordinates | with operator forces as well |
|---|---|---|
"""
DEPENDENT = ("CartesianPendulum", "IsokineticOscillator", "Satellite", "SpatialCat")
"""Their start values satisfy a condition, so that not all of them can be unknown."""
# Which parameters of contacts count changes from event to event.
MECHANISMS = [n for n, c in catalogue().items() if issubclass(c, (Mechanism, Chain)) and not c.contact_names()]


def values(name: str, model: Model) -> dict[str, float]:
    """Values near those that are declared, with no symmetry that a special value would have."""
    random = np.random.default_rng(3)
    chosen = {}
    for variable in (*model.parameters, *model.inputs):
        start, part = float(variable.starts[0]), 0.2 * random.uniform(0.5, 1)
        moves = name not in DEPENDENT[:2] and not variable.name.startswith("q_")
        chosen[variable.name] = start + (part * (start or 1) if moves else 0)
    return chosen


def not_determined(component: type[Component], *, forces: bool) -> list[str]:
    model = (assemble(component, 3) if issubclass(component, Chain) else assemble(component)).flat()
    active = [a.value for a in model.active]
    own = [p.name for p in model.parameters]
    unknown = [name for name in own if component.__name__ not in DEPENDENT or not name.partition("[")[0].endswith("_0")]
    unknown += active
    outputs = [v.name for v in model.outputs]
    signals = [s.name for s in model.states if s.name in outputs and not s.name.startswith(("p_", "H_"))]
    signals = [name for name in signals if name not in {"work", "dissipated"}]
    signals += [f"{name}_force" for name in active] if forces else []
    chosen = values(component.__name__, model)
    start_values = {name: value for name, value in chosen.items() if name in {*own, *active}}
    times = np.linspace(0, 4, 61)
    motion = motion_of(model, unknown, times, record=signals, start_values=start_values)
    data = {"time": times, **dict(zip(signals, motion(motion.values), strict=True))}
    fit = identify(model, data, unknown, noise=1e-3, start_values=start_values, segments=1)
    return [sentence.partition(" by ")[0].replace("*", r"\*") for sentence in fit.estimate.indeterminacy_sentences]


def row(name: str) -> str:
    component = catalogue()[name]
    cells = ["<br>".join(not_determined(component, forces=forces)) or "all" for forces in (False, True)]
    if not assemble(component).active:
        cells[1] = ""
    return f"| {name} | {cells[0]} | {cells[1]} |"


@pytest.mark.slow
@pytest.mark.parametrize("name", MECHANISMS)
def test_the_page_says_what_is_determined(name: str) -> None:
    assert row(name) in PAGE.read_text(encoding="utf-8").splitlines()


if __name__ == "__main__":
    PAGE.write_text(HEAD + "\n".join(map(row, MECHANISMS)) + "\n", encoding="utf-8", newline="\n")
