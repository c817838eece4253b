"""How the slow quantity of a run moves where it passes a special point."""

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
from fastslow.model.structure import TIME, read_expression, real
from fastslow.passage.overlay.slow_quantities import SlowQuantity
from fastslow.results.overlay.drifts import Drift
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.dense import evaluate
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Half width of the interval over which a path's parameter is differentiated, by the run's length.
WINDOW = 1e-4

#: Digits of numbers in the text of a law.
DIGITS = 17


def drift_at(
    slow: SlowQuantity, point: SpecialPoint, time: float, *, told: bool = True
) -> Drift | None:
    """The drift of the slow quantity about a special point that a run passes at a time.

    Of a forcing with its derivatives at that time; of a slow state with its rate and
    the derivatives of its rate at the special point, other slow quantities as they move
    then; of the parameter g of a path w = u(g) with those of w'/u'(g). Without
    the model of the run, or dense output, only what the run itself shows, with
    ``complete=False``.

    Parameters
    ----------
    slow : SlowQuantity
    point : SpecialPoint
    time : float
        When the slow quantity passes the value of the point.
    told : bool
        Whether a rate that is not linear is put into words; without it the law of the drift
        may be missing.

    Returns
    -------
    Drift or None
        None where the slow quantity is at rest there.
    """
    run, name = slow.run, slow.name
    model = run.symbolic_model
    try:
        if name in run.forcing and model is not None:
            return _of_a_forcing(model, slow, time, told)
        if slow.laws and slow.dense and model is not None:
            return _on_a_path(slow, point, time)
        if slow.laws or not slow.dense:
            return _along_the_run(slow, time)
        if model is None:
            _, rate, double = _derivatives(run, time)[:, run.columns.index(name)]
            change = float(double) if name in run.forcing else 0.0
            return Drift(float(rate), change=change, complete=False)
        return _of_a_slow_state(slow, point, time, told)
    except ArgumentError:
        # the drift is at rest, or not finite
        return None


def _derivatives(run: Trajectory, time: float) -> Array:
    """Value, first and second derivative of every column at a time, shape (3, columns)."""
    assert run.series is not None
    row = max(int(np.searchsorted(run.step_starts, time, side="right")) - 1, 0)
    offset, series = time - float(run.steps[row, 0]), run.series[row]
    order = np.arange(series.shape[1])
    value = evaluate(run, np.array([row]), np.array([offset]))[:, 0]
    powers = offset ** np.maximum(order[None, :] - np.array([[1], [2]]), 0)
    first = series @ (order * powers[0] * (order >= 1))
    second = series @ (order * (order - 1) * powers[1] * (order >= 2))
    return np.array([value, first, second])


def _along_the_run(slow: SlowQuantity, time: float) -> Drift:
    """Rate and change from three values of the slow quantity."""
    begin, end = float(slow.run.t[0]), float(slow.run.t[-1])
    step = min(WINDOW * (end - begin), time - begin, end - time)
    if not step > 0.0:
        step = WINDOW * (end - begin)
        time = float(np.clip(time, begin + step, end - step))
    before, here, after = slow.at(np.array([time - step, time, time + step]))[0]
    change = (after - 2.0 * here + before) / step**2 if slow.dense else 0.0
    return Drift((after - before) / (2.0 * step), change=change, complete=False)


def _of_a_forcing(model: Any, slow: SlowQuantity, time: float, told: bool) -> Drift:
    """From the derivatives of a forcing at a time."""
    return _drift_of(model, _in_time(model.forcing[slow.name]), {}, time, (), told)


@lru_cache(maxsize=128)
def _in_time(forcing: sp.Expr) -> sp.Expr:
    """The rate of a forcing."""
    return forcing.diff(TIME)


def _of_a_slow_state(slow: SlowQuantity, point: SpecialPoint, time: float, told: bool) -> Drift:
    """From the rate of a slow state, its gradient at the special point, and what else moves."""
    model, names = slow.run.symbolic_model, (*slow.states, slow.name)
    others = [n for n in slow.run.columns if n not in names]
    rate = model.rates[slow.name]
    if any(symbol.name in others for symbol in rate.free_symbols):
        law = _rate(model, slow.name, time).xreplace(_moving(slow, time))
        return drift_of_law(law, {n: point[n] for n in names})
    here = {n: float(point[n]) for n in names}
    return _drift_of(model, rate, here, time, names, told)


