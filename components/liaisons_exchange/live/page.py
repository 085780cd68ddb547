"""A live page: one HTML file in which the FMUs' own C runs as WebAssembly; no network, no library."""

from __future__ import annotations

import base64
import gzip
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from liaisons.base.archive import START_VALUES, Archive, file_identity
from liaisons.base.arguments import name_list
from liaisons.base.array_names import array_and_index
from liaisons.base.compiler import INSTALLATION, compile_wasm, zig_compiler
from liaisons.cosim import OperatorFmu, Port, System, SystemComponent, SystemDocument, read_description
from liaisons.errors import SimulationError, suggestion
from liaisons.results import Picture, combined_pictures
from liaisons_exchange.live.motions import with_page_motions
from liaisons_pages.pictures import inlined_page

_MODULES = ("fmu.js", "sources.js", "machine.js", "picture.js", "plot.js", "page.js")  # each after what it imports
_CALLED = (  # by fmu.js; what none of them needs, as the saving of states, is not in the page
    *("fmi2SetupExperiment", "fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2Reset", "fmi2DoStep"),
    *("fmi2GetReal", "fmi2GetInteger", "fmi2GetBoolean", "fmi2SetReal", "fmi2SetInteger", "malloc", "free"),
)
_FORMATTED = ("-Dsnprintf=page_snprintf", "-Dvsnprintf=page_vsnprintf")  # by page.c
_FLAGS = ("-flto", *_FORMATTED, *(f"-Wl,--export={name}" for name in _CALLED))
_MOST_READ = 400  # elements of arrays read in each frame
_MOST_SLIDERS = 8  # elements of an array with a slider each
_FRAMES = 60  # a second
_LONGEST = 20.0  # [s] that a default experiment takes on the page
_MOST_PLOTS = 4  # colours in plot.js
_INTERPOLATE = 2


def live_page(
    subject: Path | System,
    starts: Mapping[str, object] | None = None,
    *,
    controls: Iterable[str] | None = None,
    plots: Iterable[str] | None = None,
    question: str = "",
) -> bytes:
    """Return the HTML of the page of an FMU or of a system: sliders, picture, plot, energy account.

    :param starts: values of an FMU's parameters and inputs at the start, where they differ from its own, or operators.
    :param controls: names of those that can be changed on the page; None: all.
    :param plots: names of at most four signals that are plotted; None: angles, with a choice of all.
    :param question: above the picture.
    :raises SimulationError: if an FMU cannot be read, or has no C sources of FMI 2.0; for a name that the page has not.
    :raises BuildError: if there is no compiler for WebAssembly, or it fails.
    """
    document, moves, title, text = _document_and_heading(subject, starts or {})
    for part in document.parts.values():
        part.fmu.require_file("a live page")
    ordered = [name for group in document.graph.strong_components for name in group]
    document = replace(document, parts={name: document.parts[name] for name in ordered})
    parts, connections, feeds, scene = document.parts, document.connections, document.graph.feeds, document.scene
    paths = list(dict.fromkeys(part.fmu.path for part in parts.values()))
    components = [
        _component_data(prefix, part, paths, feeds, ordered[:i], picture=scene.pictures[prefix])
        | {"moves": {name: motion for (owner, name), motion in moves.items() if owner == part.name}}
        for i, (prefix, part) in enumerate(scene.parts.items())
    ]
    index_of = {name: i for i, name in enumerate(parts)}
    speed, step = _speed_and_step_size(parts.values())
    signals = [
        name
        for component, part in zip(components, parts.values(), strict=True)
        for name in _default_signals(component, part)
    ]
    plan = {
        "components": components,
        "connections": [
            [index_of[c.source.part.name], c.source.name, index_of[c.target.part.name], c.target.name, *c.conversion]
            for c in connections
        ],
        "groups": scene.groups,
        "modules": [_encoded_module(path, *file_identity(path)) for path in paths],
        "step_size": step,
        "tolerance": min((part.fmu.experiment.tolerance or 1e-8 for part in parts.values()), default=1e-8),
        "speed": speed,
        "plane": combined_pictures(scene.pictures).plane,
        "signals": signals if plots is None else _checked_names("plots", plots, components, "read", _MOST_PLOTS),
        "asked": plots is not None,
        "controls": None if controls is None else _checked_names("controls", controls, components, "set"),
        "question": question,
    }
    return inlined_page("page.html", _MODULES, title or "", text, plan)


