"""Live pages: an FMU's own C as WebAssembly in one HTML file."""

from liaisons_exchange.live.files import LivePage, default_page_path, write_live_page
from liaisons_exchange.live.page import live_page

__all__ = ["LivePage", "default_page_path", "live_page", "write_live_page"]