def _drift_of(
    model: Any,
    rate: sp.Expr,
    here: Mapping[str, float],
    time: float,
    names: tuple[str, ...],
    told: bool,
) -> Drift:
    """As `drift_of_law` of a rate in the parameters of a model, by functions that are made once.

    Parameters
    ----------
    model : Model
    rate : Expr
    here : mapping
        Values of the states and the slow quantity at the special point.
    time : float
        When it is passed.
    names : tuple of str
        Of ``here``, in order; the slow quantity is the last.
    told : bool
        Whether a rate that is not linear is put into words.
    """
    moving = (*map(real, names), TIME)
    used, values = _values(rate, tuple(model.values), moving)
    given = [*(float(model.values[n]) for n in used), *(here[n] for n in names), time]
    try:
        value, *slopes, change = map(float, values(*given))
    except (TypeError, ValueError, NameError, ArithmeticError):
        value, slopes, change = math.nan, [], math.nan
    if not all(map(math.isfinite, (value, *slopes, change))):
        # what these functions cannot tell, SymPy may
        return drift_of_law(rate.xreplace({**_known(model, used), TIME: _later(time)}), here)
    text = ""
    if told and not _linear(rate, moving):
        moved = rate.xreplace(_known(model, used))
        if not _linear(moved, moving):
            text = str(moved.xreplace({TIME: _later(time)}))
    *states, last = [*names] or [""]
    by = dict(zip(names, slopes, strict=True))
    return Drift(
        value,
        change=change,
        by_value=by.get(last, 0.0),
        by_state={n: by[n] for n in states},
        law=text,
    )


def _known(model: Any, used: tuple[sp.Symbol, ...]) -> dict[sp.Symbol, sp.Float]:
    """Values of some parameters."""
    return {n: sp.Float(model.values[n], DIGITS) for n in used}


@lru_cache(maxsize=128)
def _values(
    rate: sp.Expr, parameters: tuple[sp.Symbol, ...], moving: tuple[sp.Symbol, ...]
) -> tuple[tuple[sp.Symbol, ...], Callable[..., Any]]:
    """The parameters in a rate, and it and its slopes as a function of these and what moves."""
    used = tuple(n for n in parameters if n in rate.free_symbols)
    slopes = [rate.diff(s) if s in rate.free_symbols else sp.Integer(0) for s in moving]
    function: Callable[..., Any] = sp.lambdify((*used, *moving), [rate, *slopes], "math")
    return used, function


@lru_cache(maxsize=256)
def _linear(law: sp.Expr, moving: tuple[sp.Symbol, ...]) -> bool:
    """Whether a rate is linear, or at least affine, in what moves."""
    inside = [s for s in moving if s in law.free_symbols]
    return not law.has(sp.Piecewise) and all(
        sp.expand(law.diff(s).diff(other)) == 0 for s in inside for other in inside
    )


def _on_a_path(slow: SlowQuantity, point: SpecialPoint, time: float) -> Drift:
    """From the rate of the quantity that varies most along the path: g' = w'/u'(g)."""
    values = {real(n): sp.Float(v, DIGITS) for n, v in slow.constants.items()}
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
    """The rate of a slow quantity, t from a time on."""
    law = model.forcing[name].diff(TIME) if name in model.forcing else model.rates[name]
    numbers = {n: sp.Float(v, DIGITS) for n, v in model.values.items()}
    return law.xreplace({**numbers, TIME: _later(time)})


def _later(time: float) -> sp.Expr:
    """The time from a time on."""
    # one below the normal numbers is the rounding of 0, and has no decimals to be read again
    return TIME + (sp.Float(time, DIGITS) if abs(time) >= sys.float_info.min else 0)


def _moving(slow: SlowQuantity, time: float) -> dict[sp.Symbol, sp.Expr]:
    """Other slow quantities of a run from a time on, to first order."""
    run, found = slow.run, {}
    columns = _derivatives(run, time)
    for k, name in enumerate(run.columns):
        if name != slow.name and name not in slow.states:
            value, rate, _ = columns[:, k]
            found[real(name)] = sp.Float(value, DIGITS) + sp.Float(rate, DIGITS) * TIME
    return found


def drift_of_law(law: sp.Expr, here: Mapping[str, float]) -> Drift:
    """The drift of a rate given in the fast states, the slow quantity and the time since it passed.

    Parameters
    ----------
    law : Expr
        In real symbols; t is the time.
    here : mapping
        Names to their values at the special point, the slow quantity last.

    Raises
    ------
    ArgumentError
        For a rate that vanishes there.

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
