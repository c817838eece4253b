"""Exploration of models with sliders and picking, in notebooks and HTML pages."""
