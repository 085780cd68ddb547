"""Work on arrays grows in proportion to their elements: a loop in a loop over them takes hours at 100 000."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from liaisons.cosim import DefaultExperiment
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.description.model_description import parse
from liaisons.cosim.description.start_values import start_values
from liaisons.fmu import model_description
from liaisons.fmu.code import model_code
from liaisons.mechanics import Model, assemble
from liaisons.models import OscillatorChain
from liaisons_pages.fmu_pages.page import index_page

SMALL, LARGE = 30, 1200
MOST = 4
"""Times the growth of n: linear work, whose constant part counts for the small n, stays below 1, quadratic is 40."""


@cache
def chain(n: int) -> Model:
    return replace(assemble(OscillatorChain, n), draw=None, drawn=(), picture=None)  # of 200 links at most


def scalars(n: int) -> bytes:
    """A model description of FMI 2.0 with 9 n + 13 variables."""
    return model_description(chain(n), guid="{}", backend="native")


@cache
def described(n: int) -> Fmu:
    """The FMU that the model description in FMI 3.0 describes, without a file."""
    description = parse(io.BytesIO(model_description(chain(n), "3", guid="{}")), {})
    values = dict.fromkeys(Fmu.__dataclass_fields__, 0)
    values |= {"path": Path("chain.fmu"), "experiment": DefaultExperiment(), "variables": description.variables}
    return Fmu(**values)  # type: ignore[arg-type]


def each_start(n: int) -> None:
    """Copies of a tuple are quick: 30 times as many elements as elsewhere."""
    values = range(1, 30 * n + 1)
    found = start_values("chain", described(values[-1]), {f"u_0[{i}]": float(i) for i in values})
    assert found == {"u_0": tuple(map(float, values))}


WORK: dict[str, Callable[[int], object]] = {
    "code, FMI 2.0": lambda n: model_code(chain(n), "{}", "2"),
    "code, FMI 3.0": lambda n: model_code(chain(n), "{}", "3"),
    "description, FMI 2.0": scalars,
    "description, FMI 3.0": lambda n: model_description(chain(n), "3", guid="{}"),
    "description, FMI 3.0, numbers": lambda n: model_description(chain(n), "3", guid="{}", arrays=False),
    "page": lambda n: index_page(chain(n)),
    "numbers": lambda n: chain(n).flat(),
    "reading, FMI 2.0": lambda n: parse(io.BytesIO(scalars(n)), {}),
    "starts of elements": each_start,
}


@pytest.mark.slow  # it is timed, and another process may slow it down
@pytest.mark.parametrize("of", WORK)
def test_work_grows_as_the_number_of_elements(of: str) -> None:
    def taken(n: int) -> float:
        """Processor time [s]; the model is a new one, of which nothing has been calculated before."""
        chain.cache_clear()
        chain(n)
        start = time.process_time()
        WORK[of](n)
        return time.process_time() - start

    once = max(1e-3, min(taken(SMALL) for _ in range(2)))
    assert taken(LARGE) < MOST * LARGE / SMALL * once
