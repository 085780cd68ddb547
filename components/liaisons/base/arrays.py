"""Types of arrays, indices, and blocks of columns."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
"""An array of real numbers, of any shape."""


def as_indices(integers: object) -> NDArray[np.intp]:
    """Integers as an array of indices."""
    return np.array(integers, dtype=np.intp)


def lane_blocks(rows: Floats, width: int) -> Floats:
    """Blocks of ``width`` columns each, (blocks, rows, width), the last one padded with the last column."""
    blocks = -(-rows.shape[1] // width)
    padded = np.hstack([rows, np.repeat(rows[:, -1:], blocks * width - rows.shape[1], axis=1)])
    return np.ascontiguousarray(padded.reshape(len(rows), blocks, width).swapaxes(0, 1))


def rows_of_blocks(blocks: Floats, count: int) -> Floats:
    """Array (..., rows, count) of the first ``count`` columns in blocks (..., blocks, rows, width)."""
    rows = blocks.swapaxes(-3, -2)
    return rows.reshape(*rows.shape[:-2], blocks.shape[-3] * blocks.shape[-1])[..., :count]
