"""``liaisons plan``: from a goal to the motion of an operator, its proof, picture and system."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from liaisons_tools.cli._command import Output, command, print_verdicts


@command("""
    liaisons plan goal.toml
    liaisons plan goal.toml --output results
    python -c "import liaisons; help(liaisons.plan)"        the keys of goal.toml
""")
def plan(
    goal: Annotated[Path, typer.Argument(metavar="GOAL.toml", help="its keys are the arguments of liaisons.plan")],
    *,
    output: Output = None,
) -> int:
    """Plan the motion of active coordinates that reaches a goal at least cost, and verify it.

    Writes the plan (.json), its figure (.png), its animation (.gif) and its system (.ssp), and prints verdicts.  The
    exit status is 1 if a verdict fails.
    """
    from liaisons_motion.planning import plan_from_file

    folder = output or Path()
    motion = plan_from_file(goal, progress=True)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / goal.stem
    motion.save(path.with_suffix(".json"))
    motion.plot(path=path.with_suffix(".png"))
    motion.replay().animate(path.with_suffix(".gif"))
    motion.system(interpolate=False).write_ssp(path.with_suffix(".ssp"))
    print(f"{motion!r}"[1:-1])
    for name, kind in (("plan", ".json"), ("figure", ".png"), ("motion", ".gif"), ("system", ".ssp")):
        print(f"{name}: {path.with_suffix(kind)}")
    verdicts = motion.verify()
    print()
    return print_verdicts(verdicts)
