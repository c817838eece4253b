"""Points proved in ball arithmetic, and the list of those that a diagram lacks."""
