"""The kinds of special points of equilibria that have curves in two parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion
from fastslow.continuation.marks import ExpressionMark, Mark
from fastslow.continuation.point_kinds import PointKind
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.codimension_two import CODIMENSION_TWO
from fastslow.diagrams.points.defining import (
    BranchPointSystem,
    DefiningSystem,
    FoldSystem,
    InterfaceSystem,
    PairSystem,
    TwoFoldSystem,
)
from fastslow.diagrams.points.marked_points import LevelSystem, MarkedKind
from fastslow.errors import ArgumentError
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import SpecialPoint

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PointInPlane:
    """A special point in the plane of two parameters: where its defining system is set up.

    Parameters
    ----------
    field : FrozenField
        With both parameters varying.
    point : SpecialPoint
    u : ndarray, shape (n + 2,)
        States and parameters.
    unit : ndarray, shape (n,)
    span : ndarray, shape (2,)
        Lengths of the ranges of both parameters.
    """

    field: FrozenField
    point: SpecialPoint
    u: Array
    unit: Array
    span: Array

    @property
    def regions(self) -> list[int]:
        """The regions of the point."""
        names = self.field.regions
        return [names.index(region) for region in self.point.regions if region in names]


class CurveKind(PointKind):
    """Base class: special points that are continued as a curve in two parameters."""

    system: ClassVar[type[DefiningSystem]]

    def region(self, place: PointInPlane) -> int:
        """Return the region whose rates vanish."""
        return place.regions[0]

    def start(self, place: PointInPlane) -> tuple[DefiningSystem, Array]:
        """Return the defining system with its first unknowns."""
        system = self.system(place.field, self.region(place), place.unit, place.span)
        return system, system.start(place.u)

    def traced(self, system: DefiningSystem, place: PointInPlane) -> bool:
        """Return whether a curve of a system consists of such points, of the place's region."""
        if system.code != self.code:
            return False
        region, field = self.region(place), system.field
        sides = field.modes[system.region].sides
        twin = system.region
        if sides is not None:
            # the sliding motion with the same equations
            twin = system.region - 1 if sides.escaping else system.region + 1
        return region in (system.region, twin)


class FoldKind(CurveKind):
    """Folds: a zero eigenvalue."""

    system = FoldSystem


class HopfKind(CurveKind):
    """Hopf points and neutral saddles: two eigenvalues with sum zero."""

    def start(self, place: PointInPlane) -> tuple[DefiningSystem, Array]:
        system = PairSystem(place.field, self.region(place), place.unit, place.span)
        frequency, own = place.point.frequency, KINDS[place.point.code]
        squared = frequency**2 if frequency is not None else None
        return system, system.start(place.u, squared if own.squared is None else own.squared)


class BranchPointKind(CurveKind):
    """Branch points: [F_x F_p] is singular."""

    system = BranchPointSystem


class TwoFoldKind(CurveKind):
    """Two-folds: both fields are tangent to an interface."""

    system = TwoFoldSystem


class BoundaryKind(CurveKind):
    """Boundary equilibria: equilibria on an interface."""

    def region(self, place: PointInPlane) -> int:
        """Return neither the sliding motion nor the one held against the wall."""
        field, interface = place.field, place.point.interface
        plain = [
            k
            for k in place.regions
            if field.modes[k].sides is None
            and interface not in [field.interfaces[w] for w in field.modes[k].held]
        ]
        return plain[0] if plain else place.regions[0]

    def start(self, place: PointInPlane) -> tuple[DefiningSystem, Array]:
        field, point = place.field, place.point
        if point.interface not in field.interfaces:
            raise ArgumentError(f"the point {point.label} is not on an interface of the model")
        number = field.interfaces.index(point.interface)
        system = InterfaceSystem(field, self.region(place), place.unit, place.span, number)
        return system, system.start(place.u)

    def traced(self, system: DefiningSystem, place: PointInPlane) -> bool:
        number, field, name = system.own_interface, system.field, place.point.interface
        if number is None or name != field.interfaces[number]:
            return False
        if not field.continuous(str(name)):
            return super().traced(system, place)
        # on the interface the equilibria of both sides coincide
        return self.region(place) in (system.region, field.neighbour(system.region, number))


class MarkedCurveKind(CurveKind):
    """Zeros of an expression."""

    def start(self, place: PointInPlane) -> tuple[DefiningSystem, Array]:
        mark = ExpressionMark(place.point.mark, place.point.expression)
        region = self.region(place)
        system = LevelSystem(place.field, region, place.unit, place.span, mark)
        return system, system.start(place.u)

    def traced(self, system: DefiningSystem, place: PointInPlane) -> bool:
        same = isinstance(system, LevelSystem) and (
            system.mark.expression == place.point.expression
        )
        return same and super().traced(system, place)


#: The kinds with curves.
CURVES: tuple[CurveKind, ...] = (
    FoldKind(POINT_TYPES[FoldSystem.code]),
    HopfKind(POINT_TYPES[PairSystem.code]),
    BranchPointKind(POINT_TYPES[BranchPointSystem.code]),
    BoundaryKind(POINT_TYPES[InterfaceSystem.code]),
    TwoFoldKind(POINT_TYPES[TwoFoldSystem.code]),
    MarkedCurveKind(POINT_TYPES[LevelSystem.code]),
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
