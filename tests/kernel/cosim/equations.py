"""FMUs of Model Exchange, made of a few lines of C."""

from __future__ import annotations

import re
from pathlib import Path

from making import packed

_CODE = (Path(__file__).parent / "equations.c.in").read_text(encoding="utf-8")


def equations(folder: Path, states: int, indicators: int = 0, **code: str) -> Path:
    """An FMU with states ``x[0]``, ..., an input ``u`` and an output ``y``, for which C can be given.

    :param code: ``start`` of x; ``rates`` f of ``x``, ``u``, ``t``, ``memory``; ``indicators_of`` z of the same;
        ``event`` (may change ``x``, ``memory``, ``info->...``); ``nominals`` nominal; ``output`` y.
    """
    code["indicators"] = code.pop("indicators_of", "")
    text = re.sub("@([a-z]+)@", lambda found: code.get(found[1], ""), _CODE)
    variable = '<ScalarVariable name="{}" valueReference="{}" causality="{}"{}><Real{}/></ScalarVariable>'
    listed = [
        *(variable.format(f"x{k}", k, "output", ' initial="exact"', ' start="0"') for k in range(states)),
        *(variable.format(f"f{k}", 20 + k, "local", "", f' derivative="{k + 1}"') for k in range(states)),
        variable.format("u", 10, "input", "", ' start="0"'),
        variable.format("y", 11, "output", "", ""),
    ]
    unknowns = "".join(f'<Unknown index="{states + k + 1}"/>' for k in range(states))
    outputs = "".join(f'<Unknown index="{k + 1}" dependencies=""/>' for k in range(states))
    described = (
        '<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="x" guid="x" '
        f'numberOfEventIndicators="{indicators}"><ModelExchange modelIdentifier="x" canGetAndSetFMUstate="true" '
        'completedIntegratorStepNotNeeded="true"/>'
        f"<ModelVariables>{''.join(listed)}</ModelVariables><ModelStructure><Outputs>{outputs}"
        f'<Unknown index="{2 * states + 2}"/></Outputs><Derivatives>{unknowns}</Derivatives><InitialUnknowns>{unknowns}'
        f'<Unknown index="{2 * states + 2}"/></InitialUnknowns></ModelStructure>'
        "</fmiModelDescription>"
    )
    folder.mkdir(parents=True, exist_ok=True)
    return packed(folder, "x", text, described)
