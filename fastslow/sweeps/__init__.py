"""Many points of a parameter plane, of which only those are computed that matter."""
