"""Chains of equal links: described by one of them, solved for all at a cost linear in their number."""
