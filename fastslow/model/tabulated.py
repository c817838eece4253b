"""Measured loads: tables of values in time, interpolated by piecewise polynomials."""

from __future__ import annotations

import sys
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import flag, numbers, validated, whole, word
from fastslow.errors import ArgumentError
from fastslow.results.base.display import Displayed
from fastslow.results.base.html import HTML_ROWS, Cells
from fastslow.results.base.immutable import read_only
from fastslow.results.stored.operations import PiecewisePolynomial

Floats = NDArray[np.float64]

Interpolation = Literal["linear", "cubic", "previous"]


class Tabulated(Displayed):
    """A quantity given by a table of times and values.

    A law for ``forcing=`` of `Model`. Trajectories meet every time of the table (knot) exactly,
    and extrapolation is refused. Tables are immutable and compared by content.

    Parameters
    ----------
    times : array_like, shape (n,)
        Increasing, at least two; at least four for ``"cubic"``.
    values : array_like, shape (n,)
    interpolation : str
        ``"linear"``; ``"cubic"``, the spline with continuous second derivative and
        not-a-knot ends, which is the default of SciPy's ``CubicSpline``; or ``"previous"``,
        where every value is kept until the next time.
    periodic : bool
        Whether the table is one period of a load that repeats: first and last value are equal,
        and the spline has continuous derivatives there.

    Raises
    ------
    ArgumentError
        For arrays of different lengths, too few or not increasing times, numbers that are
        not finite, or a period that begins and ends with different values.

    Examples
    --------
    >>> import fastslow as fs
    >>> torque = fs.Tabulated([0, 1, 3], [0, 2, 1])
    >>> torque
    Tabulated(3 values, linear, 0 ≤ t ≤ 3)
    >>> torque([0.5, 2.0])
    array([1. , 1.5])
    >>> model = fs.Model({"x": "w - x"}, forcing={"w": torque})
    >>> fs.simulate(model, [0], t=(0, 3)).outcome.success
    True
    >>> fs.Tabulated([0, 1, 3], [0, 2, 0], periodic=True)(7.0)
    2.0
    """

    times: Floats
    values: Floats
    interpolation: Interpolation
    periodic: bool

    @validated(interpolation=word("interpolation", get_args(Interpolation)), periodic=flag)
    def __init__(
        self,
        times: ArrayLike,
        values: ArrayLike,
        *,
        interpolation: Interpolation = "linear",
        periodic: bool = False,
    ) -> None:
        knots, heights = (
            np.array(numbers(what, given), dtype=float)
            for what, given in (("times", times), ("values", values))
        )
        if knots.ndim != 1 or knots.shape != heights.shape:
            raise ArgumentError(
                f"times have shape {knots.shape}, values {heights.shape}; expected two lists of "
                "the same length"
            )
        least = 4 if interpolation == "cubic" else 2
        if len(knots) < least:
            raise ArgumentError(
                f"received {len(knots)} times; {interpolation} interpolation needs at least {least}"
            )
        for what, given in (("times", knots), ("values", heights)):
            wrong = np.flatnonzero(~np.isfinite(given))
            if len(wrong):
                raise ArgumentError(f"{what}[{wrong[0]}] = {given[wrong[0]]}; expected a number")
        wrong = np.flatnonzero(np.diff(knots) <= 0)
        if len(wrong):
            k = int(wrong[0])
            raise ArgumentError(
                f"times[{k}] = {knots[k]:g} is followed by {knots[k + 1]:g}; expected "
                "increasing times"
            )
        if periodic and heights[0] != heights[-1]:
            raise ArgumentError(
                f"one period begins with the value {heights[0]:g} and ends with {heights[-1]:g}; "
                "expected equal values: the last time is the first one of the next period"
            )
        # −0.0 is 0.0: equal tables have equal content
        knots, heights = read_only((knots + 0.0, heights + 0.0))
        self.__dict__.update(
            times=knots, values=heights, interpolation=interpolation, periodic=periodic
        )
        with np.errstate(over="ignore", invalid="ignore"):
            finite = np.isfinite(self.coefficients).all()
        if not finite:
            raise ArgumentError("the slopes of this table overflow; expected smaller values")

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"cannot set '{name}' of Tabulated")

    @cached_property
    def coefficients(self) -> Floats:
        """Coefficients of the polynomial after each knot, in the time since it; shape (n − 1, k).

        Lowest order first; k is 1, 2 or 4.
        """
        if self.interpolation == "previous":
            return self.values[:-1, None]
        if self.interpolation == "linear":
            slopes = np.diff(self.values) / np.diff(self.times)
            return np.asarray(read_only(np.column_stack([self.values[:-1], slopes])))
        from scipy.interpolate import CubicSpline

        ends = "periodic" if self.periodic else "not-a-knot"
        found = CubicSpline(self.times, self.values, bc_type=ends).c[::-1].T.copy()
        # the value at a knot is that of the table to the last bit
        found[:, 0] = self.values[:-1]
        return np.asarray(read_only(found))

    @cached_property
    def polynomial(self) -> PiecewisePolynomial:
        """The interpolation as it is stored with a model."""
        return PiecewisePolynomial(self.times, self.coefficients, self.periodic)

    @property
    def period(self) -> float | None:
        """The period of a periodic table, None for others."""
        return self.polynomial.length if self.periodic else None

    @validated(derivative=whole(0, 3))
    def __call__(self, t: ArrayLike, *, derivative: int = 0) -> Any:
        """Evaluate the table or a derivative; at a knot, the derivative to its right.

        Parameters
        ----------
        t : float or array_like
            Times inside the table.
        derivative : int
            Up to 3.

        Raises
        ------
        ArgumentError
            For a time outside the table.

        Examples
        --------
        >>> Tabulated([0, 1, 3], [0, 2, 1])(2.0, derivative=1)
        -0.5
        """
        at = numbers("t", t)
        outside = at[~((at >= self.times[0]) & (at <= self.times[-1]))]
        if outside.size and not (self.periodic and np.isfinite(outside).all()):
            raise ArgumentError(
                f"t = {outside.flat[0]:g} is outside the table, "
                f"{self.times[0]:g} ≤ t ≤ {self.times[-1]:g}"
            )
        found = self.polynomial.evaluate(at, derivative)
        if derivative == 0:
            found = np.where(at == self.times[-1], self.values[-1], found)
        return found if found.ndim else float(found)

    @cached_property
    def _content(self) -> tuple[str, bool, bytes, bytes]:
        numbers = self.times.tobytes(), self.values.tobytes()
        return self.interpolation, self.periodic, *numbers

    def __eq__(self, other: object) -> bool:
        return self._content == other._content if isinstance(other, Tabulated) else NotImplemented

    @cached_property
    def _hash(self) -> int:
        return hash(self._content)

    def __hash__(self) -> int:
        return self._hash

    def __reduce__(self) -> tuple[Any, ...]:
        return _table, (self.times, self.values, self.interpolation, self.periodic)

    def __copy__(self) -> Tabulated:
        return self

    def __deepcopy__(self, memo: object) -> Tabulated:
        return self

    def _cells(self) -> Cells:
        rows = [
            (f"{time:.6g}", f"{value:.6g}")
            for time, value in zip(self.times[:HTML_ROWS], self.values[:HTML_ROWS], strict=True)
        ]
        return Cells(("t", "value"), rows, len(self.times))

    def __repr__(self) -> str:
        first, last = self.times[0], self.times[-1]
        span = f"period {self.period:g}" if self.periodic else f"{first:g} ≤ t ≤ {last:g}"
        return f"Tabulated({len(self.times)} values, {self.interpolation}, {span})"


