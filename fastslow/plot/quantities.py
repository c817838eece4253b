"""What an axis shows: a column, an expression in columns, or a function of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import evaluated, names_in, written_formula
from fastslow.plot.layout.typesetting import plain, written
from fastslow.results.angles import principal
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.overlay import Overlay
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


class Columns(dict[str, Any]):
    """Numbers and arrays by name, which says what it holds when asked for something else."""

    def __missing__(self, name: object) -> Any:
        raise unknown_name("column", name, self)


@dataclass(frozen=True)
class Quantity:
    """What an axis shows.

    Parameters
    ----------
    text : str
        A name or an expression; of a function its name.
    function : callable, optional
        Given the columns, by name, it returns the values.
    """

    text: str
    function: Callable[[Columns], Any] | None = None

    def of(self, columns: Mapping[str, Any], count: int) -> Array:
        """Values for columns of a length, shape (count,).

        Raises
        ------
        UnknownNameError
            For a name that is no column.
        ArgumentError
            For what is no expression; for a function with values of another shape.
        """
        if self.function is None:
            return np.broadcast_to(evaluated(self.text, columns), (count,))
        values = np.asarray(self.function(Columns(columns)), dtype=float)
        if values.shape not in ((), (count,)):
            raise ArgumentError(
                f"{self.text} returned values of shape {values.shape}; expected ({count},), "
                "one for each row of the columns it was given"
            )
        return np.broadcast_to(values, (count,))

    @property
    def column(self) -> str:
        """The name or expression, empty for a function."""
        return self.text if self.function is None else ""

    @property
    def label(self) -> str:
        """The label of the axis."""
        if self.function is not None:
            return "$f$" if self.text == "<lambda>" else plain(self.text.replace("_", " "))
        return written(self.text)


def quantity_of(
    given: object, default: str, varying: Sequence[str], fixed: Iterable[str], kind: str
) -> Quantity:
    """Read what an axis is to show.

    Parameters
    ----------
    given : str, Symbol, Expr, callable or None
    default : str
        Shown if nothing is given.
    varying : sequence of str
        Columns; at least one must stand in an expression.
    fixed : iterable of str
        Names of constants that may stand in an expression too.
    kind : str
        What the columns are, for the error.

    Raises
    ------
    UnknownNameError
        For an unknown name; for an expression in constants alone.
    ArgumentError
        For what is no expression.
    """
    # symbols of SymPy are callable too
    if callable(given) and not hasattr(given, "free_symbols"):
        return Quantity(getattr(given, "__name__", type(given).__name__), given)
    text = default if given is None else written_formula(given)
    if text not in varying:
        known = dict.fromkeys((*varying, *fixed), 0.0)
        if text.isidentifier() or not names_in(text, known) & set(varying):
            raise unknown_name(kind, text, varying)
    return Quantity(text)


def of_diagram(diagram: Diagram, given: object, default: str) -> Quantity:
    """What an axis of a diagram shows: states, its parameter, expressions, functions."""
    names = (*diagram.states, diagram.parameter)
    return quantity_of(given, default, names, diagram.parameters, "state or parameter")


def of_run(run: Trajectory, given: object, default: str) -> Quantity:
    """What an axis of a trajectory shows: time, states, slow quantities, expressions, functions."""
    names = (*run.columns, "t")
    return quantity_of(given, default, names, run.parameters, "state or slow quantity")


def joined(
    columns: Sequence[Array], shown: Sequence[Quantity], periods: Mapping[str, float]
) -> list[Array]:
    """Columns of a line, in parts where a periodic state goes round.

    Where the line leaves the principal range by one end it is led up to it and goes
    on from the other; between both stands a row of NaN.

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
    """Values of a periodic state in its principal range (−period/2, period/2]."""
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
    """Quantities where a trajectory crosses interfaces, each of shape (number of crossings,)."""
    met = run.crossings
    times = np.array([c.time for c in met])
    columns = {name: np.interp(times, run.t, run[name]) for name in run.columns}
    state = np.reshape([c.state for c in met], (-1, len(run.states)))
    columns |= dict(zip(run.states, state.T, strict=True))
    known = {**run.parameters, **columns, "t": times}
    return [_wrapped(q.of(known, len(met)), q, run.periods) for q in shown]


def along_overlay(lay: Overlay, *shown: Quantity) -> list[Array]:
    """Quantities at the times of an overlay, each of shape (N,)."""
    columns = {name: lay.run[name] for name in lay.run.columns}
    known = {**_fixed(lay), **columns, lay.parameter: lay.slow}
    return [_wrapped(q.of(known, len(lay)), q, lay.run.periods) for q in shown]


def at_times(
    lay: Overlay, times: Array, names: Sequence[str], state: Array, *shown: Quantity
) -> list[Array]:
    """Quantities at times between samples, where some states are known, shape (K, states)."""
    columns = {n: np.interp(times, lay.time, lay.run[n]) for n in lay.run.columns}
    columns[lay.parameter] = np.interp(times, lay.time, lay.slow)
    columns |= dict(zip(names, state.reshape(len(times), -1).T, strict=True))
    known = {**_fixed(lay), **columns}
    return [_wrapped(q.of(known, len(times)), q, lay.run.periods) for q in shown]


def _fixed(lay: Overlay) -> dict[str, Any]:
    return {**lay.run.parameters, **lay.diagram.parameters}
