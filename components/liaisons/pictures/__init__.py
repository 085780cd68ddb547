"""What is drawn: curves, pictures and films of results, in files and notebooks."""

from liaisons.pictures.animation import animate, last_image, motion_frames, motion_page
from liaisons.pictures.figures import default_names, new_figure, plot, save_figure
from liaisons.pictures.frames import picture_frames
from liaisons.pictures.inline import inlined_page
from liaisons.pictures.notebook import result_html, sandboxed_frame
from liaisons.pictures.stage import Face, Stage

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
