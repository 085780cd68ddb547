"""Author, version, licence and date of an FMU.

A component has the author and the licence of the package that publishes it.  The date is never that of a clock, so that
equal FMUs are equal files.
"""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path
from xml.sax.saxutils import quoteattr

from liaisons.base.archive import DESCRIPTION
from liaisons.base.published import own_distribution, publishing_package
from liaisons.base.version import __date__, __version__
from liaisons.errors import BuildError
from liaisons.fmu.archive import read_member
from liaisons.mechanics import Model

_EPOCH = "SOURCE_DATE_EPOCH"
_BEFORE = b' generationTool="'


def provenance(model: Model) -> dict[str, str]:
    """Author, version, licence and date of a model as attributes of its model description.

    They are those of the package that publishes the component.  The date is that of the environment variable
    SOURCE_DATE_EPOCH, else, of a component of liaisons, that of its version.

    :raises BuildError: if SOURCE_DATE_EPOCH is not a number of seconds.
    """
    package = publishing_package(model.module)
    ours = package is own_distribution()
    about = {} if package is None else package.metadata.json
    attributes = {
        "author": about.get("author") or about.get("author_email"),
        "version": __version__ if ours else about.get("version"),
        "license": about.get("license_expression") or about.get("license"),
        "generationDateAndTime": _source_date() or (f"{__date__}T00:00:00Z" if ours else ""),
    }
    return {name: str(value) for name, value in attributes.items() if value}


def with_provenance(description: bytes, model: Model) -> bytes:
    """Model description with the attributes of :func:`provenance` added."""
    attributes = "".join(f" {name}={quoteattr(value)}" for name, value in provenance(model).items())
    return description.replace(_BEFORE, attributes.encode() + _BEFORE, 1)


def is_of_catalogue(fmu: Path) -> bool:
    """Whether a file is an FMU of a component of liaisons, not of a class of the same name."""
    about = own_distribution().metadata.json
    author = quoteattr(str(about.get("author") or about.get("author_email")))
    return f" author={author}".encode() in (read_member(fmu, DESCRIPTION) or b"")


def _source_date() -> str:
    """Date and time of SOURCE_DATE_EPOCH as text; empty if that is not set."""
    seconds = os.environ.get(_EPOCH, "")
    try:
        return datetime.fromtimestamp(int(seconds), UTC).strftime("%Y-%m-%dT%H:%M:%SZ") if seconds else ""
    except (ValueError, OverflowError, OSError) as error:
        raise BuildError(f"{_EPOCH} = {seconds!r}: set seconds since 1970-01-01, or unset it") from error
