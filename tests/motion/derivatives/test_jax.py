"""Motions as JAX and PyTorch take them: their transformations against differences, `gradient` and runs one by one."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liaisons_motion.jax
from liaisons import LiaisonsError, assemble
from liaisons.models import PendulumChain
from liaisons_motion.derivatives import DifferentiableMotion, motion_of

TIMES = np.linspace(0, 2, 5)
HOWTO = Path(__file__).parents[3] / "docs/howto/jax-and-pytorch.md"
CASES: dict[str, tuple[Any, dict[str, Any], dict[str, Any]]] = {
    "parameters": ("Pendulum", {"length": 1.2, "gravity": 9.81, "theta_0": 1.5}, {"friction": 0.1}),
    "start values that are arrays": (
        assemble(PendulumChain, 3),
        {"theta_0": [0.5, -0.4, 0.3], "theta_dot_0": [0.0, 1.0, 0.0], "gravity": 9.0},
        {"record": ["theta", "energy"]},
    ),
    "an operator": (
        "Pendulum",
        {"length.amplitude": 0.1, "length.offset": 1.0},
        {"operators": {"length": "Sinusoid"}, "theta_0": 0.3},
    ),
}


@pytest.fixture
def jax() -> Iterator[Any]:
    package = pytest.importorskip("jax")
    with package.enable_x64(True):
        yield package


@pytest.mark.parametrize(("component", "values", "keywords"), CASES.values(), ids=CASES)
def test_both_modes_agree_with_differences(jax, component, values, keywords) -> None:
    test_util = pytest.importorskip("jax.test_util")
    values = {name: np.asarray(value, float) for name, value in values.items()}
    motion = liaisons_motion.jax.motion(component, TIMES, **keywords)
    for function in (motion, jax.jit(motion)):
        test_util.check_grads(function, (values,), order=1, modes=("fwd", "rev"))


def test_mapped_and_compiled_is_one_by_one(jax) -> None:
    motion = liaisons_motion.jax.motion("Pendulum", TIMES, record="theta", theta_0=1.0)
    lengths = np.array([0.5, 1.0, 2.0])
    together = jax.jit(jax.vmap(jax.jacfwd(motion), in_axes=({"length": 0, "gravity": None},)))
    slopes = together({"length": lengths, "gravity": 9.81})["theta"]
    for length, by_length, by_gravity in zip(lengths, slopes["length"], slopes["gravity"], strict=True):
        alone = jax.jacrev(motion)({"length": length, "gravity": 9.81})["theta"]
        # The adjoint sums what the forward mode sums in another order.
        np.testing.assert_allclose(by_length, alone["length"], rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(by_gravity, alone["gravity"], rtol=1e-11, atol=1e-11)


def test_forward_takes_one_run_and_reverse_one_adjoint(jax, monkeypatch) -> None:
    calls: list[str] = []
    for name in ("forward", "adjoint"):
        method = getattr(DifferentiableMotion, name)
        monkeypatch.setattr(
            DifferentiableMotion, name, lambda *args, name=name, method=method: calls.append(name) or method(*args)
        )
    motion = liaisons_motion.jax.motion(assemble(PendulumChain, 4), TIMES, record="theta")
    start = {"theta_0": np.linspace(0.1, 0.4, 4)}
    jax.jacfwd(motion)(start)
    assert calls == ["forward"]
    calls.clear()
    jax.grad(lambda values: motion(values)["theta[4]"][-1])(start)
    assert calls == ["adjoint"]


@pytest.mark.usefixtures("jax")
def test_without_values_it_is_the_motion_as_declared() -> None:
    run = motion_of("Pendulum", "theta_0", TIMES, record="theta")
    signals = liaisons_motion.jax.motion("Pendulum", TIMES, record="theta")({})
    np.testing.assert_array_equal(signals["theta"], run(run.values)[0])


def test_32_bits_are_refused(jax) -> None:
    motion = liaisons_motion.jax.motion("Pendulum", TIMES)
    with jax.enable_x64(False), pytest.raises(LiaisonsError, match=r"64 bits; call jax\.config\.update"):
        motion({"theta_0": 1.0})


def test_bad_values_are_refused(jax) -> None:
    motion = liaisons_motion.jax.motion("Pendulum", TIMES)
    with pytest.raises(LiaisonsError, match="theta_0"):
        motion({"theta_O": 1.0})
    with pytest.raises(LiaisonsError, match=r"^2 numbers for theta_0; give one for each$"):
        motion({"theta_0": np.ones(2)})
    with pytest.raises(jax.errors.JaxRuntimeError, match=r"Pendulum: theta_0 = nan: must be finite"):
        motion({"theta_0": np.nan})
    with pytest.raises(LiaisonsError, match="dictionary"):
        motion(1.0)  # type: ignore[arg-type]


def test_without_jax_an_error_says_what_to_install(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(LiaisonsError, match=r"pip install 'liaisons\[jax\]'"):
        liaisons_motion.jax.motion("Pendulum", TIMES)


def test_pytorch_as_the_page_has_it() -> None:
    torch = pytest.importorskip("torch")
    (block,) = re.findall(r"```python\n(.*?)```", HOWTO.read_text(encoding="utf-8"), re.DOTALL)
    names: dict[str, Any] = {}
    exec(block, names)
    assert torch.autograd.gradcheck(lambda values: names["Motion"].apply(values, names["motion"]), names["values"])
