"""Shared by all layers: arguments, files, folders, processes, compilers, units, names of elements and of ports."""
