"""Simulations are run: a checked ``Simulation`` in, a ``Result`` with an estimate of its error out."""
