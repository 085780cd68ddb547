"""Motions as functions that JAX compiles, maps and differentiates in both modes; JAX is an optional package."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import name_dictionary
from liaisons.errors import ProjectError, SimulationError
from liaisons.library import Target
from liaisons_motion.derivatives import Motion, motion_of

if TYPE_CHECKING:
    from jax import Array


def motion(
    component: Any,
    times: ArrayLike,
    *,
    record: str | Iterable[str] | None = None,
    operators: Mapping[str, Target] | None = None,
    tolerance: float = 1e-10,
    **start_values: ArrayLike,
) -> Callable[[Mapping[str, ArrayLike]], dict[str, Array]]:
    """Return a function of JAX that takes values by name to the signals of a motion.

    ::

        swing = liaisons_motion.jax.motion("Pendulum", [0.0, 0.5, 1.0], theta_0=0.5)
        jax.grad(lambda values: swing(values)["theta"][-1])({"length": 1.2, "gravity": 9.81})

    ``jit``, ``grad``, ``jacfwd``, ``jacrev`` and ``vmap`` accept it; derivatives are of first order only.  The steps
    that are taken are differentiated: ``jacfwd`` costs one run with the derivatives with respect to all values,
    ``grad`` one run forwards and one backwards, ``jacrev`` such a pair for each number of the result.  ``vmap`` runs
    one case after the other, each with its own steps.

    :param component: its name, file or class; a model, system or FMU, as :func:`liaisons.sensitivities` takes.
    :param times: at which the signals are returned [s].
    :param record: an output or several.
    :param operators: active coordinate -> operator that moves it; its parameters are values, ``"length.amplitude"``.
    :param tolerance: of the steps, relative.
    :param start_values: numbers for what is not in the dictionary.
    :returns: function of a dictionary, name -> number, or array with the elements of the name; it returns a dictionary,
        signal -> array of shape (times,).
    :raises ProjectError: if JAX is missing.
    :raises SimulationError: by the function, where JAX calculates with 32 bits, or an array has too few elements; what
        the motion itself refuses JAX reports as ``JaxRuntimeError``, which ends in the same words.
    """
    try:
        from jax import numpy as jnp
    except ImportError:
        raise ProjectError("liaisons.jax needs JAX; pip install 'liaisons[jax]'") from None
    keywords = {"record": record, "operators": operators, "tolerance": tolerance, "start_values": start_values}

    @cache
    def prepare(names: tuple[str, ...]) -> tuple[Motion, Callable[[Array], Array]]:
        run = motion_of(component, names, times, **keywords)
        return run, _differentiable_signals(run)

    def signals_by_name(values: Mapping[str, ArrayLike]) -> dict[str, Array]:
        if jnp.result_type(float) != np.float64:
            raise SimulationError("a motion needs 64 bits; call jax.config.update('jax_enable_x64', True) before")
        names = tuple(sorted(name_dictionary("values", values)))  # as JAX orders a dictionary
        run, signals = prepare(names)
        numbers = jnp.concatenate([jnp.empty(0), *(jnp.ravel(jnp.asarray(values[name], float)) for name in names)])
        if len(numbers) != len(run.names):
            raise SimulationError(f"{len(numbers)} numbers for {', '.join(run.names)}; give one for each")
        return dict(zip(run.signals, signals(numbers), strict=True))

    return signals_by_name


def _differentiable_signals(run: Motion) -> Callable[[Array], Array]:
    """Function of JAX from values, (values,), to the signals of a motion, (signals, times)."""
    import jax

    shape, count = (len(run.signals), len(run.times)), len(run.names)

    def callback(function: Callable[..., Any], shape: tuple[int, ...], *arguments: Array) -> Array:
        return jax.pure_callback(function, jax.ShapeDtypeStruct(shape, float), *arguments, vmap_method="sequential")

    @jax.custom_jvp
    def signals(values: Array) -> Array:
        return callback(run, shape, values)

    def forward(values: Array, direction: Array) -> Array:
        # The Jacobian is calculated once for all directions that this is mapped over.
        return callback(lambda p: run.forward(p)[1], (*shape, count), values) @ direction

    def backward(values: Array, weights: Array) -> Array:
        return callback(lambda p, w: run.adjoint(p, w)[1], (count,), values, weights)

    @signals.defjvp
    def derivative(values: tuple[Array], direction: tuple[Array]) -> tuple[Array, Array]:
        (along,) = _linear_primitive().bind(*values, *direction, forward=forward, backward=backward, shape=shape)
        return signals(*values), along

    return signals


@cache
def _linear_primitive() -> Any:
    """Primitive of JAX: ``forward(values, direction)``, linear in the direction; ``backward`` is its transpose.

    JAX's own, ``linear_call``, has no rule for ``vmap``, which ``jacfwd`` needs.
    """
    from jax import vmap
    from jax.core import ShapedArray
    from jax.extend.core import Primitive
    from jax.interpreters import ad, batching, mlir

    def applied(*arguments: Array, forward: Callable[..., Array], **_: Any) -> list[Array]:
        return [forward(*arguments)]

    def mapped(arguments: Any, axes: Any, **parameters: Any) -> Any:
        return vmap(partial(applied, **parameters), in_axes=axes)(*arguments), [0]

    def transposed(weights: Any, values: Array, _: Any, *, backward: Callable[..., Array], **__: Any) -> list[Any]:
        return [None, backward(values, ad.instantiate_zeros(weights[0]))]

    primitive = Primitive("derivative_of_motion")
    primitive.multiple_results = True  # as lower_fun has it
    primitive.def_impl(applied)
    primitive.def_abstract_eval(lambda values, *_, shape, **__: [ShapedArray(shape, values.dtype)])
    mlir.register_lowering(primitive, mlir.lower_fun(applied))
    batching.primitive_batchers[primitive] = mapped
    ad.primitive_transposes[primitive] = transposed
    return primitive
