"""Drift of the slow quantity of a run at the passage of a special point."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.model.equations import read_expression
from fastslow.model.structure import TIME, real
from fastslow.model.tabulated import TableValue
from fastslow.passage.delays.drift_laws import DRIFT_DIGITS, shifted
from fastslow.passage.slow_quantities import SlowQuantity
from fastslow.results.overlay.drifts import Drift
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Half-width of the stencil for derivatives of a path's parameter, relative to the run's length.
STENCIL = 1e-4


def drift_at(
    slow: SlowQuantity, point: SpecialPoint, time: float, *, with_law: bool = True
) -> Drift | None:
    """Compute the drift of the slow quantity near a special point that a run passes.

    The derivatives are those of a forcing at that time; of the rate of a slow state at the
    special point, with other slow quantities to first order in time; or of w'/u'(g) for the
    parameter g of a path w = u(g). Of a table they are those of the piece at that time, with
    ``complete=False``. Without the model of the run, or dense output, they are finite differences
    along the run, with ``complete=False``.

    Parameters
    ----------
    slow : SlowQuantity
    point : SpecialPoint
    time : float
        Time at which the slow quantity passes the value of the point.
    with_law : bool
        Whether to include the formula of a nonlinear rate, ``Drift.law``.

    Returns
    -------
    Drift or None
        None if the slow quantity is at rest.
    """
    run, name = slow.run, slow.name
    model = run.symbolic_model
    try:
        if name in run.forcing and model is not None and not model.forcing[name].has(TableValue):
            return _of_a_forcing(model, slow, time, with_law)
        if slow.laws and slow.dense and model is not None:
            return _on_a_path(slow, point, time)
        if slow.laws or not slow.dense:
            return _along_the_run(slow, time)
        if model is None or name in run.forcing:
            # without its law, or in one piece of a table, whose slope changes at the next knot
            _, rate, double = _derivatives(run, time)[:, run.columns.index(name)]
            change = float(double) if name in run.forcing else 0.0
            return Drift(float(rate), change=change, complete=False)
        return _of_a_slow_state(slow, point, time, with_law)
    except ArgumentError:
        # the rate is zero or not finite
        return None


def _derivatives(run: Trajectory, time: float) -> Array:
    """Value, first and second derivative of every column at a time, shape (3, columns)."""
    dense = run.dense
    row = max(int(np.searchsorted(dense.step_starts, time, side="right")) - 1, 0)
    offset, series = time - float(dense.steps[row, 0]), dense.series[row]
    order = np.arange(series.shape[1])
    value = dense.evaluate(np.array([row]), np.array([offset]))[:, 0]
    powers = offset ** np.maximum(order[None, :] - np.array([[1], [2]]), 0)
    first = series @ (order * powers[0] * (order >= 1))
    second = series @ (order * (order - 1) * powers[1] * (order >= 2))
    return np.array([value, first, second])


def _along_the_run(slow: SlowQuantity, time: float) -> Drift:
    """Rate and its change by finite differences of the slow quantity."""
    begin, end = float(slow.run.t[0]), float(slow.run.t[-1])
    step = min(STENCIL * (end - begin), time - begin, end - time)
    if not step > 0.0:
        step = STENCIL * (end - begin)
        time = float(np.clip(time, begin + step, end - step))
    before, here, after = slow.at(np.array([time - step, time, time + step]))[0]
    change = (after - 2.0 * here + before) / step**2 if slow.dense else 0.0
    return Drift((after - before) / (2.0 * step), change=change, complete=False)


def _of_a_forcing(model: Any, slow: SlowQuantity, time: float, with_law: bool) -> Drift:
    """Drift of a forcing from its derivatives at a time."""
    return _drift_of(model, _in_time(model.forcing[slow.name]), {}, time, (), with_law)


@lru_cache(maxsize=128)
def _in_time(forcing: sp.Expr) -> sp.Expr:
    """Time derivative of a forcing."""
    return forcing.diff(TIME)


def _of_a_slow_state(slow: SlowQuantity, point: SpecialPoint, time: float, with_law: bool) -> Drift:
    """Drift of a slow state from its rate and gradient at the special point."""
    model, names = slow.run.symbolic_model, (*slow.states, slow.name)
    others = [n for n in slow.run.columns if n not in names]
    rate = model.rates[slow.name]
    if any(symbol.name in others for symbol in rate.free_symbols):
        law = _rate(model, slow.name, time).xreplace(_moving(slow, time))
        return drift_of_law(law, {n: point[n] for n in names})
    here = {n: float(point[n]) for n in names}
    return _drift_of(model, rate, here, time, names, with_law)


def _drift_of(
    model: Any,
    rate: sp.Expr,
    here: Mapping[str, float],
    time: float,
    names: tuple[str, ...],
    with_law: bool,
) -> Drift:
    """Drift of a rate in the parameters of a model, as `drift_of_law`, by cached functions.

    Parameters
    ----------
    model : Model
    rate : Expr
    here : mapping
        Values of the states and the slow quantity at the special point.
    time : float
        Time of the passage.
    names : tuple of str
        Names in ``here``, in order; the slow quantity is the last.
    with_law : bool
        Whether to include the formula of a nonlinear rate.
    """
    moving = (*map(real, names), TIME)
    used, values = _values(rate, tuple(model.values), moving)
    given = [*(float(model.values[n]) for n in used), *(here[n] for n in names), time]
    try:
        value, *slopes, change = map(float, values(*given))
    except (TypeError, ValueError, NameError, ArithmeticError):
        value, slopes, change = math.nan, [], math.nan
    if not all(map(math.isfinite, (value, *slopes, change))):
        # SymPy may evaluate what these functions cannot
        return drift_of_law(rate.xreplace({**_known(model, used), TIME: _later(time)}), here)
    text = ""
    if with_law and not _linear(rate, moving):
        text = shifted(_formula(rate, tuple((n, model.values[n]) for n in used), moving), time)
    *states, last = [*names] or [""]
    by = dict(zip(names, slopes, strict=True))
    return Drift(
        value,
        change=change,
        by_value=by.get(last, 0.0),
        by_state={n: by[n] for n in states},
        law=text,
    )


@lru_cache(maxsize=128)
def _formula(
    rate: sp.Expr, values: tuple[tuple[sp.Symbol, float], ...], moving: tuple[sp.Symbol, ...]
) -> str:
    """Return a rate with numbers for its parameters as text, "" if it is affine."""
    moved = rate.xreplace({n: sp.Float(v, DRIFT_DIGITS) for n, v in values})
    return "" if _linear(moved, moving) else str(moved)


def _known(model: Any, used: tuple[sp.Symbol, ...]) -> dict[sp.Symbol, sp.Float]:
    """Values of parameters as SymPy numbers."""
    return {n: sp.Float(model.values[n], DRIFT_DIGITS) for n in used}


@lru_cache(maxsize=128)
def _values(
    rate: sp.Expr, parameters: tuple[sp.Symbol, ...], moving: tuple[sp.Symbol, ...]
) -> tuple[tuple[sp.Symbol, ...], Callable[..., Any]]:
    """Parameters in a rate, and a function of these and the variables for it and its slopes."""
    used = tuple(n for n in parameters if n in rate.free_symbols)
    slopes = [rate.diff(s) if s in rate.free_symbols else sp.Integer(0) for s in moving]
    function: Callable[..., Any] = sp.lambdify((*used, *moving), [rate, *slopes], "math")
    return used, function


@lru_cache(maxsize=256)
def _linear(law: sp.Expr, moving: tuple[sp.Symbol, ...]) -> bool:
    """Whether a rate is affine in the variables."""
    inside = [s for s in moving if s in law.free_symbols]
    return not law.has(sp.Piecewise) and all(
        sp.expand(law.diff(s).diff(other)) == 0 for s in inside for other in inside
    )


def _on_a_path(slow: SlowQuantity, point: SpecialPoint, time: float) -> Drift:
    """Drift g' = w'/u'(g) from the quantity that varies most along the path."""
    values = {real(n): sp.Float(v, DRIFT_DIGITS) for n, v in slow.constants.items()}
    parameter = real(slow.name)
    known = (*slow.constants, slow.name)
    path = {
        real(n): read_expression(f"path of {n}", text, known).xreplace(values)
        for n, text in slow.laws.items()
    }
    here = {n: point[n] for n in (*slow.states, slow.name)}
    slopes = {n: law.diff(parameter) for n, law in path.items()}
    size = {n: abs(float(s.subs(parameter, here[slow.name]))) for n, s in slopes.items()}
    most = max(size, key=lambda n: size[n])
    law = _rate(slow.run.symbolic_model, most.name, time).xreplace({**_moving(slow, time), **path})
    return drift_of_law(law / slopes[most], here)


