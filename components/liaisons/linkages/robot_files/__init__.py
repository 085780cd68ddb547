"""Files of robots, URDF and MJCF, as declarations of a linkage."""