def _document_and_heading(
    subject: Path | System, starts: Mapping[str, object]
) -> tuple[SystemDocument, dict[tuple[str, str], Any], str, str]:
    """System of a page, motions that the page computes by part and input, and title and text above the picture.

    :param starts: values of an FMU at the start, or operators.
    """
    if isinstance(subject, System):
        return subject.document.filled(), {}, subject.name, ""
    operators = {name: value for name, value in starts.items() if isinstance(value, OperatorFmu)}
    own = {name: value for name, value in starts.items() if name not in operators}
    document, root, moves = SystemDocument.of_fmu(subject, own), read_description(subject).root, {}
    if operators:
        system = System.from_document(document)
        system.prescribe(document.name, operators)
        document, moves = with_page_motions(system.document.as_single())
    return document, moves, root["modelName"], root.get("description", "")


def _speed_and_step_size(parts: Collection[SystemComponent]) -> tuple[float, float]:
    """Seconds of motion a second, by the longest default experiment; and a step of which samples are multiples [s]."""
    stops = [part.fmu.experiment.stop_time for part in parts]
    speed = max(1.0, max((stop or 0.0 for stop in stops), default=0.0) / _LONGEST)
    step = speed / (2 * _FRAMES)
    for part in parts:
        if part.fmu.next_event_variable and "period" in part.fmu.variables:  # its samples are communication points
            period = float(str(part.starts.get("period", part.fmu.variables["period"].start)))
            step = period / math.ceil(period / step)
    return speed, step


def _checked_names(
    label: str, names: Iterable[str], components: Iterable[Mapping[str, Any]], kind: str, most: int | None = None
) -> list[str]:
    """Names as a list; raise a SimulationError for one that no variable of this kind has, or for too many."""
    known = [
        component["prefix"] + v["name"]
        for component in components
        for v in component["variables"]
        if v.get(kind) and not v.get("drawn")
    ]
    chosen = list(dict.fromkeys(name_list(f"show: {label}", names)))
    for name in chosen:
        if name not in known:
            raise SimulationError(f"show: {label}: the page has no {name!r}{suggestion(name, known)}")
    if most is not None and len(chosen) > most:
        raise SimulationError(f"show: {label}: {len(chosen)} signals; give at most {most}")
    return chosen


@lru_cache(maxsize=64)
def _encoded_module(path: Path, *_identity: int) -> str:
    """WebAssembly of the C sources in an FMU, compiled, gzipped, and in base64."""
    with Archive(path) as archive:
        members = [name for name in archive.names if name.startswith("sources/") and name.endswith((".c", ".h"))]
        sources = {}
        if START_VALUES in archive.names:
            with archive.open(START_VALUES) as file:
                if file.read(2) == b"t ":
                    raise SimulationError(
                        f"{path.name}: a live page reads no files, and this FMU has its motion in one"
                    )
        for member in members:
            with archive.open(member) as file:
                sources[member.removeprefix("sources/")] = file.read()
    if "fmi2Functions.h" not in sources:
        ours = "as our FMUs have them" if zig_compiler() else f"as our native FMUs have them: {INSTALLATION}"
        raise SimulationError(f"{path}: a live page needs the C sources of FMI 2.0 inside, {ours}")
    sources["page.c"] = (files("liaisons_pages.pictures") / "web" / "page.c").read_bytes()
    return base64.b64encode(gzip.compress(compile_wasm(sources, *_FLAGS), 9, mtime=0)).decode()


