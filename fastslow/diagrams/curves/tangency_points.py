"""Tangency points of the vector fields of a frozen model with its interfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mpmath
import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.arguments import instance, mapping, validated
from fastslow.continuation.location import newton
from fastslow.continuation.ordering import in_order
from fastslow.continuation.polynomial_systems import Solutions, solve_polynomials
from fastslow.diagrams.field import require_frozen
from fastslow.diagrams.modes import Mode, modes_of
from fastslow.diagrams.solve.equations import COMPLETE_ROOTS_DEGREE, NEWTON_STARTS
from fastslow.diagrams.solve.equilibrium_sets import ZERO_FUNCTION
from fastslow.diagrams.solve.exact_polynomials import IRRATIONAL_DIGITS, terms_of
from fastslow.errors import ArgumentError, ModelError, refuse_resets, refuse_switches
from fastslow.model.functions import numpy_function
from fastslow.model.interfaces import vanishes_on
from fastslow.model.model import Model
from fastslow.model.motion import drift
from fastslow.model.structure import exact_values, real
from fastslow.model.units import natural_units
from fastslow.results.branch.tangencies import Tangencies, Tangency
from fastslow.results.stored.model import finite_number
from fastslow.symbolic.solving.elimination import eliminate

Array = NDArray[np.float64]

#: Largest correction of a root of a polynomial by Newton's method, relative to the state.
ROOT_CORRECTION = 1e-3


@validated(model=instance(Model), values=mapping)
def tangencies(
    model: Model, values: Mapping[Any, float] | None = None, /, **named: float
) -> Tangencies:
    """Compute all tangency points of a frozen model: h = 0 and ∇h·f = 0 for one side.

    In the plane they are isolated. With n > 2 states they form surfaces of dimension n − 2, and
    n − 2 states must be fixed. If both equations are polynomials all solutions are found, and
    ``completeness`` is ``"complete"``; otherwise Newton's method is applied from many starting
    points, and it is ``"found"``. Interfaces to which a field is tangent everywhere are omitted.

    Parameters
    ----------
    model : Model
        A frozen model.
    values : mapping, optional
        Slow quantity, parameter, or fixed state (symbol or name) to its value.
    **named : float
        The same by keyword.

    Returns
    -------
    Tangencies
        A list of Tangency, interface by interface and region by region.

    Raises
    ------
    UnknownNameError
        For a name that is neither a parameter nor a state.
    ModelError
        For a slow quantity without a value.
    ArgumentError
        If not exactly n − 2 states are fixed, or the model has only one state.

    See Also
    --------
    fastslow.equilibria, fastslow.continue_equilibria

    Examples
    --------
    A block on a belt with speed 1 and dry friction; the tangencies bound the sticking set.

    >>> x, v = sp.symbols("x v")
    >>> block = Model({x: v, v: -x - sp.sign(v - 1) / 2})
    >>> for point in tangencies(block):
    ...     print(point)
    Tangency(x = -0.5, v = 1; of S1 to v - 1; invisible)
    Tangency(x = 0.5, v = 1; of S2 to v - 1; visible)
    """
    changes = {str(k): v for k, v in {**(values or {}), **named}.items()}
    held = {n: finite_number(f"state {n}", changes.pop(n)) for n in model.states if n in changes}
    refuse_resets(model.resets, "tangencies")
    refuse_switches(model.switches, "tangencies")
    require_frozen(model, "compute the tangencies of")
    given = model.with_parameters(changes)
    _check(given, held)
    by_signs = {mode.signs: mode for mode in modes_of(given) if mode.sides is None}
    modes = _possible(given, [*by_signs.values()], held)
    found: list[Tangency] = []
    complete = True
    for k in range(len(given.interfaces)):
        for mode in modes:
            across = (*mode.signs[:k], -mode.signs[k], *mode.signs[k + 1 :])
            contact = TangencyEquations(given, mode, by_signs.get(across), k, held)
            complete &= contact.solved[1]
            found += contact.points()
    return Tangencies(found, "complete" if complete else "found")


def _check(model: Model, held: Mapping[str, float]) -> None:
    free = [n for n in model.free if n not in model.parameters]
    if free:
        raise ModelError(
            f"the frozen slow quantity '{free[0]}' has no value; give one, "
            f"as in tangencies(model, {free[0]}=…)"
        )
    wanted = len(model.states) - 2
    if wanted < 0:
        raise ArgumentError(
            "tangency points need two states; a model of one state is tangent to an interface "
            "only at a boundary equilibrium, which continue_equilibria finds"
        )
    if len(held) != wanted:
        left = [n for n in model.states if n not in held]
        received = ", ".join(held) or "none"
        raise ArgumentError(
            f"tangencies of a model with {wanted + 2} states: expected values for {wanted} of "
            f"its states {', '.join(model.states)}, received {received}"
            + (f"; as in tangencies(model, {left[-1]}=0)" if len(held) < wanted else "")
        )


def _possible(model: Model, modes: Sequence[Mode], held: Mapping[str, float]) -> list[Mode]:
    """Return the regions that the fixed states do not exclude, beyond rounding."""
    numbers = exact_values({**model.parameters, **held})
    sides = {}
    for k, interface in enumerate(model.interfaces.values()):
        height = interface.function.subs(numbers)
        if height.is_number:
            terms = [term.subs(numbers) for term in sp.Add.make_args(interface.function)]
            size = sum(abs(float(term)) for term in terms)
            sides[k] = float(height) / size if size > 0 else 0.0
    return [
        mode
        for mode in modes
        if all(mode.signs[k] * side > -ZERO_FUNCTION for k, side in sides.items())
    ]


@dataclass(frozen=True, eq=False)
class TangencyEquations:
    """Tangency equations of one interface and one region, with n − 2 fixed states.

    Parameters
    ----------
    model : Model
    mode : Mode
        The region.
    across : Mode, optional
        The region across the interface.
    interface : int
    held : mapping
        State to its value.
    """

    model: Model
    mode: Mode
    across: Mode | None
    interface: int
    held: Mapping[str, float]

    @cached_property
    def numbers(self) -> dict[sp.Symbol, sp.Rational]:
        """Exact values of all parameters and fixed states."""
        return exact_values({**self.model.parameters, **self.held})

    @property
    def unknown(self) -> tuple[str, ...]:
        """The two unknown states."""
        return tuple(n for n in self.model.states if n not in self.held)

    @cached_property
    def units(self) -> Array:
        """Natural units of the two unknown states."""
        functions = [i.function for i in self.model.interfaces.values()]
        values = {real(n): float(v) for n, v in {**self.model.parameters, **self.held}.items()}
        units = natural_units(self.unknown, self.model.regions.values(), functions, values)
        return np.array([units[name] for name in self.unknown])

    @cached_property
    def equations(self) -> tuple[sp.Expr, sp.Expr]:
        """Functions h and L h (the Lie derivative) of the two unknown states."""
        return tuple(sp.expand(e.subs(self.numbers)) for e in self._symbolic)

    @cached_property
    def _symbolic(self) -> tuple[sp.Expr, sp.Expr]:
        h = self.mode.rows[self.interface]
        return h, drift(h, self.model.states, self.mode.rates)

    @cached_property
    def _function(self) -> Callable[..., Any]:
        return self._numeric(self._symbolic)

    def _numeric(self, expressions: Sequence[sp.Expr]) -> Callable[..., Any]:
        """Return a function of the unknowns, with numbers as arguments: powers of them overflow."""
        powers = set().union(*(e.atoms(sp.Pow) for e in expressions))
        exponents = set().union(*(power.exp.free_symbols for power in powers))
        inside = {s: v for s, v in self.numbers.items() if s in exponents}
        others = {s: float(v) for s, v in self.numbers.items() if s not in exponents}
        symbols = [*map(real, self.unknown), *others]
        function = numpy_function(symbols, [e.subs(inside) for e in expressions])
        return lambda *state: function(*map(np.float64, (*state, *others.values())))

    @cached_property
    def _details(self) -> Callable[..., Any]:
        """L²h, L h across the interface, and every h, of the unknowns."""
        h, rates = self.mode.rows[self.interface], self.mode.rates
        names = self.model.states
        second = drift(drift(h, names, rates), names, rates)
        other = self.across.rates if self.across is not None else rates
        rows = [i.function for i in self.model.interfaces.values()]
        return self._numeric([second, drift(h, names, other), *rows])

    @cached_property
    def _jumps(self) -> bool:
        """Whether the rates are discontinuous across the interface."""
        h, other = self.mode.rows[self.interface], self.across
        if other is None:
            return False
        pairs = zip(self.mode.rates, other.rates, strict=True)
        return any(not vanishes_on(sp.expand(g - f), h) for f, g in pairs)

    @cached_property
    def solved(self) -> tuple[list[Array], bool]:
        """Return solutions for the unknown states, and whether they are provably all."""
        names = self.unknown
        left = eliminate(dict(zip(names, self.equations, strict=True)), names)
        if any(e.is_number and e.is_nonzero for e in left.remaining):
            return [], True
        if left.unknowns and len(left.remaining) < len(left.unknowns):
            # tangent everywhere along the interface
            return [], True
        if not left.is_polynomial or left.divisors:
            return self._searched(), False
        terms = terms_of(left.remaining, left.unknowns)
        if terms is None or any(sum(e) > COMPLETE_ROOTS_DEGREE for q in terms for e in q):
            return self._searched(), False
        formula = sp.lambdify(left.unknowns, left.state({}, names), "mpmath")
        roots = (
            solve_polynomials(terms)
            if terms
            else Solutions(np.empty((1, 0)), np.empty((0, 2, 0)), True)
        )
        found = [self._refined(_state_at(formula, root), ROOT_CORRECTION) for root in roots.simple]
        near = [_state_at(formula, box.mean(axis=0)) for box in roots.clusters]
        if not roots.complete or any(state is None for state in found):
            return self._searched(), False
        return self._distinct(
            [*found, *(self._refined(guess, ROOT_CORRECTION) for guess in near)]
        ), True

    def _searched(self) -> list[Array]:
        """Search from a fixed sequence of states over several scales."""
        generator = np.random.default_rng(20231)
        spread = 10.0 ** generator.uniform(-2, 1.5, (NEWTON_STARTS, 1))
        starts = generator.standard_normal((NEWTON_STARTS, 2)) * spread * self.units
        return self._distinct([self._refined(s, np.inf) for s in (np.zeros(2), *starts)])

    @np.errstate(all="ignore")
    def _refined(self, guess: Array, reach: float) -> Array | None:
        """Refine a guess by Newton's method; None if it diverges or moves away."""
        scale = np.maximum(self.units, np.abs(guess))
        state, _, _, size = newton(lambda z: self._values(z), guess, scale)
        near = bool(np.all(np.abs(state - guess) <= reach * scale))
        # at a double root the corrections stay near the square root of rounding
        return state if near and size < 1e-6 and self._holds(state) else None

    def _distinct(self, states: Sequence[Array | None]) -> list[Array]:
        kept: list[Array] = []
        for state in states:
            if state is None:
                continue
            gaps = (np.abs(state - o) / np.maximum(self.units, np.abs(o)) for o in kept)
            apart = (float(gap.max()) for gap in gaps)
            if min(apart, default=1.0) > 1e-6:
                kept.append(state)
        return [kept[k] for k in in_order(np.reshape(kept, (-1, 2)), self.units)]

    def _values(self, state: Array) -> Array:
        return np.array(self._function(*state), dtype=float)

    def _holds(self, state: Array) -> bool:
        """Return whether both equations are satisfied up to rounding in their terms."""
        terms = self._terms(self._function, state)
        return bool(np.all(np.abs(self._values(state)) <= ZERO_FUNCTION * terms))

    def _terms(self, function: Any, state: Array) -> Array:
        """Return the size of the terms of functions at a state, by differences."""
        step = 1e-6 * np.maximum(self.units, np.abs(state))
        value = np.array(function(*state), dtype=float)
        moved = [np.array(function(*(state + step * e)), dtype=float) for e in np.eye(2)]
        return np.abs(value) + sum(np.abs(m - value) for m in moved) / 1e-6

    @np.errstate(all="ignore")
    def points(self) -> list[Tangency]:
        """Return the solutions in the closure of the region as Tangency objects."""
        found = []
        for state in self.solved[0]:
            second, other, *heights = np.array(self._details(*state), dtype=float)
            size = self._terms(self._details, state)
            bounds = np.array(self.mode.signs[: len(heights)]) * np.array(heights)
            outside = bounds < -ZERO_FUNCTION * size[2:]
            if np.any(np.delete(outside, self.interface)):
                continue
            bends = self.mode.signs[self.interface] * second
            place = dict(zip(self.unknown, state, strict=True)) | dict(self.held)
            found.append(
                Tangency(
                    interface=list(self.model.interfaces)[self.interface],
                    region=self.mode.name,
                    states=self.model.states,
                    state=np.array([place[name] for name in self.model.states]),
                    parameters=dict(self.model.parameters),
                    second_derivative=float(second),
                    visible=bool(bends > 0) if abs(bends) > ZERO_FUNCTION * size[0] else None,
                    two_fold=self._jumps and abs(float(other)) <= ZERO_FUNCTION * size[1],
                    residual=float(np.abs(self._values(state)).max()),
                )
            )
        return found


def _state_at(formula: Callable[..., Sequence[Any]], unknowns: Array) -> Array:
    """Return the state at values of the unknowns, NaN where it is not a number."""
    try:
        with mpmath.workdps(IRRATIONAL_DIGITS):
            return np.array([float(s) for s in formula(*unknowns)])
    except (ArithmeticError, ValueError, TypeError):
        return np.full(2, np.nan)
