"""The pendulum, by its name."""

from numpy.typing import NDArray

from liaisons import identify


def solve(times: NDArray, angles: NDArray, start: dict[str, float], noise: float) -> dict[str, float]:
    """Length, friction and first angle."""
    data = {"time": times, "theta": angles}
    return identify("Pendulum", data, unknown=[*start], noise={"theta": noise}, start_values=start).values
