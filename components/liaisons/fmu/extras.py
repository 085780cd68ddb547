"""Documentation, terminals and reference results of an FMU."""

from __future__ import annotations

import json
from functools import cache

from liaisons.base.published import own_distribution
from liaisons.fmu.documentation import index_page
from liaisons.fmu.layout import Fmi
from liaisons.fmu.reference_results import reference_members, trajectory
from liaisons.fmu.terminals import terminals_and_icons
from liaisons.mechanics import Model

_LICENSES = """\
The model: that of its author.
The runtime of liaisons, in the binaries and beside the model in sources:

{ours}

The headers of the FMI standard in sources: BSD-2-Clause, its text stands in them.
"""


def extra_members(model: Model, fmi: Fmi) -> dict[str, bytes]:
    """Return documentation, terminals, picture and reference results, by path in the archive."""
    picture = {} if model.picture is None else {"resources/picture.json": json.dumps(model.picture, indent=1).encode()}
    return picture | {
        "documentation/index.html": index_page(model),
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_and_icons(model, fmi),
        "documentation/licenses/license.txt": _licence_text(),
        **reference_members(model, trajectory(model), fmi),
    }


@cache
def _licence_text() -> bytes:
    """Return the text of the licences of the parts of an FMU."""
    distribution = own_distribution()
    texts = [file.read_text(encoding="utf-8") for file in distribution.files or () if file.name == "LICENSE"]
    return _LICENSES.format(ours=texts[0] if texts else distribution.metadata["License-Expression"]).encode()
