"""Boxes of a window: pruned, proved to contain a piece of curve, and linked to curves."""
