"""Periodic orbits across interfaces: the flow with its derivatives, and what is built on it."""
