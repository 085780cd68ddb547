"""The C sources of a native FMU: the component's functions and tables, and the runtime that they are compiled with."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from importlib import resources
from importlib.util import find_spec
from itertools import accumulate
from pathlib import Path
from typing import Any, Literal

import casadi as ca

from liaisons.errors import BuildError
from liaisons.expressions.algebra import stack
from liaisons.fmu.dependencies import coupled, shown_states
from liaisons.fmu.description import sources
from liaisons.fmu.functions import define, function_code
from liaisons.fmu.jumps import jump_table
from liaisons.fmu.layout import TIME, Fmi, mismatch_place, places, scalars
from liaisons.fmu.loops import PREAMBLE, loop_functions
from liaisons.fmu.markup import document, element
from liaisons.language import Variable
from liaisons.mechanics.model import Model

_FMI_HEADERS = {
    "2": ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    "3": ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
_MOST = 11  # arguments: those of calculate_forward
_TABLE = 12  # where there is a table, behind them
_MOTION = ("derivatives", "motion")
_LOADS, _MOVES = 1, 2  # what inputs do that are not 0: act, say as forces, or move a coordinate of an operator's
_ACTIVITIES = {0: "_free", _LOADS: "_at_rest", _MOVES: "_unloaded", _LOADS | _MOVES: ""}
_HEADERS = (
    *("core.h", "instance.h", "inputs.h", "solver.h", "symplectic.h"),
    *("calls.h", "common.h", "face.h"),
)


def source_files(model: Model, guid: str, fmi: Fmi = "2") -> dict[str, bytes]:
    """Everything that is needed to compile the FMU, by file name.

    :param guid: what the binary compares the model description with.
    :raises BuildError: if the FMI headers are not installed.
    """
    runtime = resources.files("liaisons.fmu") / "runtime"
    model_c, *written = sources(fmi)
    return {
        "buildDescription.xml": _build_description(model, fmi),
        model_c: model_code(model, guid, fmi).encode(),
        **{name: (runtime / name).read_bytes() for name in (*_headers(model), *written)},
        **{name: _fmi_header(name) for name in _FMI_HEADERS[fmi]},
    }


def model_code(model: Model, guid: str, fmi: Fmi = "2") -> str:
    """``model.c``: the functions, then the tables that core.h declares."""
    adjoint = fmi == "3"  # where adjoint derivatives can be asked for
    loops = loop_functions(model.programs, coupled(model), adjoint=adjoint) if model.programs else {}
    rates = [] if loops else _rates(model)
    members = {"distances": model.conditions, "instants": model.events}
    members |= {} if model.draw is None else {"draw": model.draw}
    members |= {} if loops else _functions(model, adjoint=adjoint)
    calls = _calls(model, members)
    functions = [*members.values(), *(function for pair in rates for function in pair)]
    code, reals = function_code(functions)
    pairs = [(every.name(), some.name()) for every, some in rates] or [_MOTION] * len(_ACTIVITIES)
    fields = {
        **_fields(model, guid),
        "coupled": str(rates[-1][1].numel_out(0) if rates else coupled(model)),
        "most_arguments": str(max([_TABLE if calls else _MOST, *(function.sz_arg() for function in functions)])),
        "most_results": str(max([_MOST, *(function.sz_res() for function in functions)])),
        "integers": str(max(function.sz_iw() for function in functions)),
        "reals": str(max([reals, *(loop.reals for loop in loops.values())])),
        "motions": _row(*(_row(*pair) for pair in pairs)),
        **{name: function.name() for name, function in members.items() if not name.startswith("piece")},
        **{name: name for name in calls},
        **{name: name for name in loops if name not in _MOTION},
    }
    return "\n".join(
        [
            f"/* {model.name}: functions generated from its equations, and tables. */",
            "#include <math.h>",
            "",
            '#include "core.h"',
            *(['#include "knots.h"'] if calls else []),
            "",
            "#ifdef __GNUC__",
            '#pragma GCC diagnostic ignored "-Wunused-parameter"',
            "#endif",
            *code,
            *(line for name, call in calls.items() for line in define(name, [call])),
            *([PREAMBLE, *(loop.text for loop in loops.values())] if loops else []),
            *_tables(model),
            "const Model model = {",
            *(f"    .{name} = {value}," for name, value in fields.items()),
            "};",
            "",
        ]
    )


def _functions(model: Model, *, adjoint: bool) -> dict[str, ca.Function]:
    """Those that are derived as expressions, by the names of core.h."""
    functions = {
        "start": model.start,
        **({"calculate": model.outputs_function} if model.piece is None else {"piece": model.piece}),
        "jump": model.jump,
        "remember": model.remember,
        "nominals": model.nominals,
    }
    if model.project is not None:
        functions["project"] = model.project
    return functions | _derivatives(model, "forward") | (_derivatives(model, "reverse") if adjoint else {})


def _headers(model: Model) -> tuple[str, ...]:
    return _HEADERS if model.piece is None else (*_HEADERS, "knots.h")


def _calls(model: Model, members: dict[str, ca.Function]) -> dict[str, str]:
    """Statements of the functions that look up a piece of a table, by the names of core.h."""
    if model.piece is None:
        return {}
    del members["instants"]
    room, arguments = model.parameters[0].count, "arguments, results"
    pieces = {name: name.replace("piece", "calculate") for name in members if name.startswith("piece")}
    calls = {
        calculate: f"{calculate.replace('calculate', 'calculate_piece')}({piece}, {room}, {arguments});"
        for piece, calculate in pieces.items()
    }
    return {"instants": f"next_instant({room}, {arguments});"} | calls


def _rates(model: Model) -> list[tuple[ca.Function, ca.Function]]:
    """Rates of all states, and of those that act on the motion without the work to find the integrals along it.

    For each of the :data:`_ACTIVITIES`, without what is owed to inputs that are 0 then.  Of maps they are all one.
    """
    whole = model.derivatives
    if not whole.is_a("SXFunction"):
        return [(whole, whole)] * len(_ACTIVITIES)
    t, y, u, k = map(ca.SX, whole.sx_in())
    of_variable = _activities(model)
    does = [number for variable in model.inputs for number in [of_variable[variable.name]] * variable.count]
    count, pairs = coupled(model), []
    found: dict[tuple[bool, ...], tuple[ca.Function, ca.Function]] = {}
    for activity, suffix in reversed(_ACTIVITIES.items()):
        zero = tuple(bool(number & ~activity) for number in does)
        if zero not in found:
            given = stack(ca.SX(0) if is_zero else u[i] for i, is_zero in enumerate(zero))
            rates = ca.densify(ca.cse(whole.call([t, y, given, k], True, False)[0]))
            every = ca.Function(f"derivatives{suffix}", [t, y, u, k], [rates])
            found[zero] = every, ca.Function(f"motion{suffix}", [t, y, u, k], [rates[:count]])
        pairs.append(found[zero])
    return pairs[::-1]


def _activities(model: Model) -> dict[str, int]:
    """What each input does that is not 0."""
    found = {variable.name: _LOADS for variable in model.inputs}
    for coordinate in model.active:
        found |= {coordinate.value: 0, coordinate.rate: _MOVES, coordinate.acceleration: _MOVES}
    return found


def _derivatives(model: Model, way: Literal["forward", "reverse"]) -> dict[str, ca.Function]:
    """Along a direction: (arguments, results, directions) → derivatives of the results.

    In reverse: (arguments, results, weights) → derivatives of the weighted sum of the results by the arguments.
    """
    functions = {}
    for name, function, argument_vectors, result_vectors in _differentiated(model):
        arguments, results = _expressions(function)
        forward = way == "forward"
        seeds = list(map(_symbol, arguments if forward else results))
        (derivatives,) = (ca.forward if forward else ca.reverse)(results, arguments, [seeds])
        dense = _dense_vectors(model, derivatives, result_vectors if forward else argument_vectors)
        title = f"{name}_{way}"
        functions[title] = ca.Function(title, [*arguments, *map(_symbol, results), *seeds], dense)
    return functions


def _differentiated(model: Model) -> tuple[tuple[str, ca.Function, str, str], ...]:
    """Functions whose derivatives an importer can ask for, with their arguments and results."""
    return (
        ("start", model.start, "tuk", "ym"),
        ("calculate", model.outputs_function, "tyukm", "z")
        if model.piece is None
        else ("piece", model.piece, "tt", "z"),
        ("remember", model.remember, "tyukm", "m"),
    )


def _expressions(function: ca.Function) -> tuple[list[Any], list[Any]]:
    """Symbols of a function's arguments, and its results in terms of them."""
    arguments: Any = function.sx_in() if function.is_a("SXFunction") else function.mx_in()
    return list(arguments), list(function.call(arguments, True, False))


