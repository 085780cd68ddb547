"""The C sources of a native FMU: the component's functions and tables, and the runtime that they are compiled with."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from importlib.util import find_spec
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple, final

import casadi as ca
import numpy as np

from liaisons.algebra import stack
from liaisons.base.array_names import suffixed_name
from liaisons.base.contact_limits import HEADER as CONTACT_LIMITS
from liaisons.base.port_names import impulse_name, jump_name
from liaisons.errors import BuildError
from liaisons.fmu.dependencies import coupled_state_count, energy_accounts, state_outputs
from liaisons.fmu.description import source_names
from liaisons.fmu.functions import DIFFERENTIATED, function_code, function_definition
from liaisons.fmu.jumps import jump_flags
from liaisons.fmu.layout import TIME, Fmi, first_reference, index_ranges, memory_index, scalar_count, start_rates
from liaisons.fmu.markup import document, element
from liaisons.language import Variable
from liaisons.mechanics import BOOKED, SIGNATURES, Model

_FMI_HEADERS = {
    "2": ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    "3": ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
_MOST = 11  # arguments: those of calculate_forward
_MOST_WITH_TABLE = 12
_MOTION = ("derivatives", "motion")
_MOST_NAMED = 4  # prescribed coordinates that a sentence names
_LARGE = 1500  # operations of the rates, of which those of loads are few: one function for all activities
_LOADS, _MOVES = 1, 2  # effects of inputs that are not 0: forces, or the motion of prescribed coordinates
_ACTIVITIES = {0: "_free", _LOADS: "_at_rest", _MOVES: "_unloaded", _LOADS | _MOVES: ""}
_HEADERS = (
    *("core.h", "instance.h", "inputs.h", "prescribed.h", "solver.h", "symplectic.h", "stiff.h"),
    *("event_search.h", "events.h", "unilateral.h", "complementarity.h", "contact_rules.h", "contact_record.h"),
    *("impulses.h", "calls.h", "fmi_common.h", "fmi_functions.h"),
)

_FMI_FILES = ("fmi2.c", "fmi_common.c", "starts.c")


def source_files(model: Model, guid: str, fmi: Fmi = "2", *, arrays: bool = True) -> dict[str, bytes]:
    """Files from which an FMU is compiled, generated ones and the runtime, by name.

    :param guid: that of the model description, which the binary checks.
    :param arrays: False: in FMI 3.0, too, value references stand for numbers.
    :raises BuildError: if the FMI headers are not installed.
    """
    runtime = resources.files("liaisons.fmu") / "runtime"
    model_c, *c_files = source_names(model, fmi)
    files = (*_HEADERS, *["knots.h"] * bool(model.table), *c_files)
    paths = [*(runtime / name for name in files), CONTACT_LIMITS]
    return {
        "buildDescription.xml": _build_description(model, fmi),
        model_c: model_code(model, guid, fmi, arrays=arrays).encode(),
        **{path.name: path.read_bytes() for path in paths},
        **{name: _fmi_header(name) for name in _FMI_HEADERS[fmi]},
    }


@final
@dataclass(frozen=True, slots=True)
class Core:
    """Code of a model without the functions of FMI, for programs of our own that compile it.

    :param files: C files of the model and of the runtime, by name.
    :param references: numbers by which the runtime knows the variables, by name; those of the elements of arrays.
    """

    files: Mapping[str, bytes]
    references: Mapping[str, int]

    @classmethod
    def of(cls, model: Model) -> Core:
        """Core of a model."""
        files = source_files(model, "", "2").items()
        own = {name: text for name, text in files if name.endswith((".c", ".h")) and name not in _FMI_FILES}
        names = (element.name for variable in model.variables for element in variable.elements())
        return cls(own, {name: reference for reference, name in enumerate(names, first_reference(model))})


_INCLUDES = ("#include <math.h>", "", '#include "core.h"')
_NO_WARNINGS = ("", "#ifdef __GNUC__", '#pragma GCC diagnostic ignored "-Wunused-parameter"', "#endif")


def model_code(model: Model, guid: str, fmi: Fmi = "2", *, arrays: bool = True) -> str:
    """Text of ``model.c``: the functions of the model, then the tables that core.h declares."""
    adjoint = fmi == "3"
    loops = model.loops.code(coupled_state_count(model), DIFFERENTIATED, adjoint=adjoint) if model.loops else {}
    rates = [] if loops else _rate_functions(model)
    members = _model_functions(model, adjoint=adjoint)
    booking = _booking_statements(model, members)
    members = {name: function for name, function in members.items() if name not in booking}
    row_functions = _table_row_functions(model, members, rates)
    if model.table and model.table.has_events:
        del members["instants"], members["draw"]
    functions = [row_functions.get(name, function) for name, function in members.items()]
    functions += [row_functions.get(function.name(), function) for pair in rates for function in pair]
    functions += [model.table.times] if model.table else []
    code, reals = function_code(functions)
    tables = _tables(model)
    fields = {
        **_struct_members(model, guid, tables),
        **({} if arrays else {"by_number": 1}),
        **_sizes_and_motions(model, functions, rates, max([reals, *(loop.reals for loop in loops.values())])),
        "instants": "instants",
        **({} if model.draw is None else {"draw": "draw"}),
        **{name: name if name in row_functions else function.name() for name, function in members.items()},
        **{name: name for name in (*booking, *loops) if name not in _MOTION},
    }
    return "\n".join(
        [
            f"/* {model.name}: functions generated from its equations, and tables. */",
            *_INCLUDES,
            *_table_declarations(model),
            *_NO_WARNINGS,
            *code,
            *_lookup_definitions(model, row_functions),
            *(line for name, statements in booking.items() for line in function_definition(name, statements)),
            *([model.loops.preamble(loops.values()), *(loop.text for loop in loops.values())] if model.loops else []),
            *(line for table in tables for line in table.definition),
            "const Model model = {",
            *(f"    .{name} = {value}," for name, value in fields.items()),
            "};",
            "",
        ]
    )


def _sizes_and_motions(
    model: Model, functions: Sequence[ca.Function], rates: Sequence[Sequence[ca.Function]], reals: int
) -> dict[str, object]:
    """Members of the struct: room that the functions need, and the functions of the solvers for each activity."""
    motions = [[function.name() for function in pair] for pair in rates] or [_MOTION] * len(_ACTIVITIES)
    most = _MOST_WITH_TABLE if model.table else _MOST
    return {
        "coupled": rates[-1][1].numel_out(0) if rates else coupled_state_count(model),
        "most_arguments": max([most, *(function.sz_arg() for function in functions)]),
        "most_results": max([_MOST, *(function.sz_res() for function in functions)]),
        "integers": max(function.sz_iw() for function in functions),
        "reals": reals,
        "motions": _initializer(*(_initializer(*pair) for pair in motions)),
    }


def _model_functions(model: Model, *, adjoint: bool) -> dict[str, ca.Function]:
    """Functions to be generated as straight code, by their members of ``Model`` in core.h."""
    functions: dict[str, ca.Function | None] = {name: getattr(model, name) for name in SIGNATURES}
    functions |= {
        "outputs_function": _with_margin(model, (model.table or model).outputs_function),  # of rows of a table
        "remember": _with_margin(model, model.remember),
        "jump": _with_margin(model, model.jump),
        "contact": model.contact and _with_one_result(model.contact),
    }
    functions["draw"] = (model.table and model.table.draw) or model.draw
    loops = model.loops.names if model.loops else frozenset()
    members = {
        signature.member: function
        for name, signature in SIGNATURES.items()
        if signature.member and (function := functions[name]) and name not in loops
    }
    directions = [] if loops else ["forward", "reverse"] if adjoint else ["forward"]
    return members | {
        name: f for direction in directions for name, f in _directional_derivatives(model, direction).items()
    }


def _booking_statements(model: Model, members: Mapping[str, ca.Function]) -> dict[str, list[str]]:
    """C statements, by member, of functions that book energy or work: they take the number from the outputs.

    Empty unless the outputs are large: their code and its derivatives are not repeated.
    """
    outputs, sizes = model.outputs_function, {"y": model.start.numel_out(0), "m": model.start.numel_out(1)}
    moves = not model.active or model.project is not None or model.contacts or model.table or model.loops
    if moves or not outputs.is_a("SXFunction") or outputs.n_instructions() < _LARGE:
        return {}
    names, letters = [e.name for v in model.outputs for e in v.elements()], SIGNATURES["outputs_function"].arguments
    directions = len(letters) + 1  # index of the first, behind the arguments and the results
    same = ", ".join(f"arguments[{i}]" for i in range(directions))
    booking = {}
    for name, (letter, place, output) in BOOKED.items():
        if output not in names:
            return {}
        position, count, booked = letters.index(letter), sizes[letter], f"z[{names.index(output)}]"
        row = place % count
        for end, first in {"": 0, "_forward": directions}.items():
            booking[f"{name}{end}"] = [
                f"double z[{len(names)}], *all[] = {{z}};",
                f"{members[f'calculate{end}'].name()}(arguments, all, integers, reals, memory);",
                f"for (int i = 0; i < {count}; i++) results[0][i] = arguments[{first + position}][i];",
                f"results[0][{row}] = {booked};",
            ]
        weights = f"arguments[{directions}]"
        booking[f"{name}_reverse"] = [
            f"double z[{len(names)}] = {{0}};",
            f"const double *weighted[] = {{{same}, z}};",
            f"{booked} = {weights}[{row}];",
            "calculate_reverse(weighted, results, integers, reals, memory);",
            f"for (int i = 0; i < {count}; i++) results[{position}][i] += i == {row} ? 0 : {weights}[i];",
        ]
    return {name: statements for name, statements in booking.items() if name in members}


def _with_one_result(function: ca.Function) -> ca.Function:
    """Function with its results stacked in one column."""
    arguments = function.sx_in()
    return ca.Function(function.name(), arguments, [ca.vertcat(*function.call(arguments, True, False))])


# ---- tables of parameters --------------------------------------------------------------------------------------


def _table_row_functions(
    model: Model, members: Mapping[str, ca.Function], rates: Iterable[tuple[ca.Function, ca.Function]]
) -> dict[str, ca.Function]:
    """Functions whose parameters are rows of a table, by the names of the C functions that call them."""
    if model.table is None:
        return {}
    functions = {name: function for name, function in members.items() if name.startswith("calculate")}
    functions |= {"draw": model.table.draw} if model.table.draw else {}
    functions |= {"distances": model.table.conditions} if model.condition_texts else {}
    functions |= {"jump": model.table.jump} if model.states else {}
    functions |= {"sample": model.table.sample} if model.table.sample else {}
    functions |= {"instants": model.table.events} if model.table.events else {}
    functions |= {function.name(): function for pair in rates for function in pair}
    arguments = {name: function.sx_in() for name, function in functions.items()}
    return {name: ca.Function(f"seen_{name}", x, functions[name].call(x, True, False)) for name, x in arguments.items()}


def _lookup_definitions(model: Model, row_functions: Mapping[str, ca.Function]) -> list[str]:
    """C definitions of functions that look up rows of a table, and call the functions of rows."""
    statements = {}
    for name, function in row_functions.items():
        suffix = name.removeprefix("calculate") if name.startswith("calculate") else ""
        call = f"with_rows{suffix}({function.name()}, arguments, results, integers, reals, memory)"
        statements[name] = f"return {call};"
    if "instants" in row_functions:  # its arguments are (k, t)
        as_rows = "arguments[1], NULL, NULL, arguments[0], [TABLE] = arguments[TABLE]"
        statements["instants"] = (
            f"return with_rows({row_functions['instants'].name()}, (const double *[TABLE + 1]){{{as_rows}}}, results, "
            "integers, reals, memory);"
        )
    if model.table and model.table.has_events:
        statements["instants"] = "return next_instant(arguments, results);"
        statements["draw"] = "return next_break(arguments, results);"
    return [line for name, statement in statements.items() for line in function_definition(name, [statement])]


def _table_declarations(model: Model) -> list[str]:
    """C declarations of the sizes of a table, and the inclusion of knots.h."""
    if model.table is None:
        return []
    table, lookups = model.table, model.table.lookups
    behind = scalar_count(model.parameters) - table.columns * table.rows
    sizes = {"COLUMNS": table.columns, "ROOM": table.rows, "LOOKUPS": len(lookups), "BEHIND": behind}
    return [
        f"enum {{ {', '.join(f'{name} = {size}' for name, size in sizes.items())}, SEEN = {table.numbers_read} }};",
        f"static const size_t of_lookup[] = {_initializer(*map(len, lookups))};",
        f"static const size_t seen_columns[] = {_initializer(*(column for lookup in lookups for column in lookup))};",
        f"static const int rests[] = {_initializer(*map(int, table.rests))};",
        "static Function times;",
        "",
        '#include "knots.h"',
    ]


# ---- derivatives -----------------------------------------------------------------------------------------------


def _rate_functions(model: Model) -> list[tuple[ca.Function, ca.Function]]:
    """Functions of the rates of all states and of the coupled states, a pair for each of :data:`_ACTIVITIES`.

    They leave out the terms of inputs that are 0 then; functions with CasADi's maps do not.
    """
    whole = model.derivatives if model.table is None else model.table.derivatives
    if not whole.is_a("SXFunction"):
        return [(whole, whole)] * len(_ACTIVITIES)
    whole = _with_margin(model, whole)
    t, y, u, k, *m = map(ca.SX, whole.sx_in())
    effects = _activities_of_inputs(model)
    effect_of_number = [effects[variable.name] for variable in model.inputs for _ in range(variable.count)]
    large = whole.n_instructions() > _LARGE
    zeros = {
        activity: tuple(bool(effect & ~activity) and not large for effect in effect_of_number)
        for activity in _ACTIVITIES
    }
    count = coupled_state_count(model)
    pairs: dict[tuple[bool, ...], tuple[ca.Function, ca.Function]] = {}
    for activity, suffix in reversed(_ACTIVITIES.items()):
        if (is_zero := zeros[activity]) not in pairs:
            inputs = stack(ca.SX(0) if zero else u[i] for i, zero in enumerate(is_zero))
            rates, *margin = map(ca.densify, ca.cse(whole.call([t, y, inputs, k, *m], True, False)))
            every = ca.Function(f"derivatives{suffix}", [t, y, u, k, *m], [rates, *margin])
            motion = (
                ca.Function(f"motion{suffix}", [t, y, u, k, *m], [rates[:count], *margin])
                if count < rates.numel()
                else every
            )
            pairs[is_zero] = every, every if 1.2 * motion.n_instructions() > every.n_instructions() > _LARGE else motion
    return [pairs[zeros[activity]] for activity in _ACTIVITIES]


def _is_guarded(model: Model) -> bool:
    """Whether rates and outputs say how far driven constraints are from losing rank."""
    straight = model.table is None and not model.loops and bool(model.active)
    return straight and model.margin is not None and model.margin.is_a("SXFunction")


def _with_margin(model: Model, function: ca.Function) -> ca.Function:
    """Function of (t, y, u, k, ...) with :attr:`Model.margin` as a further result, if it is guarded."""
    if not _is_guarded(model) or model.margin is None:
        return function
    arguments = function.sx_in()
    results = [*function.call(arguments, True, False), *model.margin.call(arguments[:4], True, False)]
    return ca.Function(function.name(), arguments, ca.cse(results))


def _activities_of_inputs(model: Model) -> dict[str, int]:
    """For each input, by name, the key of :data:`_ACTIVITIES` that a value other than 0 needs."""
    effects = {variable.name: _LOADS if variable.variability == "continuous" else 0 for variable in model.inputs}
    for coordinate in model.active:
        effects |= {coordinate.value: 0, coordinate.rate: _MOVES, coordinate.acceleration: _MOVES}
    return effects


def _directional_derivatives(model: Model, direction: str) -> dict[str, ca.Function]:
    """(arguments, results, directions) → derivatives of the results, by member of ``Model``.

    In reverse: (arguments, results, weights) → derivatives of the weighted sum of the results by the arguments.
    """
    functions = {}
    forward = direction == "forward"
    for name in (*DIFFERENTIATED, *["project"] * bool(model.redundant)):
        signature = SIGNATURES[name]
        argument_vectors, function = signature.arguments, getattr(model, name)
        if model.table and name == "outputs_function":
            argument_vectors, function = argument_vectors.replace("k", "r"), model.table.outputs_function
        arguments: Any = function.sx_in() if function.is_a("SXFunction") else function.mx_in()
        results = function.call(arguments, True, False)
        symbols, seeds = (
            [type(x).sym("d", x.shape[0]) for x in vector] for vector in (results, arguments if forward else results)
        )
        (derivatives,) = (ca.forward if forward else ca.reverse)(results, arguments, [seeds])
        vectors = signature.results if forward else argument_vectors
        dense = [_densified(x, _variable_sizes(model, vector)) for x, vector in zip(derivatives, vectors, strict=True)]
        # What maps share is shared already, and cse is slow on them.
        dense = list(ca.cse(dense)) if all(isinstance(x, ca.SX) for x in dense) else dense
        title = f"{signature.member}_{direction}"
        functions[title] = ca.Function(title, [*arguments, *symbols, *seeds], dense)
    return functions


def _densified(vector: Any, sizes: Sequence[int]) -> Any:
    """Vector with all zeros stored.

    :param sizes: of its blocks: CasADi tabulates all indices of a vector in which some are stored.
    """
    if vector.is_dense() or len(sizes) < 2:
        return ca.densify(vector)
    return ca.vertcat(*map(ca.densify, ca.vertsplit(vector, np.cumsum([0, *sizes]).tolist())))


def _variable_sizes(model: Model, vector: str) -> list[int]:
    """Number of elements of each variable in a vector of the model."""
    groups = {"y": state_outputs(model), "u": model.inputs, "k": model.parameters, "z": model.outputs}
    if vector in groups:
        return [variable.count for variable in groups[vector]]
    return [1] * (1 if vector in {"t", "r"} else model.start.numel_out(1))  # r: parameters and rows of a table


# ---- tables: one row a variable, however many numbers it holds --------------------------------------------------


def _struct_members(model: Model, guid: str, tables: Iterable[_Table]) -> dict[str, object]:
    """C values of the members of the struct ``Model`` except functions, by name; others are 0."""
    numbers = {
        "parameters": scalar_count(model.parameters),
        "inputs": scalar_count(model.inputs),
        "outputs": scalar_count((*model.outputs, *model.drawn)),
        "states": model.start.numel_out(0),
        "memory": model.start.numel_out(1),
        "residuals": model.reach.numel_out(0) if model.reach else 0,
        "events": 1 if model.table and model.table.has_events else model.events.numel_out(0),
        "conditions": len(model.condition_texts) - model.start_only,
        "redundant": model.redundant,
        "guarded": int(_is_guarded(model)),
        "columns": model.table.columns if model.table else 0,
        "drawn": scalar_count(model.drawn),
        "variable_rows": len(model.variables),  # without the time
        "impulses": sum(len(sums) for _, sums in _load_impulses(model)) + len(_reaction_initializers(model)),
        **{table.size: len(table.rows) for table in tables if table.size},
    }
    offsets = _contact_result_offsets(model.contact, len(model.contacts)) if model.contact else {}
    return {
        "name": _c_string(model.name),
        "guid": _c_string(guid),
        "tolerance": _c_number(model.experiment.tolerance),
        **{name: number for name, number in numbers.items() if number},
        **{table.member: table.member for table in tables},
        **offsets,
    }


def _contact_result_offsets(contact: ca.Function, contacts: int) -> dict[str, object]:
    """Members of ``Model`` that say at which row each result of the contact function begins.

    :param contacts: their number; where redundant ones have factors of G, their product has rows behind the results.
    """
    sizes, momenta = {name: contact.numel_out(i) for i, name in enumerate(contact.name_out())}, 0
    if "G" not in sizes:
        momenta = sizes["momenta_by_forces"] // contacts
        sizes["G"] = contacts**2
    rows = _initializer(*map(".{} = {}".format, (*sizes, "count"), accumulate(sizes.values(), initial=0)))
    return {"rows": rows, **({"momenta": momenta} if momenta else {})}


class _Table(NamedTuple):
    """A table in C: the member of the struct ``Model``, that of the number of rows, the type of a row, and all rows.

    One without rows has a row of zeros, so that its end is not an offset of a null pointer.
    """

    member: str
    size: str
    kind: str
    rows: Sequence[str]

    @property
    def definition(self) -> list[str]:
        """Definition of a static C array, as lines."""
        if not self.rows:
            return [f"static const {self.kind} {self.member}[1];", ""]
        return [f"static const {self.kind} {self.member}[] = {{", *(f"    {row}," for row in self.rows), "};", ""]


def _tables(model: Model) -> list[_Table]:
    """All tables; a member without a number of rows is NULL if there are none."""
    inputs, row = index_ranges(model.inputs), {variable.name: i for i, variable in enumerate(model.variables)}
    active = []
    for a in model.active:
        firsts = (inputs[name].start for name in (a.value, a.rate, a.acceleration))
        shown = (memory_index(model, f"{a.value}{end}") for end in ("_mismatch", "_derived"))
        active.append(_initializer(*firsts, len(inputs[a.value]), *("NOT_SHOWN" if i < 0 else i for i in shown)))
    tables = [
        _Table("variables", "", "Variable", _variable_initializers(model)),
        _Table("starts", "start_rows", "Start", [_initializer(i, _c_number(x)) for i, x in _element_starts(model)]),
        _Table("start_rates", "start_rate_rows", "StartRate", [_initializer(*row) for row in start_rates(model)]),
        _Table("active", "active_rows", "Active", active),
        _Table("account", "account_rows", "Account", [_initializer(*account) for account in energy_accounts(model)]),
        _Table("jumps", "", "unsigned char", [", ".join(map(str, flags)) for flags in jump_flags(model)]),
        _Table("state", "state_rows", "State", [_initializer(row[s.name], row[s.derivative]) for s in model.states]),
        _Table(
            "dimensions",
            "dimension_rows",
            "Dimension",
            [_initializer(_c_string(d.name), d.count) for d in model.dimensions],
        ),
        _Table("condition_texts", "start_conditions", "char *const", [*map(_c_string, model.condition_texts)]),
        _Table("reaches", "reach_rows", "Reach", _reach_initializers(model)),
        _Table("configuration", "", "unsigned char", _configuration_flags(model)),
        *_contact_tables(model),
        _Table(
            "impulse",
            "impulse_rows",
            "ImpulseInput",
            [_initializer(sums.start, load, len(sums)) for load, sums in _load_impulses(model)],
        ),
        _Table("reaction", "reaction_rows", "Reaction", _reaction_initializers(model)),
    ]
    return [table for table in tables if table.rows or table.size]


def _contact_tables(model: Model) -> Iterator[_Table]:
    """Yield the tables of unilateral liaisons and dry frictions, whose rows have indices in the memory."""
    kinds = {"gap": "Gap", "friction": "DryFriction", "operator": "size_t", "indicator": "size_t"}
    if not model.contacts:  # then a long chain need not be flattened
        yield from (_Table(member, f"{member}s", kind, ()) for member, kind in kinds.items())
        return
    slot = {name: i for i, name in enumerate(model.memory)}
    gaps = [c for c in model.contacts if not c.friction]
    normals = {c.name: i for i, c in enumerate(gaps)}
    first = scalar_count((*model.parameters, *model.inputs))
    index = {v.name: i for i, v in enumerate(model.flat().outputs)}

    def loss_slot(name: str) -> int:
        """Slot of the energy that is lost by impacts of a part."""
        part, dot, _ = name.rpartition(".")
        return slot[f"{part}{dot}impact_loss"]

    ends = ("closed", "rests_from", "impulse", "impacts")
    gap_rows = [
        _initializer(_c_string(c.name), *(slot[c.variable(end)] for end in ends), loss_slot(c.name)) for c in gaps
    ]
    friction_rows = [
        _initializer(_c_string(c.name), slot[c.variable("direction")], normals.get(c.normal, -1), loss_slot(c.name))
        for c in model.contacts
        if c.friction
    ]
    yield _Table("gap", "gaps", "Gap", gap_rows)
    yield _Table("friction", "frictions", "DryFriction", friction_rows)
    yield _Table(
        "operator", "operators", "size_t", [str(slot[f"{name}_impulse"]) for name in model.impulsive_operators]
    )
    yield _Table("indicator", "indicators", "size_t", [str(first + index[name]) for name in model.flat().indicators])


def _configuration_flags(model: Model) -> list[str]:
    """For each state 1 if it is a coordinate, else 0; empty if no constraint can lose rank."""
    if not _is_guarded(model):
        return []
    return [str(int(e.name in model.configuration)) for v in state_outputs(model) for e in v.elements()]


def _reach_initializers(model: Model) -> list[str]:
    """C initializer for each constraint: its text, and where what is prescribed for it is in ``reach``."""
    rows, first = [], len(model.reaches)
    for reach in model.reaches:
        names = [*map(_c_string, reach.prescribed[:_MOST_NAMED])]
        listed = f"(const char *const[]){_initializer(*names)}" if names else "NULL"
        rows.append(_initializer(_c_string(reach.text), first, len(names), listed))
        first += len(reach.prescribed)
    return rows


def _load_impulses(model: Model) -> list[tuple[int, range]]:
    """For each load with a sum of impulses, its first index among the inputs and those of the sum."""
    inputs = index_ranges(model.inputs)
    pairs = ((indices.start, inputs.get(impulse_name(name))) for name, indices in inputs.items() if "_load" in name)
    return [(load, sums) for load, sums in pairs if sums is not None]


def _reaction_initializers(model: Model) -> list[str]:
    """C initializer for each prescribed rate that jumps in reaction to impulses of its operator."""
    if not model.contacts:  # then none does
        return []
    flat = model.flat()
    inputs = index_ranges(flat.inputs)
    output = {v.name: i for i, v in enumerate(flat.outputs)}
    memory = {name: i for i, name in enumerate(model.memory)}
    return [
        _initializer(
            *(inputs[name].start for name in (jump_name(a.rate), a.rate, a.acceleration)),
            output[force := suffixed_name(a.value, "_force")],
            memory[impulse_name(force)],
        )
        for a in model.active
        if jump_name(a.rate) in inputs
    ]


def _variable_initializers(model: Model) -> list[str]:
    """C initializer for each variable."""
    variables = (*model.variables, TIME)
    indices, states, activities = (
        index_ranges(variables),
        index_ranges(state_outputs(model)),
        _activities_of_inputs(model),
    )
    kinds = {"input": "INPUT", "parameter": "{}_PARAMETER"}
    return [
        _initializer(
            _c_string(variable.name),
            "INDEPENDENT"
            if variable is TIME
            else kinds.get(variable.causality, "CALCULATED").format(variable.variability.upper()),
            indices[variable.name].start,
            variable.count,
            int(variable.dimension is not None),
            states[variable.name].start if variable.name in states else "NO_STATE",
            activities.get(variable.name, 0),
            _c_number(_common_start(variable)),
            _c_number(-math.inf if variable.minimum is None else variable.minimum),
            _c_number(math.inf if variable.maximum is None else variable.maximum),
            int(variable.strict),
            _c_string(variable.domain()),
            f"NUMBER_{variable.type.upper()}",
        )
        for variable in variables
    ]


def _common_start(variable: Variable) -> float:
    """Start value that all elements of a variable have; 0 if they differ."""
    return variable.starts[0] if len(set(variable.starts)) == 1 else 0.0


def _element_starts(model: Model) -> list[tuple[int, float]]:
    """Index and start value of each element whose start is not the common one of its array."""
    listed = []
    for variable, indices in zip(model.variables, index_ranges(model.variables).values(), strict=True):
        common = _common_start(variable)  # once: an array may have 100 000 elements
        listed += [item for item in zip(indices, variable.starts, strict=True) if item[1] != common]
    return listed


def _initializer(*members: object) -> str:
    """C initializer of a struct."""
    return f"{{{', '.join(map(str, members))}}}"


def _c_number(value: float) -> str:
    """Number as a C literal."""
    if math.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


def _c_string(text: str) -> str:
    """Text as a C string literal."""
    return json.dumps(text, ensure_ascii=False)  # its escapes are those of C


# ---- headers and build description ------------------------------------------------------------------------------


def _fmi_header(name: str) -> bytes:
    """Content of a header of the FMI standard, from FMPy's files.

    :raises BuildError: if it is missing.
    """
    package = find_spec("fmpy")
    folder = Path(package.origin).parent if package and package.origin else Path()
    try:
        return (folder / "c-code" / name).read_bytes()
    except OSError as error:
        raise BuildError(f"{name} is missing in the installed fmpy; reinstall it: pip install fmpy") from error


def _build_description(model: Model, fmi: Fmi) -> bytes:
    """Text of buildDescription.xml."""
    files = (line for name in source_names(model, fmi) for line in element("SourceFile", {"name": name}))
    inside = [*element("SourceFileSet", {"language": "C99"}, files), *element("Library", {"name": "m"})]
    configuration = element("BuildConfiguration", {"modelIdentifier": model.name}, inside)
    # FMI 2.0 took the file over without a version of its own.
    return document(element("fmiBuildDescription", {"fmiVersion": "3.0"}, configuration))
