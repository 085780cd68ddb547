"""``liaisons identify``: from measurements to parameters, their proof, figure, film and residuals."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from liaisons_tools.cli._command import Output, command, print_verdicts


@command("""
    liaisons identify fit.toml
    liaisons identify fit.toml --output results
    python -c "import liaisons; help(liaisons.identify)"    what stands in fit.toml
""")
def identify(
    fit: Annotated[Path, typer.Argument(metavar="FIT.toml", help="keys are the arguments of liaisons.identify")],
    *,
    output: Output = None,
) -> int:
    """Find parameters and start values from measurements, and say how sure they are.

    Prints values with standard errors, and verdicts; writes the figure (.png), the film with the measured motion as a
    ghost (.gif) and the residuals (_residuals.csv).  Exit status 1 when a verdict fails.
    """
    from liaisons_motion.identification import identify_from_file

    result = identify_from_file(fit)
    folder = output or Path()
    folder.mkdir(parents=True, exist_ok=True)
    figure, film, residuals = (folder / f"{fit.stem}{end}" for end in (".png", ".gif", "_residuals.csv"))
    result.plot(path=figure)
    result.animate(film)
    result.to_csv(residuals)
    print(result)
    for name, path in (("figure", figure), ("motion", film), ("residuals", residuals)):
        print(f"{name}: {path}")
    verdicts = result.verify()
    print()
    return print_verdicts(verdicts)
