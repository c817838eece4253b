"""Equilibria at a value, boundary equilibria, and all branches of a frozen model."""
