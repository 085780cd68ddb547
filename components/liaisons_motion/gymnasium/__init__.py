"""Environments of Gymnasium, an optional package: mechanisms and systems to be learned.

The import registers those of ``tasks.toml``: ``gymnasium.make("liaisons/SwingUp-v0")``.
"""

import tomllib
from importlib.resources import files

from liaisons.errors import ProjectError

try:
    from gymnasium import register
except ImportError:
    raise ProjectError("liaisons.gymnasium needs Gymnasium; pip install 'liaisons[gymnasium]'") from None

from liaisons_motion.gymnasium.environment import Environment
from liaisons_motion.gymnasium.task import Task
from liaisons_motion.gymnasium.vector import VectorEnvironment

__all__ = ["Environment", "Task", "VectorEnvironment"]

for _name, _settings in tomllib.loads(files(__name__).joinpath("tasks.toml").read_text("utf-8")).items():
    register(
        f"liaisons/{_name}-v0",
        f"{__name__}:Environment",
        vector_entry_point=f"{__name__}:VectorEnvironment",
        kwargs=_settings,
    )
