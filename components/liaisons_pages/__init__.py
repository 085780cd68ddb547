"""Formulas, pictures and both texts."""
