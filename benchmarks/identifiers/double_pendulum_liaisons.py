"""The double pendulum, by its name."""

from numpy.typing import NDArray

from liaisons import identify


def solve(times: NDArray, angles: NDArray, start: dict[str, float], noise: float) -> dict[str, float]:
    """Lengths, second mass, first angles."""
    data = {"time": times, "theta_1": angles[0], "theta_2": angles[1]}
    deviations = {"theta_1": noise, "theta_2": noise}
    return identify("DoublePendulum", data, unknown=[*start], noise=deviations, start_values=start).values
