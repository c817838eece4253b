"""Nondimensionalisation: scales that normalise chosen coefficients to one."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import sympy as sp

from fastslow.arguments import formula, instance, items, mapping, refusal, text, validated
from fastslow.errors import ArgumentError, refuse_events, unknown_name
from fastslow.model.clocks import ClockCount, ClockTime
from fastslow.model.equations import sympified
from fastslow.model.model import Model
from fastslow.model.resets import Reset
from fastslow.model.structure import TIME, real
from fastslow.model.switches import Switch
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.symbolic.algebra import expanded_form, within_budget
from fastslow.symbolic.solving.verification import vanishes

#: Scaled time in clocks, until time is replaced.
SCALED = sp.Symbol("(scaled t)", real=True)


def scale_symbol(name: str) -> sp.Symbol:
    """Return the positive symbol of a scale."""
    return sp.Symbol(f"{name}_s", positive=True)


@dataclass(frozen=True)
class Scaling(Displayed):
    """A model in scaled quantities: quantity = scale × scaled quantity.

    Parameters
    ----------
    time : sympy.Expr
        Scale of time.
    scales : NamedMapping of sympy.Expr
        Scale of every state and slow quantity.
    regions : NamedMapping
        Region name to the rates of the scaled states in scaled time.
    interfaces : NamedMapping of sympy.Expr
        Each switching function in scaled quantities, normalised.
    forcing : NamedMapping of sympy.Expr
        Law of each scaled slow quantity in scaled time.
    resets : NamedMapping of Reset
        Each reset in scaled quantities and time, by its name in the model; its own name is the
        scaled relation.
    switches : NamedMapping of Switch
        Likewise.
    """

    time: sp.Expr
    scales: NamedMapping[sp.Expr]
    regions: NamedMapping[NamedMapping[sp.Expr]]
    interfaces: NamedMapping[sp.Expr]
    forcing: NamedMapping[sp.Expr]
    resets: NamedMapping[Reset] = field(default_factory=partial(NamedMapping, "reset"))
    switches: NamedMapping[Switch] = field(default_factory=partial(NamedMapping, "switch"))


@validated(model=instance(Model), region=text, replace=mapping)
def nondimensionalise(
    model: Model,
    unit_coefficients: Iterable[tuple[Any, Any]],
    *,
    region: str | None = None,
    replace: Mapping[Any, Any] | None = None,
) -> Scaling:
    """Nondimensionalise a model such that chosen coefficients become one.

    Every state, every slow quantity and time has a scale. The coefficients are
    products of powers of the scales, so that the conditions are linear in the
    logarithms of the scales and are solved exactly.

    Parameters
    ----------
    model : Model
    unit_coefficients : iterable of (state, term)
        Terms (products of states and slow quantities) whose coefficients in the
        scaled rates of the states are normalised to ±1.
    region : str, optional
        Region of these rates; the first by default.
    replace : mapping, optional
        Parameters to expressions that may contain scales (``theta_s`` for theta), to study
        the effect of a wrongly scaled factor.

    Returns
    -------
    Scaling

    Raises
    ------
    ArgumentError
        If a term is missing from its rate, or the conditions do not determine
        every scale or are inconsistent.
    UnknownNameError
        For a state or region that the model does not have.

    See Also
    --------
    fastslow.compare_scalings, fastslow.reduce_states

    Examples
    --------
    >>> x, r, K = sp.symbols("x r K")
    >>> logistic = Model({x: r * x * (1 - x / K)}, parameters={r: 2, K: 3})
    >>> scaled = nondimensionalise(logistic, [("x", "x"), ("x", "x**2")])
    >>> scaled.time, scaled.scales, scaled.regions["S1"]
    (1/r, {x: K}, {x: -x**2 + x})
    """
    refuse_events(model.events, "nondimensionalise")
    quantities = [*model.states, *model.slow_states, *model.forcing, *model.free]
    scale = {n: scale_symbol(n) for n in (*quantities, "t")}
    positive = {real(n): sp.Symbol(n, positive=v > 0) for n, v in model.parameters.items() if v > 0}
    place = {real(n): scale[n] * real(n) for n in quantities} | {TIME: scale["t"] * TIME}
    known = {*model.parameters, *quantities}
    given = {real(str(k)): _formula(e, known) for k, e in (replace or {}).items()}

    def scaled(state: str, rate: sp.Expr) -> sp.Expr:
        return whole(rate.xreplace(given)) * scale["t"] / scale[state]

    def whole(expression: sp.Expr) -> sp.Expr:
        inside = _clocks_scaled(expression.xreplace(positive), scale["t"])
        return inside.subs(place, simultaneous=True).xreplace({SCALED: TIME})

    whose = region if region is not None else next(iter(model.regions))
    smooth = model.regions[whose].rates
    names = {n: real(n) for n in (*quantities, TIME.name, *model.switches)}
    rows, sides = [], []
    for state, term in items(_pair)("unit_coefficients", unit_coefficients):
        if str(state) not in smooth:
            raise unknown_name("state", state, smooth)
        monomial = _formula(term, known)
        monomial = monomial.xreplace({s: real(s.name) for s in monomial.free_symbols})
        found = _coefficient(scaled(str(state), smooth[str(state)]), monomial, names.values())
        if found == 0:
            raise ArgumentError(f"the rate of {state} has no term {monomial} in region {whose}")
        powers = found.as_powers_dict()
        rows.append([powers.get(s, sp.S.Zero) for s in scale.values()])
        sides.append(found / sp.Mul(*(s ** powers.get(s, 0) for s in scale.values())))
    values = dict(zip(scale.values(), _solved(rows, sides, list(scale)), strict=True))
    back = {s: real(s.name) for s in positive.values()}

    def finish(expression: sp.Expr) -> sp.Expr:
        return sp.sympify(_neat(expression.subs(values, simultaneous=True)).xreplace(back))

    # of many regions most rates are the same
    finished = cache(lambda state, rate: finish(scaled(state, rate)))
    lengths = {n: values[scale[n]].xreplace(back) for n in quantities}
    terms = _ScaledTerms(scale, whole, finish, positive, tuple(names.values()))
    return Scaling(
        values[scale["t"]].xreplace(back),
        NamedMapping("quantity", lengths),
        NamedMapping(
            "region",
            {
                r.name: NamedMapping("state", {n: finished(n, e) for n, e in r.rates.items()})
                for r in model.regions.values()
            },
        ),
        NamedMapping(
            "interface",
            {
                n: finish(_unit(whole(i.function), names.values()))
                for n, i in model.interfaces.items()
            },
        ),
        NamedMapping(
            "slow quantity",
            {n: finish(whole(e) / values[scale[n]]) for n, e in model.forcing.items()},
        ),
        NamedMapping("reset", {n: terms.reset(one) for n, one in model.resets.items()}),
        NamedMapping("switch", {n: terms.switch(one) for n, one in model.switches.items()}),
    )


@dataclass(frozen=True)
class _ScaledTerms:
    """Resets and switches in scaled quantities.

    Parameters
    ----------
    scale : dict
        The scales of quantities and time.
    whole : callable
        An expression of the model in scaled quantities.
    finish : callable
        It with the scales in terms of the parameters.
    positive : dict
        Parameters with their signs.
    moving : tuple of Symbol
        What changes along a trajectory.
    """

    scale: dict[str, sp.Symbol]
    whole: Callable[[sp.Expr], sp.Expr]
    finish: Callable[[sp.Expr], sp.Expr]
    positive: dict[sp.Symbol, sp.Symbol]
    moving: tuple[sp.Symbol, ...]

    def reset(self, one: Reset) -> Reset:
        clock = self._instants(one.clock)
        jump = {n: self.finish(self.whole(e) / self.scale[n]) for n, e in one.jump.items()}
        function = self._height(one.function, clock)
        return Reset(_relation(function, clock), function, NamedMapping("state", jump), clock)

    def switch(self, one: Switch) -> Switch:
        on, off = (self._instants(clock) for clock in one.clocks)
        first, second = (
            self._height(h, clock) for h, clock in zip(one.functions, (on, off), strict=True)
        )
        relations = (_relation(first, on), _relation(second, off))
        return Switch(one.name, relations, (first, second), (on, off))

    def _height(self, function: sp.Expr, clock: tuple[sp.Expr, sp.Expr] | None) -> sp.Expr:
        if clock is not None:
            return TIME - ClockTime(*clock, TIME)
        return self.finish(_unit(self.whole(function), self.moving, keep_sign=True))

    def _instants(self, clock: tuple[sp.Expr, sp.Expr] | None) -> tuple[sp.Expr, sp.Expr] | None:
        """Scaled period and phase of a clock."""
        if clock is None:
            return None
        period, phase = (self.finish(e.xreplace(self.positive) / self.scale["t"]) for e in clock)
        return period, phase


def _relation(function: sp.Expr, clock: tuple[sp.Expr, sp.Expr] | None) -> str:
    """Text of the relation of a reset or a switch."""
    if clock is None:
        return f"{function} > 0"
    period, phase = clock
    return f"Eq(Mod({TIME - phase}, {period}), 0)"


def _clocks_scaled(expression: sp.Expr, scale: sp.Expr) -> sp.Expr:
    """Replace clocks by those of scaled time, before time itself is replaced."""
    counts = {
        c: ClockCount(c.args[0] / scale, c.args[1] / scale, SCALED)
        for c in expression.atoms(ClockCount)
    }
    times = {
        c: scale * ClockTime(c.args[0] / scale, c.args[1] / scale, SCALED)
        for c in expression.atoms(ClockTime)
    }
    return expression.xreplace({**counts, **times})


def _pair(name: str, value: Any) -> tuple[Any, ...]:
    both = items(formula)(name, value)
    if len(both) != 2:
        raise refusal(name, value, "a state and a term of its rate")
    return both


def _formula(given: Any, known: Collection[str]) -> sp.Expr:
    return sympified("a formula", given, known, exact=True)


def _coefficient(rate: sp.Expr, monomial: sp.Expr, quantities: Iterable[sp.Symbol]) -> sp.Expr:
    """Absolute value of the coefficient of a monomial, as one product."""
    moving = list(quantities)
    total = sp.S.Zero
    for term in sp.Add.make_args(sp.expand(rate)):
        constant, rest = term.as_independent(*moving)
        if rest == monomial:
            total += constant
    size = sp.powsimp(sp.factor(sp.together(total))) if within_budget(total) else total
    return sp.Mul(*(-f if f.is_negative else f for f in sp.Mul.make_args(size)))


def _solved(rows: list[list[sp.Expr]], sides: list[sp.Expr], names: list[str]) -> list[sp.Expr]:
    """Scales S with Π S_j**rows[i][j] · sides[i] = 1, by elimination on the exponents."""
    matrix = sp.Matrix(rows)
    _, pivots = matrix.rref()
    if len(pivots) < len(names):
        loose = [n for k, n in enumerate(names) if k not in pivots]
        raise ArgumentError(
            f"the conditions do not determine the scale of {', '.join(loose)}; expected "
            f"{len(names)} independent coefficients, received {len(rows)}"
        )
    if len(rows) > len(names):
        raise ArgumentError(
            f"expected {len(names)} coefficients, one for each scale, received {len(rows)}"
        )
    inverse = matrix.inv()
    return [
        _neat(sp.Mul(*(side ** (-inverse[j, i]) for i, side in enumerate(sides))))
        for j in range(len(names))
    ]


def _unit(function: sp.Expr, moving: Iterable[sp.Symbol], *, keep_sign: bool = False) -> sp.Expr:
    """Divide a switching function by the coefficient of its first moving term, or its size."""
    for symbol in moving:
        slope = sp.expand(function).diff(symbol)
        if slope != 0 and symbol not in slope.free_symbols:
            if keep_sign and not slope.is_positive:
                if not slope.is_negative:
                    continue
                slope = -slope
            return sp.expand(function / slope)
    return function


def _neat(expression: sp.Expr) -> sp.Expr:
    """Collect powers of positive symbols, term by term."""
    terms = [sp.powdenest(sp.powsimp(t)) for t in sp.Add.make_args(sp.expand(expression))]
    return sp.Add(*terms)


@dataclass(frozen=True)
class Identification(Displayed):
    """Comparison of a scaled model with a dimensionless one, term by term.

    Parameters
    ----------
    values : NamedMapping of sympy.Expr
        Parameter of the target to its expression in those of the scaled model.
    contradictions : tuple of sympy.Expr
        Further expressions that would have to vanish; empty if the models agree.
    """

    values: NamedMapping[sp.Expr]
    contradictions: tuple[sp.Expr, ...]

    @property
    def agrees(self) -> bool:
        """True if the models agree."""
        return not self.contradictions


def identify(
    scaling: Scaling,
    target: Model,
    names: Mapping[Any, Any],
    *,
    regions: Mapping[str, str] | None = None,
) -> Identification:
    """Identify the parameters of a dimensionless model with those of a scaled one.

    Coefficients of rates, interfaces and laws of slow quantities are compared.

    Parameters
    ----------
    scaling : Scaling
    target : Model
    names : mapping
        Quantity of the scaled model to that of the target.
    regions : mapping, optional
        Region of the scaled model to that of the target; the same name by default.

    Returns
    -------
    Identification

    Examples
    --------
    >>> x, y, r, K, a = sp.symbols("x y r K a")
    >>> logistic = Model({x: r * x * (1 - x / K)}, parameters={r: 2, K: 3})
    >>> scaled = nondimensionalise(logistic, [("x", "x"), ("x", "x**2")])
    >>> identify(scaled, Model({y: a * y - y**2}, parameters={a: 1}), {"x": "y"}).values
    {a: 1}
    """
    rename = {real(str(k)): real(str(v)) for k, v in names.items()}
    wanted = [real(n) for n in target.parameters]
    inner = {s: sp.Dummy(s.name, real=True) for s in wanted}
    moving = [*(real(n) for n in (*target.states, *target.free, *target.forcing)), TIME]
    gaps: list[sp.Expr] = []
    for region, rates in scaling.regions.items():
        other = target.regions[(regions or {}).get(region, region)].rates
        for state, rate in rates.items():
            mine = other[rename.get(real(state), real(state)).name].xreplace(inner)
            gaps += _coefficients(rate.xreplace(rename) - mine, moving)
    for function, interface in zip(
        scaling.interfaces.values(), target.interfaces.values(), strict=True
    ):
        gaps += _coefficients(
            function.xreplace(rename) - _unit(interface.function.xreplace(inner), moving), moving
        )
    for slow, forcing in scaling.forcing.items():
        mine = target.forcing[rename.get(real(slow), real(slow)).name].xreplace(inner)
        gaps += _forcing_gaps(forcing, mine)
    values, left = _matched(gaps, list(inner.values()))
    return Identification(
        NamedMapping("parameter", {s.name: values[d] for s, d in inner.items() if d in values}),
        tuple(left),
    )


def _coefficients(difference: sp.Expr, moving: Iterable[sp.Symbol]) -> list[sp.Expr]:
    poly = sp.Poly(sp.expand(difference), *moving)
    return [c for c in poly.coeffs() if c != 0]


def _forcing_gaps(forcing: sp.Expr, other: sp.Expr) -> list[sp.Expr]:
    """Differences of the amplitudes and arguments of two laws in time, term by term."""
    gaps = []
    mine, yours = _waves(forcing), _waves(other)
    for kind in dict.fromkeys([*mine, *yours]):
        one = mine.get(kind, (sp.S.Zero, sp.S.Zero))
        two = yours.get(kind, (sp.S.Zero, sp.S.Zero))
        gaps += [a - b for a, b in zip(one, two, strict=True) if a != b]
    return gaps


def _waves(forcing: sp.Expr) -> dict[Any, tuple[sp.Expr, sp.Expr]]:
    """Map each function of time in a forcing to its amplitude and argument."""
    found: dict[Any, tuple[sp.Expr, sp.Expr]] = {}
    for term in sp.Add.make_args(sp.expand(forcing)):
        amplitude, wave = term.as_independent(TIME)
        kind = wave.func if isinstance(wave, sp.Function) else wave
        argument = wave.args[0] if isinstance(wave, sp.Function) else sp.S.Zero
        before = found.get(kind, (sp.S.Zero, argument))
        found[kind] = (before[0] + amplitude, argument)
    return found


def _matched(
    gaps: list[sp.Expr], unknowns: list[sp.Symbol]
) -> tuple[dict[sp.Symbol, sp.Expr], list[sp.Expr]]:
    """Solve the residuals for one unknown at a time; return the values and what remains."""
    values: dict[sp.Symbol, sp.Expr] = {}
    left = [sp.expand(g.subs(TIME, 1)) for g in gaps]
    while True:
        left = [g for g in left if not vanishes(g)]
        options = [
            (len(g.free_symbols & set(unknowns)), k, u)
            for k, g in enumerate(left)
            for u in unknowns
            if u in g.free_symbols and not g.diff(u).free_symbols & set(unknowns)
        ]
        if not options:
            return values, left
        _, k, unknown = min(options, key=lambda o: (o[0], o[1], o[2].name))
        gap = left.pop(k)
        value = expanded_form(-gap.subs(unknown, 0) / gap.diff(unknown))
        values = {u: e.subs(unknown, value) for u, e in values.items()} | {unknown: value}
        left = [sp.expand(g.subs(unknown, value)) for g in left]


@validated(one=mapping, other=mapping)
def compare_scalings(one: Mapping[str, Any], other: Mapping[str, Any]) -> NamedMapping[sp.Expr]:
    """Return the ratios, other to one, of the entries in which two scalings differ.

    Parameters
    ----------
    one, other : mapping
        Name to expression, of scales or of dimensionless parameters.

    Returns
    -------
    NamedMapping of sympy.Expr
        Empty if both agree identically.

    Raises
    ------
    UnknownNameError
        If ``other`` lacks an entry of ``one``.

    See Also
    --------
    fastslow.nondimensionalise

    Examples
    --------
    >>> k, J = sp.symbols("k J", positive=True)
    >>> compare_scalings({"A": J * k, "B": J}, {"A": J * k**2, "B": J})
    {A: k}
    """
    found = {}
    for name, value in one.items():
        if name not in other:
            raise unknown_name("entry", name, other)
        mine, yours = sympified(f"entry {name}", value), sympified(f"entry {name}", other[name])
        if not vanishes(mine - yours):
            found[name] = sp.powsimp(sp.cancel(yours / mine))
    return NamedMapping("entry", found)
