"""The twelve tasks of the referee: a file each, and one in MJCF."""

from importlib import import_module

from referee.task import Task

NAMES = "pumped_length sudden_crouch moving_pivot kapitza hoop four_bar slewing_crane belt satellite cat resonance"
TASKS: tuple[Task, ...] = tuple(import_module(f"referee.tasks.{name}").TASK for name in [*NAMES.split(), "shaken_ball"])
