"""Quantities on axes: a column, an expression in columns, or a function of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import evaluated, names_in, written_formula
from fastslow.formulas.definitions import with_definitions
from fastslow.plot.layout.typesetting import plain, written
from fastslow.results.angles import principal
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.overlay import Overlay
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


class Columns(dict[str, Any]):
    """Numbers and arrays by name, with an error that lists the known names."""

    def __missing__(self, name: object) -> Any:
        raise unknown_name("column", name, self)


@dataclass(frozen=True)
class Quantity:
    """A quantity on an axis.

    Parameters
    ----------
    text : str
        Name or expression; for a function its name.
    function : callable, optional
        Function of the columns by name that returns the values.
    name : str
        Written on the axis in place of the text, as the name of a definition is.
    """

    text: str
    function: Callable[[Columns], Any] | None = None
    name: str = ""

    def of(self, columns: Mapping[str, Any], count: int) -> Array:
        """Evaluate at columns of length ``count``, shape (count,).

        Raises
        ------
        UnknownNameError
            For a name that is not a column.
        ArgumentError
            For an invalid expression; for a function that returns another shape.
        """
        if self.function is None:
            return np.broadcast_to(evaluated(self.text, columns), (count,))
        values = np.asarray(self.function(Columns(columns)), dtype=float)
        if values.shape not in ((), (count,)):
            raise ArgumentError(
                f"{self.text} returned values of shape {values.shape}; expected ({count},), "
                "one for each row of its columns"
            )
        return np.broadcast_to(values, (count,))

    @property
    def column(self) -> str:
        """Name or expression, empty for a function."""
        return self.text if self.function is None else ""

    @property
    def label(self) -> str:
        """Label of the axis."""
        if self.function is not None:
            return "$f$" if self.text == "<lambda>" else plain(self.text.replace("_", " "))
        return written(self.name or self.text)


def quantity_of(
    given: object,
    default: str,
    varying: Sequence[str],
    fixed: Iterable[str],
    kind: str,
    definitions: Mapping[str, str] | None = None,
) -> Quantity:
    """Parse the quantity of an axis.

    Parameters
    ----------
    given : str, Symbol, Expr, callable or None
    default : str
        Quantity if ``given`` is None.
    varying : sequence of str
        Columns, at least one of which an expression must contain.
    fixed : iterable of str
        Names of constants that an expression may contain.
    kind : str
        Kind of the columns, for the error.
    definitions : mapping, optional
        Names of expressions as text.

    Raises
    ------
    UnknownNameError
        For an unknown name; for an expression in constants alone.
    ArgumentError
        For an invalid expression.
    """
    # SymPy symbols are callable too
    if callable(given) and not hasattr(given, "free_symbols"):
        return Quantity(getattr(given, "__name__", type(given).__name__), given)
    name = default if given is None else written_formula(given)
    text = str(with_definitions(name, definitions or {}))
    if text not in varying:
        known = dict.fromkeys((*varying, *fixed), 0.0)
        if text.isidentifier() or not names_in(text, known) & set(varying):
            raise unknown_name(kind, text, varying)
    return Quantity(text, name=name)


def of_diagram(diagram: Diagram, given: object, default: str) -> Quantity:
    """Parse the quantity of an axis of a diagram: state, parameter, expression or function."""
    names = (*diagram.states, diagram.parameter)
    kind = "state or parameter"
    return quantity_of(given, default, names, diagram.parameters, kind, diagram.definitions)


def of_run(run: Trajectory, given: object, default: str) -> Quantity:
    """Parse the quantity of an axis of a trajectory: time, state, slow quantity or expression."""
    names = (*run.columns, "t")
    kind = "state or slow quantity"
    return quantity_of(given, default, names, run.parameters, kind, run.definitions)


def joined(
    columns: Sequence[Array], shown: Sequence[Quantity], periods: Mapping[str, float]
) -> list[Array]:
    """Break the columns of a line where a periodic state wraps around.

    The line is extended to the end of the principal range, and continues from the other end
    after a row of NaN.

    Examples
    --------
    >>> theta, p = Quantity("theta"), Quantity("p")
    >>> line = [np.array([1.5, -1.5]), np.array([0.0, 1.0])]
    >>> [c.tolist() for c in joined(line, [theta, p], {"theta": 4.0})]
    [[1.5, 2.0, nan, -2.0, -1.5], [0.0, 0.5, nan, 0.5, 1.0]]
    """
    table = np.column_stack(columns)
    for k, quantity in enumerate(shown):
        period = float(periods.get(quantity.column, 0.0))
        if period == 0.0:
            continue
        rows = np.flatnonzero(np.abs(np.diff(table[:, k])) > 0.5 * period)
        pieces = np.split(table, rows + 1)
        whole = pieces[:1]
        for before, after in pairwise(pieces):
            up = np.sign(before[-1, k] - after[0, k])
            ahead = after[0].copy()
            ahead[k] += up * period
            edge = 0.5 * up * period
            part = (edge - before[-1, k]) / (ahead[k] - before[-1, k])
            there = before[-1] + part * (ahead - before[-1])
            here = there.copy()
            there[k], here[k] = edge, -edge
            whole += [there[None], np.full((1, len(there)), np.nan), here[None], after]
        table = np.concatenate(whole)
    return list(table.T)


def _wrapped(values: Array, quantity: Quantity, periods: Mapping[str, float]) -> Array:
    """Wrap values of a periodic state to its principal range (−period/2, period/2]."""
    period = periods.get(quantity.column, 0.0)
    return principal(values, period) if period else values


def along_branch(diagram: Diagram, branch: Branch, *shown: Quantity) -> list[Array]:
    """Quantities at the rows of a branch, each of shape (N,)."""
    columns = {name: branch[name] for name in (*branch.states, diagram.parameter)}
    known = {**diagram.parameters, **columns}
    return [_wrapped(q.of(known, len(branch)), q, branch.periods) for q in shown]


def at_points(points: Sequence[SpecialPoint], *shown: Quantity) -> list[Array]:
    """Quantities at special points, each of shape (number of points,)."""
    if not points:
        return [np.empty(0) for _ in shown]
    rows = [{**p.parameters, **dict(zip(p.states, p.state, strict=True))} for p in points]
    columns = {name: np.array([row[name] for row in rows], dtype=float) for name in rows[0]}
    return [q.of(columns, len(points)) for q in shown]


def along_run(run: Trajectory, *shown: Quantity) -> list[Array]:
    """Quantities at the samples of a trajectory, each of shape (N,)."""
    columns = {name: run[name] for name in ("t", *run.columns)}
    known = {**run.parameters, **columns}
    return [_wrapped(q.of(known, len(run.t)), q, run.periods) for q in shown]


def at_crossings(run: Trajectory, *shown: Quantity) -> list[Array]:
    """Quantities at crossings of interfaces, each of shape (number of crossings,)."""
    crossings = run.crossings
    times = np.array([c.time for c in crossings])
    columns = {name: np.interp(times, run.t, run[name]) for name in run.columns}
    state = np.reshape([c.state for c in crossings], (-1, len(run.states)))
    columns |= dict(zip(run.states, state.T, strict=True))
    known = {**run.parameters, **columns, "t": times}
    return [_wrapped(q.of(known, len(crossings)), q, run.periods) for q in shown]


def along_overlay(overlay: Overlay, *shown: Quantity) -> list[Array]:
    """Quantities at the times of an overlay, each of shape (N,)."""
    columns = {name: overlay.run[name] for name in overlay.run.columns}
    known = {**_fixed(overlay), **columns, overlay.parameter: overlay.slow}
    return [_wrapped(q.of(known, len(overlay)), q, overlay.run.periods) for q in shown]


def at_times(
    overlay: Overlay, times: Array, names: Sequence[str], state: Array, *shown: Quantity
) -> list[Array]:
    """Quantities at times between samples, given some states, shape (K, states)."""
    columns = {n: np.interp(times, overlay.t, overlay.run[n]) for n in overlay.run.columns}
    columns[overlay.parameter] = np.interp(times, overlay.t, overlay.slow)
    columns |= dict(zip(names, state.reshape(len(times), -1).T, strict=True))
    known = {**_fixed(overlay), **columns}
    return [_wrapped(q.of(known, len(times)), q, overlay.run.periods) for q in shown]


def _fixed(overlay: Overlay) -> dict[str, Any]:
    return {**overlay.run.parameters, **overlay.diagram.parameters}
