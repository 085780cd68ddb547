"""XML line by line, without a tree in memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from io import BytesIO
from xml.sax.saxutils import escape

_ENTITIES = {'"': "&quot;", "\n": "&#10;", "\t": "&#9;"}


def element(name: str, attributes: Mapping[str, str], children: Iterable[str] = ()) -> Iterator[str]:
    """Yield the lines of an XML element; children are lines, which are indented."""
    start = " ".join([f"<{name}", *(f'{key}="{escape(value, _ENTITIES)}"' for key, value in attributes.items())])
    empty = True
    for line in children:
        if empty:
            yield f"{start}>"
        empty = False
        yield f"  {line}"
    yield f"{start}/>" if empty else f"</{name}>"


def document(lines: Iterable[str]) -> bytes:
    """Bytes of an XML file from the lines of its root element."""
    file = BytesIO(b"")
    file.write(b'<?xml version="1.0" encoding="UTF-8"?>\n')
    for line in lines:
        file.write(f"{line}\n".encode())
    return file.getvalue()
