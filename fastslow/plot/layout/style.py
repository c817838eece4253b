"""Colours, line styles and markers of all figures, new figures and axes, and saving."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backend_bases import get_registered_canvas_class
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.legend import Legend
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator

from fastslow.arguments import word
from fastslow.disk import write_file
from fastslow.errors import ArgumentError, unknown_name
from fastslow.plot.layout.typesetting import plain
from fastslow.results.point_types import POINT_TYPES

# M. Okabe and K. Ito, Color Universal Design, 2008
BLACK, ORANGE, GREEN = "#000000", "#E69F00", "#009E73"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY, DARK = "#8A8A8A", "#5A5A5A"

BRANCH, MOTION, CYCLES = BLACK, BLUE, GREEN

#: Line style and width of a branch by stability; virtual branches are faint and dotted.
LINES: dict[str, dict[str, Any]] = {
    "stable": {"linestyle": "-", "linewidth": 1.5},
    "unstable": {"linestyle": (0, (3.5, 1.8)), "linewidth": 1.2},
    "neutral": {"linestyle": (0, (5, 1.5, 1, 1.5)), "linewidth": 0.9},
    "undecided": {"linestyle": (0, (1, 1)), "linewidth": 1.5},
    "virtual": {"linestyle": (0, (1, 1.6)), "linewidth": 0.9, "alpha": 0.45},
}

#: Line of an interface.
INTERFACE: dict[str, Any] = {
    "color": GREY,
    "linewidth": 0.5,
    "zorder": 1,
    "label": "_interface",
}

#: Sign between the regions beside a sliding motion.
SLIDING_SIGN = "|"

#: Line of sliding along a discontinuity, of trajectories and of equilibria: a double line.
SLIDING: dict[str, Any] = {
    "linewidth": 2.2,
    "path_effects": [Normal(), Stroke(linewidth=0.9, foreground="white")],
}

#: Name of the stability of a pseudo-equilibrium, after that of an equilibrium.
PSEUDO = " pseudo-equilibrium"

#: Looks of branches of equilibria by stability, pseudo-equilibria included.
EQUILIBRIA = {**LINES, **{kind + PSEUDO: {**look, **SLIDING} for kind, look in LINES.items()}}

#: The palette by the names used in `fastslow.results.point_types`.
COLOURS = {
    "black": BLACK,
    "orange": ORANGE,
    "green": GREEN,
    "blue": BLUE,
    "vermilion": VERMILION,
    "purple": PURPLE,
    "grey": GREY,
}

#: Markers without a face.
STROKES = "x|+1234"

#: Markers of the second and further marks of a figure: stars with different numbers of rays.
FURTHER_MARKS = ((6, 2, 0), (3, 2, 0), (5, 2, 0), (8, 2, 0), (3, 2, 180))

#: Line style of virtual arcs of a curve of special points.
VIRTUAL_CURVE: dict[str, Any] = {"linestyle": (0, (1, 1.6)), "linewidth": 0.9, "alpha": 0.6}

#: Line style of Hopf curves by criticality.
HOPF_CURVES: dict[str, dict[str, Any]] = {
    "supercritical": {"linestyle": "-"},
    "subcritical": {"linestyle": (0, (3, 1.5))},
}

#: Marker, colour and legend text of a transition by kind.
TRANSITIONS: dict[str, tuple[str, str, str]] = {
    "jump": ("*", VERMILION, "jump at a fold"),
    "Hopf": ("P", GREEN, "delayed exit past Hopf"),
    "branch point": ("^", GREEN, "delayed exit past BP"),
    "period doubling": ("<", PURPLE, "delayed exit past PD"),
    "torus": ("H", GREEN, "delayed exit past TR"),
    "crossing": ("D", ORANGE, "passage through BE"),
    "gap crossing": (">", PURPLE, "gap crossing"),
    "switch": ("8", PURPLE, "change of a switch"),
    "steep": ("X", BLACK, "steep slope"),
    "rate-induced": ("o", VERMILION, "rate-induced tipping"),
    "grazing": ("h", ORANGE, "grazing"),
    "end of oscillation": ("v", VERMILION, "end of oscillation"),
    "excursion": ("p", GREY, "excursion"),
    "loss of tracking": ("s", GREY, "loss of tracking"),
    "unclassified": ("d", GREY, "unclassified transition"),
}

#: Properties of the phases of a motion by kind.
PHASES: dict[str, dict[str, Any]] = {
    "quasi-static": {"facecolor": "#B4E0CC"},
    "oscillating": {"facecolor": "#EBBC72"},
    "jump": {"facecolor": VERMILION},
    "gap crossing": {"facecolor": PURPLE},
    "excursion": {"facecolor": ORANGE},
    "transient": {"facecolor": "#EBEBEB"},
    "sticking": {"facecolor": "#727272"},
    "outside": {"facecolor": "white", "hatch": "/////", "edgecolor": GREY},
}

#: Phases whose name is drawn in white.
WHITE_WORDS = ("sticking",)

#: Light fills of the regions, cyclically.
BANDS = ("#D6E7F4", "#FFFFFF", "#FEF0D8")

#: Dots per inch on screen.
SCREEN_DPI = 150

MM = 1 / 25.4
COLUMN, FULL = 85 * MM, 170 * MM
TEXT, SMALL_TEXT = 8.0, 7.0

#: Widths of figures by name, in millimetres.
WIDTHS = {"column": 85.0, "page": 170.0}


class OwnFigure(Figure):
    """A figure of the package.

    Attributes
    ----------
    shared : tuple of Artist
        Entries of the legend below all axes.
    shared_legend : Legend or None
    """

    shared: tuple[Artist, ...] = ()
    shared_legend: Legend | None = None


def new_figure(width: float, height: float) -> Figure:
    """Create an empty figure outside pyplot, with a size in inches."""
    figure = OwnFigure(figsize=(width, height), dpi=SCREEN_DPI, layout="constrained")
    # one renderer for all texts; a bare figure would create one for each
    FigureCanvasAgg(figure)
    return figure


def styled_axes(ax: Axes) -> Axes:
    """Apply the style of new figures to axes: small text, thin frame."""
    ax.tick_params(labelsize=SMALL_TEXT, width=0.6, length=2.5)
    ax.xaxis.label.set_fontsize(TEXT)
    ax.yaxis.label.set_fontsize(TEXT)
    for axis in (ax.xaxis, ax.yaxis):
        axis.get_offset_text().set_fontsize(SMALL_TEXT)
    for spine in ax.spines.values():
        spine.set_linewidth(0.6)
    return ax


def inches(width: str | float) -> float:
    """Convert the width of a figure to inches.

    Parameters
    ----------
    width : str or float
        ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.

    Raises
    ------
    UnknownNameError
        For an unknown name.
    ArgumentError
        For a width outside of 30 to 2000 mm.

    Examples
    --------
    >>> round(inches("page"), 3), inches(127)
    (6.693, 5.0)
    """
    if isinstance(width, str):
        if width not in WIDTHS:
            raise unknown_name("width", width, WIDTHS)
        return WIDTHS[width] * MM
    if not 30.0 <= width <= 2000.0:
        raise ArgumentError(
            f'width = {width!r}; expected "column", "page", or 30 to 2000 (millimetres)'
        )
    return float(width) * MM


def axes_for(
    ax: Axes | None, width: str | float = "column", height: float = 64.0, space: bool = False
) -> Any:
    """Return the given axes, or new ones.

    Parameters
    ----------
    ax : Axes or None
    width : str or float
        Width of a new figure, as for `inches`.
    height : float
        Height in millimetres at the width of a column; wider figures are somewhat higher.
    space : bool
        Whether new axes are in space.

    Returns
    -------
    Axes
        Typed loosely, since Matplotlib does not type axes in space.
    """
    if ax is not None:
        return ax
    across = inches(width)
    figure = new_figure(across, height * MM * (across / COLUMN) ** 0.4)
    if space:
        return figure.add_subplot(projection="3d")
    axes = styled_axes(figure.add_subplot())
    axes.locator_params(axis="x", nbins=6 if across < 1.5 * COLUMN else 10)
    return axes


def spatial(function: str, ax: Axes | None, z: object) -> bool:
    """Return whether to draw in space.

    Raises
    ------
    ArgumentError
        For a third quantity with axes of the plane.
    """
    given = ax is not None and ax.name == "3d"
    if z is not None and ax is not None and not given:
        raise ArgumentError(f'{function}: z in space needs axes with projection="3d"')
    return given or z is not None


def point_colour(code: str) -> str:
    """Colour of special points of a code and of their curves."""
    return COLOURS[POINT_TYPES[code].colour]


def curve_look(code: str) -> dict[str, Any]:
    """Properties of the line of a curve of special points."""
    line = POINT_TYPES[code].line
    assert line is not None
    return {"color": point_colour(code), "linestyle": line[0], "linewidth": line[1]}


def dot_look(code: str, size: float = 4.5, *, number: int = 0) -> dict[str, Any]:
    """Properties of the marker of a special point.

    ``number`` counts the entries of a legend with the same code, as of several marks.
    """
    marker, colour = POINT_TYPES[code].marker, point_colour(code)
    stroke, letter = number > 0 or marker in STROKES, marker.startswith("$")
    thin = number == 0 and marker in "1234"  # three strokes, hardly seen on a curve
    return {
        "linestyle": "none",
        "marker": FURTHER_MARKS[(number - 1) % len(FURTHER_MARKS)] if number else marker,
        "markersize": size + (3.0 if thin else 2.0 if letter else 1.0 if marker in "dph" else 0.0),
        "markerfacecolor": colour,
        "markeredgecolor": colour if stroke or letter else "white",
        "markeredgewidth": 1.5 if thin else 0.9 if stroke else 0.2 if letter else 0.5,
    }


def widen_limits(ax: Axes) -> None:
    """Widen limits that would otherwise magnify rounding errors of nearly equal values.

    Limits set by hand are kept.
    """
    box = ax.dataLim
    limits: list[Any] = [
        (box.intervalx, ax.set_xlim, ax.get_autoscalex_on()),
        (box.intervaly, ax.set_ylim, ax.get_autoscaley_on()),
    ]
    sizes = [max(abs(low), abs(high)) for (low, high), *_ in limits]
    if not max(sizes) < float("inf"):
        return
    for ((low, high), set_limits, automatic), size in zip(limits, sizes, strict=True):
        if not automatic:
            continue
        if size <= 1e-12 * max(sizes):  # rounding errors of zero
            size = max(sizes)
        if size > 0.0 and high - low <= 1e-6 * size:
            middle = 0.5 * (low + high)
            set_limits(middle - 0.1 * size, middle + 0.1 * size)


def keep_tick_count(axis: Axis) -> None:
    """Keep the largest number of ticks of an axis with automatic ones.

    It depends on the length of the axis, and the layout on a label at the end: with 1250 there
    the axis would be shorter, so that there were no 1250, and again longer.

    Examples
    --------
    >>> ax = axes_for(None, 85)
    >>> keep_tick_count(ax.xaxis)
    >>> len(ax.get_xticks()) <= ax.xaxis.get_tick_space() + 2
    True
    """
    locator = axis.get_major_locator()
    if isinstance(locator, MaxNLocator):
        locator.set_params(nbins=max(axis.get_tick_space(), 1))


#: Fraction of the width of axes for the lines of a note: the layout may still reduce the axes.
NOTE = 0.75

#: Mean width of a letter relative to its height.
LETTER = 0.52


def note_early_end(ax: Axes, why: str, top: float = 1.0) -> None:
    """Annotate axes with the reason for an early end of a run, if any; arguments as for `note`.

    Examples
    --------
    >>> ax = axes_for(None, 85)
    >>> note_early_end(ax, "too many steps")
    >>> ax.texts[0].get_text()
    'run ended early: too many steps'
    """
    note(ax, f"run ended early: {why}" if why else "", top)


def note(ax: Axes, words: str, top: float = 1.0) -> None:
    """Write a note at the top of axes, in lines that fit, unless it is empty.

    The note takes no part in the layout, in which its width would reduce that of the axes.

    Parameters
    ----------
    ax : Axes
    words : str
    top : float
        Height below which it is written, as a fraction of that of the axes.

    Examples
    --------
    >>> ax = axes_for(None, 85)
    >>> note(ax, "outside the diagram")
    >>> ax.texts[0].get_text()
    'outside the diagram'
    """
    if words:
        size = float(FontProperties(size="small").get_size_in_points())
        width = ax.get_window_extent().width * 72.0 / root(ax).dpi
        letters = max(int(NOTE * width / (LETTER * size)), 8)
        ax.annotate(
            "\n".join(map(plain, textwrap.wrap(words, letters))),
            (0.02, top - 0.02),
            xycoords="axes fraction",
            ha="left",
            va="top",
            fontsize="small",
            color=VERMILION,
            in_layout=False,
        )


def root(ax: Axes) -> Figure:
    """The outermost figure of axes."""
    figure = ax.get_figure(root=True)
    if figure is None:
        raise ValueError("these axes were removed from their figure")
    return figure


def save(figure: Figure, path: str | Path, dpi: float = 300) -> Path:
    """Save a figure with embedded, editable fonts."""
    target = Path(path)
    ending = target.suffix.removeprefix(".").lower()
    word("figure format", sorted(figure.canvas.get_supported_filetypes()))("path", ending)
    write_file(target, rendered(figure, ending, dpi))
    return target


def rendered(figure: Figure, ending: str, dpi: float) -> bytes:
    """Render a figure in a format, with a single layout and a single draw."""
    stream = BytesIO()
    # Matplotlib 3.11 takes the number of characters of a PDF font from the "ps" entry
    fonts = rc_context({"pdf.fonttype": 42, "ps.fonttype": 42, "svg.fonttype": "none"})
    with fonts, _layout_fixed(figure, ending, dpi):
        figure.savefig(stream, format=ending, dpi=dpi)
    return stream.getvalue()


@contextmanager
def _layout_fixed(figure: Figure, ending: str, dpi: float) -> Iterator[None]:
    """Run the layout of a figure for a format once, and disable it meanwhile.

    Matplotlib would otherwise draw the figure twice, the first time for the layout alone.
    """
    engine, canvas, resolution = figure.get_layout_engine(), figure.canvas, figure.dpi
    # the canvas of a high-resolution screen has scaled the figure already
    if engine is None or not figure.axes or canvas.device_pixel_ratio != 1:
        yield
        return
    try:
        # its own canvas, where that can write the format, measures each text once
        own = hasattr(canvas, f"print_{ending}")
        for_it: Any = canvas if own else get_registered_canvas_class(ending)(figure)
        figure.dpi = for_it.fixed_dpi or dpi
        engine.execute(figure)
    finally:
        figure.dpi = resolution
        figure.set_canvas(canvas)
    figure.set_layout_engine(None)
    try:
        yield
    finally:
        figure.set_layout_engine(engine)
