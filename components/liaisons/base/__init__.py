"""What every layer uses: arguments, files, folders, processes, compilers, units, names of elements and of ports."""
