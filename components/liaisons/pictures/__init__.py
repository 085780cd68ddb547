"""Pictures of mechanisms, their frames, and animations in files."""

from liaisons.pictures.animation import Scene, animate, motion_frames, motion_page
from liaisons.pictures.declared import Picture, combined_pictures

__all__ = ["Picture", "Scene", "animate", "combined_pictures", "motion_frames", "motion_page"]
