"""Text for terminals and pipes of any encoding: what they cannot show is written in ASCII."""

from __future__ import annotations

import codecs
import io
import sys
import unicodedata

_HANDLER = "liaisons.ascii"
_USUAL = {"strict", "surrogateescape", "backslashreplace"}
"""Python's default; users choose others as in ``PYTHONIOENCODING=cp1252:replace``."""

_SIGNS = {
    sign: words
    for line in (
        "· * | × x | ⊗ x | ⁄ / | ∧ ^ | ± +- | ∓ -+ | − - | – - | — - | ‘ ' | ’ ' | ′ ' | “ \" | ” \" | √ sqrt | ∞ inf",
        "∂ d | ∇ grad | Σ sum | ∑ sum | ∫ int | ∮ int | → -> | ← <- | ↔ <-> | ⇒ => | ≪ << | ≫ >>",
        "≤ <= | ≥ >= | ≠ != | ≈ ~ | ∝ ~ | λ lambda | Λ Lambda | ς sigma | ϑ theta | ϕ phi | ø o | Ø O | ß ss",
    )
    for sign, words in (pair.split() for pair in line.split(" | "))
} | {"°": " deg"}
"""Replacements where Unicode's names do not serve, such as lamda for λ."""


def tolerate_encodings() -> None:
    """Set the standard streams to write ``sigma`` where they cannot encode σ."""
    codecs.register_error(_HANDLER, _replace_unencodable)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in _USUAL:
            stream.reconfigure(errors=_HANDLER)


def ascii_text(text: str) -> str:
    """Text in ASCII: ``φ² ≤ 2π`` is ``phi2 <= 2pi``; a character without such a name is a question mark."""
    return "".join(character if character.isascii() else _ascii_character(character) for character in text)


def _replace_unencodable(error: UnicodeError) -> tuple[str, int]:
    """ASCII text for characters that a stream cannot encode, and the position behind them."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return ascii_text(error.object[error.start : error.end]), error.end


def _ascii_character(character: str) -> str:
    """ASCII text for a character, ``"?"`` if there is none."""
    if character in _SIGNS:
        return _SIGNS[character]
    plain = unicodedata.normalize("NFKD", character)
    if plain != character:
        return "".join(part for part in ascii_text(plain) if part.isascii())
    if unicodedata.combining(character):
        return ""
    kind, _, letter = unicodedata.name(character, "").partition(" LETTER ")
    if kind in {"GREEK SMALL", "GREEK CAPITAL"} and letter.isalpha():
        return letter.lower() if kind == "GREEK SMALL" else letter.capitalize()
    return "?"
