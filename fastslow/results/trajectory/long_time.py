"""What can be asked of a run once it repeats: sections, lines of a spectrum, periods, extremes."""

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
    """The questions to a `Trajectory` about how it repeats."""

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
        """Poincaré section: where an expression passes a level, or an interface is crossed.

        Every root of every step's polynomial is found, to rounding; where the
        run begins on the section there is no point. A periodic state passes a level
        wherever it does so modulo its period.

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
        >>> fine = fs.Integration(rtol=1e-13)
        >>> run = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 10), integration=fine)
        >>> (run.section("x", direction=-1).times / sp.pi.evalf()).astype(float).round(9)
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
        return spectrum_of(self._run, name, since, window, samples)

    @validated(period=positive, tol=positive, most=whole(1, 10**6))
    def periodicity(
        self, period: float | None = None, tol: float = 1e-6, most: int = 16
    ) -> Periodicity:
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
        Periodicity
            Also where nothing repeats: ``multiple`` is then None, and ``outcome`` says why.
        """
        return periodicity_of(self._run, period, tol, most)

    @validated(since=finite, until=finite)
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
        return extremes_of(self._run, name, since, until)
