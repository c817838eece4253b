"""Figures from results: Matplotlib and results only, no display and no global settings."""

from fastslow.plot.branches import DiagramDrawing, diagram
from fastslow.plot.delays import DelayDrawing, delay_scaling
from fastslow.plot.drawings import Drawing
from fastslow.plot.eigenvalues import EigenvalueDrawing, clarke_path, eigenvalue_path
from fastslow.plot.maps import MapDrawing, regime_map
from fastslow.plot.motions import MotionDrawing, phase_portrait, time_series
from fastslow.plot.panels import PanelDrawing, panel
from fastslow.plot.passages import OverlayDrawing, overlay
from fastslow.plot.planes import PlaneDrawing, parameter_plane
from fastslow.plot.sections import SectionDrawing, section
from fastslow.plot.spaces import SpaceDrawing
from fastslow.plot.spectra import SpectrumDrawing, spectrum
from fastslow.plot.sweeping import SweepDrawing, sweep

__all__ = [
    "DelayDrawing",
    "DiagramDrawing",
    "Drawing",
    "EigenvalueDrawing",
    "MapDrawing",
    "MotionDrawing",
    "OverlayDrawing",
    "PanelDrawing",
    "PlaneDrawing",
    "SectionDrawing",
    "SpaceDrawing",
    "SpectrumDrawing",
    "SweepDrawing",
    "clarke_path",
    "delay_scaling",
    "diagram",
    "eigenvalue_path",
    "overlay",
    "panel",
    "parameter_plane",
    "phase_portrait",
    "regime_map",
    "section",
    "spectrum",
    "sweep",
    "time_series",
]
