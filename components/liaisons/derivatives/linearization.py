"""The linear system that deviations from a point follow, of any FMU."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import get_args

from numpy.typing import ArrayLike

from liaisons.base.arguments import check_choice, check_finite, name_dictionary, name_list
from liaisons.cosim.description.fmu import read
from liaisons.cosim.running.linearization import Linearization, Method
from liaisons.derivatives.fmu_equations import FmuEquations
from liaisons.errors import SimulationError
from liaisons.library import Target, fmu_file


def linearize(
    subject: Target,
    at: Mapping[str, ArrayLike] | None = None,
    *,
    inputs: str | Iterable[str] | None = None,
    outputs: str | Iterable[str] | None = None,
    time: float = 0.0,
    method: Method | None = None,
) -> Linearization:
    """Linearize the equations of a component or an FMU at a point, which need not be an equilibrium.

    The FMU's directional derivatives are compared with differences, and not believed where they contradict.

    :param subject: name, file or class of a component, or path of an FMU of Model Exchange; a system is flattened
        first: ``linearize(system.flatten())``.
    :param at: values of states, inputs and parameters by name, where they differ from the start values; of a coordinate
        and its rate those that the motion starts with.
    :param inputs: an input or several, arrays under their names; None: all continuous ones.
    :param outputs: an output or another variable, or several; None: all outputs.
    :param time: [s].
    :param method: None: directional derivatives where there are any.
    :raises ProjectError: if there is no such file or component.
    :raises SimulationError: for an unknown name, a value that the FMU refuses, derivatives that are wrong, or an FMU
        that is not made for Model Exchange.
    """
    path = fmu_file(subject)
    values = name_dictionary("linearize: at", {} if at is None else at)
    check_finite("linearize: time", time)
    if method is not None:
        check_choice("linearize: method", method, get_args(Method))
    chosen_inputs = None if inputs is None else name_list("linearize: inputs", inputs)
    chosen_outputs = None if outputs is None else name_list("linearize: outputs", outputs)
    if read(path, prefers="ModelExchange").has_sampled_outputs:
        words = "its outputs hold, and depend on nothing between samples; linearize what it controls"
        raise SimulationError(f"{path.stem} is sampled: {words}")
    with FmuEquations(path, values, inputs=chosen_inputs, outputs=chosen_outputs, time=time) as equations:
        states = len(equations.states)
        point = equations(time, equations.x, equations.u)
        method = method or (
            "directional derivatives" if equations.fmu.provides_directional_derivatives else "differences"
        )
        jacobian = equations.differences() if method == "differences" else equations.checked_jacobian()
        variables = [*equations.knowns, *equations.outputs]
        return Linearization(
            path.stem,
            jacobian[:states, :states],
            jacobian[:states, states:],
            jacobian[states:, :states],
            jacobian[states:, states:],
            *(
                tuple(variable.name for variable in group)
                for group in (equations.states, equations.inputs, equations.outputs)
            ),
            rates=point[:states],
            values={
                variable.name: float(value)
                for variable, value in zip(variables, (*equations.x, *equations.u, *point[states:]), strict=True)
            },
            units={variable.name: variable.unit for variable in variables},
            method=method,
        )
