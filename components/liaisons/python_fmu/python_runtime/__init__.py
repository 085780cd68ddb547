"""What runs inside a Python FMU: needs Python, numpy, casadi and the pythonfmu embedded in the FMU, not liaisons."""
