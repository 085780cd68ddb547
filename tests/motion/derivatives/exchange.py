"""FMUs of Model Exchange that are not ours, from their equations in C, with and without directional derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

Numbers = Mapping[str, float]
Fmi = Literal["2", "3"]


@dataclass(frozen=True)
class Exchange:
    """Equations in C: of the state ``x`` its rate ``x'``, and of outputs, in the names of variables and ``t``.

    :param partials: (``"x'"`` or an output, variable) -> C; others are 0.  None: no directional derivatives.
    :param knowns: parameters by which it differentiates; it refuses others.
    :param change: at an event, when ``indicator`` changes its sign; may set ``ends``.
    """

    states: Numbers
    rates: Mapping[str, str]
    parameters: Numbers = field(default_factory=dict)
    inputs: Numbers = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    partials: Mapping[tuple[str, str], str] | None = None
    knowns: tuple[str, ...] = ()
    indicator: str = ""
    change: str = ""

    @property
    def names(self) -> list[str]:
        return [*self.states, *(f"der({x})" for x in self.states), *self.parameters, *self.inputs, *self.outputs]

    def code(self, fmi: Fmi) -> str:
        """Its C."""
        names, rest = self.names, {**self.parameters, **self.inputs}
        starts = [*self.states.values(), *[0.0] * len(self.states), *rest.values(), *[0.0] * len(self.outputs)]
        number = {name.replace("der(", "").replace(")", "'"): k for k, name in enumerate(names)}
        known = [number[name] for name in (*self.states, *self.inputs, *self.knowns)]
        defines = "".join(f"#define {n} z[{number[n]}]\n" for n in (*self.states, *rest, *self.outputs))
        assigned = [f"z[{number[f'{x}' + chr(39)]}] = {rate};" for x, rate in self.rates.items()]
        assigned += [f"z[{number[y]}] = {value};" for y, value in self.outputs.items()]
        partials = [
            f"if (unknown == {number[z]} && known == {number[k]}) *d = {value};"
            for (z, k), value in (self.partials or {}).items()
        ]
        template = (Path(__file__).parent / "equations.c").read_text(encoding="utf-8")
        return "\n".join([
            "#define FMI3" if fmi == "3" else "",
            f"enum {{ STATES = {len(self.states)}, COUNT = {len(names)}, INDICATORS = {int(bool(self.indicator))} }};",
            f"#define STARTS {', '.join(map(str, starts))}",
            template,
            defines,
            f"static void calculate(double *z, double t) {{ (void)t; {' '.join(assigned)} }}",
            "static int partial(const double *z, double t, unsigned unknown, unsigned known, double *d) {",
            "  (void)z; (void)t;",
            f"  if ({' && '.join(f'known != {k}' for k in known)}) return 1;",
            # as the FMUs of the Modelica Association: outputs that are states are not among the unknowns
            f"  if (unknown < STATES) return 1;\n{' '.join(partials)} return 0; }}",
            f"static int change(double *z, double t) {{ int ends = 0; (void)z; (void)t; {self.change} return ends; }}",
            f"static double indicator(const double *z, double t) {{ (void)z; (void)t; return {self.indicator or 1}; }}",
        ])  # fmt: skip

    def description(self, name: str, fmi: Fmi) -> str:
        """Its model description."""
        variables = [(x, "output", f' initial="exact" start="{start}"') for x, start in self.states.items()]
        variables += [(f"der({x})", "local", f' derivative="{k}"') for k, x in enumerate(self.states, fmi == "2")]
        variables += [(k, "parameter", f' variability="fixed" start="{start}"') for k, start in self.parameters.items()]
        variables += [(u, "input", f' start="{start}"') for u, start in self.inputs.items()]
        variables += [(y, "output", "") for y in self.outputs]
        text, n = "", len(self.states)
        for k, (variable, causality, more) in enumerate(variables):
            common = f'name="{variable}" valueReference="{k}" causality="{causality}"'
            if fmi == "3":
                text += f"<Float64 {common}{more}/>"
                continue
            outer = [word for word in more.split() if word.startswith(("initial", "variability"))]
            inner = [word for word in more.split() if word not in outer]
            text += f"<ScalarVariable {common} {' '.join(outer)}><Real {' '.join(inner)}/></ScalarVariable>"
        outputs = [k for k, (_, causality, _) in enumerate(variables) if causality == "output"]
        provides = str(self.partials is not None).lower()
        if fmi == "3":
            head = 'fmiVersion="3.0" instantiationToken="x"'
            kind = f'canGetAndSetFMUState="true" providesDirectionalDerivatives="{provides}"'
            structure = "".join(f'<Output valueReference="{k}"/>' for k in outputs)
            structure += "".join(f'<ContinuousStateDerivative valueReference="{n + k}"/>' for k in range(n))
        else:
            head = f'fmiVersion="2.0" guid="x" numberOfEventIndicators="{int(bool(self.indicator))}"'
            kind = f'canGetAndSetFMUstate="true" providesDirectionalDerivative="{provides}" '
            kind += 'completedIntegratorStepNotNeeded="true"'
            listed = "".join(f'<Unknown index="{k + 1}"/>' for k in outputs)
            rates = "".join(f'<Unknown index="{n + k + 1}"/>' for k in range(n))
            structure = f"<Outputs>{listed}</Outputs><Derivatives>{rates}</Derivatives>"
        return (
            f'<?xml version="1.0"?><fmiModelDescription modelName="{name}" {head}><ModelExchange '
            f'modelIdentifier="{name}" {kind}/><ModelVariables>{text}</ModelVariables>'
            f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
        )


MU = "(1 - x0 * x0) * x1"
VAN_DER_POL = Exchange(
    {"x0": 2.0, "x1": 0.5},
    {"x0": "x1", "x1": f"mu * {MU} - x0"},
    {"mu": 1.5},
    partials={("x0'", "x1"): "1", ("x1'", "x0"): "-2 * x0 * x1 * mu - 1", ("x1'", "x1"): "mu * (1 - x0 * x0)"},
)
DAHLQUIST = Exchange({"x": 1.0}, {"x": "-k * x"}, {"k": 2.0}, partials={("x'", "x"): "-k"})
TANKS = Exchange(
    {"upper": 2.0, "lower": 1.0},
    {"upper": "(inflow - sqrt(2 * g * upper)) / area", "lower": "sqrt(2 * g * upper) - sqrt(2 * g * lower)"},
    {"area": 2.0, "g": 9.81},
    {"inflow": 5.0},
    {"outflow": "sqrt(2 * g * lower) + 0.1 * inflow"},
    {
        ("upper'", "upper"): "-sqrt(g / 2 / upper) / area",
        ("upper'", "inflow"): "1 / area",
        ("upper'", "area"): "-(inflow - sqrt(2 * g * upper)) / area / area",
        ("lower'", "upper"): "sqrt(g / 2 / upper)",
        ("lower'", "lower"): "-sqrt(g / 2 / lower)",
        ("outflow", "lower"): "sqrt(g / 2 / lower)",
        ("outflow", "inflow"): "0.1",
    },
    ("area",),
)
BALL = Exchange(
    {"h": 1.0, "v": 0.0},
    {"h": "v", "v": "-g"},
    {"g": 9.81, "e": 0.7},
    partials={("h'", "v"): "1"},
    indicator="h",
    change="if (h <= 0 && v < 0) { h = 0; v = -e * v; }",
)

Made = Callable[[Exchange], Path]
"""Path of the FMU of equations."""
