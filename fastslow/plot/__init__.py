"""Figures from results: Matplotlib and results only, no display and no global settings."""

from fastslow.plot.branches import DiagramDrawing, diagram
from fastslow.plot.motions import MotionDrawing, phase_portrait, time_series
from fastslow.plot.panels import PanelDrawing, panel
from fastslow.plot.passages import OverlayDrawing, overlay
from fastslow.plot.style import Drawing

__all__ = [
    "DiagramDrawing",
    "Drawing",
    "MotionDrawing",
    "OverlayDrawing",
    "PanelDrawing",
    "diagram",
    "overlay",
    "panel",
    "phase_portrait",
    "time_series",
]
