"""How far clocks of importers may be off."""

from __future__ import annotations

CLOCK_ERROR = 1e-6
"""Part of the sampling period by which clocks may miss a sample."""
