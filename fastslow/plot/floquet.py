"""Floquet multipliers in the complex plane, of one periodic orbit or along a branch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from numpy.typing import NDArray

from fastslow.arguments import flag, instance, validated
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.eigenvalues import colour_bar, coloured, matched, through_collisions
from fastslow.plot.layout.labels import label_of, place, tag
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import BLACK, BLUE, GREEN, GREY, VERMILION, axes_for, dot_look
from fastslow.plot.layout.typesetting import plain, typeset
from fastslow.results.orbits.orbit import NEUTRAL_MULTIPLIER, Orbit
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.point_types import POINT_TYPES

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Multipliers of an orbit below this modulus are labelled with it.
LABELLED_MODULUS = 0.03

#: Marker and colour of the multipliers of one orbit.
KINDS = {
    "inside the unit circle": ("o", BLUE),
    "on the unit circle": ("D", GREEN),
    "outside the unit circle": ("s", VERMILION),
}

#: Largest difference of |log |μ|| between critical multipliers at a special point.
CRITICAL_LOG = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class MultiplierDrawing(Drawing):
    """Drawn Floquet multipliers.

    Parameters
    ----------
    ax : Axes
    circle : Line2D
        The unit circle; the line |μ| = 1 with ``log``.
    paths : tuple of LineCollection
        Of a branch, coloured by the parameter; interrupted where the itinerary changes.
    jumps : tuple of Line2D
        Segments between the multipliers of one itinerary and those of the next.
    points : tuple of Line2D
        Multipliers of a single orbit, those that are exactly 0, and the trivial one.
    markers : tuple of Line2D
        One for each code of special points.
    labels : tuple of Annotation
    bar : Colorbar or None
    legend : Legend or None
    """

    circle: Line2D
    paths: tuple[LineCollection, ...]
    jumps: tuple[Line2D, ...]
    points: tuple[Line2D, ...]
    markers: tuple[Line2D, ...]
    labels: tuple[Annotation, ...]
    bar: Colorbar | None = None
    legend: Legend | None = None

    @property
    def handles(self) -> list[Artist]:
        """Legend entries: each kind once."""
        return [self.circle, *self.points, *self.jumps[:1], *self.markers]


@validated(
    source=instance(Orbit, OrbitBranch),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    log=flag,
    style=line_style,
)
def multipliers(
    source: Orbit | OrbitBranch,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool | None = None,
    log: bool = False,
    **style: Any,
) -> MultiplierDrawing:
    r"""Draw Floquet multipliers and the unit circle.

    The multiplier 1 of perturbations along an autonomous orbit is marked as trivial; the others
    of a stable orbit are inside the circle. Multipliers that are exactly 0, as with sliding,
    have a marker of their own.

    Parameters
    ----------
    source : Orbit or OrbitBranch
        The multipliers of a branch are coloured by its parameter, with its special points; they
        jump, dashed grey, where the itinerary changes.
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to write LPC1, GR1, … beside special points, and the modulus of a multiplier of
        an orbit that is too small to be distinguished from 0.
    legend : bool, optional
        Whether to draw a legend; by default as ``label``.
    log : bool
        Draw log₁₀\|μ\| over \|arg μ\|/π instead, from ``log_multipliers``: also multipliers below
        the smallest number, whose argument is unknown and drawn as 0. Those that are exactly 0
        are at the lower edge.
    **style
        Properties of the paths of a branch or of the points of an orbit.

    Returns
    -------
    MultiplierDrawing

    Raises
    ------
    ArgumentError
        For an orbit that was not found.

    See Also
    --------
    fastslow.find_orbit, fastslow.plot.eigenvalue_path

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, y = sp.symbols("x y")
    >>> oscillator = fs.Model({x: y, y: (1 - x**2) * y - x})
    >>> drawn = fs.plot.multipliers(fs.find_orbit(oscillator, [2, 0]))
    >>> list(drawn.data), [label.get_text() for label in drawn.labels]
    (['unit circle', 'inside the unit circle', 'trivial multiplier'], ['$8.6\\times 10^{-4}$'])
    """
    mu = np.atleast_2d(source.multipliers)
    logs = np.atleast_2d(source.log_multipliers)
    if np.isnan(logs).any():
        raise ArgumentError(f"this orbit has no multipliers to draw: {source.outcome}")
    own, ax = ax is None, axes_for(ax, width, height=78.0)
    trivial = _trivial(source)
    if trivial is not None:
        rows = np.arange(len(mu))
        kept = np.ones(mu.shape, dtype=bool)
        kept[rows, trivial] = False
        mu, logs = mu[kept].reshape(len(mu), -1), logs[kept].reshape(len(mu), -1)
    where = _places(mu, logs, log)
    circle = _frame(ax, log)
    paths: list[LineCollection] = []
    jumps: list[Line2D] = []
    bar: Colorbar | None = None
    points: list[Line2D] = []
    markers: list[Line2D] = []
    labels: list[Annotation] = []
    if isinstance(source, Orbit):
        points += _points(ax, where[0], logs[0], style)
        if label and not log:
            tiny = logs[0] < np.log(LABELLED_MODULUS)
            labels += [
                tag(ax, _power(size), (z.real, z.imag))
                for z, size in dict(zip(where[0][tiny], logs[0][tiny], strict=True)).items()
            ]
    else:
        paths, jumps = _paths(ax, source, where, log, style)
        markers, labels = _marks(ax, source, where, logs, label)
        bar = colour_bar(ax, paths[0], typeset(source.parameter))
    if np.isneginf(logs).any():
        zero = complex(0.0, _floor(logs) if log else 0.0)
        points += _dots(ax, [zero], "exactly 0", "v" if log else "x", BLACK, 5.0)
        points[-1].set_clip_on(False)
    if trivial is not None:
        points += _dots(ax, [0j if log else 1 + 0j], "trivial multiplier", "+", BLACK, 8.0)
    if log and np.isneginf(logs).any() and ax.get_autoscaley_on():
        ax.set_ylim(bottom=_floor(logs), auto=None)
    drawn = MultiplierDrawing(
        ax, circle, tuple(paths), tuple(jumps), tuple(points), tuple(markers), tuple(labels), bar
    )
    drawn = replace(drawn, legend=add_legend(ax, drawn.handles, own, label, legend))
    place(ax, labels)
    return drawn


def _trivial(source: Orbit | OrbitBranch) -> NDArray[np.int64] | None:
    """Index of the trivial multiplier of each row, None with forcing."""
    index = source.trivial
    if index is None or np.min(index) < 0:
        return None
    return np.atleast_1d(np.asarray(index, dtype=np.int64))


def _places(mu: Complex, logs: Array, log: bool) -> Complex:
    """Multipliers as drawn: abscissa + i ordinate; NaN for log 0."""
    if not log:
        return mu
    height = np.where(np.isfinite(logs), logs / np.log(10.0), np.nan)
    return np.abs(np.angle(mu)) / np.pi + 1j * height


def _floor(logs: Array) -> float:
    """Lower edge of a logarithmic axis, below every multiplier that is not 0."""
    finite = logs[np.isfinite(logs)] / np.log(10.0)
    low, high = min(float(finite.min(initial=0.0)), 0.0), max(float(finite.max(initial=0.0)), 0.0)
    return low - max(0.15 * (high - low), 1.0)


def _frame(ax: Axes, log: bool) -> Line2D:
    """Draw the unit circle and both axes of the plane."""
    look: dict[str, Any] = {"color": BLACK, "linewidth": 0.8, "zorder": 1.5}
    if log:
        ax.set_xlabel(r"$|\mathrm{arg}\,\mu|\,/\,\pi$")
        ax.set_ylabel(r"$\log_{10}|\mu|$")
        ax.margins(0.08)
        return ax.plot([0.0, 1.0], [0.0, 0.0], label="unit circle", **look)[0]
    turns = np.linspace(0.0, 2.0 * np.pi, 361)
    circle = ax.plot(np.cos(turns), np.sin(turns), label="unit circle", **look)[0]
    for line in (ax.axhline, ax.axvline):
        line(0.0, color=GREY, linewidth=0.5, zorder=1.0)
    ax.set_xlabel(r"$\mathrm{Re}\,\mu$")
    ax.set_ylabel(r"$\mathrm{Im}\,\mu$")
    ax.margins(0.08)
    # a circle, unless limits were set by hand
    if ax.get_autoscalex_on() and ax.get_autoscaley_on():
        ax.set_aspect("equal", adjustable="datalim")
        # an aspect adjusted so leaves no margin at the data
        ax.update_datalim([(-1.12, -1.12), (1.12, 1.12)])
    return circle


def _points(ax: Axes, where: Complex, logs: Array, style: dict[str, Any]) -> list[Line2D]:
    """Draw the multipliers of one orbit, by their side of the unit circle."""
    side = np.where(np.abs(logs) < NEUTRAL_MULTIPLIER, 1, np.where(logs < 0, 0, 2))
    side[np.isneginf(logs)] = -1
    drawn: list[Line2D] = []
    for code, (kind, (marker, colour)) in enumerate(KINDS.items()):
        if (side == code).any():
            drawn += _dots(ax, where[side == code], kind, marker, colour, 5.0, **style)
    return drawn


def _dots(
    ax: Axes,
    where: Sequence[complex] | Complex,
    kind: str,
    marker: str,
    colour: str,
    size: float,
    **style: Any,
) -> list[Line2D]:
    look: dict[str, Any] = {"linestyle": "none", "marker": marker, "color": colour}
    look |= {"markersize": size, "zorder": 4.0, "label": kind, **style}
    return ax.plot(np.real(where), np.imag(where), **look)


def _power(log: float) -> str:
    """A modulus as text, from its logarithm."""
    if np.isneginf(log):
        return "0"
    exponent = int(np.floor(log / np.log(10.0)))
    lead = f"{np.exp(log - exponent * np.log(10.0)):.1f}"
    return rf"${lead}\times 10^{{{exponent}}}$"


def _paths(
    ax: Axes, branch: OrbitBranch, where: Complex, log: bool, style: dict[str, Any]
) -> tuple[list[LineCollection], list[Line2D]]:
    """Draw the multipliers along a branch, and their jumps where its itinerary changes."""
    path = matched(where)
    near = [k for row in branch.special_rows for k in (row - 1, row)]
    edges = [
        k + 1
        for k in sorted(set(near))
        if 0 <= k < len(branch) - 1 and branch[k].itinerary != branch[k + 1].itinerary
    ]
    scale = Normalize(*branch.range)
    look: dict[str, Any] = {"label": "multipliers", **style}
    paths = []
    for start, stop in zip([0, *edges], [*edges, len(path)], strict=True):
        part, values = path[start:stop], branch.values[start:stop]
        if not log:
            part, values = through_collisions(part, values)
        paths.append(coloured(ax, part, values, scale, look))
    dashed: dict[str, Any] = {
        "color": GREY,
        "linestyle": (0, (3, 2)),
        "linewidth": 0.8,
        "zorder": 2.0,
    }
    jumps = [
        line
        for edge in edges
        for one, other in zip(path[edge - 1], path[edge], strict=True)
        for line in ax.plot(
            [one.real, other.real],
            [one.imag, other.imag],
            label="change of itinerary",
            **dashed,
        )
    ]
    ax.autoscale_view()
    return paths, jumps


def _marks(
    ax: Axes, branch: OrbitBranch, where: Complex, logs: Array, label: bool
) -> tuple[list[Line2D], list[Annotation]]:
    """Mark special points: the multipliers on the unit circle, or all of the point."""
    markers: list[Line2D] = []
    labels: list[Annotation] = []
    for code, known in POINT_TYPES.items():
        roots: list[complex] = []
        for point, row in zip(branch.special, branch.special_rows, strict=True):
            if point.code != code:
                continue
            here = where[row][np.isfinite(where[row])]
            if known.event:
                size = np.abs(logs[row][np.isfinite(where[row])])
                here = here[size <= size.min(initial=np.inf) + CRITICAL_LOG]
            roots += here.tolist()
            if label and len(here):
                top = max(here.tolist(), key=lambda z: (z.imag, z.real))
                labels.append(tag(ax, plain(label_of(point)), (top.real, top.imag)))
        if roots:
            look: dict[str, Any] = {**dot_look(code), "zorder": 5, "label": known.title}
            markers += ax.plot(np.real(roots), np.imag(roots), **look)
    return markers, labels
