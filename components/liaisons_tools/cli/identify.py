"""``liaisons identify``: from measurements to parameters, their proof, figure, film and residuals."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from liaisons_tools.cli._command import Output, command, print_verdicts


@command("""
    liaisons identify fit.toml
    liaisons identify fit.toml --output results
    python -c "import liaisons; help(liaisons.identify)"    the keys of fit.toml
""")
def identify(
    fit: Annotated[Path, typer.Argument(metavar="FIT.toml", help="its keys are the arguments of liaisons.identify")],
    *,
    output: Output = None,
) -> int:
    """Estimate parameters and start values from measurements, with their standard errors.

    Prints the values and verdicts; writes the figure (.png), a film that also shows the measured motion (.gif),
    and the residuals (_residuals.csv).  The exit status is 1 if a verdict fails.
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
