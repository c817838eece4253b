"""What a run is asked: its moments at a value, its parts, the moment nearest to a point."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from fastslow.arguments import among, text, validated
from fastslow.results.trajectory.lookup import in_region, moments_on, one_value
from fastslow.results.trajectory.nearest import nearest_moment
from fastslow.results.trajectory.slicing import parts_of
from fastslow.results.trajectory.state_at import StatePoint

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory


class Queries:
    """The questions to a `Trajectory` about its moments and parts."""

    @property
    def _run(self) -> Trajectory:
        return cast("Trajectory", self)

    @validated(region=text, direction=among(-1, 0, 1, None))
    def at(
        self, *, region: str | None = None, direction: int | None = None, **value: float
    ) -> list[StatePoint]:
        """The moments at one value of a column, one per passage; of a time, the one then.

        Every root of every step's series is found, to rounding; a touch counts
        once, and so does an end of the run that misses the value by rounding. Of a stretch
        of time that stays on the value its two ends are given, with
        ``resting=True``. Without dense output the samples are joined by straight
        lines, and what is read between them says so (``interpolated=True``).

        Parameters
        ----------
        region : str, optional
            Keep only those in one region (or sliding, as ``"S1|S2"``).
        direction : int, optional
            Keep only passages upwards (+1), downwards (−1), or touches (0).
        **value : float
            A state, slow state, slow quantity or ``t`` by name, e.g. ``x=0.5``.

        Returns
        -------
        list of StatePoint
            In order of time.

        Raises
        ------
        UnknownNameError
            For a name that is no column, or no region.
        ArgumentError
            If the run does not reach the value.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v = sp.symbols("x v")
        >>> fine = fs.Integration(rtol=1e-13)
        >>> run = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 6), integration=fine)
        >>> for moment in run.at(x=0.5):  # at π/3 and 5π/3
        ...     print(moment)
        StatePoint(t = 1.04719755: x = 0.5, v = -0.866025; in S1)
        StatePoint(t = 5.23598776: x = 0.5, v = 0.866025; in S1)
        >>> run.at(t=3.2)
        [StatePoint(t = 3.2: x = -0.998295, v = 0.0583741; in S1)]
        >>> [part.span for part in run.select(between=(1, 2))]
        [(1.0, 2.0)]
        """
        name, level = one_value(value, (*self._run.columns, "t"))
        return in_region(self._run, moments_on(self._run, name, level, direction), region)

    @validated(region=text)
    def select(
        self, *, region: str | None = None, between: tuple[float, float] | None = None
    ) -> tuple[Trajectory, ...]:
        """The parts of the run that fulfil the conditions, each a trajectory, in order.

        A part is cut exactly, keeps its series, and has the crossings at its ends.
        Without dense output it goes from the first sample within to the last.

        Parameters
        ----------
        region : str, optional
            Stays in one region (or sliding, as ``"S1|S2"``).
        between : (float, float), optional
            Times, ends included.

        Returns
        -------
        tuple of Trajectory

        Raises
        ------
        UnknownNameError
            For a region that there is not.
        ArgumentError
            For a range that is none.
        """
        return parts_of(self._run, region, between)

    def nearest(self, **values: float) -> StatePoint:
        """The moment nearest to some values of columns.

        Distances are measured in units of each column's range. The moment is
        found along the series, to rounding; without dense output on straight lines.

        Parameters
        ----------
        **values : float
            At least one of the states, slow quantities and ``t``, e.g. ``x=0.1, v=0``.

        Returns
        -------
        StatePoint

        Raises
        ------
        UnknownNameError
            For a name that is no column.
        ArgumentError
            For a number that is not finite, or none at all.
        """
        return nearest_moment(self._run, values)
