"""Long-time queries of a trajectory: sections, spectrum, periodicity and extremes."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from fastslow.arguments import among, finite, formula, positive, text, validated, whole
from fastslow.results.trajectory.extrema import extremes_of
from fastslow.results.trajectory.periodicity import Periodicity, periodicity_of
from fastslow.results.trajectory.section import (
    Section,
    poincare_section,
    stroboscopic_section,
    window_of,
)
from fastslow.results.trajectory.spectrum import Spectrum, spectrum_of

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory


class LongTime:
    """Mixin of a `Trajectory` with the queries of its long-time behaviour."""

    @property
    def _run(self) -> Trajectory:
        return cast("Trajectory", self)

    @validated(period=positive, phase=finite, since=finite)
    def stroboscopic(
        self,
        period: float | None = None,
        phase: float = 0.0,
        since: float | None = None,
    ) -> Section:
        """Return the stroboscopic section: states at the times start + phase + k·period.

        Parameters
        ----------
        period : float, optional
            By default that of the forcing.
        phase : float
            Time after the start of the run, in units of time.
        since : float, optional
            Earlier points are omitted.

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
        return stroboscopic_section(self._run, period, phase, since)

    @validated(
        expression=formula,
        level=finite,
        direction=among(-1, 0, 1, None),
        interface=formula,
        since=finite,
        until=finite,
    )
    def section(
        self,
        expression: object = None,
        *,
        level: float = 0.0,
        direction: int | None = None,
        interface: object = None,
        since: float | None = None,
        until: float | None = None,
    ) -> Section:
        """Return a Poincaré section, at a level of an expression or on an interface.

        All roots of the polynomial of every step are computed to rounding; an initial
        state on the section is not included. For a periodic state the level is taken
        modulo its period.

        Parameters
        ----------
        expression : str or Expr, optional
            A column, or a polynomial in columns, parameters and t.
        level : float
        direction : int, optional
            +1 upwards, −1 downwards, 0 for tangencies; all by default.
        interface : str or Expr, optional
            Instead of an expression: the crossings of this interface.
        since, until : float, optional
            The time interval, by default that of the run.

        Raises
        ------
        UnknownNameError
            For an unknown column, parameter or interface.
        ArgumentError
            For an expression that is not a polynomial, or without dense output.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v = sp.symbols("x v")
        >>> fine = fs.Integration(rtol=1e-13)
        >>> run = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 10), integration=fine)
        >>> (run.section("x", direction=-1).t / sp.pi.evalf()).astype(float).round(9)
        array([0.5, 2.5])
        """
        window = window_of(self._run, since, until)
        return poincare_section(self._run, expression, level, direction, interface, window)

    @validated(since=finite, window=text, samples=whole(8, 2**24))
    def spectrum(
        self,
        name: object,
        since: float | None = None,
        window: str = "hann",
        samples: int | None = None,
    ) -> Spectrum:
        """Return the amplitude spectrum of a column.

        Parameters
        ----------
        name : str or Symbol
        since : float, optional
            Start of the time interval, after the transient; with forcing it is shortened
            to whole periods, so that the harmonics coincide with bins.
        window : str
            ``"hann"``, ``"flattop"``, ``"blackman"``, ``"hamming"`` or ``"rectangular"``.
        samples : int, optional
            Number of equidistant samples of the dense output; by default 16 for each
            step, at least 4096.

        Raises
        ------
        UnknownNameError
            For an unknown column or window.
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return spectrum_of(self._run, name, since, window, samples)

    @validated(period=positive, tol=positive, max_multiple=whole(1, 10**6))
    def periodicity(
        self, period: float | None = None, tol: float = 1e-6, max_multiple: int = 16
    ) -> Periodicity:
        """Detect the period of the motion at the end of the run.

        Without forcing, periods are replaced by the returns to a Poincaré section,
        on which the state with the largest range crosses its mean upwards.

        Parameters
        ----------
        period : float, optional
            By default that of the forcing.
        tol : float
            Largest difference that counts as a repeat, in units of each state's range.
        max_multiple : int
            Largest multiple of the period that is tried.

        Returns
        -------
        Periodicity
            If nothing repeats, ``multiple`` is None and ``outcome`` gives the reason.
        """
        return periodicity_of(self._run, period, tol, max_multiple)

    @validated(since=finite, until=finite)
    def extremes(
        self, name: object, since: float | None = None, until: float | None = None
    ) -> tuple[float, float]:
        """Return minimum and maximum of a column in a time interval, to rounding.

        The polynomial of a step is maximised if its coefficients allow values beyond
        the extremes at the ends of the steps.

        Parameters
        ----------
        name : str or Symbol
        since, until : float, optional
            The time interval, by default that of the run.

        Raises
        ------
        UnknownNameError
            For a name that is not a column.
        ArgumentError
            For a time outside the run, or without dense output.
        """
        return extremes_of(self._run, name, since, until)
