"""Ends of branches of cycles near equilibria: homoclinic orbits and slow points."""
