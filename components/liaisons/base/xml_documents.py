"""XML from untrusted files: no entities, limited size, nesting and length of elements."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import IO
from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser

_PORTION = 2**20
_LONGEST_ELEMENT = 2**24  # bytes between two tags; expat scans them again with every portion
_DEEPEST = 200
_MOST_NODES = 1_000_000  # elements and attributes of a tree
_LONGEST_TREE = 2**26  # bytes


Start = Callable[[str, dict[str, str]], object]
"""Called for a start tag with its attributes."""
End = Callable[[str], object]
"""Called for an end tag."""


def parse(file: IO[bytes], start: Start, end: End = lambda _: None, max_size: float = math.inf) -> None:
    """Call ``start`` and ``end`` for each tag of a document.

    :param max_size: largest size in bytes.
    :raises ValueError: for XML that is not well-formed, an unknown encoding, a document type (only those can define
        entities that grow without bounds), and whatever exceeds a limit.
    """
    tags = depth = silent = 0

    def opened(tag: str, attributes: dict[str, str]) -> None:
        nonlocal tags, depth
        tags, depth = tags + 1, depth + 1
        if depth > _DEEPEST:
            raise ValueError(f"its elements are nested more than {_DEEPEST} deep")
        start(tag, attributes)

    def closed(tag: str) -> None:
        nonlocal depth
        depth -= 1
        end(tag)

    parser = XMLParser(target=SimpleNamespace(start=opened, end=closed, doctype=_refuse_document_type))
    try:
        size = 0
        while portion := file.read(_PORTION):
            size += len(portion)
            if size > max_size:
                raise ValueError(f"it is longer than {max_size} bytes")
            before = tags
            parser.feed(portion)
            silent = 0 if tags > before else silent + len(portion)
            if silent > _LONGEST_ELEMENT:
                raise ValueError(f"an element is longer than {_LONGEST_ELEMENT} bytes")
        parser.close()
    except ParseError as error:
        raise ValueError(str(error)) from None
    except LookupError as error:  # also KeyError, for a missing attribute
        raise ValueError(
            f"an element has no attribute {error}" if isinstance(error, KeyError) else str(error)
        ) from None
    except OverflowError as error:
        raise ValueError(f"a number is out of range: {error}") from None


def read_tree(file: IO[bytes]) -> Element:
    """Root element of a document: a tree of elements with attributes, without texts.

    :raises ValueError: as :func:`parse`, and for too many elements and attributes.
    """
    builder, nodes = TreeBuilder(), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal nodes
        nodes += 1 + len(attributes)
        if nodes > _MOST_NODES:
            raise ValueError(f"it has more than {_MOST_NODES} elements and attributes")
        builder.start(tag, attributes)

    parse(file, start, builder.end, _LONGEST_TREE)
    return builder.close()


def _refuse_document_type(*_: object) -> None:
    """Raise a ValueError: called for a declaration of a document type."""
    raise ValueError("it declares a document type (<!DOCTYPE ...>); leave that out")
