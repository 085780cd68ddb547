"""A class of a robot's file, for ``Linkage.from_urdf`` and ``Linkage.from_mjcf``."""

from pathlib import Path
from typing import Any

from liaisons import Linkage
from liaisons.errors import ComponentError
from liaisons_exchange.robot_files.mjcf import read_mjcf
from liaisons_exchange.robot_files.robot import RobotOptions
from liaisons_exchange.robot_files.urdf import read_urdf

_READERS = {"urdf": read_urdf, "mjcf": read_mjcf}


def linkage_of_file(base: type[Linkage], kind: str, path: Path | str, **options: Any) -> type[Linkage]:
    """Subclass of a linkage with the bodies and joints of a file.

    :param kind: urdf or mjcf; ``options`` those of RobotOptions.
    :raises ComponentError: for a file that cannot be read, or a wrong body or joint in it.
    """
    robot = _READERS[kind](path, RobotOptions(**options))
    try:
        made: Any = type(base)
        return made(robot.name, (base,), robot.class_members())
    except ComponentError as error:
        raise ComponentError(robot.located(str(error))) from None
