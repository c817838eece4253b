"""Numbers of one period of a motion: largest and smallest value, mean and root mean square.

Of a periodic orbit also its multipliers, as ``abs(multiplier_1)``, ``re`` and ``im``.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.formulas.columns import column, written_formula
from fastslow.results.trajectory.steps.dense import DenseOutput

Array = NDArray[np.float64]

#: Points per step in which an expression is evaluated: its polynomial has the degree of the
#: series, up to 24, and its square twice that.
GAUSS_POINTS = 32

#: Functionals of a column that are computed together, in this order.
EXTREMES = ("min", "max")

#: Numbers of a multiplier, given by its number.
PARTS = ("abs", "re", "im")

#: A functional of one expression, or a number of a multiplier.
_CALL = re.compile(r"\b(?:(max|min|mean|rms)\s*\(|(abs|re|im)\s*\(\s*(multiplier_[1-9]\d*)\s*\))")


def split(key: object) -> tuple[str, dict[str, tuple[str, str]]]:
    """Replace functionals of a text by names; return it with functional and argument by name.

    ``max`` and ``min`` of several arguments are functions of numbers and are left unchanged.

    Examples
    --------
    >>> split("max(x) - min(x**2)")
    ('value_0 - value_1', {'value_0': ('max', 'x'), 'value_1': ('min', 'x**2')})
    >>> split("max(x, 0)")
    ('max(x, 0)', {})
    >>> split("abs(multiplier_2) - 0.5")
    ('value_0 - 0.5', {'value_0': ('abs', 'multiplier_2')})
    """
    text = written_formula(key)
    found: dict[str, tuple[str, str]] = {}
    out, place = "", 0
    while (match := _CALL.search(text, place)) is not None:
        out += text[place : match.start()]
        name = f"value_{len(found)}"
        if match.group(1) is None:
            found[name] = match.group(2), match.group(3)
            out, place = out + name, match.end()
            continue
        end, commas = _closing(text, match.end())
        if commas:
            out += text[match.start() : match.end()]
            place = match.end()
            continue
        found[name] = (match.group(1), text[match.end() : end].strip())
        out += name
        place = end + 1
    return out + text[place:], found


def _closing(text: str, begin: int) -> tuple[int, int]:
    """Place of the parenthesis that closes one opened before, and commas at its level."""
    depth, commas = 1, 0
    for place in range(begin, len(text)):
        sign = text[place]
        depth += (sign == "(") - (sign == ")")
        commas += sign == "," and depth == 1
        if depth == 0:
            return place, commas
    raise ArgumentError(f"{text!r} has an opening parenthesis without a closing one")


def evaluate(name: str, dense: DenseOutput, argument: str) -> float:
    """Evaluate a functional of an expression over the span of a dense output.

    Means are integrals over time, by Gauss-Legendre
    quadrature in every step.

    Parameters
    ----------
    name : str
        max, min, mean or rms.
    dense : DenseOutput
    argument : str
        A column, or an expression in columns, parameters and t.
    """
    if name in EXTREMES:
        if argument in dense.columns:
            return dense.extremes(argument, dense.span)[EXTREMES.index(name)]
        return _extreme(dense, argument, 1.0 if name == "max" else -1.0)
    points, weights = _gauss()
    values = _values(dense, argument, points)
    power = 2 if name == "rms" else 1
    area = float(dense.steps[:, 1] @ (values**power @ weights))
    mean = area / (dense.span[1] - dense.span[0])
    return float(np.sqrt(mean)) if name == "rms" else mean


@lru_cache(maxsize=1)
def _gauss() -> tuple[Array, Array]:
    points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    return 0.5 * (points + 1.0), 0.5 * weights


def _values(dense: DenseOutput, argument: str, points: Array) -> Array:
    """Values of an expression at fractions of every step, shape (n_steps, points)."""
    times = dense.steps[:, :1] + dense.steps[:, 1:2] * points
    flat = np.clip(times.reshape(-1), *dense.span)
    table = dense.columns_at(flat)
    columns: dict[str, Callable[[], Array]] = {
        name: partial(table.__getitem__, k) for k, name in enumerate(dense.columns)
    }
    columns["t"] = lambda: flat
    return column(argument, columns, dense.parameters, len(flat)).reshape(times.shape)


def _extreme(dense: DenseOutput, argument: str, sign: float) -> float:
    """Largest value of an expression, from its Chebyshev polynomial in every step."""
    nodes = np.cos(np.pi * (np.arange(GAUSS_POINTS) + 0.5) / GAUSS_POINTS)
    points = np.concatenate([[0.0], 0.5 * (nodes[::-1] + 1.0), [1.0]])
    values = sign * _values(dense, argument, points)
    best = float(np.nanmax(values))
    spread = np.ptp(values, axis=1)
    for k in np.flatnonzero(values.max(axis=1) + spread >= best):
        series = np.polynomial.chebyshev.chebfit(nodes[::-1], values[k, 1:-1], GAUSS_POINTS - 1)
        slope = np.polynomial.chebyshev.chebder(series)
        large = np.flatnonzero(np.abs(slope) > 1e-14 * np.abs(slope).max(initial=0.0))
        if not len(large):
            continue
        roots = np.polynomial.chebyshev.chebroots(slope[: large[-1] + 1])
        there = roots.real[(np.abs(roots.imag) < 1e-6) & (np.abs(roots.real) <= 1.0)]
        found = np.polynomial.chebyshev.chebval(there, series)
        best = max(best, float(found.max(initial=best)))
    return sign * best
