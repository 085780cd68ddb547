"""C code of a program's loops."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable

from liaisons.chains.loops.plans import LoopPlan, LoopPlans, operands
from liaisons.chains.rows import RowProgram
from liaisons.expressions import OPERATIONS, Instruction, literal
from liaisons.mechanics import Code

_VECTORISED = """\
#if defined __GNUC__ && !defined __clang__
#define VECTORISED __attribute__((optimize("tree-vectorize", "vect-cost-model=dynamic")))
#else
#define VECTORISED
#endif
"""
_SUMS = """
enum { BLOCK = 256 }; /* terms of a sum that are calculated before they are added up */

/* Several sums at once: one alone would wait for each of its additions. */
static inline VECTORISED double total(const double *terms, size_t count) {
    double sums[8] = {0};
    size_t i = 0;
    for (; i + 8 <= count; i += 8)
        for (size_t k = 0; k < 8; k++) sums[k] += terms[i + k];
    for (size_t k = 0; i + k < count; k++) sums[k] += terms[i + k];
    return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
}
"""

_LONGEST = 80  # characters of an expression without a name


def preamble(functions: Iterable[Code]) -> str:
    """C that has to stand before functions; that of sums where there are any, since clang warns of what is unused."""
    sums = any("total(" in function.text for function in functions)
    return _VECTORISED + (_SUMS if sums else "")


def loops_code(program: RowProgram) -> Code:
    """C function of a program; the :func:`preamble` has to stand before it."""
    writer = _Writer(LoopPlans(program))
    lines = [line for index in range(len(writer.plans.plans)) for line in writer.loop_statements(index)]
    for target, number in writer.plans.ends:
        value = _without_brackets(writer.scalar_operand(number))
        lines += [*writer.pop_pending(), f"{target} = {value};"]
    body = "".join(f"    {line}\n" for line in lines)
    pointers = "".join(f"    {line}\n" for name, line in writer.plans.pointers.items() if f"{name}[" in body)
    head = "const double **argument, double **result, long long *integers, double *work, int memory"
    text = f"static VECTORISED int {program.name}({head}) {{\n{pointers}{body}    return 0;\n}}\n"
    return Code(text, len(writer.plans.kept) * program.n)


class _Writer:
    """Writer of the statements of loops, and of the single numbers that they need."""

    def __init__(self, plans: LoopPlans) -> None:
        self.plans = plans
        self._texts: dict[int, str] = {}
        self._pending: list[str] = []
        ends = [x for _, x in plans.ends]
        for plan in plans.plans:
            ends += [x for _, x in plan.edges] + [x for _, _, edges in plan.sums for x in edges]
            ends += [x for _, x, _ in plan.carried]
        in_loops = [i for plan in plans.plans for i in plan.targets]
        for node, each in zip(plans.nodes, plans.each, strict=True):
            in_loops += operands(node) if each else ()
        alone = [node for node, each in zip(plans.nodes, plans.each, strict=True) if not each]
        self._use_counts = _use_counts(alone, ends, in_loops)

    def pop_pending(self) -> list[str]:
        """Remove and return the statements that define operands used next."""
        statements, self._pending = self._pending, []
        return statements

    def scalar_operand(self, number: int) -> str:
        """C text of a node outside of loops; adds statements that define it to the pending ones."""
        nodes, ahead, needed = self.plans.nodes, [number], set()
        while ahead:
            i = ahead.pop()
            if i not in needed and i not in self._texts:
                needed.add(i)
                ahead += operands(nodes[i])
        for i in sorted(needed):
            leaf = self.plans.leaf(i)
            text = leaf.text if leaf else _operation_text(nodes[i], self._texts.__getitem__)
            if self._use_counts[i] > 1 and not _is_short(text):
                self._pending.append(f"const double s{i} = {_without_brackets(text)};")
                text = f"s{i}"
            self._texts[i] = text
        return self._texts[number]

    def loop_statements(self, index: int) -> list[str]:
        """Statements of a loop and those before it: operands, edges and starts."""
        plan = self.plans.plans[index]
        lines = [f"{target} = {_without_brackets(self.scalar_operand(x))};" for target, x in plan.edges]
        lines += [
            f"double {name} = {_without_brackets(self.scalar_operand(start))};" for name, start, _ in plan.carried
        ]
        for name, _, edges in plan.sums:
            lines.append(f"double {name} = {' + '.join(map(self.scalar_operand, edges)) or '0.0'};")
        loop = self._for_statement(index, plan) if plan.links else []
        return [*self.pop_pending(), *lines, *loop]

    def _for_statement(self, index: int, plan: LoopPlan) -> list[str]:
        """Lines of the ``for`` statement of a loop."""
        link = _Link(self, index, plan)
        body = link.lines
        body += [
            f"{name}[i] = {_without_brackets(link.operand(x))};"
            for name, x in (*self.plans.stored_arrays(index), *plan.rows)
        ]
        first, end = plan.links.start, plan.links.stop
        terms = [(name, _without_brackets(link.operand(x))) for name, x, _ in plan.sums]
        if plan.inward is None and terms:
            body += [f"terms{k}[i - begin] = {text};" for k, (_, text) in enumerate(terms)]
            return [
                f"for (size_t begin = {first}; begin < {end}; begin += BLOCK) {{",
                f"    const size_t end = begin + BLOCK < {end} ? begin + BLOCK : {end};",
                f"    double {', '.join(f'terms{k}[BLOCK]' for k in range(len(terms)))};",
                "    for (size_t i = begin; i < end; i++) {",
                *(f"        {line}" for line in body),
                "    }",
                *(f"    {name} += total(terms{k}, end - begin);" for k, (name, _) in enumerate(terms)),
                "}",
            ]
        body += [f"{name} += {text};" for name, text in terms]
        following = {name: _without_brackets(link.operand(x)) for name, _, x in plan.carried}
        body += [f"const double n{name} = {text};" for name, text in following.items() if text in following]
        body += [f"{name} = {f'n{name}' if text in following else text};" for name, text in following.items()]
        head = f"size_t i = {end}; i-- > {first};" if plan.inward else f"size_t i = {first}; i < {end}; i++"
        return [f"for ({head}) {{", *(f"    {line}" for line in body), "}"]


class _Link:
    """Statements for one link of a loop, and operands for its numbers."""

    def __init__(self, writer: _Writer, index: int, plan: LoopPlan) -> None:
        plans = writer.plans
        arrays = {i: array for i, (array, since) in plans.kept.items() if since < index}
        needed, read = plans.needed_nodes(plan.targets, arrays)
        nodes = [plans.nodes[i] for i in sorted(needed)]
        self.lines: list[str] = []
        self._writer, self._texts = writer, {i: f"{arrays[i]}[i]" for i in sorted(read)}
        self._use_counts = _use_counts(
            nodes,
            [*(x for _, x in plan.rows), *(x for _, x, _ in plan.sums)],
            [*(x for _, _, x in plan.carried), *(x for _, x in plans.stored_arrays(index))],
        )
        for number in sorted(needed | read):
            if (text := self._texts.get(number)) is None:
                leaf = plans.leaf(number)
                text = leaf.text if leaf else _operation_text(plans.nodes[number], self.operand)
            if (self._use_counts[number] > 1 and not _is_short(text)) or len(text) > _LONGEST:
                self.lines.append(f"const double a{number} = {_without_brackets(text)};")
                text = f"a{number}"
            self._texts[number] = text

    def operand(self, number: int) -> str:
        """C text of a node in the loop."""
        leaf = self._writer.plans.leaf(number)
        if number in self._texts:
            return self._texts[number]
        if leaf and leaf.each:  # carried, but needed in no operation
            return leaf.text
        return self._writer.scalar_operand(number)


def _use_counts(nodes: Iterable[Instruction], once: Iterable[int], several: Iterable[int]) -> Counter[int]:
    """How often each node is used.

    :param once: further uses.
    :param several: uses in a loop, which count twice.
    """
    uses = Counter([*once, *several, *several])
    for node in nodes:
        if node.operation is not None:
            for k, number in enumerate(node.arguments):
                uses[number] += OPERATIONS[node.operation].count(f"{{{k}}}")
    return uses


def _operation_text(node: Instruction, text_of: Callable[[int], str]) -> str:
    """C text of an operation, in brackets, or of a constant."""
    if node.operation is None:
        return literal(0.0 if node.constant is None else node.constant)
    pattern = OPERATIONS[node.operation]
    text = pattern.format(*map(text_of, node.arguments))
    return text if pattern[0].isalpha() else f"({text})"  # a call needs no brackets


def _without_brackets(text: str) -> str:
    """C text without the brackets around it."""
    return text[1:-1] if text.startswith("(") else text


def _is_short(text: str) -> bool:
    """Whether C text is a name or a number."""
    return text.replace(".", "").isalnum() or text.isidentifier()