def _symbol(like: Any) -> Any:
    return type(like).sym("d", like.shape[0])


def _dense_vectors(model: Model, expressions: Sequence[Any], vectors: str) -> list[Any]:
    dense = [_dense(x, _blocks(model, vector)) for x, vector in zip(expressions, vectors, strict=True)]
    scalar = all(isinstance(x, ca.SX) for x in dense)  # what maps share is shared already, and cse is slow on them
    return list(ca.cse(dense)) if scalar else dense


def _dense(vector: Any, blocks: Sequence[int]) -> Any:
    """The same with its zeros; block by block, because CasADi writes a table of all places for one that is mixed."""
    offsets = [0, *accumulate(blocks)]
    if vector.is_dense() or len(blocks) < 2:
        return ca.densify(vector)
    return ca.vertcat(*(ca.densify(block) for block in ca.vertsplit(vector, offsets)))


def _blocks(model: Model, vector: str) -> list[int]:
    """How many numbers each variable has in a vector."""
    groups = {"y": shown_states(model), "u": model.inputs, "k": model.parameters, "z": model.outputs}
    if vector in groups:
        return [variable.count for variable in groups[vector]]
    return [1] * (1 if vector == "t" else model.start.numel_out(1))


def _fields(model: Model, guid: str) -> dict[str, str]:
    """Members of the struct Model: texts, numbers and tables."""
    numbers = {
        "parameters": sum(variable.count for variable in model.parameters),
        "inputs": sum(variable.count for variable in model.inputs),
        "outputs": sum(variable.count for variable in (*model.outputs, *model.drawn)),
        "states": model.start.numel_out(0),
        "memory": model.start.numel_out(1),
        "events": model.events.numel_out(0) if model.piece is None else 1,
        "conditions": len(model.condition_texts) - model.start_only,
        "start_conditions": len(model.condition_texts),
        "variable_rows": len(model.variables),
        "start_rows": len(_starts(model)),
        "active_rows": len(model.active),
        "state_rows": len(model.states),
        "dimension_rows": len(model.dimensions),
    }
    tables = ("variables", "starts", "active", "state", "dimensions", "condition_texts")
    return {
        "name": _string(model.name),
        "guid": _string(guid),
        "tolerance": _number(model.experiment.tolerance),
        **{name: str(number) for name, number in numbers.items()},
        **{name: name for name in tables},
        **({"columns": str(len(model.parameters))} if model.piece else {}),
        **({"drawn": str(sum(variable.count for variable in model.drawn))} if model.drawn else {}),
        **({"jumps": "jumps"} if jump_table(model) else {}),
    }


