"""What a file says of an FMU: archive and modelDescription.xml in, :class:`.fmu.Fmu` and checked start values out."""
