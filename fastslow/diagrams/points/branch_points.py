"""Branch points: two curves of equilibria intersect, and [F_x F_p] is singular."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curves import STOPPED
from fastslow.continuation.endings import NO_BRANCH_POINT
from fastslow.continuation.location import Located, branch_point, crossing_tangents
from fastslow.continuation.zeros import Bracket
from fastslow.diagrams.points.defining import CurveKind, DefiningSystem
from fastslow.diagrams.points.on_branches import (
    Detected,
    OnBranches,
    SegmentSurvey,
    SurveyedRows,
    Test,
    mostly,
)
from fastslow.diagrams.points.own_eigenvalues import without_zero
from fastslow.results.base.outcome import Outcome
from fastslow.results.point_types import BRANCH_POINT, CANDIDATE, POINT_TYPES

Array = NDArray[np.float64]

#: Fraction of its unit above which β breaks a branch point: there is no symmetry.
ISOLATED = 1e-7

#: Distance from singularity below which a matrix with unit rows is singular to rounding.
SINGULAR_DISTANCE = 1e-14

#: The same where most rows of a segment are below.
FLAT_DISTANCE = 1e-11

#: Distance of two curves, in units of the window, up to which they intersect if rounding leaves
#: this open; for rates of the size of their terms it is about 1e-7.
INTERSECTION_DISTANCE = 1e-5

#: Distance of two solutions for the same point, in units of the window.
SAME_SOLUTION = 1e-8


class BranchPointSystem(DefiningSystem):
    """F + βψ = 0, [F_x F_p]ᵀψ = 0, |ψ| = 1: a branch point over the first parameter.

    The extra unknowns are ψ and β. In a model without symmetry β does not
    remain zero: branch points are then isolated in the parameter plane.
    """

    code: ClassVar[str] = BRANCH_POINT

    def lost(self, z: Array, scale: Array) -> bool:
        """Return whether β is not zero: without a symmetry the points do not persist."""
        return bool(abs(z[-1]) > ISOLATED * scale[-1])

    def end(self, status: str, z: Array, where: str) -> Outcome | None:
        if status != STOPPED:
            return None
        return NO_BRANCH_POINT.at(where=where)

    def start(self, u: Array) -> Array:
        left, _, _ = np.linalg.svd(self.at(u)[1][:, : self.n + 1])
        return np.concatenate([u, left[:, -1], [0.0]])

    def extras(self, z: Array) -> Array:
        units = np.ones(len(z) - self.width)
        rate = np.abs(z[self.width : -1]) @ np.abs(self.at(z)[1]).sum(axis=1)
        units[-1] = rate if rate > 0 else 1.0
        return units

    def residual(self, z: Array, guide: Array) -> Array:
        rates, slopes = self.at(z)
        n, w = self.n, self.width
        psi, beta = z[..., w : w + n], z[..., -1:]
        null = np.einsum("...ij,...i->...j", slopes[..., : n + 1], psi)
        length = psi @ guide[w : w + n] - 1.0
        return np.concatenate([rates + beta * psi, null, length[..., None]], axis=-1)

    def renewed(self, z: Array) -> Array:
        n, w = self.n, self.width
        psi = z[w : w + n]
        return np.concatenate([z[:w], psi / np.linalg.norm(psi), z[-1:]])


class BranchPointKind(CurveKind, OnBranches):
    """Branch points: [F_x F_p] is singular."""

    system = BranchPointSystem
    changes = (-1, 0, 1)
    identical = "equilibria are not isolated, to rounding: no branch points are reported there."

    def vanishes(self, rows: SurveyedRows) -> bool:
        return mostly(np.abs(rows.branching) < FLAT_DISTANCE)

    def at_rows(self, rows: SurveyedRows, vanishing: bool) -> Array:
        least = np.inf if vanishing else SINGULAR_DISTANCE
        return np.where((np.abs(rows.branching) < least) | rows.undefined, 0.0, rows.branching)

    def test(self, survey: SegmentSurvey) -> Test:
        """Return the distance of [F_x F_p; tangent] from singularity, with its sign."""
        region, scale = survey.segment.region, survey.window.scale

        def crossing(u: Array, along: Array) -> float:
            tangent = survey.tangent(u, along)
            return float(survey.field.branching(region, u[None], tangent[None], scale)[0])

        return crossing

    def located(self, survey: SegmentSurvey, bracket: Bracket) -> Iterator[Detected]:
        found = survey.solved(bracket, self.test(survey), lambda u: _solved(survey, u))
        if found is not None:
            around = survey.rows.eigenvalues[bracket.row : bracket.row + 3]
            yield self.point(
                survey, bracket.row, found, without_zero(survey.eigenvalues(found.u), around)
            )

    def detected(self, survey: SegmentSurvey) -> Iterator[Detected]:
        points = list(super().detected(survey))
        yield from points
        # a branch that leaves the window at a branch point has no row beyond it
        rows, window, test = survey.segment.u, survey.window, survey.tests[self]
        for end, row in ((0, 0), (-1, len(rows) - 2)):
            u = rows[end]
            if row >= 0 and window.at_bounds(u).any() and abs(test[end]) < SAME_SOLUTION:
                found = _solved(survey, u)
                known = any(_coincide(found.u, p.located.u, survey) for p in points)
                if found.converged and _coincide(found.u, u, survey) and not known:
                    yield self.point(survey, row, found)

    def point(self, survey: SegmentSurvey, row: int, located: Located, note: str = "") -> Detected:
        """Return a branch point, a candidate unless its defining equations are solved to rounding.

        ``note`` is what contradicts it.
        """
        note = note or _undecided(located)
        form = {"switch": _crossing_tangent(survey, row, located.u)}
        return Detected(row, self, located, type=CANDIDATE if note else None, note=note, form=form)


BRANCH_POINTS = BranchPointKind(POINT_TYPES[BRANCH_POINT])


def _undecided(located: Located) -> str:
    """Return why a solution of the defining equations is not known to be a branch point."""
    if not located.extra.size:
        return (
            "its defining equations are singular; two curves may pass each other there without "
            "an intersection"
        )
    distance, resolution = located.extra.tolist()
    if distance > 0:
        return (
            f"two curves pass each other at {distance:.1g} of the window, without an "
            "intersection, nearer than the smallest steps"
        )
    if resolution <= INTERSECTION_DISTANCE:
        return ""
    return (
        f"two curves intersect, or pass each other nearer than {resolution:.1g} of the window, "
        "which rounding of the rates does not decide"
    )


def _solved(survey: SegmentSurvey, u: Array) -> Located:
    return branch_point(survey.curve, u, survey.window.scale)


def _coincide(u: Array, other: Array, survey: SegmentSurvey) -> bool:
    """Return whether two solutions are equal to their accuracy."""
    return bool(np.abs((u - other) / survey.window.scale).max() < SAME_SOLUTION)


def _crossing_tangent(survey: SegmentSurvey, row: int, u: Array) -> Array | None:
    """Return the tangent of the branch that crosses a segment after a row."""
    both = crossing_tangents(survey.curve, u, survey.window.scale)
    if both is None:
        return None
    here = survey.segment.tangents[row]
    return np.asarray(both[np.argmin(np.abs(both @ (here * survey.window.weight)))])
