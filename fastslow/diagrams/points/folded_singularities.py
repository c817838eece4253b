"""Folded singularities along curves: their equations in states, slow variables and parameters.

With f = 0, Δ = det f_x = 0 on folds and q = cᵀ adj(f_x) f_y, which is a multiple of ψᵀf_y there,
folded singularities satisfy q·g = 0. Slow rates that vanish at such a point, FSN2, change their
direction along the fold; two points that collide, FSN1, are a fold of their curve.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion, always
from fastslow.continuation.curves import BOUND, ExactSystem
from fastslow.continuation.point_kinds import PointKind
from fastslow.diagrams.endings import LEFT_REGION
from fastslow.diagrams.points.defining import ON_INTERFACE
from fastslow.diagrams.points.folds import FOLDS
from fastslow.model.structure import real
from fastslow.results.base.outcome import Outcome
from fastslow.results.point_types import (
    CANARD_POINT,
    FOLDED_FOCUS,
    FOLDED_NODE,
    FOLDED_SADDLE,
    FOLDED_SADDLE_NODE_1,
    FOLDED_SADDLE_NODE_2,
    POINT_TYPES,
)
from fastslow.symbolic.folded_points import FoldedFlow, eigenvalue_pair, folded_type

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class FoldedConditions:
    """Expressions that vanish at folds and folded singularities.

    Parameters
    ----------
    flow : FoldedFlow
    weights : tuple of float, length n
        The vector c, a right null vector of f_x at a point of the curve.
    """

    flow: FoldedFlow
    weights: tuple[float, ...]

    @cached_property
    def fold(self) -> list[sp.Expr]:
        """F and det f_x."""
        jacobian = self.flow.f.jacobian(self.flow.x)
        return [*self.flow.f, jacobian.det(method="berkowitz")]

    @cached_property
    def push(self) -> sp.Matrix:
        """cᵀ adj(f_x) f_y, shape (1, m)."""
        jacobian = self.flow.f.jacobian(self.flow.x)
        row = sp.Matrix([self.weights]) if len(self.weights) > 1 else sp.ones(1, 1)
        return row * jacobian.adjugate() * self.flow.f.jacobian(self.flow.y)

    @property
    def folded(self) -> sp.Expr:
        """q·g, zero at folded singularities."""
        return (self.push * self.flow.g)[0]

    @property
    def along(self) -> sp.Expr:
        """Component of g along the fold in the plane of two slow variables, zero at FSN2."""
        (one, other), (g, h) = self.push, self.flow.g
        return one * h - other * g


class FoldedKind(PointKind):
    """Base class: the equations of a curve of such points, and their test along other curves."""

    #: Number of parameters over which such points form a curve.
    parameters: ClassVar[int] = 2

    def equations(self, conditions: FoldedConditions) -> list[sp.Expr]:
        """Return what vanishes along a curve of such points."""
        return [*conditions.fold, conditions.folded]

    def code_at(self, system: FoldedSystem, z: Array) -> str:
        """Return the code of a row of a curve of such points."""
        return self.code

    def coefficient(self, system: FoldedSystem, z: Array) -> float:
        """Return μ of folded nodes, else NaN."""
        return float("nan")

    def eigenvalues(self, system: FoldedSystem, z: Array) -> Complex:
        """Return the eigenvalues at a row of a curve of such points."""
        return system.eigenvalues(z)

    def tests(self, system: FoldedSystem) -> Iterator[Criterion]:
        """Yield the tests along a curve of such points."""
        yield from ()

    def on_folds(self, system: FoldedSystem) -> Iterator[Criterion]:
        """Yield the test along a fold curve in two slow variables."""
        yield from ()

    def on_folded(self, system: FoldedSystem) -> Iterator[Criterion]:
        """Yield the test along a curve of folded singularities over one parameter."""
        yield from ()


class FoldCurve(FoldedKind):
    """Folds of the critical manifold."""

    def equations(self, conditions: FoldedConditions) -> list[sp.Expr]:
        return conditions.fold

    def eigenvalues(self, system: FoldedSystem, z: Array) -> Complex:
        return system.fast_eigenvalues(z)

    def tests(self, system: FoldedSystem) -> Iterator[Criterion]:
        return (test for kind in FOLDED_KINDS.values() for test in kind.on_folds(system))


class FoldedSingularity(FoldedKind):
    """A folded node, saddle or focus."""

    parameters = 1

    def code_at(self, system: FoldedSystem, z: Array) -> str:
        return system.type_at(z)

    def coefficient(self, system: FoldedSystem, z: Array) -> float:
        strong, weak = system.eigenvalues(z)
        is_node = system.type_at(z) and strong.imag == 0 and (strong * weak).real > 0
        return float((weak / strong).real) if is_node else float("nan")

    def tests(self, system: FoldedSystem) -> Iterator[Criterion]:
        return (test for kind in FOLDED_KINDS.values() for test in kind.on_folded(system))

    def on_folds(self, system: FoldedSystem) -> Iterator[Criterion]:
        test = system.test(system.conditions.folded)
        yield Criterion(self, test, lambda z: system.type_at(z) == self.code)


class FoldedSaddleNodeI(FoldedKind):
    """Two folded singularities collide."""

    def equations(self, conditions: FoldedConditions) -> list[sp.Expr]:
        return [*conditions.fold, conditions.folded, conditions.flow.invariants[1]]

    def on_folded(self, system: FoldedSystem) -> Iterator[Criterion]:
        def turning(z: Array) -> tuple[float, float]:
            slopes = system.slopes(z, z)[:, :-1] * system.scale[:-1]
            sizes = np.abs(slopes).max(axis=1, keepdims=True)
            return float(np.linalg.det(slopes / np.where(sizes > 0, sizes, 1.0))), 1.0

        yield Criterion(self, turning, always)


class CanardPointKind(FoldedKind):
    """All slow rates vanish on a fold."""

    def equations(self, conditions: FoldedConditions) -> list[sp.Expr]:
        return [*conditions.fold, *conditions.flow.g]


class FoldedSaddleNodeII(CanardPointKind):
    """An equilibrium of the slow flow passes a fold, with two slow variables."""

    def on_folded(self, system: FoldedSystem) -> Iterator[Criterion]:
        yield Criterion(self, system.test(system.conditions.along), always)


#: Fold curves in two slow variables.
FOLD_CURVE = FoldCurve(FOLDS.record)

#: The kinds of points on folds, by code.
FOLDED_KINDS: dict[str, FoldedKind] = {
    kind.code: kind
    for kind in (
        FOLD_CURVE,
        FoldedSingularity(POINT_TYPES[FOLDED_NODE]),
        FoldedSingularity(POINT_TYPES[FOLDED_SADDLE]),
        FoldedSingularity(POINT_TYPES[FOLDED_FOCUS]),
        FoldedSaddleNodeI(POINT_TYPES[FOLDED_SADDLE_NODE_1]),
        FoldedSaddleNodeII(POINT_TYPES[FOLDED_SADDLE_NODE_2]),
        CanardPointKind(POINT_TYPES[CANARD_POINT]),
    )
}


@dataclass(frozen=True, eq=False)
class FoldedSystem(ExactSystem):
    """A curve of folds or folded singularities, over one parameter or two.

    Parameters
    ----------
    conditions : FoldedConditions
    kind : FoldedKind
    free : tuple of str
        The parameters, or slow variables, over which the curve is traced.
    scale : ndarray, shape (N + 1,)
        Unit of each unknown.
    """

    conditions: FoldedConditions
    kind: FoldedKind
    free: tuple[str, ...]
    scale: Array

    @property
    def states(self) -> tuple[str, ...]:
        """The variables that are not free."""
        flow = self.conditions.flow
        return tuple(n for n in (*flow.fast, *flow.slow) if n not in self.free)

    @property
    def n(self) -> int:
        return len(self.states)

    @property
    def width(self) -> int:
        """Number of unknowns."""
        return len(self.names)

    @property
    def unit(self) -> Array:
        """Unit of every state."""
        return self.scale[: self.n]

    @property
    def region_name(self) -> str:
        """The region whose rates vanish."""
        return self.conditions.flow.region

    def end(self, status: str, z: Array, where: str) -> Outcome | None:
        """Return the outcome of a curve that leaves its region, None otherwise."""
        if status != BOUND:
            return None
        return LEFT_REGION.at(region=self.region_name, where=where)

    @property
    def names(self) -> tuple[str, ...]:
        """The unknowns: variables, then what is free."""
        return (*self.states, *self.free)

    @cached_property
    def symbols(self) -> list[sp.Symbol]:
        """The symbols of the unknowns."""
        return [real(name) for name in self.names]

    def function(self, rows: Sequence[sp.Expr]) -> Callable[[Array], Array]:
        """Compile expressions as a function of z, shape (..., N + 1) to (..., k)."""
        values = self.conditions.flow.parameters
        known = {real(n): sp.Float(v, 17) for n, v in values.items() if n not in self.free}
        inside = [sp.sympify(row).xreplace(known) for row in rows]
        made = sp.lambdify(self.symbols, inside, "numpy", cse=True)

        def evaluate(z: Array) -> Array:
            with np.errstate(all="ignore"):
                found = made(*np.moveaxis(z, -1, 0))
            return np.stack([np.broadcast_to(row, z.shape[:-1]) for row in found], axis=-1)

        return evaluate

    @cached_property
    def _rows(self) -> list[sp.Expr]:
        return self.kind.equations(self.conditions)

    @cached_property
    def _equations(self) -> Callable[[Array], Array]:
        return self.function(self._rows)

    @cached_property
    def _slopes(self) -> Callable[[Array], Array]:
        return self.function(list(sp.Matrix(self._rows).jacobian(self.symbols)))

    def residual(self, z: Array, guide: Array) -> Array:
        return self._equations(z)

    def slopes(self, z: Array, guide: Array) -> Array:
        return self._slopes(z).reshape(len(self._rows), len(self.symbols))

    def test(self, expression: sp.Expr) -> Callable[[Array], tuple[float, float]]:
        """Return a function of z: an expression, and the size of its terms by its slopes."""
        compiled = self.function([expression, *(sp.diff(expression, s) for s in self.symbols)])

        def tested(z: Array) -> tuple[float, float]:
            value, *slopes = compiled(z)
            return float(value), float(np.abs(slopes) @ np.maximum(np.abs(z), self.scale))

        return tested

    @cached_property
    def _spectrum(self) -> Callable[[Array], Array]:
        flow = self.conditions.flow
        return self.function([*flow.f.jacobian(flow.x), *flow.invariants])

    def fast_eigenvalues(self, z: Array) -> Complex:
        """Eigenvalues of f_x."""
        n = len(self.conditions.flow.fast)
        return np.linalg.eigvals(self._spectrum(z)[:-2].reshape(n, n)).astype(complex)

    def eigenvalues(self, z: Array) -> Complex:
        """λ₁ and λ₂ of the desingularised flow; with one slow variable those of f_x."""
        if len(self.conditions.flow.slow) != 2:
            return self.fast_eigenvalues(z)
        return np.array(eigenvalue_pair(*self._spectrum(z)[-2:].tolist()))

    def type_at(self, z: Array) -> str:
        """Return the code of a folded point by its eigenvalues, empty if no sheet attracts."""
        fast = self.fast_eigenvalues(z)
        others = np.delete(fast, int(np.argmin(np.abs(fast))))
        if not (others.real < 0).all():
            return ""
        return folded_type(*self._spectrum(z)[-2:].tolist())[0]

    def code_at(self, z: Array) -> str:
        """The code of a row."""
        return self.kind.code_at(self, z)

    @cached_property
    def _inside(self) -> Callable[[Array], Array]:
        return self.function([*self.conditions.flow.inside, sp.S.One])

    def heights(self, z: Array) -> Array:
        """Functions that are positive in the region."""
        return self._inside(z)

    def holds(self, z: Array) -> bool:
        """Return whether a point is in the closure of its region."""
        return bool((self.heights(z) >= -ON_INTERFACE).all())
