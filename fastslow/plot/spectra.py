"""Amplitude spectra."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation

from fastslow.arguments import flag, instance, interval, validated, whole
from fastslow.errors import ArgumentError
from fastslow.plot.arguments import figure_width, line_style
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.labels import place, tag
from fastslow.plot.layout.legends import add_legend
from fastslow.plot.layout.style import MOTION, VERMILION, axes_for, note_early_end
from fastslow.plot.layout.typesetting import typeset
from fastslow.results.trajectory.long_time.spectrum import Spectrum

#: Amplitudes below this fraction of the largest are disregarded in the default limits.
SHOWN_AMPLITUDE = 1e-4

#: Lower limit of the axes, as a fraction of the largest amplitude.
LOWEST_AMPLITUDE = 1e-7

#: Fraction of the axes above the largest line, for its label.
ABOVE = 0.12


@dataclass(frozen=True, eq=False, repr=False)
class SpectrumDrawing(Drawing):
    """A drawn spectrum.

    Parameters
    ----------
    ax : Axes
    line : Line2D
    peaks : Line2D or None
        The largest lines, interpolated between bins.
    labels : tuple of Annotation
        Their frequencies.
    legend : Legend or None
        None unless requested.
    """

    line: Line2D
    peaks: Line2D | None
    labels: tuple[Annotation, ...]
    legend: Legend | None = None


@validated(
    spectrum=instance(Spectrum),
    ax=instance(Axes),
    width=figure_width,
    label=flag,
    legend=flag,
    angular=flag,
    frequencies=interval,
    peaks=whole(0),
    style=line_style,
)
def spectrum(
    spectrum: Spectrum,
    *,
    ax: Axes | None = None,
    width: str | float = "column",
    label: bool = True,
    legend: bool = False,
    angular: bool = False,
    frequencies: tuple[float, float] | None = None,
    peaks: int = 3,
    **style: Any,
) -> SpectrumDrawing:
    """Draw an amplitude spectrum, with a logarithmic vertical axis.

    Parameters
    ----------
    spectrum : Spectrum
    ax : Axes, optional
        Axes to draw into; new ones otherwise.
    width : str or float
        Width of a new figure: ``"column"`` (85 mm), ``"page"`` (170 mm), or millimetres.
    label : bool
        Whether to label the largest lines with their frequencies.
    legend : bool
        Whether to draw a legend.
    angular : bool
        Whether to show angular frequency.
    frequencies : (float, float), optional
        Range of frequencies; by default up to the last significant amplitude.
    peaks : int
        Number of lines to mark.
    **style
        Properties of the curve.

    Returns
    -------
    SpectrumDrawing

    Raises
    ------
    ArgumentError
        For an empty range.

    See Also
    --------
    fastslow.simulate, fastslow.plot.time_series

    Examples
    --------
    >>> import fastslow as fs
    >>> run = fs.simulate(fs.systems.van_der_pol(), [2, 0], t=(0, 200))
    >>> fs.plot.spectrum(run.spectrum("x"), peaks=1).ax.get_xlabel()
    'frequency'
    """
    unit = 2.0 * np.pi if angular else 1.0
    frequency, amplitude = unit * spectrum.frequency[1:], spectrum.amplitude[1:]
    largest = float(amplitude.max()) or 1.0
    if frequencies is None:
        last = (
            int(np.flatnonzero(amplitude >= SHOWN_AMPLITUDE * largest)[-1])
            if amplitude.any()
            else -1
        )
        frequencies = 0.0, float(frequency[min(int(1.15 * last) + 8, len(frequency) - 1)])
    if not frequencies[0] < frequencies[1]:
        raise ArgumentError(f"frequencies = {frequencies!r}; expected a range, low < high")
    own, ax = ax is None, axes_for(ax, width, height=54.0)
    look = {"color": MOTION, "linewidth": 0.8, "label": "amplitude", **style}
    # a logarithmic axis cannot show zero
    (line,) = ax.plot(frequency, np.maximum(amplitude, 1e-300), **look)
    ax.set_yscale("log")
    ax.set_xlim(*frequencies)
    ax.set_ylim(LOWEST_AMPLITUDE * largest, largest * LOWEST_AMPLITUDE ** (-ABOVE / (1.0 - ABOVE)))
    ax.set_xlabel("angular frequency" if angular else "frequency")
    ax.set_ylabel(f"amplitude of {typeset(spectrum.name)}")
    note_early_end(ax, spectrum.ended)
    found = [
        p for p in spectrum.peaks(peaks) if frequencies[0] <= unit * p.frequency <= frequencies[1]
    ]
    if not found:
        return SpectrumDrawing(ax, line, None, (), add_legend(ax, [line], own, label, legend))
    (marks,) = ax.plot(
        [unit * p.frequency for p in found],
        [p.amplitude for p in found],
        linestyle="none",
        marker="o",
        markersize=3.0,
        markerfacecolor="white",
        markeredgecolor=VERMILION,
        markeredgewidth=0.7,
        zorder=4,
        label="largest lines",
    )
    labels: tuple[Annotation, ...] = ()
    if label:
        at = [(unit * p.frequency, p.amplitude) for p in found]
        labels = tuple(tag(ax, f"{spot[0]:.4g}", spot) for spot in at)
    key = add_legend(ax, [line, marks], own, label, legend)
    place(ax, labels)
    return SpectrumDrawing(ax, line, marks, labels, key)
