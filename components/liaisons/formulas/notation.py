"""How variables are written: letters, dots and subscripts from their names, in MathML."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from html import escape, unescape

from liaisons.mechanics.model import Model

# Letters that everybody uses for these words; a declaration may have another one.
_LETTERS = {
    "kinetic_energy": "T",
    "potential_energy": "V",
    "energy": "E",
    "angular_frequency": "ω",
    "amplitude": "A",
    "inertia": "I",
    "length": "l",
    "mass": "m",
    "phase": "φ",
    "radius": "R",
    "stiffness": "k",
}
_NAME = re.compile(r"(?P<stem>.+?)(?P<rate>_d?dot)?(?P<start>_0)?(?:\[(?P<index>.+)\])?")
_DOTS = {"_dot": "˙", "_ddot": "¨"}


class Notation:
    """How each variable is written: its letter, dots, subscripts.  No two variables are written alike.

    :param names: names of variables, by rank: factors of a product stand in this order.
    :param active: those that an operator prescribes, whose forces are called λ.
    :param symbols: what is declared for some of them: a letter, ``"m_1"`` with a subscript.
    """

    def __init__(
        self, names: Iterable[str], active: Collection[str] = (), symbols: Mapping[str, str] | None = None
    ) -> None:
        self._letters = _LETTERS | {name.partition("[")[0]: symbol for name, symbol in (symbols or {}).items()}
        self._rank = {name: i for i, name in enumerate(names)}
        self._active = active
        written = {name: self._written(name) for name in self._rank}
        taken = Counter(written.values())
        self._symbols = {name: text if taken[text] == 1 else _letter(name) for name, text in written.items()}

    def __getitem__(self, name: str) -> str:
        return self._symbols.get(name) or self._written(name)

    @classmethod
    def from_model(cls, model: Model) -> Notation:
        """That of a model's variables."""
        symbols = {v.name: v.symbol for v in model.variables if v.symbol}
        return cls([v.name for v in model.variables], {active.value for active in model.active}, symbols)

    def rank(self, name: str) -> int:
        """Index among the names; behind all of them for others."""
        return self._rank.get(name, len(self._rank))

    def free_letter(self) -> str:
        """A letter that no variable has, for abbreviations: ``"a"``, if they are called a_1, a_2."""
        stems = {name.partition("_")[0] for name in self._rank}
        written = "".join(self._symbols.values())
        return next(x for x in "abcdefhjnuvw" if f">{x}<" not in written and x not in stems)

    def _written(self, name: str) -> str:
        match = _NAME.fullmatch(name)
        assert match is not None  # names are not empty
        stem, prefix = match["stem"], list[str]()
        for ending, letter in (("_force", "Q"), ("_load", "F"), ("_power", "P"), ("_mismatch", "Δ")):
            if stem.endswith(ending):
                stem = stem.removesuffix(ending)
                prefix = ["λ" if ending == "_force" and stem in self._active else letter]
        if stem.startswith("p_") and stem[2:] in self._letters:
            stem, prefix = stem[2:], ["p"]
        head, *subscripts = prefix + self._letters.get(stem, stem).split("_")
        is_word = not prefix and len(_greek(head)) > 1 and head not in self._letters
        if is_word and subscripts and subscripts[-1] in self._letters:
            head, subscripts = subscripts[-1], [head, *subscripts[:-1]]  # the inertia of the hoop, I_hoop
        base = _letter(self._letters.get(head, head))
        if match["rate"]:
            base = f"<mover>{base}<mo>{_DOTS[match['rate']]}</mo></mover>"
        below = [_letter(part) for part in subscripts if part]
        if match["index"]:
            below += [self._written(part) for part in match["index"].split(",")]
        if match["start"]:
            below.append("<mn>0</mn>")
        return f"<msub>{base}{_row(below, '<mo>,</mo>')}</msub>" if below else base


def _letter(text: str) -> str:
    return f"<mn>{text}</mn>" if text.isdecimal() else f"<mi>{escape(_greek(text))}</mi>"


def _greek(text: str) -> str:
    """The letter that a word is the name of, else the word."""
    letter = unescape(f"&{text};")
    return letter if "Α" <= letter <= "ω" else text


def _row(parts: list[str], between: str) -> str:
    return parts[0] if len(parts) == 1 else f"<mrow>{between.join(parts)}</mrow>"
