"""Files that an FMU carries beside those of FMI, with their roles: the layered standard fmi-ls-ref 1.0.0-beta.1."""

from __future__ import annotations

import posixpath
from dataclasses import dataclass, field
from typing import final

from liaisons.base.archive import Archive
from liaisons.base.xml_documents import parse
from liaisons.errors import SimulationError

NAME = "org.fmi-standard.fmi-ls-ref"
VERSION = "1.0.0-beta.1"
READ_VERSIONS = (VERSION, "1.0.0-alpha.1")
"""Versions that are read; the later one adds labels, annotations and the role ``meta-data``."""
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
FOLDER = f"extra/{NAME}"
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"


@final
@dataclass(frozen=True, slots=True)
class RelatedFile:
    """A file and what it is for.

    :param type: MIME type.
    :param source: URI, relative to the folder of the manifest.
    :param role: ``"result"``, ``"parameter"``, ``"experiment/smoke-test"``, ...
    :param labels: names of what it has in common with further files.
    """

    type: str
    source: str
    role: str
    labels: set[str] = field(default_factory=set)

    @property
    def member(self) -> str:
        """Path in the archive, from the URI."""
        return posixpath.normpath(f"{FOLDER}/{self.source}")


def related_files(archive: Archive) -> list[RelatedFile]:
    """The files that the manifest of an FMU names, without those that are not in the archive.

    :raises SimulationError: if the manifest is of another version, or damaged.
    """
    files: list[RelatedFile] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag == "fmiReferences":
            version = attributes[f"{{{NAMESPACE}}}fmi-ls-version"]
            if version not in READ_VERSIONS:
                raise ValueError(f"fmi-ls-ref of version {version} is not read; {', '.join(READ_VERSIONS)} are")
        elif tag == "Related":
            files.append(
                RelatedFile(
                    attributes.get("type", "application/octet-stream"), attributes["source"], attributes["role"]
                )
            )
        elif tag == "Label":
            files[-1].labels.add(attributes["name"])

    if MANIFEST in archive.names:
        try:
            with archive.open(MANIFEST) as file:
                parse(file, start)
        except ValueError as error:
            raise SimulationError(f"{archive.path}: {MANIFEST}: {error}") from None
    return [file for file in files if file.member in archive.names]
