"""Chains of equal links: described by one of them, solved for all at a cost linear in their number.

With this package loaded, :func:`liaisons.mechanics.assemble` takes subclasses of Chain.
"""

from liaisons.chains.assembly import model_of
from liaisons.chains.chain import Chain
from liaisons.chains.sweeps import ChainLink, link_of
from liaisons.mechanics import assemble_by

__all__ = ["Chain", "ChainLink", "link_of"]

assemble_by(Chain, model_of)
