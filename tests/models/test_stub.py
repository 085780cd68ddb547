"""The stub by which type checkers know the catalogue; ``python tests/models/test_stub.py`` writes it."""

from __future__ import annotations

from pathlib import Path

from liaisons import models

STUB = Path(models.__file__).with_suffix(".pyi")


def declared() -> str:
    """What the stub has to say: where each name of the catalogue comes from."""
    assert models.CATALOGUE  # loads all files
    prefix = f"{models.__name__}."
    names = [
        (value.__module__.removeprefix(prefix), not name[0].isupper(), name)
        for name, value in vars(models).items()
        if not name.startswith("_") and str(getattr(value, "__module__", "")).startswith(prefix)
    ]
    imports = [f"from .{module} import {name} as {name}" for module, _, name in sorted(names)]
    catalogue = "CATALOGUE: tuple[type[Component], ...]"
    return "\n".join(["from liaisons.language import Component", "", *imports, "", catalogue, ""])


def test_type_checkers_know_the_catalogue() -> None:
    assert STUB.read_text(encoding="utf-8") == declared()


if __name__ == "__main__":
    STUB.write_text(declared(), encoding="utf-8", newline="\n")
