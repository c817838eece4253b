"""Computation of a periodic orbit from a guess, a run or a special point."""
