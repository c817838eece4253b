"""Branch points, proved on an invariant subspace or by factors of a rate.

A branch point is a singular equilibrium, which no numerical method distinguishes from branches that
pass close to one another. It is a regular solution of other equations where one branch is in an
invariant subspace (Crandall and Rabinowitz 1971), or where a rate has two factors.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, combinations, islice

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.certification.equations import ExactEquations
from fastslow.certification.points.defining import Block, Defined, Local, null_block, vector
from fastslow.results.points import SpecialPoint
from fastslow.symbolic.algebra import factors
from fastslow.symbolic.solving.verification import EXACT, checked

Array = NDArray[np.float64]

#: Relative distance up to which a state may have a value in closed form.
CLOSED_FORM_DISTANCE = 1e-6

#: Largest denominator of a rational value of a state, and of a rational multiple of π.
DENOMINATOR, OF_PI = 100, 6

#: Largest number of subspaces that are tried.
SUBSPACES = 100


def _singular() -> str:
    return "the branches touch, or more than two intersect"


@dataclass(frozen=True, eq=False)
class _Subspace:
    """A linear subspace of the states, as z = 0 in other coordinates.

    Parameters
    ----------
    words : str
        Its equations.
    states : mapping
        States in terms of coordinates z and s, which have the symbols of states.
    across : tuple of Symbol
        The coordinates z.
    rates : tuple of Expr
        Rates of z.
    kept : mapping
        Coordinates s to their rates.
    """

    words: str
    states: Mapping[sp.Symbol, sp.Expr]
    across: tuple[sp.Symbol, ...]
    rates: tuple[sp.Expr, ...]
    kept: Mapping[sp.Symbol, sp.Expr]


def branch_points(equations: ExactEquations, point: SpecialPoint, u: Array) -> Iterator[Defined]:
    """Yield systems of which a branch point may be a regular solution."""
    local = Local(equations, point, u)
    yield from _on_subspaces(local)
    yield from _by_factors(local)


def unfolded(equations: ExactEquations, point: SpecialPoint, u: Array) -> Defined:
    """The system F + β c = 0, F_xᵀψ = 0, F_pᵀψ = 0, c·ψ = 1 (Kuznetsov 2004, section 10.2).

    It is regular at a simple branch point of F + β c, with β as last unknown.
    """
    local = Local(equations, point, u)
    _, left = local.null_vectors()
    psi, beta = vector("psi", len(left)), sp.Symbol("(beta)", real=True)
    border = [sp.Rational(float(c)) for c in left]
    rates = sp.Matrix(equations.rows)
    whole = Block(
        (*equations.unknowns, *psi, beta),
        (
            *(rates + beta * sp.Matrix(border)),
            *(local.symbolic.T * psi),
            (rates.diff(equations.unknowns[-1]).T * psi)[0],
            sum(c * s for c, s in zip(border, psi, strict=True)) - 1,
        ),
        np.concatenate([u, left, [0.0]]),
    )
    return Defined(whole, equations.unknowns, "", _singular)


def _on_subspaces(local: Local) -> Iterator[Defined]:
    """F restricted to an invariant subspace vanishes, and its transversal Jacobian is singular."""
    for one in islice(chain(_constant(local), _paired(local)), SUBSPACES):
        inside = dict.fromkeys(one.across, sp.S.Zero)
        if checked([r.xreplace(inside) for r in one.rates], {}) != EXACT:
            continue
        jacobian = sp.Matrix(one.rates).jacobian(one.across).xreplace(inside)
        coordinates = (*one.kept, local.equations.unknowns[-1])
        place = dict(zip(local.equations.unknowns, local.u, strict=True))
        restricted = Block(
            coordinates,
            tuple(r.xreplace(inside) for r in one.kept.values()),
            np.array([place[s] for s in coordinates]),
        )
        full = Block(one.across, (), np.zeros(len(one.across)))
        numbers = local.values(list(jacobian), full).reshape(jacobian.shape)
        sizes = np.linalg.norm(numbers, axis=1)
        right = np.linalg.svd(numbers / np.where(sizes > 0, sizes, 1.0)[:, None])[2][-1]
        null = null_block(jacobian, right)
        whole = Block(
            (*restricted.unknowns, *null.unknowns),
            (*restricted.rows, *null.rows),
            np.concatenate([restricted.start, null.start]),
        )
        position = tuple(
            sp.sympify(one.states.get(s, s)).xreplace(inside) for s in local.equations.unknowns
        )
        yield Defined(
            whole,
            position,
            f"a second branch crosses the one in the invariant subspace {one.words}",
            _singular,
        )


def _constant(local: Local) -> Iterator[_Subspace]:
    """Subspaces on which states have constant values near those of the point."""
    rates = dict(zip(local.states, local.equations.rows, strict=True))
    place = zip(local.states, local.u.tolist(), strict=False)
    values = {s: _closed_form(local, v) for s, v in place}
    known = {s: value for s, value in values.items() if value is not None}
    for size in range(1, len(known) + 1):
        for chosen in combinations(known, size):
            across = tuple(vector("z", size))
            moved = {s: known[s] + z for s, z in zip(chosen, across, strict=True)}
            yield _Subspace(
                ", ".join(f"{s} = {_shown(known[s])}" for s in chosen),
                moved,
                across,
                tuple(rates[s].xreplace(moved) for s in chosen),
                {s: r.xreplace(moved) for s, r in rates.items() if s not in chosen},
            )


def _closed_form(local: Local, value: float) -> sp.Expr | None:
    """Zero, a number of the equations, a rational one or a multiple of π near a value, or None."""
    numbers = set().union(*(r.atoms(sp.Rational) for r in local.equations.rows))
    candidates = [
        sp.S.Zero,
        *sorted(numbers | {-n for n in numbers}, key=lambda n: abs(float(n) - value)),
        sp.Rational(value).limit_denominator(DENOMINATOR),
        sp.Rational(value / np.pi).limit_denominator(OF_PI) * sp.pi,
    ]
    near = CLOSED_FORM_DISTANCE * max(1.0, abs(value))
    return next((c for c in candidates if abs(float(c) - value) <= near), None)


def _shown(value: sp.Expr) -> str:
    """A number in closed form, in decimals if that is shorter."""
    return min(str(value), f"{float(value):.15g}", key=len)


def _paired(local: Local) -> Iterator[_Subspace]:
    """Subspaces on which pairs of states are equal or opposite, as under a symmetry."""
    rates = dict(zip(local.states, local.equations.rows, strict=True))
    values = dict(zip(local.states, local.u, strict=False))
    near = [
        (a, b, sign)
        for a, b in combinations(local.states, 2)
        for sign in (1, -1)
        if abs(values[a] - sign * values[b]) <= CLOSED_FORM_DISTANCE * max(1.0, abs(values[a]))
    ]
    for size in range(1, len(local.states) // 2 + 1):
        for pairs in combinations(near, size):
            if len({s for a, b, _ in pairs for s in (a, b)}) < 2 * size:
                continue
            across = tuple(vector("z", size))
            moved: dict[sp.Symbol, sp.Expr] = {}
            for (a, b, sign), z in zip(pairs, across, strict=True):
                moved |= {a: a + z, b: sign * (a - z)}
            second = {b for _, b, _ in pairs}
            kept = {s: r for s, r in rates.items() if s not in second}
            kept |= {a: (rates[a] + sign * rates[b]) / 2 for a, b, sign in pairs}
            yield _Subspace(
                ", ".join(f"{b} = {a if sign > 0 else -a}" for a, b, sign in pairs),
                moved,
                across,
                tuple(((rates[a] - sign * rates[b]) / 2).xreplace(moved) for a, b, sign in pairs),
                {s: r.xreplace(moved) for s, r in kept.items()},
            )


def _by_factors(local: Local) -> Iterator[Defined]:
    """Two factors of one rate vanish."""
    rows = local.equations.rows
    for k, row in enumerate(rows):
        simple = [f for f, power in factors(row)[1] if power == 1]
        for one, other in combinations(simple, 2):
            whole = Block(
                local.equations.unknowns,
                (*rows[:k], one, other, *rows[k + 1 :]),
                local.u,
            )
            yield Defined(
                whole,
                local.equations.unknowns,
                f"two branches cross, on which the factors {one} and {other} of the rate of "
                f"{local.states[k]} vanish",
                _singular,
            )
