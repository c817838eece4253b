"""Matplotlib figures of results, without a display and without global settings.

Every function takes a result and, by keyword:

``ax``
    Axes to draw into (three for `panel`). Otherwise a new figure outside pyplot is created,
    which a notebook displays and ``drawn.save("figure.pdf")`` writes. Limits and scales set
    on given axes are kept.
``width``
    Width of a new figure in print: ``"column"`` (85 mm), ``"page"`` (170 mm), or a number of
    millimetres. Text is 6 to 8 points high at that size.
``label``, ``legend``
    ``label=False`` omits all text within the axes and the legend; ``legend`` sets the legend
    alone. The legend is below the axes in a new figure and at a free position inside given
    axes; ``drawn.handles`` are the entries for a legend elsewhere.
``**style``
    Matplotlib properties of the lines or points:
    ``linewidth=0.5``, ``color="black"``.

Quantities on axes (``x``, ``y``, in space ``z``) are a name, a SymPy symbol or expression, an
expression as text such as ``"x**2 + v"``, or a function of the columns by name:
``lambda c: c["x"] ** 2``. With ``z``, or in axes with ``projection="3d"``, the view is in space.

The functions return a frozen `Drawing` with its axes, figure, lines, markers, labels and
legend; ``artists`` contains all of them, and ``data`` the plotted points by legend entry.
Labels do not overlap curves, markers or each other, and are placed again after a change of
the limits or the size of the figure.

PDF files embed their fonts (Type 42), and SVG files keep text as text. Colours are those of
Okabe and Ito (2008), areas also differ in lightness, and every kind of line or point also has
its own line style or marker.

Examples
--------
Two diagrams in one figure, 170 mm wide:

>>> import fastslow as fs
>>> model = fs.systems.van_der_pol()
>>> found = fs.continue_equilibria(model.frozen(), "w", over=(-2, 2))
>>> left, right = fs.plot.axes("ab", height=70)
>>> drawn = fs.plot.diagram(found, "x", ax=left)
>>> other = fs.plot.diagram(found, lambda c: c["x"] ** 2, ax=right, label=False)
>>> [line.get_label() for line in drawn.lines], other.legend
(['stable', 'unstable', 'stable'], None)
>>> drawn.data["HB Hopf"][0].round(6).tolist()
[[-1.0, -1.0], [1.0, 1.0]]
"""

from fastslow.plot.attraction import BasinDrawing, basins
from fastslow.plot.branches import DiagramDrawing, diagram
from fastslow.plot.delays import DelayDrawing, delay_scaling
from fastslow.plot.drawings import Drawing
from fastslow.plot.eigenvalues import EigenvalueDrawing, clarke_path, eigenvalue_path
from fastslow.plot.floquet import MultiplierDrawing, multipliers
from fastslow.plot.grids import GridDrawing, grid
from fastslow.plot.maps import MapDrawing, regime_map
from fastslow.plot.mosaics import axes
from fastslow.plot.motions import MotionDrawing, phase_portrait, time_series
from fastslow.plot.panels import PanelDrawing, panel
from fastslow.plot.passages import OverlayDrawing, overlay
from fastslow.plot.planes import PlaneDrawing, parameter_plane
from fastslow.plot.responses import ResponseDrawing, response
from fastslow.plot.sections import SectionDrawing, section
from fastslow.plot.slow_manifolds import FreezingDrawing, freezing
from fastslow.plot.spaces import SpaceDrawing
from fastslow.plot.spectra import SpectrumDrawing, spectrum
from fastslow.plot.sweeping import SweepDrawing, sweep
from fastslow.plot.tipping import tipping_map
from fastslow.plot.variance_shares import SobolDrawing, sobol

__all__ = [
    "BasinDrawing",
    "DelayDrawing",
    "DiagramDrawing",
    "Drawing",
    "EigenvalueDrawing",
    "FreezingDrawing",
    "GridDrawing",
    "MapDrawing",
    "MotionDrawing",
    "MultiplierDrawing",
    "OverlayDrawing",
    "PanelDrawing",
    "PlaneDrawing",
    "ResponseDrawing",
    "SectionDrawing",
    "SobolDrawing",
    "SpaceDrawing",
    "SpectrumDrawing",
    "SweepDrawing",
    "axes",
    "basins",
    "clarke_path",
    "delay_scaling",
    "diagram",
    "eigenvalue_path",
    "freezing",
    "grid",
    "multipliers",
    "overlay",
    "panel",
    "parameter_plane",
    "phase_portrait",
    "regime_map",
    "response",
    "section",
    "sobol",
    "spectrum",
    "sweep",
    "time_series",
    "tipping_map",
]


def __dir__() -> list[str]:
    return sorted(__all__)
