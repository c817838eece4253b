"""Sets of pseudo-equilibria on discontinuities in closed form, such as a sticking band."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp
from sympy.logic.boolalg import Boolean

from fastslow.model.model import Model
from fastslow.model.motion import Motion
from fastslow.model.motions import motions_of
from fastslow.model.recurrences import CODES_KEPT
from fastslow.model.structure import real
from fastslow.model.work import Budget, PastWorkError, cached, nodes, spend
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.signs.signs import Signs

#: Note of an equilibrium that is the edge of a set, followed by the name of the set.
EDGE = "edge of the equilibrium set"

#: Budget of work of the equilibrium sets of a model.
SETS_WORK = 80_000


@dataclass(frozen=True)
class EquilibriumSetForm(Displayed):
    """Equilibria of a Filippov system on one or several discontinuities, in closed form.

    Zero is in the convex hull of the vector fields adjacent to each point (Filippov 1988).

    Parameters
    ----------
    region : str
        The sliding motion, such as ``"S1|S2"``.
    interfaces : tuple of str
        Sliding interfaces.
    free : tuple of Symbol
        States that vary within the set.
    state : NamedMapping of sympy.Expr
        Every state; a free one is given by its own symbol.
    conditions : tuple of Boolean
        Inequalities that bound the set, such as the limits of a friction force or other
        interfaces.
    edges : tuple of NamedMapping
        States at the two ends of a set with one free state, if they have a closed form.
    attracting : bool or None
        True if both vector fields point towards the interface (sticking). None if the
        assumed signs do not decide it, and for several interfaces.
    weights : tuple of sympy.Expr
        Weight of the jump across each interface, between −1 and 1 in the set.
    heights : tuple of sympy.Expr
        Switching functions of the interfaces.
    """

    region: str
    interfaces: tuple[str, ...]
    free: tuple[sp.Symbol, ...]
    state: NamedMapping[sp.Expr]
    conditions: tuple[Boolean, ...]
    edges: tuple[NamedMapping[sp.Expr], ...]
    attracting: bool | None
    weights: tuple[sp.Expr, ...]
    heights: tuple[sp.Expr, ...]

    def on_edge(self, state: Mapping[str, sp.Expr], parameters: Mapping[str, sp.Expr]) -> bool:
        """Check that a state is on the edge of the set, for all other parameter values."""
        at = {real(n): e for n, e in state.items()}
        given = {real(n): e for n, e in parameters.items()}

        def zero(expression: sp.Expr) -> bool:
            return bool(sp.simplify(expression.subs(at).subs(given)) == 0)

        return all(map(zero, self.heights)) and any(zero(1 - s**2) for s in self.weights)


def equilibrium_set_forms(
    model: Model, signs: Signs, exact: Callable[[sp.Expr], sp.Expr]
) -> tuple[tuple[EquilibriumSetForm, ...], tuple[str, ...]]:
    """Return the equilibrium sets of sliding motions, and the motions past the budget of work.

    Parameters
    ----------
    model : Model
    signs : Signs
        Assumed signs of the parameters.
    exact : callable
        Replaces floats by rational numbers.

    Examples
    --------
    >>> x, v, w = sp.symbols("x v w")
    >>> block = Model({x: v, v: w - x - sp.sign(v) / 2}, parameters={w: 0})
    >>> (band,), _ = equilibrium_set_forms(block, Signs({}), lambda e: e)
    >>> band.conditions, [edge["x"] for edge in band.edges]
    ((Abs(w - x) <= 1/2,), [w - 1/2, w + 1/2])
    """
    forms, omitted, budget = [], [], Budget(SETS_WORK)
    for motion in motions_of(model.partition, with_jumps=True).sliding:
        try:
            with budget.spending():
                forms.append(_form(model, motion, signs, exact))
        except PastWorkError:
            omitted.append(motion.name)
    return tuple(form for form in forms if form is not None), tuple(omitted)


def _form(
    model: Model, motion: Motion, signs: Signs, exact: Callable[[sp.Expr], sp.Expr]
) -> EquilibriumSetForm | None:
    functions = [exact(i.function) for i in model.interfaces.values()]
    heights = tuple(functions[j] for j in motion.slides)
    names = model.states
    solution = solved_along(heights, [exact(r) for r in motion.rates], names, signs.nonzero)
    if solution is None or not solution[1]:
        return None
    solved, free = solution[0], solution[1]
    others = [sp.expand(s * functions[j].subs(solved)) for j, s in enumerate(motion.signs) if s]
    if any(h == 0 for h in others):
        # the edge of a set on one more interface
        return None
    walls = (reset for reset in model.resets.values() if reset.clock is None)
    others += [sp.expand(-exact(wall.function).subs(solved)) for wall in walls]
    weights = tuple(sp.cancel(exact(s).subs(solved)) for s in motion.weights)
    bounds = [_bound(weight, free, signs) for weight in weights]
    conditions = [condition for condition, _ in bounds]
    conditions += [sp.Gt(h, 0) for h in others if signs.sign(h) != 1]
    attracting = None
    if len(heights) == 1:
        a, b = (exact(e).subs(solved) for e in motion.bounds)
        sign = signs.sign(sp.expand(a - b))
        attracting = None if sign is None else sign < 0
    interfaces = list(model.interfaces)
    return EquilibriumSetForm(
        region=motion.name,
        interfaces=tuple(interfaces[j] for j in motion.slides),
        free=free,
        state=NamedMapping("state", {n: solved.get(real(n), real(n)) for n in names}),
        conditions=tuple(conditions),
        edges=_edges(bounds[0][1], solved, free, names) if len(bounds) == len(free) == 1 else (),
        attracting=attracting,
        weights=weights,
        heights=heights,
    )


def _bound(
    weight: sp.Expr, free: Sequence[sp.Symbol], signs: Signs
) -> tuple[Boolean, tuple[sp.Expr, sp.Expr]]:
    """Write |s| ≤ 1 as |e| ≤ f, with e monic in its first free state; return also (e, f)."""
    top, below = sp.fraction(sp.cancel(weight))
    slope = next((c for s in free if (c := top.diff(s)) != 0), sp.Integer(1))
    if slope.free_symbols & set(free):
        slope = sp.Integer(1)
    top, below = sp.cancel(top / slope), sp.cancel(below / slope)
    sign = signs.sign(below)
    below = below if sign == 1 else -below if sign == -1 else sp.Abs(below)
    return sp.Le(sp.Abs(sp.expand(top)), sp.expand(below)), (top, below)


def _edges(
    bound: tuple[sp.Expr, sp.Expr],
    solved: Mapping[sp.Symbol, sp.Expr],
    free: Sequence[sp.Symbol],
    names: Sequence[str],
) -> tuple[NamedMapping[sp.Expr], ...]:
    """States at which |e| = f, if e is affine in the only free state."""
    (symbol,), (top, below) = free, bound
    slope = top.diff(symbol)
    if slope == 0 or slope.has(symbol) or below.has(symbol):
        return ()
    edges = []
    for side in (-1, 1):
        at = {symbol: sp.expand(symbol - (top - side * below) / slope)}
        whole = {s: sp.expand(e.subs(at)) for s, e in solved.items()} | at
        edges.append(NamedMapping("state", {n: whole.get(real(n), real(n)) for n in names}))
    return tuple(edges)


def solved_along(
    heights: Sequence[sp.Expr],
    rates: Sequence[sp.Expr],
    names: Sequence[str],
    nonzero: Callable[[sp.Expr], bool] = lambda c: bool(c.is_number and c != 0),
) -> tuple[dict[sp.Symbol, sp.Expr], tuple[sp.Symbol, ...] | None] | None:
    """Solve h = 0 and f = 0 for as many states as they determine.

    Equations that are affine in a state are solved for it successively if its coefficient
    is nonzero according to ``nonzero``, by default if it is a number.

    Returns
    -------
    solved : dict
        States as functions of the free ones.
    free : tuple of Symbol or None
        None if an unsolved equation remains. None is returned in place of both if the
        equations are inconsistent.

    Examples
    --------
    >>> x, v, w = real("x"), real("v"), real("w")
    >>> solved_along([v - w], [v - w, 0], ["x", "v"])
    ({v: w}, (x,))
    """
    left = [_numerator(sp.sympify(e)) for e in (*heights, *rates)]
    states = [real(n) for n in names]
    solved: dict[sp.Symbol, sp.Expr] = {}
    while True:
        left = [e for e in left if e != 0]
        if not left:
            break
        spend(sum(map(nodes, left)))
        if any(not (e.free_symbols & set(states)) for e in left):
            return None
        # interfaces first, then the last states, so that positions remain free
        pick = next(
            (
                (e, s)
                for e in left
                for s in reversed(states)
                if s not in solved
                and not (c := e.diff(s)).free_symbols & set(states)
                and nonzero(c)
            ),
            None,
        )
        if pick is None:
            return solved, None
        equation, symbol = pick
        root = sp.cancel(symbol - equation / equation.diff(symbol))
        solved = {s: sp.expand(e.subs(symbol, root)) for s, e in solved.items()} | {symbol: root}
        left = [_numerator(e.subs(symbol, root)) if e.has(symbol) else e for e in left]
    return solved, tuple(s for s in states if s not in solved)


@cached(CODES_KEPT)
def _numerator(expression: sp.Expr) -> sp.Expr:
    """Return the numerator, multiplied out; sliding motions share most equations."""
    return sp.expand(sp.together(expression).as_numer_denom()[0])
