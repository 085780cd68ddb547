"""The twelve tasks of the referee, a file each."""

from referee.task import Task
from referee.tasks import (
    belt,
    cat,
    four_bar,
    hoop,
    kapitza,
    moving_pivot,
    pumped_length,
    resonance,
    satellite,
    shaken_ball,
    slewing_crane,
    sudden_crouch,
)

TASKS: tuple[Task, ...] = tuple(
    module.TASK
    for module in (
        pumped_length,
        sudden_crouch,
        moving_pivot,
        kapitza,
        hoop,
        four_bar,
        slewing_crane,
        belt,
        satellite,
        cat,
        resonance,
        shaken_ball,
    )
)
