"""Figures from results: Matplotlib and results only, no display and no global settings.

Every function takes a result, and by name:

``ax``
    Axes to draw into (a `panel` takes three). Without them a figure of its own is made,
    outside pyplot, which a notebook shows and ``drawn.save("figure.pdf")`` writes. Limits
    and scales that were set on given axes before are kept.
``width``
    Of a new figure, as it will stand in print: ``"column"`` (85 mm), ``"page"`` (170 mm),
    or a number of millimetres. Text is 6 to 8 points high at that size.
``label``, ``legend``
    ``label=False`` leaves out every text within the axes and the legend; ``legend=True`` or
    ``False`` decides about the legend alone. A legend stands below the axes of a figure of
    its own, inside given axes where it covers nothing; ``drawn.handles`` serves for one
    that stands elsewhere.
``**style``
    Properties of the lines or points drawn, by their names in Matplotlib:
    ``linewidth=0.5``, ``color="black"``.

Axes of curves (``x``, ``y``, in space ``z``) take a name, a SymPy symbol or expression, an
expression as text such as ``"x**2 + v"``, or a function that is given the columns by name:
``lambda c: c["x"] ** 2``. With ``z``, or in axes with ``projection="3d"``, the view is in space.

What is returned is a frozen `Drawing`: its axes, its figure, its lines, markers, labels and
legend by name, all of them as ``artists``, and in ``data`` the points drawn, by what the
legend calls them. Labels keep off curves, markers and each other, also after the limits or
the size of the figure have been changed.

Files in PDF embed their fonts (Type 42), SVG keeps text as text. Colours are those of Okabe
and Ito (2008), areas differ in lightness too, and every kind of line or point also has a
line style or a marker of its own.

Examples
--------
Two figures in one, 170 mm wide:

>>> import fastslow as fs
>>> from matplotlib.figure import Figure
>>> model = fs.systems.van_der_pol()
>>> found = fs.continue_equilibria(model.frozen(), "w", over=(-2, 2))
>>> figure = Figure(figsize=(170 / 25.4, 70 / 25.4), layout="constrained")
>>> left, right = figure.subplots(1, 2)
>>> drawn = fs.plot.diagram(found, "x", ax=left)
>>> other = fs.plot.diagram(found, lambda c: c["x"] ** 2, ax=right, label=False)
>>> [line.get_label() for line in drawn.lines], other.legend
(['stable', 'unstable', 'stable'], None)
>>> drawn.data["HB Hopf"][0].round(6).tolist()
[[-1.0, -1.0], [1.0, 1.0]]
"""

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
