"""Pages as one HTML file with style, script and data, whose policy allows no other source."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from liaisons_pages.pictures.frames import FLASH, THICKNESS
from liaisons_pages.pictures.stage import COILS, FACING, LIGHT, SIZES, TEETH


def inlined_page(template: str, modules: Sequence[str], title: str, description: str, plan: Mapping[str, Any]) -> bytes:
    """HTML file that contains its style, script and data; ``DRAWING`` in the script has the constants of pictures.

    :param template: name of the file of its body.
    :param modules: names of the ES modules, each after those that it imports.
    :param title: text, as is ``description``; neither becomes markup.
    :param plan: data for the script.
    """
    folder = files("liaisons_pages.pictures") / "web"
    floor = {"thickness": THICKNESS, "teeth": TEETH}
    shared = {"sizes": SIZES, "coils": COILS, "facing": FACING, "light": LIGHT, "floor": floor, "flash": FLASH}
    constants = f"const DRAWING = {json.dumps(shared)};"
    named = ("page.css", "unpack.js", *modules)
    style, unpack, *sources = [_inlined((folder / name).read_text(encoding="utf-8")) for name in named]
    script = "\n".join([constants, *sources])
    policy = (
        f"default-src 'none'; script-src '{_policy_hash(unpack)}' '{_policy_hash(script)}' 'wasm-unsafe-eval'; "
        f"style-src '{_policy_hash(style)}'; img-src data:; base-uri 'none'; form-action 'none'"
    )
    contents = {
        "title": html.escape(title),
        "description": html.escape(description),
        "policy": policy,
        "style": style,
        "packed": base64.b64encode(gzip.compress(script.encode(), 9, mtime=0)).decode(),
        "unpack": unpack,
        "plan": json.dumps(plan, ensure_ascii=False, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
    }
    body = (folder / template).read_text(encoding="utf-8").rstrip()
    text = (folder / "frame.html").read_text(encoding="utf-8").replace("{body}", body)
    return re.sub(r"\{(\w+)\}", lambda match: contents[match[1]], text).encode()


def _inlined(text: str) -> str:
    """Text of a JavaScript module as a script, without imports and exports, since a file:// page loads no modules.

    Without indentation, and without comments that have lines of their own, which mean nothing in JavaScript or CSS.
    """
    return re.sub(r"^(import [^;]*;\n|export | *//.*\n| */\*(?s:.*?)\*/\n| +)", "", text, flags=re.MULTILINE)


def _policy_hash(text: str) -> str:
    """Hash of a text in the form of a content security policy."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"
