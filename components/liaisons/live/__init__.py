"""Live pages: an FMU's own C as WebAssembly in one HTML file."""

from liaisons.live.page import live_page, write_live_page

__all__ = ["live_page", "write_live_page"]