def _rate(model: Any, name: str, time: float) -> sp.Expr:
    """Rate of a slow quantity, with time measured from a given time."""
    law = model.forcing[name].diff(TIME) if name in model.forcing else model.rates[name]
    numbers = {n: sp.Float(v, DRIFT_DIGITS) for n, v in model.values.items()}
    return law.xreplace({**numbers, TIME: _later(time)})


def _later(time: float) -> sp.Expr:
    """Time measured from a given time."""
    # a subnormal number is the rounding of 0 and cannot be parsed again
    return TIME + (sp.Float(time, DRIFT_DIGITS) if abs(time) >= sys.float_info.min else 0)


def _moving(slow: SlowQuantity, time: float) -> dict[sp.Symbol, sp.Expr]:
    """Other slow quantities of a run to first order in time."""
    run, found = slow.run, {}
    columns = _derivatives(run, time)
    for k, name in enumerate(run.columns):
        if name != slow.name and name not in slow.states:
            value, rate, _ = columns[:, k]
            found[real(name)] = sp.Float(value, DRIFT_DIGITS) + sp.Float(rate, DRIFT_DIGITS) * TIME
    return found


def drift_of_law(law: sp.Expr, here: Mapping[str, float]) -> Drift:
    """Drift of a rate in the fast states, the slow quantity and the time since its passage.

    Parameters
    ----------
    law : Expr
        In real symbols; t is the time.
    here : mapping
        Values at the special point by name, the slow quantity last.

    Raises
    ------
    ArgumentError
        For a rate that vanishes at the point.

    Examples
    --------
    >>> x, w = sp.symbols("x w", real=True)
    >>> drift_of_law(x - w / 10, {"x": 2, "w": 1})
    Drift(w' = 1.9 − 0.1 (w − w*) + 1 (x − x*))
    """
    at: dict[sp.Symbol, Any] = {TIME: 0.0, **{real(n): float(v) for n, v in here.items()}}
    moving = [s for s in at if s in law.free_symbols]
    slopes = {s: law.diff(s) for s in moving}
    linear = _linear(law, tuple(moving))
    values = {s.name: _number(slope, at) for s, slope in slopes.items()}
    *states, name = [*here] or [""]
    return Drift(
        _number(law, at),
        change=values.get(TIME.name, 0.0),
        by_value=values.get(name, 0.0),
        by_state={n: values.get(n, 0.0) for n in states},
        law="" if linear else str(law),
    )


def _number(expression: sp.Expr, at: dict[sp.Symbol, Any]) -> float:
    return float(expression.subs(at))
