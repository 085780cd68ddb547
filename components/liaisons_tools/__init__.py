"""The commands, sweeps and the runner of scenarios."""
