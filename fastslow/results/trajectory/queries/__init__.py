"""States of a trajectory by time, by value and by distance."""
