"""Branches of periodic orbits, across changes of their itinerary."""
