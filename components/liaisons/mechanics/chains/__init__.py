"""Chains of equal links: described by one of them, solved for all at a cost linear in their number."""

from liaisons.mechanics.chains.chain import Chain

__all__ = ["Chain"]
