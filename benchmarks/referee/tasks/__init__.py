"""The twelve tasks of the referee: each mechanism is a file, each task another in MJCF and in Modelica."""

from referee.task import Task
from referee.tasks import belt, cat, four_bar, hoop, pendulums, resonance, satellite, shaken_ball, slewing_crane

TASKS: tuple[Task, ...] = (
    *pendulums.TASKS,
    *(file.TASK for file in (hoop, four_bar, slewing_crane, belt, satellite, cat, resonance, shaken_ball)),
)
