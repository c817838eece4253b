"""Folds: a zero eigenvalue, at an extremum of the parameter along a branch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion
from fastslow.continuation.location import fold
from fastslow.continuation.zeros import Bracket
from fastslow.diagrams.points.defining import CurveKind, DefiningSystem
from fastslow.diagrams.points.normal_forms import fold_form, forms_at
from fastslow.diagrams.points.on_branches import (
    Detected,
    OnBranches,
    SegmentSurvey,
    SurveyedRows,
    Test,
)
from fastslow.diagrams.points.own_eigenvalues import without_zero
from fastslow.results.point_types import CANDIDATE, FOLD, POINT_TYPES

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class FoldSystem(DefiningSystem):
    """F = 0, J v = 0, |v| = 1; the extra unknowns are v."""

    code: ClassVar[str] = FOLD

    @property
    def tested(self) -> int:
        return self.width + self.n

    def tests(self, kinds: Iterable[Any]) -> Iterator[Criterion]:
        return (criterion for kind in kinds for criterion in kind.on_folds(self))

    def coefficient(self, z: Array) -> float:
        """A of y' = β + a y²."""
        u = z[: self.width]
        raw = self.field.residual_and_jacobian(self.region, u)[1][:, : self.n]
        return fold_form(forms_at(self.field, self.region, u), raw, self.unit)

    def start(self, u: Array) -> Array:
        _, _, right = np.linalg.svd(self.balanced(u))
        return np.concatenate([u, right[-1]])

    def residual(self, z: Array, guide: Array) -> Array:
        rates, slopes = self.at(z)
        v = z[..., self.width :]
        null = np.einsum("...ij,...j->...i", slopes[..., : self.n], v)
        length = v @ guide[self.width :] - 1.0
        return np.concatenate([rates, null, length[..., None]], axis=-1)

    def renewed(self, z: Array) -> Array:
        v = z[self.width :]
        return np.concatenate([z[: self.width], v / np.linalg.norm(v)])


class FoldKind(CurveKind, OnBranches):
    """Folds: a zero eigenvalue."""

    system = FoldSystem
    changes = (-1, 1)

    def at_rows(self, rows: SurveyedRows, vanishing: bool) -> Array:
        return rows.turning

    def test(self, survey: SegmentSurvey) -> Test:
        """Return the parameter component of the tangent, in units of the window."""
        scale = float(survey.window.scale[-1])
        return lambda u, along: float(survey.tangent(u, along)[-1] / scale)

    def located(self, survey: SegmentSurvey, bracket: Bracket) -> Iterator[Detected]:
        scale, row = survey.window.scale, bracket.row
        found = survey.solved(bracket, self.test(survey), lambda u: fold(survey.curve, u, scale))
        if found is None:
            return
        known = survey.rows.eigenvalues
        note = without_zero(survey.eigenvalues(found.u), known[row : row + 3])
        if note and _keeps_orientation(known[row : row + 2]):
            return
        jacobian = survey.curve(found.u)[1][:, : survey.field.n]
        forms = forms_at(survey.field, survey.segment.region, found.u)
        form = {"coefficient": fold_form(forms, jacobian, scale[:-1])}
        yield Detected(row, self, found, type=CANDIDATE if note else None, note=note, form=form)


FOLDS = FoldKind(POINT_TYPES[FOLD])


def _keeps_orientation(eigenvalues: Complex) -> bool:
    """Return whether the determinant has the same sign, not zero, at neighbouring rows.

    The parameter then changes its direction by rounding alone, as at an asymptote.
    """
    modulus = np.abs(eigenvalues)
    if not np.isfinite(modulus).all() or not modulus.all():
        return False
    signs = np.sign((eigenvalues / modulus).prod(axis=-1).real)
    return bool((signs == signs[0]).all())
