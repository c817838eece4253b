"""The flow of segments with its derivatives, and the equations of periodic orbits."""
