"""The C sources of a native FMU: the component's functions and tables, and the runtime that they are compiled with."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
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


def source_files(model: Model, guid: str, fmi: Fmi = "2", *, arrays: bool = True) -> dict[str, bytes]:
    """Everything that is needed to compile the FMU, by file name.

    :param guid: what the binary compares the model description with.
    :param arrays: False: in FMI 3.0, too, value references stand for numbers.
    :raises BuildError: if the FMI headers are not installed.
    """
    runtime = resources.files("liaisons.fmu") / "runtime"
    model_c, *written = sources(fmi)
    return {
        "buildDescription.xml": _build_description(model, fmi),
        model_c: model_code(model, guid, fmi, arrays=arrays).encode(),
        **{name: (runtime / name).read_bytes() for name in (*_headers(model), *written)},
        **{name: _fmi_header(name) for name in _FMI_HEADERS[fmi]},
    }


def model_code(model: Model, guid: str, fmi: Fmi = "2", *, arrays: bool = True) -> str:
    """``model.c``: the functions, then the tables that core.h declares."""
    adjoint = fmi == "3"  # where adjoint derivatives can be asked for
    loops = loop_functions(model.programs, coupled(model), adjoint=adjoint) if model.programs else {}
    rates = [] if loops else _rates(model)
    members = {"distances": model.conditions, "instants": model.events}
    draw = (model.table and model.table.draw) or model.draw
    members |= {} if draw is None else {"draw": draw}
    members |= {} if loops else _functions(model, adjoint=adjoint)
    seeing, rates = _seeing(model, members, rates)
    functions = [*members.values(), *(function for pair in rates for function in pair)]
    functions += [model.table.times] if model.table else []
    code, reals = function_code(functions)
    names = {function.name(): name for name, function in seeing.items()}
    pairs = [tuple(names.get(f.name(), f.name()) for f in pair) for pair in rates] or [_MOTION] * len(_ACTIVITIES)
    fields = {
        **_fields(model, guid),
        **({} if arrays else {"by_number": "1"}),
        "coupled": str(rates[-1][1].numel_out(0) if rates else coupled(model)),
        "most_arguments": str(max([_TABLE if model.table else _MOST, *(function.sz_arg() for function in functions)])),
        "most_results": str(max([_MOST, *(function.sz_res() for function in functions)])),
        "integers": str(max(function.sz_iw() for function in functions)),
        "reals": str(max([reals, *(loop.reals for loop in loops.values())])),
        "motions": _row(*(_row(*pair) for pair in pairs)),
        "instants": "instants",
        **({} if model.draw is None else {"draw": "draw"}),
        **{name: names.get(function.name(), function.name()) for name, function in members.items()},
        **{name: name for name in loops if name not in _MOTION},
    }
    return "\n".join(
        [
            f"/* {model.name}: functions generated from its equations, and tables. */",
            "#include <math.h>",
            "",
            '#include "core.h"',
            *_table_sizes(model),
            "",
            "#ifdef __GNUC__",
            '#pragma GCC diagnostic ignored "-Wunused-parameter"',
            "#endif",
            *code,
            *_by_table(model, seeing),
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
        "calculate": _outputs(model),
        "jump": model.jump,
        "remember": model.remember,
        "nominals": model.nominals,
    }
    if model.project is not None:
        functions["project"] = model.project
    return functions | _derivatives(model, "forward") | (_derivatives(model, "reverse") if adjoint else {})


def _headers(model: Model) -> tuple[str, ...]:
    return _HEADERS if model.table is None else (*_HEADERS, "knots.h")


def _outputs(model: Model) -> ca.Function:
    """(t, y, u, k, m) -> z; of a table with the rows that are seen instead of all."""
    return model.outputs_function if model.table is None else model.table.outputs_function


def _seeing(
    model: Model, members: dict[str, ca.Function], rates: list[tuple[ca.Function, ca.Function]]
) -> tuple[dict[str, ca.Function], list[tuple[ca.Function, ca.Function]]]:
    """Functions that see rows of a table, by the names of those that look the rows up, which take their places."""
    if model.table is None:
        return {}, rates
    seeing = {name: members[name] for name in members if name.startswith("calculate")}
    seeing |= {"draw": model.table.draw} if model.table.draw else {}
    seeing |= {function.name(): function for pair in rates for function in pair}
    seeing = {name: _renamed(function, f"seen_{name}") for name, function in seeing.items()}
    members |= {name: seeing[name] for name in members if name in seeing}
    if model.table.has_events:
        del members["instants"], members["draw"]
    return seeing, [(seeing[every.name()], seeing[some.name()]) for every, some in rates]


def _renamed(function: ca.Function, name: str) -> ca.Function:
    arguments = function.sx_in()
    return ca.Function(name, arguments, function.call(arguments, True, False))


def _by_table(model: Model, seeing: Mapping[str, ca.Function]) -> list[str]:
    """Definitions of functions that look rows up, for those that see them."""
    calls = {name: f"see{name.removeprefix('calculate')}" for name in seeing if name.startswith("calculate")}
    calls = dict.fromkeys(seeing, "see") | calls
    arguments = "arguments, results, integers, reals, memory"
    lines = [define(name, [f"return {call}({seeing[name].name()}, {arguments});"]) for name, call in calls.items()]
    if model.table and model.table.has_events:
        lines.append(define("instants", ["return next_instant(arguments, results);"]))
        lines.append(define("draw", ["return next_break(arguments, results);"]))
    return [line for definition in lines for line in definition]


def _table_sizes(model: Model) -> list[str]:
    """What knots.h has to know of a table, and knots.h."""
    if model.table is None:
        return []
    table, lookups = model.table, model.table.lookups
    behind = sum(variable.count for variable in model.parameters) - table.columns * table.rows
    sizes = {"COLUMNS": table.columns, "ROOM": table.rows, "LOOKUPS": len(lookups), "BEHIND": behind}
    columns = ", ".join(str(column) for lookup in lookups for column in lookup)
    rests = ", ".join(str(int(rests)) for rests in table.rests)
    return [
        f"enum {{ {', '.join(f'{name} = {size}' for name, size in sizes.items())}, SEEN = {table.seen} }};",
        f"static const size_t of_lookup[] = {{{', '.join(str(len(lookup)) for lookup in lookups)}}};",
        f"static const size_t seen_columns[] = {{{columns}}};",
        f"static const int rests[] = {{{rests}}};",
        "static Function times;",
        "",
        '#include "knots.h"',
    ]


def _rates(model: Model) -> list[tuple[ca.Function, ca.Function]]:
    """Rates of all states, and of those that act on the motion without the work to find the integrals along it.

    For each of the :data:`_ACTIVITIES`, without what is owed to inputs that are 0 then.  Of maps they are all one.
    """
    whole = model.derivatives if model.table is None else model.table.derivatives
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
            motion = ca.Function(f"motion{suffix}", [t, y, u, k], [rates[:count]]) if count < rates.numel() else every
            found[zero] = every, motion
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
        ("calculate", _outputs(model), "tyukm" if model.table is None else "tyurm", "z"),
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
        "events": 1 if model.table and model.table.has_events else model.events.numel_out(0),
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
        **({"columns": str(model.table.columns)} if model.table else {}),
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
    return variable.starts[0] if len(set(variable.starts)) == 1 else 0.0


def _starts(model: Model) -> list[tuple[int, float]]:
    """Places and values where an array starts otherwise."""
    where = places(model)
    listed = []
    for variable in model.variables:
        common = _common_start(variable)  # once: an array may have 100 000 elements
        listed += [(where[variable.name][i], value) for i, value in enumerate(variable.starts) if value != common]
    return listed


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
