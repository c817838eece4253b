"""A smooth motion of a piecewise-smooth model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from fastslow.model.differentiation import gradient
from fastslow.model.expansion import cancelled, expanded
from fastslow.model.structure import TIME, real
from fastslow.results.stored.sign_patterns import Pattern

#: Operations up to which a quotient is cancelled, so that exact zeros remain exact.
CANCELLED_OPERATIONS = 150


@dataclass(frozen=True)
class Motion:
    """A smooth motion: the flow in a region, or sliding along one or several interfaces.

    Sliding along the interfaces I with the rates f₀ + Σ bᵢ sᵢ, sᵢ = sign hᵢ, solves
    0 = ḣ_I = a + B s for s, with B_ij = ∇hᵢ·b_j, and is valid where every |sᵢ| < 1
    (Filippov 1988). Its name joins the names of two regions: that in which all hᵢ are
    positive, and that in which all are negative.

    Parameters
    ----------
    name : str
    signs : tuple of int
        Sign of every interface function; 0 for the sliding interfaces.
    rates : tuple of sympy.Expr
        Of states and slow states.
    laws : tuple of sympy.Expr
        Of the slow quantities.
    corners : tuple of int
        Indices of the adjacent regions: 2**m of them for sliding along m interfaces,
        beginning with the one where all hᵢ are positive.
    bounds : tuple of sympy.Expr
        Two for each sliding interface: the Lie derivative of hᵢ for sᵢ = 1 and for
        sᵢ = −1, both while sliding along the other interfaces. They have opposite
        signs if and only if |sᵢ| < 1.
    weights : tuple of sympy.Expr
        sᵢ for each of them.
    """

    name: str
    signs: Pattern
    rates: tuple[sp.Expr, ...]
    laws: tuple[sp.Expr, ...]
    corners: tuple[int, ...] = ()
    bounds: tuple[sp.Expr, ...] = ()
    weights: tuple[sp.Expr, ...] = ()

    @property
    def slides(self) -> tuple[int, ...]:
        """Indices of the sliding interfaces."""
        return tuple(j for j, sign in enumerate(self.signs) if sign == 0)


def drift(
    function: sp.Expr,
    names: Sequence[str],
    rates: Sequence[sp.Expr],
    laws: Mapping[str, sp.Expr] | None = None,
) -> sp.Expr:
    """Return the rate of change of a function along a vector field, ∂h/∂t + ∇h·f.

    Examples
    --------
    >>> x, y = real("x"), real("y")
    >>> drift(x - y**2, ["x", "y"], [y, -x])
    2*x*y + y
    """
    return expanded(drift_as_written(function, names, rates, laws or {}))


def drift_as_written(
    function: sp.Expr,
    names: Sequence[str],
    rates: Sequence[sp.Expr],
    laws: Mapping[str, sp.Expr],
) -> sp.Expr:
    """Return the rate of change of a function as a sum that is not multiplied out."""
    moving = dict(zip(names, rates, strict=True))
    moving |= {name: law.diff(TIME) for name, law in laws.items()}
    own, *slopes = gradient(function, (TIME, *map(real, moving)))
    terms = [own]
    for slope, rate in zip(slopes, moving.values(), strict=True):
        if slope != 0:
            terms.append(slope * rate)
    return sp.Add(*terms)


def fixed_state(function: sp.Expr, names: Sequence[str], forcing: Iterable[str] = ()) -> int | None:
    """Return the index of the state that is constant where a function vanishes, if there is one.

    A motion that slides there does not change it.

    Examples
    --------
    >>> x, v = real("x"), real("v")
    >>> fixed_state(v**3 - v, ["x", "v"]), fixed_state(v - x, ["x", "v"])
    (1, None)
    """
    used = function.free_symbols & {*map(real, (*names, *forcing)), TIME}
    name = next(iter(used)).name if len(used) == 1 else ""
    return list(names).index(name) if name in names else None


def shortened(expression: sp.Expr) -> sp.Expr:
    """Cancel common terms of a short expression with exact numbers."""
    if expression.has(sp.Float) or sp.count_ops(expression) > CANCELLED_OPERATIONS:
        return expression
    return cancelled(expression)
