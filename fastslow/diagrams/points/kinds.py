"""The kinds of special points of equilibria."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from fastslow.continuation.curve_points import Criterion
from fastslow.continuation.marks import Mark
from fastslow.continuation.point_kinds import PointKind
from fastslow.diagrams.points.boundary_equilibria import BOUNDARY_EQUILIBRIA
from fastslow.diagrams.points.branch_points import BRANCH_POINTS
from fastslow.diagrams.points.codimension_two import CODIMENSION_TWO
from fastslow.diagrams.points.defining import CurveKind, DefiningSystem
from fastslow.diagrams.points.folds import FOLDS
from fastslow.diagrams.points.hopf_points import HOPF_POINTS
from fastslow.diagrams.points.marked_points import MARKED, MarkedKind
from fastslow.diagrams.points.on_branches import OnBranches
from fastslow.diagrams.points.two_fold_points import TWO_FOLDS
from fastslow.results.point_types import POINT_TYPES

#: The kinds that are found by a test along a branch, in the order in which they are searched.
ON_BRANCHES: tuple[OnBranches, ...] = (FOLDS, BRANCH_POINTS, HOPF_POINTS)

#: The kinds with curves in two parameters.
CURVES: tuple[CurveKind, ...] = (
    FOLDS,
    HOPF_POINTS,
    BRANCH_POINTS,
    BOUNDARY_EQUILIBRIA,
    TWO_FOLDS,
    MARKED,
)

#: The kind of every code; the record alone where nothing else is known.
KINDS: Mapping[str, PointKind] = MappingProxyType(
    {
        **{code: PointKind(record) for code, record in POINT_TYPES.items()},
        **{kind.code: kind for kind in (*CODIMENSION_TWO, *CURVES)},
    }
)


def curve_kind(code: str) -> CurveKind:
    """Return the kind of the points of a curve."""
    kind = KINDS[code]
    assert isinstance(kind, CurveKind)
    return kind


def criteria(system: DefiningSystem, marks: Sequence[Mark]) -> list[Criterion]:
    """Return all tests along a curve: those of codimension-two points, and of marks."""
    marked = (MarkedKind.given(mark).criterion(system) for mark in marks)
    return [*system.tests(CODIMENSION_TWO), *marked]
