"""Files of robots, URDF and MJCF, as linkages."""

from liaisons_exchange.robot_files.linkages import linkage_of_file

__all__ = ["linkage_of_file"]
