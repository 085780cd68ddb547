"""Pictures drawn: their frames, and animations in files."""

from liaisons.pictures.animation import animate, motion_frames, motion_page
from liaisons.pictures.frames import picture_frames
from liaisons.pictures.inline import inlined_page
from liaisons.pictures.stage import Face, Stage

__all__ = ["Face", "Stage", "animate", "inlined_page", "motion_frames", "motion_page", "picture_frames"]
