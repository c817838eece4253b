"""Bounds of eigenvalues, and stability along proved curves."""
