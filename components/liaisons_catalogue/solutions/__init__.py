"""Differential equations with a known solution, in NumPy and SciPy alone: what the catalogue is checked against."""
