"""What an FMU has beside description and code: terminals, picture, and what others add.

Whoever has a page, an icon or results for FMUs registers a function as an entry point of the group
``liaisons.fmu_extras``.  It takes a model and a version of FMI, and returns members by their paths in the archive.  A
member is its content, or a function without arguments that returns it, which is called when the file is written; the
guid does not depend on it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from liaisons.base.published import own_distribution, registered
from liaisons.fmu.layout import Fmi
from liaisons.fmu.terminals import terminals_and_icons
from liaisons.mechanics import Model

EXTRAS = "liaisons.fmu_extras"
_ICON = "terminalsAndIcons/icon.png"
_LICENSES = """\
The model: that of its author.
The runtime of liaisons, in the binaries and beside the model in sources:

{ours}

The headers of the FMI standard in sources: BSD-2-Clause, its text stands in them.
"""


def extra_members(model: Model, fmi: Fmi) -> dict[str, bytes]:
    """Terminals, picture, and what others add, by path in the archive."""
    picture = {} if model.picture is None else {"resources/picture.json": json.dumps(model.picture, indent=1).encode()}
    return picture | {
        **{name: content for name, content in _members_of_others(model, fmi) if not callable(content)},
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_and_icons(model, fmi),
        "documentation/licenses/license.txt": _licence_text(),
    }


def drawn_members(model: Model, fmi: Fmi) -> dict[str, bytes]:
    """Members that others draw when the file is written; FMI 2.0 has the icon at the root, too."""
    drawn = {name: draw() for name, draw in _members_of_others(model, fmi) if callable(draw)}
    return drawn | ({"model.png": drawn[_ICON]} if fmi == "2" and _ICON in drawn else {})


def _members_of_others(model: Model, fmi: Fmi) -> Iterator[tuple[str, bytes | Callable[[], bytes]]]:
    """Yield paths and contents of what is registered."""
    for extras in registered(EXTRAS):
        yield from extras(model, fmi).items()


@cache
def _licence_text() -> bytes:
    """Text of the licences of the parts of an FMU; that of this package by its name, where the file is missing."""
    ours = own_distribution().metadata["License-Expression"]
    for file in own_distribution().files or ():
        path = Path(str(file.locate()))
        if file.name == "LICENSE" and path.is_file():
            ours = path.read_text(encoding="utf-8")
    return _LICENSES.format(ours=ours).encode()
