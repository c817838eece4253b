"""Adaptive maps of outcomes over a plane of two parameters."""
