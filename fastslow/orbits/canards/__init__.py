"""Canards: trajectories that follow a repelling sheet of the critical manifold."""