# ---- tables: one row a variable, however many numbers it holds --------------------------------------------------


def _tables(model: Model) -> list[str]:
    where, jumps = places(model), jump_table(model)
    row = {variable.name: i for i, variable in enumerate(model.variables)}
    first_input = sum(variable.count for variable in model.parameters)
    count = {variable.name: variable.count for variable in model.variables}
    active = [
        (
            *(where[name].start - first_input for name in (a.value, a.rate, a.acceleration)),
            count[a.value],
            "NO_MISMATCH" if (place := mismatch_place(model, a)) is None else place,
        )
        for a in model.active
    ]
    return [
        *_table("Variable", "variables", _variables(model)),
        *_table("Start", "starts", [_row(str(place), _number(value)) for place, value in _starts(model)]),
        *_table("Active", "active", [_row(*map(str, of_coordinate)) for of_coordinate in active]),
        *(_table("unsigned char", "jumps", [", ".join(map(str, row)) for row in jumps]) if jumps else []),
        *_table("State", "state", [_row(str(row[s.name]), str(row[s.derivative])) for s in model.states]),
        *_table("Dimension", "dimensions", [_row(_string(d.name), str(d.count)) for d in model.dimensions]),
        *_table("char *const", "condition_texts", [_string(text) for text in model.condition_texts]),
    ]


