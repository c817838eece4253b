"""Slow passage: a trajectory measured against an equilibrium diagram."""
