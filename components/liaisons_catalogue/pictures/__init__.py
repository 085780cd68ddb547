"""Pictures that take more than a few lines, in files called as their components."""
