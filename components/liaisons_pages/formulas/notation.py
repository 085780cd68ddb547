"""How variables are written: letters, dots and subscripts from their names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from html import unescape

from liaisons.language import Component
from liaisons.mechanics import Model, assemble

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
_ORDERS = {None: 0, "_dot": 1, "_ddot": 2}


@dataclass(frozen=True, slots=True)
class Letter:
    """A letter, number or word, with dots above and further ones below."""

    text: str
    dots: int = 0
    below: tuple[Letter, ...] = ()

    @property
    def is_word(self) -> bool:
        return len(self.text) > 1 and not self.text.isdecimal()

    def texts(self) -> Iterator[str]:
        """Yield the text of the letter and those of its subscripts."""
        yield self.text
        for letter in self.below:
            yield from letter.texts()


class Notation:
    """How each variable is written: its letter, dots, subscripts.  No two variables are written alike.

    :param names: names of variables, by rank: factors of a product stand in this order.
    :param active: those that an operator prescribes, and contacts, whose forces are called λ.
    :param symbols: what is declared for some of them: a letter, ``"m_1"`` with a subscript.
    """

    def __init__(
        self, names: Iterable[str], active: Collection[str] = (), symbols: Mapping[str, str] | None = None
    ) -> None:
        self._letters = _LETTERS | {name.partition("[")[0]: symbol for name, symbol in (symbols or {}).items()}
        self._rank = {name: i for i, name in enumerate(names)}
        self._active = active
        written = {name: self._letter_of(name) for name in self._rank}
        taken = Counter(written.values())
        self._symbols = {name: x if taken[x] == 1 else Letter(_greek_or_word(name)) for name, x in written.items()}

    def __getitem__(self, name: str) -> Letter:
        return self._symbols.get(name) or self._letter_of(name)

    @classmethod
    def from_model(cls, model: Model) -> Notation:
        """Return the notation of a model's variables."""
        symbols = {v.name: v.symbol for v in model.variables if v.symbol}
        upheld = {
            name.partition("[")[0] for name in (*(a.value for a in model.active), *(c.name for c in model.contacts))
        }
        return cls([v.name for v in model.variables], upheld, symbols)

    @classmethod
    def from_component(cls, component: type[Component]) -> Notation:
        """Return the notation of a component's variables."""
        return cls.from_model(assemble(component))

    def rank(self, name: str) -> int:
        """Return the index of a name; that of an unknown one is the number of names."""
        return self._rank.get(name, len(self._rank))

    def unused_letter(self) -> str:
        """Return a letter that no variable has, for abbreviations a_1, a_2."""
        taken = {name.partition("_")[0] for name in self._rank}
        taken.update(text for letter in self._symbols.values() for text in letter.texts())
        return next(x for x in "abcdefhjnuvw" if x not in taken)

    def _letter_of(self, name: str, part: str = "") -> Letter:
        """Return the letter of a variable.

        :param part: name of its part of a system, with a dot.
        """
        owner, dot, inner = name.partition("[")[0].partition(".")
        if dot:
            letter = self._letter_of(inner + name[len(owner) + 1 + len(inner) :], f"{owner}.")
            return replace(letter, below=(*letter.below, Letter(owner)))
        letters = self._letters
        if part:
            letters = letters | {k.removeprefix(part): v for k, v in letters.items() if k.startswith(part)}
        match = _NAME.fullmatch(name)
        assert match is not None  # names are not empty
        stem, prefix = match["stem"], list[str]()
        for ending, letter in (("_force", "Q"), ("_load", "F"), ("_power", "P"), ("_mismatch", "Δ")):
            if stem.endswith(ending):
                stem = stem.removesuffix(ending)
                prefix = ["λ" if ending == "_force" and part + stem in self._active else letter]
        if stem.startswith("p_") and stem[2:] in letters:
            stem, prefix = stem[2:], ["p"]
        head, *subscripts = prefix + letters.get(stem, stem).split("_")
        is_word = not prefix and len(_greek_or_word(head)) > 1 and head not in letters
        if is_word and subscripts and subscripts[-1] in letters:
            head, subscripts = subscripts[-1], [head, *subscripts[:-1]]  # the inertia of the hoop, I_hoop
        below = [Letter(_greek_or_word(text)) for text in subscripts if text]
        if match["index"]:
            below += [self._letter_of(index) for index in match["index"].split(",")]
        if match["start"]:
            below.append(Letter("0"))
        return Letter(_greek_or_word(letters.get(head, head)), _ORDERS[match["rate"]], tuple(below))


def _greek_or_word(text: str) -> str:
    """Return the Greek letter with this name; else the word itself."""
    letter = unescape(f"&{text};")
    return letter if "Α" <= letter <= "ω" else text
