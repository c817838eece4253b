"""The steps of a trajectory as polynomials, and their roots."""
