"""Hopf points and neutral saddles: two eigenvalues with sum zero, which have one test."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion
from fastslow.continuation.location import Located, hopf_or_neutral_saddle
from fastslow.continuation.point_kinds import PointKind
from fastslow.continuation.zeros import TEST_ROUNDING, Bracket
from fastslow.diagrams.eigenvalue_pairs import (
    ROUNDING,
    pair_sums,
    product_of_pair,
    vanishing_count,
)
from fastslow.diagrams.points.branch_points import BRANCH_POINTS
from fastslow.diagrams.points.defining import CurveKind, DefiningSystem, PointInPlane
from fastslow.diagrams.points.normal_forms import forms_at, lyapunov_at, lyapunov_terms
from fastslow.diagrams.points.on_branches import (
    Detected,
    OnBranches,
    SegmentSurvey,
    SurveyedRows,
    Test,
    mostly,
)
from fastslow.diagrams.points.own_eigenvalues import own_pair
from fastslow.results.point_types import CANDIDATE, HOPF, NEUTRAL_SADDLE, POINT_TYPES

Array = NDArray[np.float64]

#: Relative sum of two eigenvalues that is zero to rounding where it is at most rows of a segment:
#: the eigenvalues of a pair differ by rounding of the rates.
ALIKE = 1e-9

#: Narrowings of a bracket before the first Newton iteration, which costs dozens of evaluations for
#: many states.
NARROWED_FIRST = 3

#: Largest relative sum of the pair at a Hopf point or neutral saddle.
PAIR_SUM = 1e-5

#: Product of two eigenvalues of opposite sign, relative to that at the rows around it, below which
#: both are zero to rounding.
DOUBLE_ZERO_PRODUCT = 1e-9

#: Note on a point with two such eigenvalues.
BOTH = (
    "two eigenvalues vanish there, as where several curves intersect by symmetry, or at a "
    "Bogdanov-Takens point"
)

NEUTRAL_SADDLES = PointKind(POINT_TYPES[NEUTRAL_SADDLE])


class PairSystem(DefiningSystem):
    """F = 0, (J² + κ) v = 0, |v| = 1, ⟨c, v⟩ = 0: two eigenvalues with sum zero.

    The extra unknowns are κ, v and c, a constant vector that with v spans the plane of both
    eigenvectors. κ > 0 is a Hopf point with frequency √κ, κ < 0 a neutral saddle.
    """

    code: ClassVar[str] = HOPF

    @property
    def tested(self) -> int:
        return self.width + 1

    def tests(self, kinds: Iterable[Any]) -> Iterator[Criterion]:
        return (criterion for kind in kinds for criterion in kind.on_pairs(self))

    def code_at(self, z: Array) -> str:
        return NEUTRAL_SADDLES.code if z[self.width] < 0 else self.code

    def relative(self, z: Array) -> float:
        """κ in units of the squared rate of the pair."""
        rate = self.rate(z)
        return float(z[self.width]) / (rate**2 if rate > 0 else 1.0)

    def lyapunov(self, z: Array) -> tuple[float, float]:
        """First Lyapunov coefficient and the size of its terms; NaN at neutral saddles."""
        w, region = self.width, self.region
        if not z[w] > 0:
            return np.nan, np.nan
        raw = self.field.residual_and_jacobian(region, z[:w])[1][:, : self.n]
        return lyapunov_terms(forms_at(self.field, region, z[:w]), raw, float(np.sqrt(z[w])))

    def coefficient(self, z: Array) -> float:
        """l₁, 0 where it is a rounding error."""
        value, size = self.lyapunov(z)
        return 0.0 if abs(value) <= TEST_ROUNDING * size else value

    def start(self, u: Array, squared: float | None = None) -> Array:
        """Return z for a point, given the product of the pair.

        By default the pair is the one with the smallest relative sum.
        """
        if squared is None:
            values = np.linalg.eigvals(self.jacobian(u))
            first, second = (values[k] for k in np.triu_indices(self.n, 1))
            size = np.maximum(np.abs(first) + np.abs(second), np.finfo(float).tiny)
            squared = float((first * second).real[np.argmin(np.abs(first + second) / size)])
        plane = self._plane(u, squared)
        return np.concatenate([u, [squared], plane[0], plane[1]])

    def _plane(self, z: Array, kappa: float) -> Array:
        """Return two vectors that span the null space of J² + κ, shape (2, n)."""
        matrix = self.jacobian(z)
        square = matrix @ matrix + kappa * np.eye(self.n)
        # rows scaled by their terms, for accuracy with fast states
        size = (np.abs(matrix) @ np.abs(matrix)).sum(axis=1, keepdims=True) + abs(kappa)
        _, _, right = np.linalg.svd(square / np.where(size > 0, size, 1.0))
        return np.asarray(right[[-1, -2]])

    def rate(self, z: Array) -> float:
        """Rate of the pair: the norm of the Jacobian in its plane, at least √|κ|."""
        plane = np.linalg.qr(self._plane(z[: self.width], float(z[self.width])).T)[0]
        inner = plane.T @ self.jacobian(z) @ plane
        return float(max(np.linalg.norm(inner), np.sqrt(abs(z[self.width]))))

    def extras(self, z: Array) -> Array:
        units = np.ones(len(z) - self.width)
        rate = self.rate(z)
        units[0] = rate**2 if rate > 0 else 1.0
        return units

    def residual(self, z: Array, guide: Array) -> Array:
        rates, slopes = self.at(z)
        n, w = self.n, self.width
        matrix, kappa, v = slopes[..., :n], z[..., w], z[..., w + 1 : w + 1 + n]
        double = np.einsum("...ij,...jk,...k->...i", matrix, matrix, v) + kappa[..., None] * v
        ends = [
            v @ guide[w + 1 : w + 1 + n] - 1.0,
            v @ guide[w + 1 + n :],
        ]
        kept = z[..., w + 1 + n :] - guide[w + 1 + n :]
        return np.concatenate([rates, double, np.stack(ends, axis=-1), kept], axis=-1)

    def renewed(self, z: Array) -> Array:
        n, w = self.n, self.width
        u, kappa, v = z[:w], z[w], z[w + 1 : w + 1 + n]
        v = v / np.linalg.norm(v)
        # the direction of the null space orthogonal to v
        plane = self._plane(u, kappa)
        plane = plane - np.outer(plane @ v, v)
        other = plane[np.argmax(np.linalg.norm(plane, axis=1))]
        other = other / np.linalg.norm(other)
        if other @ z[w + 1 + n :] < 0:
            other = -other
        return np.concatenate([u, [kappa], v, other])


class HopfKind(CurveKind, OnBranches):
    """Hopf points and neutral saddles: two eigenvalues with sum zero."""

    system = PairSystem
    changes = (-2, 0, 2)
    identical = (
        "the sum of two eigenvalues is zero to rounding: no Hopf points and neutral saddles of "
        "this pair are reported there."
    )

    def start(self, place: PointInPlane) -> tuple[DefiningSystem, Array]:
        system = PairSystem(place.field, self.region(place), place.unit, place.span)
        squared, frequency = place.kind.squared, place.point.frequency
        if squared is None and frequency is not None:
            squared = frequency**2
        return system, system.start(place.u, squared)

    def vanishes(self, rows: SurveyedRows) -> bool:
        values = rows.eigenvalues
        finite = np.isfinite(values).all(axis=-1) & (np.shape(values)[-1] > 1)
        return mostly(np.asarray(finite & (np.abs(pair_sums(values, rounding=0.0)) < ALIKE)))

    def at_rows(self, rows: SurveyedRows, vanishing: bool) -> Array:
        return pair_sums(rows.eigenvalues, alike=_left_out(vanishing))

    def _limits(self, survey: SegmentSurvey) -> tuple[float, float]:
        """Return the sums that are left out between rows, by rounding and as fractions."""
        # a sum that vanishes at most rows, as for a conservative oscillator, is left out; any other
        # is small only near the point to be located
        lost = survey.tests[self] != pair_sums(survey.rows.eigenvalues, rounding=0.0)
        return ROUNDING if mostly(lost) else 0.0, _left_out(survey.vanishing[self])

    def test(self, survey: SegmentSurvey) -> Test:
        """Return `pair_sums`."""
        rounding, alike = self._limits(survey)
        return lambda u, along: float(pair_sums(survey.eigenvalues(u), rounding, alike))

    def located(self, survey: SegmentSurvey, bracket: Bracket) -> Iterator[Detected]:
        row, (rounding, alike) = bracket.row, self._limits(survey)

        def product_at(u: Array) -> float:
            return product_of_pair(survey.eigenvalues(u), rounding, alike)

        nearer = int(abs(bracket.values[1]) < abs(bracket.values[0]))
        product = product_at(bracket.points[nearer])
        around = max(abs(product_at(u)) for u in bracket.points)
        usual = min(vanishing_count(survey.eigenvalues(u), ALIKE) for u in bracket.points)

        def locate(u: Array) -> Located:
            here = product_at(u)
            squared = product if np.isnan(here) else here
            found = hopf_or_neutral_saddle(survey.curve, u, survey.window.scale, squared)
            solved = float(found.extra[0]) if found.extra.size else squared
            # a pair whose sum vanishes all along solves the same equations
            more = vanishing_count(survey.eigenvalues(found.u), PAIR_SUM) > usual
            own = more or abs(solved) <= DOUBLE_ZERO_PRODUCT * around
            return found if own else replace(found, converged=False)

        found = survey.solved(bracket, self.test(survey), locate, first=NARROWED_FIRST)
        if found is None:
            return
        own = survey.eigenvalues(found.u)
        # in a bracket at rounding, the pair at its ends may be another one
        beside = product if rounding else product_of_pair(own, rounding, alike)
        solved = float(found.extra[0]) if found.extra.size else beside
        if abs(solved) <= DOUBLE_ZERO_PRODUCT * around:
            yield BRANCH_POINTS.point(survey, row, found, BOTH)
            return
        kappa, note = own_pair(own, solved, survey.tests[self][row : row + 3])
        kind = self if kappa > 0 else NEUTRAL_SADDLES
        form = _form(survey, found.u, float(np.sqrt(kappa))) if kappa > 0 else {}
        type_ = CANDIDATE if note else None
        yield Detected(row, kind, found, type=type_, note=note, form=form)


def _left_out(vanishing: bool) -> float:
    """Return the relative sum below which a pair is left out."""
    return ALIKE if vanishing else 0.0


def _form(survey: SegmentSurvey, u: Array, frequency: float) -> dict[str, Any]:
    value = lyapunov_at(survey.field, survey.segment.region, u, frequency)
    return {"frequency": frequency, "lyapunov": value}


HOPF_POINTS = HopfKind(POINT_TYPES[HOPF])
