"""Motions: their derivatives, ensembles, plans, controllers and fits."""
