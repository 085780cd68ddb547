"""Pictures of mechanisms, their frames, and animations in files."""

from liaisons.pictures.animation import Scene, animate, motion_frames, motion_page
from liaisons.pictures.declared import Picture, together

__all__ = ["Picture", "Scene", "animate", "motion_frames", "motion_page", "together"]