def _component_data(
    prefix: str,
    part: SystemComponent,
    paths: Sequence[Path],
    feeds: Mapping[tuple[str, str], tuple[str, str]],
    stepped_before: Collection[str],
    *,
    picture: Picture,
) -> dict[str, Any]:
    """Return the data of a component for the page's script.

    :param paths: FMUs of the page, each once.
    :param feeds: input -> output that it is connected to, each (component, variable).
    :param stepped_before: names of the components that are stepped before it.
    """
    described = read_description(part.fmu.path).attributes
    variables = {name: v for name, v in described.items() if v["tag"] == "Real" or v["causality"] == "output"}
    fed = {variable for name, variable in feeds if name == part.name}
    free = [
        [port.name for port in triple]
        for name, v in variables.items()
        if v["causality"] == "input" and name not in fed and (triple := Port(part, name).triple())
    ]
    hidden = fed | {member for triple in free for member in triple[1:]}
    outputs = [
        name
        for name, v in variables.items()
        if v["causality"] in {"output", "input"} and array_and_index(name)[1] is None
    ]
    elements = [
        name for name, v in variables.items() if v["causality"] == "output" and array_and_index(name)[1] is not None
    ]
    read = dict.fromkeys([*outputs, *picture.variables, *elements[:_MOST_READ]])
    later = {name for name, source in feeds.items() if name[0] == part.name and source[0] not in stepped_before}
    chooses = part.approximation.method is not None and not later and not (fed and part.approximation.is_chosen)
    mode = _INTERPOLATE if chooses else part.approximation.method
    reference = part.fmu.variables["input_reconstruction"].reference if mode is not None else 0
    starts = part.element_starts
    needed = {*hidden, *starts, *(name for name, *_ in free)}  # beside what is read or has a slider
    listed = [
        _variable_data(v, part, starts, read=name in read, hidden=name in hidden) for name, v in variables.items()
    ]
    return {
        "prefix": prefix,
        "module": paths.index(part.fmu.path),
        "guid": re.sub(r"}-\w+$", "}", part.fmu.guid),  # without what start values in a file add
        "variables": [v for v in listed if v.get("read") or v.get("set") or v["name"] in needed],
        "free": free,
        "settings": {} if mode is None else {str(reference): mode},
        "reconstruction": _INTERPOLATE if mode is None else mode,  # others take the newest values
        "picture": picture.document,
        "units": {s: [variables[force].get("unit", ""), "W"] for s, *_ in free if (force := Port(part, s).force)},
    }


def _variable_data(
    v: Mapping[str, str], part: SystemComponent, starts: Mapping[str, Any], *, read: bool, hidden: bool
) -> dict[str, Any]:
    """Return the data of a variable for the page's script, without empty entries."""
    name, causality = v["name"], v["causality"]
    base, index = array_and_index(name)
    start_value = starts.get(name, v.get("start"))
    start = float(str(start_value)) if causality in {"parameter", "input"} and start_value is not None else None
    few = index is None or index[-1] <= _MOST_SLIDERS
    terminal, shown = Port(part, name).terminal, base.removesuffix("_0")
    impulse = terminal is not None and terminal.impulse == name
    settable = start is not None and few and not hidden and Port(part, name).force != name and not impulse
    entry = {
        "name": name,
        "reference": int(v["valueReference"]),
        "type": None if v["tag"] == "Real" else v["tag"],
        "unit": v.get("unit"),
        "start": start,
        "read": read,
        "drawn": read and causality == "local",
        "set": settable,
    }
    if settable:  # by a slider
        entry |= {
            "description": v.get("description"),
            "minimum": float(v["min"]) if "min" in v else None,
            "maximum": float(v["max"]) if "max" in v else None,
            "initial": causality == "parameter"
            and shown != base
            and (shown in part.fmu.variables or shown in part.fmu.arrays),
            "tunable": causality == "input" or v.get("variability") == "tunable",
        }
    return {name: value for name, value in entry.items() if value is not None and value is not False}


def _default_signals(component: Mapping[str, Any], part: SystemComponent) -> Sequence[str]:
    """Return the names of the signals that are plotted at first: angles, else the attitude, else coordinates."""
    shown = {v["name"]: v.get("unit") for v in component["variables"] if v.get("read") and "start" not in v}
    triples = {name: Port(part, name).triple() for name in shown}
    coordinates = [name for name, triple in triples.items() if triple and {p.name for p in triple} <= shown.keys()]
    angles = [name for name in coordinates if shown[name] == "rad"]
    attitude = [name for name in shown if name[:-1].endswith("q_") and name[-1] in "xyz"]
    names = angles or attitude or coordinates or [name for name in shown if array_and_index(name)[0] == "y"]
    return [component["prefix"] + name for name in names[: len(attitude) or 2]]
