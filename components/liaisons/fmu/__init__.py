"""Equations -> .fmu: generated C with a small runtime, or pythonfmu with CasADi at run time."""

from liaisons.base.renamed import rename
from liaisons.fmu.building import build
from liaisons.fmu.calls import Call
from liaisons.fmu.code import Core
from liaisons.fmu.dependencies import coupled_state_count, energy_accounts
from liaisons.fmu.description import SELDOM_RUN, model_description
from liaisons.fmu.extras import extra_members
from liaisons.fmu.jumps import jump_effects
from liaisons.fmu.layout import first_reference, index_ranges, memory_index, start_rates, start_vectors
from liaisons.fmu.markup import document, element
from liaisons.fmu.origin import is_of_catalogue

__all__ = [
    "SELDOM_RUN",
    "Call",
    "Core",
    "build",
    "coupled_state_count",
    "document",
    "element",
    "energy_accounts",
    "extra_members",
    "first_reference",
    "index_ranges",
    "is_of_catalogue",
    "jump_effects",
    "memory_index",
    "model_description",
    "start_rates",
    "start_vectors",
]

rename(f"{__name__}.loops", "liaisons.chains.loops")
