"""Both texts, Kneller's and Marle's, number by number: what each says, where it lives, what verifies it."""

from liaisons_pages.companion.numbers import CITATION, completions, entries_of, is_text_number, search_entries
from liaisons_pages.companion.table import TITLES, Entry, TextSection, entries, sections
from liaisons_pages.companion.unicode import unicode_text

__all__ = [
    "CITATION",
    "TITLES",
    "Entry",
    "TextSection",
    "completions",
    "entries",
    "entries_of",
    "is_text_number",
    "search_entries",
    "sections",
    "unicode_text",
]
