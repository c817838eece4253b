"""A solution in time: its series, its crossings, and the regions it went through."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.errors import unknown_name
from fastslow.results.contacts import (
    Contacts,
    contacts_of,
    count_hits,
    regime_of,
    residence_in,
)
from fastslow.results.crossings import Crossing, Segment, crossings_of, segments_of
from fastslow.results.dense import columns_at, refined_table
from fastslow.results.outcome import Outcome
from fastslow.results.sections import (
    Section,
    poincare_section,
    stroboscopic_section,
    window_of,
)
from fastslow.results.spectra import Spectrum, spectrum_of
from fastslow.results.steady import SteadyState, steady_state
from fastslow.results.turning import extremes_of


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """A solution in time.

    Parameters
    ----------
    states : tuple of str
        States, then slow states: the order of every state vector.
    forcing : tuple of str
        Slow quantities.
    interfaces, regions : tuple of str
        Names in the model's order.
    parameters : mapping
        Parameter values.
    period : float or None
        Common period of all forcing.
    gap : tuple of str or None
        For a model with a gap, the regions below, inside and above it.
    outcome : Outcome
        Why the run ended.
    end : ndarray, shape (1 + n,)
        Time and state reached.
    method : str
        How the steps were made.
    steps : ndarray, shape (n_steps, 4)
        Time, length and mode of every step, and what took the place of a
        series: 0 nothing, 1 collocation, 2 an implicit method.
    modes : tuple of str
        What the modes in ``steps`` and ``crossing_table`` are: regions, then sliding motions.
    crossing_table : ndarray, shape (n_crossings, 6 + n)
        Time, interface, direction, mode before, mode after, near-tangential, state.
    series : ndarray, shape (n_steps, n + n_forcing, order + 1), optional
        Taylor coefficients of every step.
    sampled : tuple of ndarray, optional
        Times (N,) asked for and their columns (n or n + n_forcing, N).
    span : tuple of float
        First and last time reached.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, v = sp.symbols("x v")
    >>> run = fs.simulate(fs.Model({x: v, v: -sp.sign(x)}), [0.5, 0.0], t=(0, 3))
    >>> run.crossings
    (Crossing(t = 1, x downwards, S1 → S2),)
    >>> run.word
    ('S1', 'S2')
    >>> run(3.0).round(12)
    array([0., 1.])
    """

    states: tuple[str, ...]
    forcing: tuple[str, ...]
    interfaces: tuple[str, ...]
    regions: tuple[str, ...]
    parameters: Mapping[str, float]
    period: float | None
    gap: tuple[str, str, str] | None
    outcome: Outcome
    span: tuple[float, float]
    end: NDArray[np.float64]
    method: str
    steps: NDArray[np.float64]
    modes: tuple[str, ...]
    crossing_table: NDArray[np.float64]
    series: NDArray[np.float64] | None
    sampled: tuple[NDArray[np.float64], NDArray[np.float64]] | None

    @cached_property
    def t(self) -> NDArray[np.float64]:
        """Times of the samples; without samples, enough of them to plot."""
        return self._table[0]

    @property
    def columns(self) -> tuple[str, ...]:
        """Names that can be asked for: states, slow states, slow quantities."""
        return (*self.states, *self.forcing)

    def __getitem__(self, name: object) -> NDArray[np.float64]:
        """A state, slow state or slow quantity at the times ``t``, shape (N,)."""
        key = str(name)
        if key == "t":
            return self.t
        if key not in self.columns:
            raise unknown_name("column", key, self.columns)
        row = self.columns.index(key)
        values = self._table[1]
        if row >= len(values):
            values = self._all_sampled
        return values[row]

    def __call__(self, times: ArrayLike) -> NDArray[np.float64]:
        """States at any times of the run, shape (n, N); (n,) for a scalar time.

        Raises
        ------
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return self.dense_columns(times)[: len(self.states)]

    def dense_columns(self, times: ArrayLike) -> NDArray[np.float64]:
        """All columns at any times of the run, shape (n + n_forcing, N).

        Raises
        ------
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return columns_at(self, times)

    @cached_property
    def _table(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.sampled if self.sampled is not None else refined_table(self)

    @cached_property
    def _all_sampled(self) -> NDArray[np.float64]:
        return self.dense_columns(self.t)

    @cached_property
    def crossings(self) -> tuple[Crossing, ...]:
        """Every crossing in order of time."""
        return crossings_of(self)

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """Stretches of one region, in order."""
        return segments_of(self)

    @property
    def word(self) -> tuple[str, ...]:
        """The regions in the order they were gone through."""
        return tuple(segment.region for segment in self.segments)

    @cached_property
    def regime(self) -> str | None:
        """How the sides of a gap are touched in the last period of the run.

        ``"bilateral"``, ``"unilateral upper"``, ``"unilateral lower"``,
        ``"meshed upper"``, ``"meshed lower"`` or ``"free"``; None for models
        without gap or period. Sliding along an edge touches it; rounding decides grazes.
        """
        return regime_of(self)

    @property
    def residence(self) -> dict[str, float]:
        """The part of the run spent in every region (and in every sliding motion)."""
        return residence_in(self, self.span)

    def hits(
        self,
        interface: object,
        direction: int | None = None,
        *,
        since: float | None = None,
        until: float | None = None,
    ) -> int:
        """How often an interface was crossed, upwards (+1), downwards (−1) or either way.

        Parameters
        ----------
        interface : str or Expr
        direction : int, optional
        since, until : float, optional
            The part of the run, by default all of it.

        Raises
        ------
        UnknownNameError
            For an interface that is not in the model.
        ArgumentError
            For another direction, or times outside the run.
        """
        return count_hits(self, interface, direction, window_of(self, since, until))

    def contacts(
        self,
        since: float | None = None,
        until: float | None = None,
        *,
        period: float | None = None,
    ) -> Contacts:
        """Crossings and residence in a part of the run, in all and period by period.

        Parameters
        ----------
        since, until : float, optional
            The part of the run, by default all of it.
        period : float, optional
            By default that of the forcing.

        Returns
        -------
        Contacts
        """
        return contacts_of(self, period, window_of(self, since, until))

    def stroboscopic(
        self, period: float | None = None, phase: float = 0.0, since: float | None = None
    ) -> Section:
        """States once every period, at start + phase + k·period.

        Parameters
        ----------
        period : float, optional
            By default that of the forcing.
        phase : float
            Time after the start of the run, in units of time.
        since : float, optional
            Earlier points are left out.

        Raises
        ------
        ArgumentError
            Without a period, or without dense output.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v, t = sp.symbols("x v t")
        >>> run = fs.simulate(fs.Model({x: v, v: sp.sin(t) - x - v}), [-1, 0], periods=3)
        >>> run.stroboscopic()["x"].round(9)
        array([-1., -1., -1., -1.])
        """
        return stroboscopic_section(self, period, phase, since)

    def section(
        self,
        expression: object = None,
        level: float = 0.0,
        *,
        direction: int | None = None,
        interface: object = None,
        since: float | None = None,
        until: float | None = None,
    ) -> Section:
        """Poincaré section: where an expression passes a level, or an interface is crossed.

        Every root of every step's polynomial is found, to rounding; where the
        run begins on the section there is no point.

        Parameters
        ----------
        expression : str or Expr, optional
            A column, or a polynomial in columns, parameters and t.
        level : float
        direction : int, optional
            +1 upwards, −1 downwards, 0 for touches; all by default.
        interface : str or Expr, optional
            Instead of an expression: the crossings of this interface.
        since, until : float, optional
            The part of the run, by default all of it.

        Raises
        ------
        UnknownNameError
            For an unknown column, parameter or interface.
        ArgumentError
            For an expression that is no polynomial, or without dense output.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v = sp.symbols("x v")
        >>> run = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 10), tol=1e-13)
        >>> (run.section("x", 0.0, direction=-1).times / sp.pi.evalf()).astype(float).round(9)
        array([0.5, 2.5])
        """
        window = window_of(self, since, until)
        return poincare_section(self, expression, level, direction, interface, window)

    def spectrum(
        self,
        name: object,
        since: float | None = None,
        window: str = "hann",
        samples: int | None = None,
    ) -> Spectrum:
        """Frequencies and amplitudes of a column.

        Parameters
        ----------
        name : str or Symbol
        since : float, optional
            The transient before is left out; with forcing, so is what is left
            over of a period, so that its multiples fall on bins.
        window : str
            ``"hann"``, ``"flattop"``, ``"blackman"``, ``"hamming"`` or ``"rectangular"``.
        samples : int, optional
            Even samples of the dense output; by default 16 a step, 4096 at least.

        Raises
        ------
        UnknownNameError
            For a name that is no column, or no window.
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return spectrum_of(self, name, since, window, samples)

    def steady(self, period: float | None = None, tol: float = 1e-6, most: int = 16) -> SteadyState:
        """After how many periods the states repeat, and from which time on.

        Without forcing, the returns to a Poincaré section take the place of
        the periods: the state with the largest range passes its mean upwards.

        Parameters
        ----------
        period : float, optional
            By default that of the forcing.
        tol : float
            Largest difference that counts as a repeat, in units of each state's range.
        most : int
            Largest multiple that is tried.

        Returns
        -------
        SteadyState
            Also where nothing repeats: ``multiple`` is then None, and ``outcome`` says why.
        """
        return steady_state(self, period, tol, most)

    def extremes(
        self, name: object, since: float | None = None, until: float | None = None
    ) -> tuple[float, float]:
        """Minimum and maximum of a column in a part of the run, to rounding.

        Every step's polynomial is maximised where its coefficients allow more
        than the extremes at the ends of the steps.

        Parameters
        ----------
        name : str or Symbol
        since, until : float, optional
            The part, by default all of it.

        Raises
        ------
        UnknownNameError
            For a name that is no column.
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return extremes_of(self, name, since, until)

    def __getstate__(self) -> dict[str, Any]:
        names = self.__dataclass_fields__
        return {name: value for name, value in self.__dict__.items() if name in names}

    def __repr__(self) -> str:
        low, high = self.span
        lines = [
            f"Trajectory of {', '.join(self.columns)} for t from {low:.6g} to {high:.6g}",
            f"  {len(self.steps)} steps, {len(self.crossing_table)} crossings, "
            f"{len(self.segments)} segments" + (f", regime {self.regime}" if self.regime else ""),
            f"  {self.method}",
            f"  {self.outcome}",
        ]
        return "\n".join(lines)
