"""Equilibria and bifurcation diagrams of frozen models."""
