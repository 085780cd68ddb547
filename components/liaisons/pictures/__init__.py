"""What a mechanism looks like and how it moves: its picture, frames of it, and the files they go into."""

from liaisons.pictures.animation import Scene, animate, motion_frames, motion_page
from liaisons.pictures.declared import Picture, together

__all__ = ["Picture", "Scene", "animate", "motion_frames", "motion_page", "together"]
