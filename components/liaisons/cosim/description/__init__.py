"""What a file says about an FMU: archive in, :class:`.fmu.Fmu` and checked start values out."""
