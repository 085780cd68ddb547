"""Goals as files: TOML whose keys are the arguments of ``plan``."""

from __future__ import annotations

import inspect
import tomllib
from pathlib import Path
from typing import Any

from liaisons.arguments import as_path, named
from liaisons.errors import suggestion
from liaisons.operators.planning import plan
from liaisons.operators.plans import Plan
from liaisons.operators.problems import PlanError


def planned(path: Path | str, **options: Any) -> Plan:
    """Plan what a file asks for.

    ::

        mechanism = "PlanarCat"
        moves = ["psi_1", "psi_2"]
        closed = true
        duration = 0.9
        start = { phi = 0 }
        end = { phi = -0.1 }
        bounds = { psi_1 = [-3, 3], psi_2 = [-3, 3] }
        values = { arm_1 = 0.25, arm_2 = 0.25 }

    :param path: the file; that of a mechanism of one's own is looked for beside it.
    :param options: further ones of :func:`liaisons.plan`.
    :raises PlanError: if it is no TOML, or has another key, or what it asks for cannot be planned.
    """
    path = as_path("path", path, PlanError)
    try:
        asked = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise PlanError(f"{path}: {error}") from None
    known = {*inspect.signature(plan).parameters} - {"guess", "progress", "keywords"} | {"values"}
    for key in asked:
        if key not in known:
            raise PlanError(f"{path}: unknown key {key!r}{suggestion(key, known)}")
    for key in ("mechanism", "duration"):
        if key not in asked:
            raise PlanError(f"{path}: {key} is missing, for example {key} = {_EXAMPLES[key]}")
    mechanism, values = str(asked.pop("mechanism")), asked.pop("values", {})
    for key in named(f"{path}: values", values, PlanError):
        if key in known:
            raise PlanError(f"{path}: values: {key} is a key of its own, and no parameter")
    beside = path.parent / mechanism
    if beside.suffix == ".py" and beside.is_file():
        mechanism = str(beside)
    return plan(mechanism, **asked, **values, **options)


_EXAMPLES = {"mechanism": '"PlanarCat"', "duration": "0.9"}