def _table(
    times: Floats, values: Floats, interpolation: Interpolation, periodic: bool
) -> Tabulated:
    return Tabulated(times, values, interpolation=interpolation, periodic=periodic)


class TableAtom(sp.Atom):
    """A table as an atom of expressions."""

    __slots__ = ("table",)
    table: Tabulated

    def __new__(cls, table: Tabulated) -> TableAtom:
        made: TableAtom = super().__new__(cls)
        made.table = table
        return made

    def _hashable_content(self) -> tuple[Any, ...]:
        return (self.table,)

    def __getnewargs__(self) -> tuple[Any, ...]:
        return (self.table,)

    def sort_key(self, order: Any = None) -> Any:
        return self.class_key(), (1, (repr(self.table._content),)), sp.S.One.sort_key(), sp.S.One

    def _sympystr(self, _: Any) -> str:
        return repr(self.table)


class TableValue(sp.Function):
    """The value of a table or of one of its derivatives, as a function in expressions.

    Its arguments are a `TableAtom`, the order of the derivative, and the time. At a number it
    is evaluated.
    """

    nargs = 3
    is_real = True

    @classmethod
    def eval(cls, atom: Any, order: Any, time: Any) -> Any:
        if time.is_Number:
            return sp.Float(atom.table(float(time), derivative=int(order)))
        return None

    @property
    def table(self) -> Tabulated:
        return self.args[0].table

    @property
    def order(self) -> int:
        return int(self.args[1])

    def fdiff(self, argindex: int = 3) -> sp.Expr:
        # not simplified where it is zero: the next piece has other coefficients
        return TableValue(self.args[0], self.order + 1, self.args[2])

    def _eval_derivative(self, symbol: sp.Symbol) -> sp.Expr:
        return self.fdiff() * self.args[2].diff(symbol)

    def _sympystr(self, printer: Any) -> str:
        name = f"{self.table.interpolation}_table" + "'" * self.order
        return f"{name}({printer.doprint(self.args[2])})"

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        marks = "'" * self.order
        power = f"^{{{exp}}}" if exp else ""
        return rf"\mathrm{{table}}{marks}\left({printer.doprint(self.args[2])}\right){power}"

    @property
    def key(self) -> str:
        """Name in generated NumPy code."""
        return f"table_{hash(self.table) & sys.maxsize}_{self.order}"

    def evaluate(self, times: Any) -> Any:
        """Evaluate at times, NaN outside a table without a period."""
        at = np.asarray(times, dtype=float)
        inside = self.table.periodic | (at >= self.table.times[0]) & (at <= self.table.times[-1])
        return np.where(inside, self.table.polynomial.evaluate(at, self.order), np.nan)

    def _numpycode(self, printer: Any) -> str:
        return f"{self.key}({printer.doprint(self.args[2])})"
