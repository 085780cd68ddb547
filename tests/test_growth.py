"""Work on arrays grows in proportion to their elements: a loop in a loop over them takes hours at 100 000."""

from __future__ import annotations

import time
import zipfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import fmpy
import pytest

from liaisons.cosim import SystemComponent
from liaisons.fmu import model_description
from liaisons.fmu.code import model_code
from liaisons.mechanics import Model, assemble
from liaisons.models import OscillatorChain
from liaisons_pages.fmu_pages import extras

SMALL, LARGE = 30, 1200
MOST = 4
"""Times the growth of n: linear work, whose constant part counts for the small n, stays below 1, quadratic is 40."""


@cache
def chain(n: int) -> Model:
    return replace(assemble(OscillatorChain, n), draw=None, drawn=(), picture=None)  # of 200 links at most


def scalars(n: int) -> bytes:
    """A model description of FMI 2.0 with 9 n + 13 variables."""
    return model_description(chain(n), guid="{}", backend="native")


def described(folder: Path, description: bytes, **starts: float) -> SystemComponent:
    """A component of an FMU that has nothing but its description."""
    path = folder / "chain.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr(f"binaries/{fmpy.platform_tuple}/OscillatorChain{fmpy.sharedLibraryExtension}", "")
        archive.writestr(f"binaries/{fmpy.platform}/OscillatorChain{fmpy.sharedLibraryExtension}", "")
    return SystemComponent.read("chain", path, starts)


def each_start(n: int, folder: Path) -> None:
    """Copies of a tuple are quick: 30 times as many elements as elsewhere."""
    values = range(1, 30 * n + 1)
    text = model_description(chain(values[-1]), "3", guid="{}")
    found = described(folder, text, **{f"u_0[{i}]": float(i) for i in values}).starts
    assert found == {"u_0": tuple(map(float, values))}


WORK: dict[str, Callable[[int, Path], object]] = {
    "code, FMI 2.0": lambda n, _: model_code(chain(n), "{}", "2"),
    "code, FMI 3.0": lambda n, _: model_code(chain(n), "{}", "3"),
    "description, FMI 2.0": lambda n, _: scalars(n),
    "description, FMI 3.0": lambda n, _: model_description(chain(n), "3", guid="{}"),
    "description, FMI 3.0, numbers": lambda n, _: model_description(chain(n), "3", guid="{}", arrays=False),
    "page": lambda n, _: extras(chain(n), "2"),
    "numbers": lambda n, _: chain(n).flat(),
    "reading, FMI 2.0": lambda n, folder: described(folder, scalars(n)),
    "starts of elements": each_start,
}


@pytest.mark.slow  # it is timed, and another process may slow it down
@pytest.mark.parametrize("of", WORK)
def test_work_grows_as_the_number_of_elements(of: str, tmp_path: Path) -> None:
    def taken(n: int) -> float:
        """Processor time [s]; the model is a new one, of which nothing has been calculated before."""
        chain.cache_clear()
        chain(n)
        start = time.process_time()
        WORK[of](n, tmp_path)
        return time.process_time() - start

    once = max(1e-3, min(taken(SMALL) for _ in range(2)))
    assert taken(LARGE) < MOST * LARGE / SMALL * once
