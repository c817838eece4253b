"""Numerical continuation of curves F(u) = 0, independent of any model."""
