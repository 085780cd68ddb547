"""Simulations are run: a checked ``Simulation`` in, a ``Result`` out."""
