"""What is drawn: curves, pictures and films of results, in files and notebooks."""

from liaisons_pages.pictures.animation import animate, last_image, motion_frames, motion_page
from liaisons_pages.pictures.figures import default_names, new_figure, plot, save_figure
from liaisons_pages.pictures.frames import picture_frames
from liaisons_pages.pictures.inline import inlined_page
from liaisons_pages.pictures.notebook import result_html, sandboxed_frame
from liaisons_pages.pictures.stage import Face, Stage

__all__ = [
    "Face",
    "Stage",
    "animate",
    "default_names",
    "inlined_page",
    "last_image",
    "motion_frames",
    "motion_page",
    "new_figure",
    "picture_frames",
    "plot",
    "result_html",
    "sandboxed_frame",
    "save_figure",
]
