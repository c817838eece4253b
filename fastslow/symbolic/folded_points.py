"""Folded singularities and canard points: zeros of the slow flow on folds of the manifold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.model.structure import TIME, real
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.point_types import (
    CANARD_POINT,
    FOLDED_FOCUS,
    FOLDED_NODE,
    FOLDED_SADDLE,
    point_name,
)
from fastslow.symbolic.closed_forms.forms import CriticalPoint
from fastslow.symbolic.solving.location import short_form

Array = NDArray[np.float64]

#: Relative size below which a number is zero to rounding.
ZERO_NUMBER = 1e-12

#: Digits to which closed forms are evaluated.
CLOSED_FORM_DIGITS = 30


@dataclass(frozen=True, repr=False, kw_only=True)
class CanardPoint(Displayed):
    """The singular Hopf bifurcation and the maximal canard at a canard point.

    Parameters
    ----------
    parameter : str
    value : float
        Value at which the slow rate vanishes on the fold.
    hopf, canard : float
        Value of the singular Hopf bifurcation, and of the maximal canard, to first order in the
        ratio of the rates (Krupa and Szmolyan, SIAM J. Math. Anal. 33, 286-314, 2001, eqs. 3.12
        and 3.16). The order of the error is 3/2.
    coefficient : float
        The coefficient A of the same source: the Hopf bifurcation is supercritical if A < 0.
    """

    parameter: str
    value: float
    hopf: float
    canard: float
    coefficient: float

    @property
    def criticality(self) -> str:
        """``"supercritical"`` or ``"subcritical"``; ``"degenerate"`` if A is 0 to rounding."""
        if abs(self.coefficient) <= ZERO_NUMBER:
            return "degenerate"
        return "supercritical" if self.coefficient < 0 else "subcritical"


@dataclass(frozen=True, repr=False, kw_only=True)
class FoldedPoint(Displayed):
    """A zero of the desingularised slow flow on a fold of the critical manifold.

    Parameters
    ----------
    code : str
        With two slow variables ``"FN"``, ``"FS"`` or ``"FF"``, with one slow variable ``"CN"``;
        empty where the other eigenvalues of the fast rates are not all negative, so that no
        attracting sheet ends at the fold, and where the point is not real or is degenerate.
    form : CriticalPoint
        Its place in closed form, or the equations that are left.
    state : NamedMapping of sympy.Expr
        All fast and slow variables, in closed form where there is one.
    trace, determinant : sympy.Expr or None
        λ₁ + λ₂ and λ₁λ₂ of the desingularised flow, whose other eigenvalues are zero; with two
        slow variables.
    values : NamedMapping of float
        The variables, and a parameter that is solved for, at the parameter values of the model;
        empty if they are not real, or not known. Where one polynomial equation is left of the
        closed form, there is a point for each of its real roots.
    eigenvalues : tuple of complex
        λ₁ and λ₂ at these values, |λ₁| ≥ |λ₂|; empty without values.
    canard : CanardPoint or None
        With one slow variable.
    note : str
    """

    code: str
    form: CriticalPoint
    state: NamedMapping[sp.Expr]
    trace: sp.Expr | None = None
    determinant: sp.Expr | None = None
    values: NamedMapping[float] = field(default_factory=lambda: NamedMapping("variable", {}))
    eigenvalues: tuple[complex, ...] = ()
    canard: CanardPoint | None = None
    note: str = ""
    flow: FoldedFlow | None = field(default=None, repr=False, compare=False)

    @property
    def ratio(self) -> float:
        """μ = λ₂/λ₁ of a folded node, between 0 and 1, else NaN."""
        if not (self.code and self.eigenvalues):
            return float("nan")
        first, second = self.eigenvalues
        is_node = first.imag == 0 and first.real * second.real > 0
        return second.real / first.real if is_node else float("nan")

    @property
    def funnel(self) -> bool:
        """True for a folded node through which trajectories pass from the attracting sheet.

        With positive eigenvalues it has faux canards only.
        """
        return not math.isnan(self.ratio) and self.eigenvalues[0].real < 0

    @property
    def rotations(self) -> int:
        """Largest number s = ⌊(μ + 1)/(2μ)⌋ of small oscillations near a folded node, else 0.

        A bound for rates that are well separated, √ε ≪ μ (Wechselberger, SIAM J. Appl. Dyn.
        Syst. 4, 101-139, 2005).
        """
        mu = self.ratio
        return 0 if math.isnan(mu) else math.floor((mu + 1) / (2 * mu) + ZERO_NUMBER)

    @property
    def canards(self) -> int:
        """Number of canards for well separated rates: s + 1 in a funnel, 1 at a saddle, else 0."""
        if self.funnel:
            return self.rotations + 1
        if not (self.code and self.eigenvalues):
            return 0
        first, second = self.eigenvalues
        return int(first.imag == 0 and first.real * second.real < 0)

    @property
    def words(self) -> str:
        """The type with its numbers."""
        name = point_name(self.code) if self.code else "folded singularity"
        if self.canard is not None:
            one = self.canard
            return (
                f"{name} at {one.parameter} = {one.value:.9g}: {one.criticality} singular Hopf "
                f"bifurcation near {one.hopf:.9g}, maximal canard near {one.canard:.9g}"
            )
        if not self.eigenvalues:
            return name
        first, second = self.eigenvalues
        shown = f"{first.real:.6g}, {second.real:.6g}"
        if first.imag:
            shown = f"{first.real:.6g} ± {first.imag:.6g}i"
        more = ""
        if not math.isnan(self.ratio):
            passage = f"at most {self.rotations} rotations" if self.funnel else "faux canards only"
            more = f", μ = {self.ratio:.6g}, {passage}"
        return f"{name}: eigenvalues {shown}{more}"


@dataclass(frozen=True, repr=False, kw_only=True)
class FoldedFlow(Displayed):
    """What types of folded points are computed from: f, g and the desingularised slow flow.

    Parameters
    ----------
    fast, slow : tuple of str
        The n fast and m slow variables.
    f, g : sympy.Matrix, shape (n, 1) and (m, 1)
    desingularised : sympy.Matrix, shape (n + m, 1)
    parameters : mapping
        Values of the parameters.
    period : float or None
        Of the forcing.
    region : str
    inside : tuple of sympy.Expr
        Functions that are positive in the region.
    equations : str
        The model as text.
    """

    fast: tuple[str, ...]
    slow: tuple[str, ...]
    f: sp.ImmutableDenseMatrix
    g: sp.ImmutableDenseMatrix
    desingularised: sp.ImmutableDenseMatrix
    parameters: Mapping[str, float]
    period: float | None = None
    region: str = ""
    inside: tuple[sp.Expr, ...] = ()
    equations: str = ""

    @cached_property
    def x(self) -> list[sp.Symbol]:
        """The fast variables."""
        return [real(n) for n in self.fast]

    @cached_property
    def y(self) -> list[sp.Symbol]:
        """The slow variables."""
        return [real(n) for n in self.slow]

    @cached_property
    def invariants(self) -> tuple[sp.Expr, sp.Expr]:
        """λ₁ + λ₂ and λ₁λ₂: trace and sum of the principal minors of second order."""
        jacobian = self.desingularised.jacobian([*self.x, *self.y])
        size = jacobian.rows
        pairs = [(i, j) for i in range(size) for j in range(i)]
        minors = (
            jacobian[i, i] * jacobian[j, j] - jacobian[i, j] * jacobian[j, i] for i, j in pairs
        )
        return jacobian.trace(), sp.Add(*minors)

    def numbers(self, expressions: list[sp.Expr], at: Mapping[sp.Symbol, sp.Expr]) -> Array:
        """Evaluate expressions at a place and the parameter values; NaN where not real."""
        known = {real(n): sp.Float(v, CLOSED_FORM_DIGITS) for n, v in self.parameters.items()}
        place = {s: e for s, e in at.items() if s != e}
        found = []
        for expression in expressions:
            inside = sp.sympify(expression).xreplace(place).xreplace(known)
            # an integer that counts periods: the first one
            integers = {s: sp.S.Zero for s in inside.free_symbols if s.is_integer}
            value = sp.N(inside.xreplace(integers), CLOSED_FORM_DIGITS)
            good = value.is_number and value.is_finite and value.is_real
            found.append(float(value) if good else float("nan"))
        return np.array(found)

    def typed(self, form: CriticalPoint) -> list[FoldedPoint]:
        """Return the folded point at a place that satisfies its conditions.

        If one polynomial equation remains, a point for each of its real roots at the parameter
        values.
        """
        roots = self._roots(form) if form.equations else []
        points = [self._examined(form, root) for root in roots or [{}]]
        return [replace(p, form=replace(form, code=p.code), flow=self) for p in points]

    def _roots(self, form: CriticalPoint) -> list[dict[sp.Symbol, sp.Expr]]:
        """Return the real roots of a single remaining equation, at the parameter values."""
        values = {n: v for n, v in self.parameters.items() if n not in form.parameters}
        known = {real(n): sp.Rational(repr(float(v))) for n, v in values.items()}
        left = [sp.sympify(equation).xreplace(known) for equation in form.equations]
        unknown = set().union(*(equation.free_symbols for equation in left))
        if len(left) != 1 or len(unknown) != 1 or not left[0].is_polynomial(*unknown):
            return []
        (symbol,) = unknown
        found = sp.Poly(left[0], symbol).nroots(n=CLOSED_FORM_DIGITS, maxsteps=200)
        return [{symbol: root} for root in found if root.is_real]

    def _examined(self, form: CriticalPoint, root: Mapping[sp.Symbol, sp.Expr]) -> FoldedPoint:
        solved = {**form.state, **form.parameters}
        state = NamedMapping("variable", {n: solved.get(n, real(n)) for n in self._variables})
        place = {real(n): e for n, e in solved.items()}
        trace = determinant = None
        if len(self.slow) == 2:
            trace, determinant = (short_form(e.xreplace(place)) for e in self.invariants)
        base = FoldedPoint(code="", form=form, state=state, trace=trace, determinant=determinant)
        if form.equations and not root:
            return replace(base, note="not in closed form: the remaining equations are given")
        # on the roots of what remains
        place = {s: sp.sympify(e).xreplace(root) for s, e in place.items()}
        varied = next((n for n in form.parameters if n not in self._variables), None)
        if varied is None and trace is None:
            note = "the slow rate vanishes on the fold for all parameter values"
            return replace(base, note=note)
        names = [*self._variables, *([varied] if varied else [])]
        numbers = self.numbers([real(n) for n in names], place)
        if np.isnan(numbers).any():
            return replace(base, note="not real at the parameter values of the model")
        if not self._inside(form, root):
            known = dict(zip(map(real, names), map(sp.Float, numbers), strict=True))
            heights = np.abs(self.numbers(list(self.inside), known))
            where = "on an interface" if (heights <= ZERO_NUMBER).any() else "outside its region"
            return replace(base, note=f"{where} at the parameter values of the model")
        values = dict(zip(names, map(float, numbers), strict=True))
        if self.period is not None:
            values[TIME.name] %= self.period
        base = replace(base, values=NamedMapping("variable", values))
        at = {real(n): sp.Float(v, CLOSED_FORM_DIGITS) for n, v in values.items()}
        spectrum = np.linalg.eigvals(self._matrix(self.f.jacobian(self.x), at))
        others = np.delete(spectrum, int(np.argmin(np.abs(spectrum))))
        attracting = bool((others.real < 0).all())
        if trace is None or determinant is None:
            assert varied is not None
            base = self._canard(base, at, varied) if attracting else base
        else:
            total, product = self.numbers([trace, determinant], place)
            code, note = folded_type(total, product) if attracting else ("", "")
            note = note or ("a root of the remaining equation" if root else "")
            base = replace(base, code=code, eigenvalues=eigenvalue_pair(total, product), note=note)
        return base if attracting else replace(base, note="no attracting sheet ends at this fold")

    @cached_property
    def _variables(self) -> tuple[str, ...]:
        return (*self.fast, *self.slow)

    def _matrix(self, matrix: sp.Matrix, at: Mapping[sp.Symbol, sp.Expr]) -> Array:
        return self.numbers(list(matrix), at).reshape(matrix.shape)

    def _inside(self, form: CriticalPoint, root: Mapping[sp.Symbol, sp.Expr]) -> bool:
        """Check the condition for a point to be in its region, at the parameter values."""
        known = {real(n): sp.Float(v, CLOSED_FORM_DIGITS) for n, v in self.parameters.items()}
        condition = form.admissible.xreplace(root).xreplace(known)
        integers = {e: sp.S.Zero for e in condition.free_symbols if e.is_integer}
        return bool(condition.xreplace(integers) == sp.true)

    def _canard(
        self, base: FoldedPoint, at: Mapping[sp.Symbol, sp.Expr], varied: str
    ) -> FoldedPoint:
        """Return the canard point, reduced to a center manifold with more fast variables."""
        x, a = self.x, real(varied)
        (y,) = self.y
        n = len(x)
        fx = self._matrix(self.f.jacobian(x), at)
        right, left = _null_vectors(fx)
        border = np.block([[fx, right[:, None]], [left[None], np.zeros((1, 1))]])

        def complement(vector: Array) -> Array:
            """Solve f_x h = −(v − φ ψv), ψh = 0."""
            inside = -(vector - right * (left @ vector))
            return np.asarray(np.linalg.solve(border, [*inside, 0.0])[:n])

        def tensor(entries: sp.Matrix, order: int) -> Array:
            each = list(entries)
            for _ in range(order):
                each = [sp.diff(e, s) for e in each for s in x]
            return self.numbers(each, at).reshape((len(list(entries)),) + (n,) * order)

        fy, fa = (self.numbers(list(self.f.diff(s)), at) for s in (y, a))
        fxx, fxxx, fxy = tensor(self.f, 2), tensor(self.f, 3), tensor(self.f.diff(y), 1)
        gx, gxx = tensor(self.g, 1)[0], tensor(self.g, 2)[0]
        gy, ga = self.numbers([self.g[0].diff(y), self.g[0].diff(a)], at)
        bent = fxx @ right @ right
        huu, hy = complement(bent), complement(fy)
        curvature, push = left @ bent, left @ fy
        if abs(curvature) <= ZERO_NUMBER * np.abs(fxx).max(initial=0.0):
            return replace(base, note="degenerate: the fold is not quadratic")
        mixed = left @ (fxx @ hy @ right + fxy @ right)
        cubic = left @ (fxxx @ right @ right @ right + 3 * fxx @ huu @ right)
        slope, slow_bend = gx @ right, right @ gxx @ right + gx @ huu
        separation = -push * slope
        # the fold as the parameter varies
        determinant = self.f.jacobian(x).det()
        rows = self.numbers([determinant.diff(s) for s in (*x, y, a)], at)
        system = np.vstack([np.column_stack([fx, fy]), rows[:-1]])
        moved = np.linalg.solve(system, -np.array([*fa, rows[-1]]))
        drift = ga + gx @ moved[:-1] + gy * moved[-1]
        if not separation > 0 or curvature == 0:
            return replace(base, note="no singular Hopf bifurcation: the equilibrium is a saddle")
        p = 2 / curvature
        q = -p / push
        a2, a3, a4 = mixed * p / push, p**2 * cubic / 6, slow_bend * p / (2 * slope)
        a5 = (gy + gx @ hy) / separation
        coefficient = -a2 + 3 * a3 - 2 * a4 - 2 * a5
        unit = q * separation**2 / drift
        value = base.values[varied]
        canard = CanardPoint(
            parameter=varied,
            value=value,
            hopf=float(value + unit * a5 / 2),
            canard=float(value + unit * (a5 / 2 + coefficient / 8)),
            coefficient=float(coefficient),
        )
        return replace(base, code=CANARD_POINT, canard=canard)


def _null_vectors(matrix: Array) -> tuple[Array, Array]:
    """Right and left vectors of the smallest singular value, with product 1."""
    left, _, right = np.linalg.svd(matrix)
    phi, psi = right[-1], left[:, -1]
    return phi, psi / (psi @ phi)


def folded_type(total: float, product: float) -> tuple[str, str]:
    """Return the code of a folded point, empty where it is degenerate, and a note."""
    if abs(product) <= ZERO_NUMBER * total**2:
        return "", "an eigenvalue is zero: a folded saddle-node"
    if product < 0:
        return FOLDED_SADDLE, ""
    return (FOLDED_FOCUS, "") if total**2 < 4 * product else (FOLDED_NODE, "")


def eigenvalue_pair(total: float, product: float) -> tuple[complex, complex]:
    """Return two numbers by their sum and their product, the larger modulus first."""
    square = total**2 / 4 - product
    if square < 0:
        return complex(total / 2, math.sqrt(-square)), complex(total / 2, -math.sqrt(-square))
    larger = total / 2 + math.copysign(math.sqrt(square), total)
    # without the cancellation in the smaller one
    return complex(larger), complex(product / larger if larger else 0.0)
