"""Formulas as MathML, which browsers draw themselves: no script, no font, no network."""

from __future__ import annotations

import re
from html import unescape
from typing import NoReturn
from xml.etree import ElementTree

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.writers.html5 import HTML5Translator

MATHML = "{http://www.w3.org/1998/Math/MathML}"
ElementTree.register_namespace("", MATHML[1:-1])


def setup(app: Sphinx) -> None:
    """Offer the renderer ``mathml``."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))


def _inline(self: HTML5Translator, node: nodes.math) -> NoReturn:
    self.body.append(_markup(node, as_block=False))
    raise nodes.SkipNode


def _block(self: HTML5Translator, node: nodes.math_block) -> NoReturn:
    number = f'<span class="eqno">({node["number"]})</span>' if node["number"] else ""
    self.body.append(self.starttag(node, "div", CLASS="math") + number + _markup(node, as_block=True) + "</div>")
    raise nodes.SkipNode


def _markup(node: nodes.Element, *, as_block: bool) -> str:
    try:
        return markup(node.astext(), as_block=as_block)
    except MathError as error:
        raise ExtensionError(f"{node.source}:{node.line}: {error} in {node.astext()!r}") from error


def markup(latex: str, *, as_block: bool = False) -> str:
    """MathML of a formula in LaTeX.

    :raises MathError: for a command that it does not know.
    """
    spaced = re.sub(r"&(?!lt|gt|amp)\w+;", lambda entity: unescape(entity[0]), tex2mathml(latex, as_block=as_block))
    root = ElementTree.fromstring(spaced)
    for node in list(root.iter()):
        if node.tag == f"{MATHML}munderover" and "movablelimits" not in node[0].attrib:  # no sum, no product
            _move_subscript_beside(node)
        if node.tag == f"{MATHML}mover":
            node.attrib.pop("accent", None)  # browsers let dots that are accents touch the letter
    return ElementTree.tostring(root, encoding="unicode")


def _move_subscript_beside(node: ElementTree.Element) -> None:
    """Write the subscript of an accented letter beside it: docutils writes it below."""
    letter, subscript, accent = node
    accented = ElementTree.Element(f"{MATHML}mover")
    accented.extend((letter, accent))
    node.tag = f"{MATHML}msub"
    node[:] = accented, subscript
