"""Queries of a trajectory: states at a value, slices, and the nearest state."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from fastslow.arguments import among, text, validated
from fastslow.results.trajectory.lookup import in_region, one_value, states_at_level
from fastslow.results.trajectory.nearest import nearest_state
from fastslow.results.trajectory.slicing import parts_of
from fastslow.results.trajectory.state_at import StatePoint

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory


class Queries:
    """Mixin of a `Trajectory` with the queries of its states and slices."""

    @property
    def _run(self) -> Trajectory:
        return cast("Trajectory", self)

    @validated(region=text, direction=among(-1, 0, 1, None))
    def at(
        self, *, region: str | None = None, direction: int | None = None, **value: float
    ) -> list[StatePoint]:
        """Return the states at which a column has a given value, or the state at a time.

        All roots of the series of every step are computed to rounding. A tangency counts
        once, and so does an end of the run that misses the value by rounding. A time
        interval in which the column is constant at the value is represented by its two
        ends, with ``resting=True``. Without dense output the states are interpolated
        linearly between samples (``interpolated=True``).

        Parameters
        ----------
        region : str, optional
            Select states in one region (or sliding, as ``"S1|S2"``).
        direction : int, optional
            Select crossings of the value upwards (+1) or downwards (−1), or tangencies (0).
        **value : float
            A state, slow state, slow quantity or ``t`` by name, e.g. ``x=0.5``.

        Returns
        -------
        list of StatePoint
            In order of time.

        Raises
        ------
        UnknownNameError
            For an unknown column or region.
        ArgumentError
            If the run does not reach the value.

        Examples
        --------
        >>> import sympy as sp, fastslow as fs
        >>> x, v = sp.symbols("x v")
        >>> fine = fs.Integration(rtol=1e-13)
        >>> run = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 6), integration=fine)
        >>> for point in run.at(x=0.5):  # at π/3 and 5π/3
        ...     print(point)
        StatePoint(t = 1.04719755: x = 0.5, v = -0.866025; in S1)
        StatePoint(t = 5.23598776: x = 0.5, v = 0.866025; in S1)
        >>> run.at(t=3.2)
        [StatePoint(t = 3.2: x = -0.998295, v = 0.0583741; in S1)]
        >>> [part.span for part in run.select(between=(1, 2))]
        [(1.0, 2.0)]
        """
        name, level = one_value(value, (*self._run.columns, "t"))
        return in_region(self._run, states_at_level(self._run, name, level, direction), region)

    @validated(region=text)
    def select(
        self, *, region: str | None = None, between: tuple[float, float] | None = None
    ) -> tuple[Trajectory, ...]:
        """Return the slices of the run that satisfy all conditions, in order.

        Each slice is a trajectory with exact ends, its series, and the crossings at its
        ends. Without dense output it extends from the first to the last sample inside.

        Parameters
        ----------
        region : str, optional
            Select the time in one region (or sliding, as ``"S1|S2"``).
        between : (float, float), optional
            Select a closed time interval.

        Returns
        -------
        tuple of Trajectory

        Raises
        ------
        UnknownNameError
            For an unknown region.
        ArgumentError
            For an invalid interval.
        """
        return parts_of(self._run, region, between)

    def nearest(self, **values: float) -> StatePoint:
        """Return the state nearest to given values of columns.

        Distances are measured in units of each column's range. The minimum is computed
        on the series, to rounding; without dense output by linear interpolation.

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
            For a name that is not a column.
        ArgumentError
            For a number that is not finite, or without any value.
        """
        return nearest_state(self._run, values)
