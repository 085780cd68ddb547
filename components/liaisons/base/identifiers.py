"""Names of systems as identifiers of languages."""

from __future__ import annotations

import re


def identifier(name: str) -> str:
    """Name as an identifier: ``"pumped swing"`` becomes ``PumpedSwing``."""
    words = re.findall(r"[A-Za-z0-9]+", name)
    joined = "".join(word[0].upper() + word[1:] for word in words)
    return joined if joined[:1].isalpha() else f"System{joined}"
