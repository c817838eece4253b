"""Amplitude spectra of trajectories."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import validated, whole, within
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.display import Displayed
from fastslow.results.base.outcome import early_end
from fastslow.results.base.result import Result
from fastslow.results.base.table import Row, Table
from fastslow.results.trajectory.steps.dense import DenseOutput

#: Cosine coefficients of the tapers, w(s) = sum (−1)**m a_m cos(2π m s).
TAPERS: dict[str, tuple[float, ...]] = {
    "rectangular": (1.0,),
    "hann": (0.5, 0.5),
    "hamming": (0.54, 0.46),
    "blackman": (0.42, 0.5, 0.08),
    "flattop": (0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368),
}

#: Samples per Taylor step, and bounds of their total number.
PER_STEP, FEWEST_SAMPLES, SPECTRUM_SAMPLES = 16, 2**12, 2**20


@dataclass(frozen=True)
class Peak(Displayed):
    """A line of a spectrum, interpolated between bins.

    Parameters
    ----------
    frequency : float
        In cycles per unit of time.
    amplitude : float
    """

    frequency: float
    amplitude: float

    @property
    def angular(self) -> float:
        """Angular frequency."""
        return 2.0 * np.pi * self.frequency


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(Table[Row], Result):
    """One-sided amplitude spectrum of a column.

    Parameters
    ----------
    name : str
        The column.
    taper : str
    span : tuple of float
        The time interval.
    frequency : ndarray, shape (N,)
        In cycles per unit of time, from zero.
    amplitude : ndarray, shape (N,)
        Amplitude of a sine wave at the centre of each bin; at zero frequency, the
        modulus of the mean.
    ended : str
        The outcome code of a run that ended early, else empty.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v, t = sp.symbols("x v t")
    >>> run = fs.simulate(fs.Model({x: v, v: sp.sin(t) - x - v}), [-1, 0], periods=20)
    >>> (peak,) = run.spectrum("x").peaks(1)
    >>> round(peak.angular, 6), round(peak.amplitude, 6)
    (1.0, 1.0)
    """

    name: str
    taper: str
    span: tuple[float, float]
    frequency: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    ended: str = ""

    _row = "frequency"
    _places = ("frequency",)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return frequency, angular frequency and amplitude."""
        return {
            "frequency": self.frequency,
            "angular": self.angular,
            "amplitude": self.amplitude,
        }

    @cached_property
    def angular(self) -> NDArray[np.float64]:
        """Angular frequencies, shape (N,)."""
        return 2.0 * np.pi * self.frequency

    @validated(n=whole(0), min_amplitude=within(0.0, 1.0))
    def peaks(self, n: int = 5, *, min_amplitude: float = 1e-6) -> tuple[Peak, ...]:
        """Return the largest lines except the mean, largest first.

        The frequency of a line is interpolated from the ratio of two bins by the
        transform of the window, exactly for a single sine wave. A line is a maximum
        within the resolution of the window; the smaller lines may include side lobes
        farther away.

        Parameters
        ----------
        n : int
            Maximal number of lines.
        min_amplitude : float
            Lines below this fraction of the largest amplitude are omitted.

        Returns
        -------
        tuple of Peak
        """
        a = self.amplitude
        reach = max(len(TAPERS[self.taper]), 1)
        padded = np.pad(a, reach, constant_values=-1.0)
        # the mean is a line of its own
        padded[reach] = -1.0
        around = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
        top = np.flatnonzero((around.max(axis=1) == a) & (a > 0))
        top = top[(top > 0) & (top < len(a) - 1)]
        top = top[a[top] >= min_amplitude * a[top].max(initial=0.0)]
        top = top[np.argsort(-a[top], kind="stable")][:n]
        return tuple(self._interpolated(int(k)) for k in top)

    def _interpolated(self, k: int) -> Peak:
        terms = TAPERS[self.taper]
        below, peak, above = self.amplitude[k - 1 : k + 2]
        side = 1.0 if above >= below else -1.0
        if k == 1 and side < 0:
            # the bin below holds the mean
            side = 1.0
        ratio = (above if side > 0 else below) / peak
        low, high = 0.0, 0.5
        for _ in range(60):
            middle = 0.5 * (low + high)
            if transform(terms, 1.0 - middle) / transform(terms, middle) < ratio:
                low = middle
            else:
                high = middle
        shift = 0.5 * (low + high)
        width = float(self.frequency[1])
        return Peak((k + side * shift) * width, float(peak / transform(terms, shift)))

    def __repr__(self) -> str:
        lines = ", ".join(f"{p.amplitude:.4g} at {p.frequency:.6g}" for p in self.peaks(3))
        return (
            f"Spectrum of {self.name} for t from {self.span[0]:.6g} to {self.span[1]:.6g}, "
            f"{self.taper} taper: {lines or 'no line'}"
            + (f"; the run ended early: {self.ended}" if self.ended else "")
        )


def transform(terms: tuple[float, ...], shift: float) -> float:
    """Return the modulus of a window's transform at a shift in bins, relative to zero shift.

    Examples
    --------
    >>> round(transform((0.5, 0.5), 0.5), 6), abs(round(transform((1.0,), 1.0), 6))
    (0.848826, 0.0)
    """
    total = 0.0
    for m, a in enumerate(terms):
        both = np.sinc(shift - m) + np.sinc(shift + m)
        total += (a if m else 0.5 * a) * float(both) / (2.0 if m else 1.0)
    return abs(total) / terms[0]


def spectrum_of(
    dense: DenseOutput,
    name: object,
    window: tuple[float, float],
    taper: str,
    samples: int | None,
    period: float | None,
) -> Spectrum:
    """Compute the spectrum of a column in a time interval; see `Trajectory.spectrum`."""
    if str(name) not in dense.columns:
        raise unknown_name("column", name, dense.columns)
    if taper not in TAPERS:
        raise unknown_name("taper", taper, TAPERS)
    first, last = window
    if period is not None and last - first >= period:
        # with whole periods the harmonics of the forcing are at the centres of bins
        count = int((last - first) / period + 1e-9)
        first = max(last - count * period, dense.span[0])
    if not last > first:
        raise ArgumentError(
            f"since = {first:g} is the end of the interval; expected an earlier time"
        )
    if samples is None:
        steps = int(np.count_nonzero(dense.steps[:, 0] + dense.steps[:, 1] > first))
        samples = 2 ** int(
            np.ceil(np.log2(np.clip(PER_STEP * steps, FEWEST_SAMPLES, SPECTRUM_SAMPLES)))
        )
    part = np.arange(samples) / samples
    values = dense.columns_at(first + (last - first) * part)[dense.columns.index(str(name))]
    mean = float(values.mean())
    weights = np.zeros(samples)
    for m, a in enumerate(TAPERS[taper]):
        weights += (-1.0) ** m * a * np.cos(2.0 * np.pi * m * part)
    # subtract the mean, which the window would spread over the lowest bins
    amplitude = 2.0 * np.abs(np.fft.rfft((values - mean) * weights)) / weights.sum()
    amplitude[0] = abs(mean)
    if samples % 2 == 0:
        amplitude[-1] /= 2.0
    frequency = np.arange(len(amplitude)) / (last - first)
    return Spectrum(str(name), taper, (first, last), frequency, amplitude, early_end(dense.outcome))
