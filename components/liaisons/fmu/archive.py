"""Reproducible zip archives, written atomically."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

from liaisons.base import cache
from liaisons.base.archive import DESCRIPTION
from liaisons.base.files import atomic_replacement
from liaisons.errors import BuildError

_EARLIEST = (1980, 1, 1, 0, 0, 0)  # the first date that a zip archive can hold


def write_archive(path: Path, members: Mapping[str, bytes]) -> None:
    """Write a zip archive atomically, and make its parent folders.

    Its digest is stored as that of a trusted FMU: simulations load it without a trial in a process of its own.

    :param members: contents by name inside the archive, with ``/``.
    :raises BuildError: if the file cannot be written; an earlier file stays.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_replacement(path) as partial:
            with zipfile.ZipFile(partial, "x", zipfile.ZIP_DEFLATED) as archive:
                for name in sorted(members, key=lambda name: (name != DESCRIPTION, name)):
                    archive.writestr(_zip_info(name), members[name])
            digest = cache.digest(partial)
    except OSError as error:
        raise BuildError(f"{path} cannot be written: {error.strerror}; choose another folder with output=") from error
    cache.add_trusted_fmu(digest)


def read_member(path: Path, name: str) -> bytes | None:
    """Content of a member of an archive; None if archive or member is missing or damaged."""
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.read(name)
    except (OSError, KeyError, zipfile.BadZipFile):
        return None


def _zip_info(name: str) -> zipfile.ZipInfo:
    """Zip header of a member, the same on every machine."""
    entry = zipfile.ZipInfo(name, _EARLIEST)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.create_system = 3  # Unix, wherever it is written
    entry.external_attr = (0o100755 if name.startswith("binaries/") else 0o100644) << 16
    return entry
