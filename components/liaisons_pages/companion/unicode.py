"""LaTeX as one line of Unicode, for terminals."""

from __future__ import annotations

import re
import unicodedata

_ABOVE = str.maketrans(
    "0123456789-+=()abcdefghijklmnoprstuvwxyzABDEGHIJKLMNOPRTUVWαβγδφχ",
    "⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺⁼⁽⁾ᵃᵇᶜᵈᵉᶠᵍʰⁱʲᵏˡᵐⁿᵒᵖʳˢᵗᵘᵛʷˣʸᶻᴬᴮᴰᴱᴳᴴᴵᴶᴷᴸᴹᴺᴼᴾᴿᵀᵁⱽᵂᵅᵝᵞᵟᵠᵡ",
)
_BELOW = str.maketrans("0123456789-+=()aehijklmnoprstuvxβγρφχ", "₀₁₂₃₄₅₆₇₈₉₋₊₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓᵦᵧᵨᵩᵪ")
_FRACTIONS = {"1/2": "½", "1/3": "⅓", "2/3": "⅔", "1/4": "¼", "3/4": "¾"}
_ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "tilde": "\u0303", "hat": "\u0302", "bar": "\u0304"}
_WORDS = {"sin", "cos", "arctan", "lim", "det"}
_SIGNS = {
    "nabla": "∇", "sum": "Σ", "int": "∫", "infty": "∞", "cdot": "·", "times": "×", "wedge": "∧", "to": "→",
    "mapsto": "↦", "leq": "≤", "geq": "≥", "neq": "≠", "approx": "≈", "sim": "∼", "pm": "±", "circ": "∘", "in": "∈",
    "mid": "|", "perp": "⟂", "langle": "⟨", "rangle": "⟩", "ldots": "…", "phi": "φ", "pi": "π", "partial": "∂",
    "quad": "", "left": "", "right": "",
}  # fmt: skip
_COMMAND = re.compile(r"\\(?P<name>[A-Za-z]+)(?P<blank>\s*)")
_GROUP = re.compile(
    r"\\frac\{(?P<above>[^{}]*)\}\{(?P<below>[^{}]*)\}"
    r"|\\(?!frac)(?P<name>[a-z]+)\{(?P<inside>[^{}]*)\}"
    r"|(?P<sign>[_^])(?:\{(?P<script>[^{}]*)\}|(?P<single>[^{\\\s]))"
    r"|(?<![a-z}])\{(?P<bare>[^{}]*)\}"
)
"""A command or script whose arguments have no groups, or a group alone."""
_PLAIN = {r"\{": "\1", r"\}": "\2", r"\,": " ", r" \\ ": "; ", " &": ",", r"\mathcal{L}": "ℒ"}
_LAST = {1: "{", 2: "}", 3: "_", 4: "^", ord("-"): "−"}
"""Characters that would be read as signs of LaTeX before the last step."""
_PLAIN |= {rf"\{end}{{pmatrix}}": bracket for end, bracket in (("begin", "("), ("end", ")"))}


def unicode_text(latex: str) -> str:
    r"""Return a formula in LaTeX as a line of Unicode: ``\frac{1}{2} m \dot{x}^2`` as ``½ m ẋ²``.

    :raises ValueError: for a command of LaTeX that the formulas of the table do not use.
    """
    text = latex
    for command, plain in _PLAIN.items():
        text = text.replace(command, plain)
    text, changed = _COMMAND.sub(_command_symbol, text), 1
    while changed:
        text, changed = _GROUP.subn(_group_text, text)
    if "\\" in text:
        raise ValueError(f"{latex}: a command is none that the formulas of the table use")
    text = re.sub(r"(?<=[(\[⟨]) | (?=[)\]⟩,])", "", re.sub(r" +", " ", text)).translate(_LAST)
    return unicodedata.normalize("NFC", text.strip())


def _command_symbol(command: re.Match[str]) -> str:
    """Unicode symbol of a LaTeX command; the command itself if it has arguments."""
    name, size = command["name"], "CAPITAL" if command["name"][0].isupper() else "SMALL"
    blank = "" if name in {"partial", "delta", "Delta"} else command["blank"]
    if name in _SIGNS or name in _WORDS:
        return _SIGNS.get(name, name) + blank
    try:
        return unicodedata.lookup(f"GREEK {size} LETTER {name.upper().replace('LAMBDA', 'LAMDA')}") + blank
    except KeyError:
        return command[0]


def _group_text(group: re.Match[str]) -> str:
    """Unicode text of a matched fraction, script, root, accented letter, or group in braces."""
    if group["sign"]:
        return _script_text(group["sign"], (group["script"] or group["single"]).replace(" ", ""))
    if group["above"]:
        text = f"{_bracketed_operand(group['above'], '+-/')}/{_bracketed_operand(group['below'], '+-/ ')}"
        return _FRACTIONS.get(text, text)
    name, inside = group["name"], group["inside"] or group["bare"]
    if name in _ACCENTS:
        return inside[0] + _ACCENTS[name] + inside[1:]
    if name == "sqrt":
        return f"√{inside}" if len(inside) == 1 else f"√({inside})"
    if name in {None, "mathbf", "text", "operatorname", "overline"}:
        return f"⟨{inside}⟩" if name == "overline" else inside
    raise ValueError(f"\\{name} is no command that the formulas of the table use")


def _script_text(sign: str, text: str) -> str:
    """Text in superscript ("^") or subscript ("_") characters; where Unicode lacks one, the text behind the sign."""
    small = text.translate(_ABOVE if sign == "^" else _BELOW)
    if not set(text) & set(small):
        return small
    whole = len(text) == 1 or (sign == "_" and all(unicodedata.category(x) in {"Ll", "Lu"} for x in text))
    beside = "" if text == "*" else "\3" if sign == "_" else "\4"
    return f"{beside}{text}" if whole else f"{beside}({text})"


def _bracketed_operand(text: str, operators: str) -> str:
    """Operand of a fraction, in brackets if it has one of the operators outside of brackets."""
    outside, changed = text, 1
    while changed:
        outside, changed = re.subn(r"[(\[][^()\[\]]*[)\]]", "", outside)
    return f"({text})" if set(operators) & set(outside) else text
