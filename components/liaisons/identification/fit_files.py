"""Fits that are described by TOML files."""

from __future__ import annotations

import inspect
from pathlib import Path

from liaisons.base.arguments import as_path, listed
from liaisons.base.files import beside, toml_arguments
from liaisons.errors import IdentificationError
from liaisons.identification.fits import Fit
from liaisons.identification.identifying import identify
from liaisons.interface import System

_EXAMPLES = {"subject": '"Pendulum"', "data": '"measured.csv"', "unknown": '["length", "theta_0"]'}


def identified(path: Path | str) -> Fit:
    """Run :func:`liaisons.identify` with the arguments of a TOML file.

    ::

        subject = "Pendulum"
        data = "measured.csv"
        unknown = ["length", "friction", "theta_0"]
        noise = { theta = 0.01 }
        start_values = { friction = 0.1 }

    :param path: the file; relative paths in it start from its folder.
    :raises IdentificationError: for invalid TOML, an unknown key, and as :func:`liaisons.identify` does.
    """
    path = as_path("path", path, IdentificationError)
    keys = {*inspect.signature(identify).parameters} - {"keywords"}
    arguments = toml_arguments(path, keys, _EXAMPLES, IdentificationError)
    subject = beside(path, str(arguments.pop("subject")))
    data = [beside(path, name) for name in listed(f"{path}: data", arguments.pop("data"), IdentificationError)]
    return identify(System.from_ssp(subject) if subject.endswith(".ssp") else subject, data, **arguments)