def _table(kind: str, name: str, rows: Sequence[str]) -> list[str]:
    # C has no arrays without elements; the tables that have none are never read.
    nothing = "0" if kind.endswith("const") else "{0}"
    return [f"static const {kind} {name}[] = {{", *(f"    {row}," for row in rows or [nothing]), "};", ""]


def _variables(model: Model) -> list[str]:
    where = places(model)
    kinds = {"input": "INPUT", "parameter": "{}_PARAMETER"}
    activities = _activities(model)
    state_places, first = {}, 0
    for state in model.states:
        state_places[state.name] = first
        first += len(where[state.name])
    rows = [
        _variable(
            variable,
            kinds.get(variable.causality, "CALCULATED").format(variable.variability.upper()),
            where[variable.name].start,
            str(state_places.get(variable.name, "NO_STATE")),
            activities.get(variable.name, 0),
        )
        for variable in model.variables
    ]
    return [*rows, _variable(TIME, "INDEPENDENT", scalars(model), "NO_STATE", 0)]


def _variable(variable: Variable, kind: str, first: int, state: str, activity: int) -> str:
    return _row(
        _string(variable.name),
        kind,
        str(first),
        str(variable.count),
        str(int(variable.dimension is not None)),
        state,
        str(activity),
        _number(_common_start(variable)),
        _number(-math.inf if variable.minimum is None else variable.minimum),
        _number(math.inf if variable.maximum is None else variable.maximum),
        str(int(variable.strict)),
        _string(variable.domain()),
    )


def _common_start(variable: Variable) -> float:
    """What all numbers of a variable start at, but those that are listed one by one."""
    return 0.0 if isinstance(variable.start, tuple) else variable.start or 0.0


def _starts(model: Model) -> list[tuple[int, float]]:
    """Places and values where an array starts otherwise."""
    where = places(model)
    return [
        (where[variable.name][i], value)
        for variable in model.variables
        if isinstance(variable.start, tuple)
        for i, value in enumerate(variable.start)
        if value != 0
    ]


def _row(*members: str) -> str:
    return f"{{{', '.join(members)}}}"


def _number(value: float) -> str:
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # its escapes are those of C


# ---- what comes with them --------------------------------------------------------------------------------------


def _fmi_header(name: str) -> bytes:
    """A header of the FMI standard, which FMPy carries; FMPy itself is not loaded."""
    package = find_spec("fmpy")
    folder = Path(package.origin).parent if package and package.origin else Path()
    try:
        return (folder / "c-code" / name).read_bytes()
    except OSError as error:
        raise BuildError(f"{name} is missing in the installed fmpy; reinstall it: pip install fmpy") from error


def _build_description(model: Model, fmi: Fmi) -> bytes:
    files = (line for name in sources(fmi) for line in element("SourceFile", {"name": name}))
    inside = [*element("SourceFileSet", {"language": "C99"}, files), *element("Library", {"name": "m"})]
    configuration = element("BuildConfiguration", {"modelIdentifier": model.name}, inside)
    # FMI 2.0 took the file over without a version of its own.
    return document(element("fmiBuildDescription", {"fmiVersion": "3.0"}, configuration))
