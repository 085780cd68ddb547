"""What a system consists of: FMUs, connections and sources in, a checked :class:`.simulation.Simulation` out."""
