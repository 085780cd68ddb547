"""Live pages: an FMU's own C as WebAssembly in one HTML file."""

from liaisons.live.files import LivePage, show
from liaisons.live.page import live_page

__all__ = ["LivePage", "live_page", "show"]
