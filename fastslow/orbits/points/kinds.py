"""The kinds of special points of periodic orbits: one object for each code.

A bifurcation knows when it is between two orbits of a branch, its extended equations, and what its
multipliers confirm; every kind with a curve in two parameters knows the equations of the curve, the
codimension-two points on it, and where it ends.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion, always
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points import normal_forms
from fastslow.orbits.points.codimension_two import (
    CUSP,
    DEGENERATE_CONTACT,
    DEGENERATE_DOUBLING,
    DEGENERATE_TORUS,
    DOUBLING_IN_CONTACT,
    FLIP_AND_PAIR,
    FOLD_AND_FLIP,
    FOLD_AND_PAIR,
    FOLD_IN_CONTACT,
    ONE_TO_FOUR,
    ONE_TO_ONE,
    ONE_TO_THREE,
    ONE_TO_TWO,
    TORUS_IN_CONTACT,
    TWO_PAIRS,
    OrbitCodimensionTwo,
)
from fastslow.orbits.points.contacts import ContactEquations
from fastslow.orbits.points.curve_tests import OrbitCurveKind, OrbitPointKind, Start, Tests
from fastslow.orbits.points.location import (
    Extended,
    LocatedOrbit,
    branch_point_system,
    locate_branch_point,
    locate_doubling,
    locate_fold,
    locate_torus,
    multiplier_system,
    torus_system,
)
from fastslow.orbits.points.marked_equations import MarkEquations
from fastslow.orbits.points.multiplier_signs import MultiplierChange, MultiplierSigns
from fastslow.results.point_types import (
    ADDING_SLIDING,
    BRANCH_POINT_OF_CYCLES,
    CORNER_COLLISION,
    CROSSING_SLIDING,
    FOLD_OF_CYCLES,
    GRAZING,
    GRAZING_SLIDING,
    HOMOCLINIC,
    PERIOD_DOUBLING,
    SWITCHING_SLIDING,
    TORUS,
    USER_VALUE,
    kind_of,
)

Array = NDArray[np.float64]

#: Equations, and first values of unknowns beside the orbit.
Equations = tuple[Callable[[Array], Extended], list[float]]

#: Distance of the angle of TR from 0 and π at which its curve is traced no further: folds of
#: cycles and period doublings satisfy its equations there.
NO_RESONANCE = 0.05

#: Unfolding, in units of the equations, above which there is no branch point.
UNFOLDED = 1e-7


class BifurcationKind(OrbitCurveKind):
    """Base class: a multiplier on the unit circle."""

    #: Whether the equations are singular where a multiplier is 1.
    singular: ClassVar[bool] = False

    #: Whether points are located across a contact at which the multipliers are continuous.
    across_contacts: ClassVar[bool] = False

    #: Whether the point is where the multiplier nearest to 1 passes it.
    by_multiplier: ClassVar[bool] = False

    @abstractmethod
    def occurs(self, change: MultiplierChange) -> bool:
        """Whether such a point is between two orbits."""

    @abstractmethod
    def located(self, shooting: Shooting, u: Array, scale: Array, angle: float) -> LocatedOrbit:
        """Solve for the point from an estimate; ``angle`` is that of a critical pair."""

    def test(self, signs: MultiplierSigns) -> float:
        """A function along the branch that vanishes at the point, NaN for none."""
        return np.nan

    def distance(self, signs: MultiplierSigns, critical: complex) -> float:
        """Distance of the nearest multiplier from that of the bifurcation, NaN without one."""
        return abs(signs.nearest_unit)

    def angle_of(self, multiplier: complex) -> float:
        """Argument of the critical pair, NaN without one."""
        return np.nan


class RealKind(BifurcationKind):
    """Base class: a real multiplier ±1."""

    multiplier: ClassVar[float]
    resonance: ClassVar[OrbitCodimensionTwo]
    with_pair: ClassVar[OrbitCodimensionTwo]

    @abstractmethod
    def degeneracy(self, tests: Tests) -> Criterion:
        """The test of the coefficient of the normal form."""

    def equations(self, start: Start, scale: Array) -> Equations:
        return multiplier_system(start.shooting, scale, self.multiplier), []

    def criteria(self, tests: Tests) -> Iterator[Criterion]:
        mu = self.multiplier
        yield self.degeneracy(tests)
        count = tests.count
        if count < 2:
            return
        yield Criterion(self.resonance, lambda z: normal_forms.overlap(tests.at(z), mu), always)
        yield Criterion(FOLD_AND_FLIP, lambda z: tests.singular(z, -mu), always)
        if count > 2:
            yield tests.pairs(self.with_pair, (mu,))


class CycleFoldKind(RealKind):
    """Folds of cycles, LPC."""

    multiplier = 1.0
    singular = True
    by_multiplier = True
    resonance = ONE_TO_ONE
    with_pair = FOLD_AND_PAIR
    touch = FOLD_IN_CONTACT

    def occurs(self, change: MultiplierChange) -> bool:
        return change.folds

    def located(self, shooting: Shooting, u: Array, scale: Array, angle: float) -> LocatedOrbit:
        return locate_fold(shooting, u, scale)

    def test(self, signs: MultiplierSigns) -> float:
        return float(signs.slope)

    def degeneracy(self, tests: Tests) -> Criterion:
        return Criterion(CUSP, tests.quadratic, always)


class DoublingKind(RealKind):
    """Period doublings, PD."""

    multiplier = -1.0
    across_contacts = True
    switches = 2
    resonance = ONE_TO_TWO
    with_pair = FLIP_AND_PAIR
    touch = DOUBLING_IN_CONTACT

    def occurs(self, change: MultiplierChange) -> bool:
        return change.doubles

    def located(self, shooting: Shooting, u: Array, scale: Array, angle: float) -> LocatedOrbit:
        return locate_doubling(shooting, u, scale)

    def test(self, signs: MultiplierSigns) -> float:
        return signs.nearest_flip

    def distance(self, signs: MultiplierSigns, critical: complex) -> float:
        return abs(signs.nearest_flip)

    def degeneracy(self, tests: Tests) -> Criterion:
        return Criterion(
            DEGENERATE_DOUBLING, lambda z: normal_forms.flip_terms(tests.at(z)), always
        )


class TorusKind(BifurcationKind):
    """Torus bifurcations, TR: the further unknown of their curves is the angle."""

    across_contacts = True
    touch = TORUS_IN_CONTACT
    end = "resonance"

    def occurs(self, change: MultiplierChange) -> bool:
        return change.pairs

    def located(self, shooting: Shooting, u: Array, scale: Array, angle: float) -> LocatedOrbit:
        return locate_torus(shooting, u, scale, angle)

    def test(self, signs: MultiplierSigns) -> float:
        return np.nan if signs.pair is None else signs.pair[0]

    def distance(self, signs: MultiplierSigns, critical: complex) -> float:
        return float(np.abs(signs.values - critical).min(initial=np.inf))

    def angle_of(self, multiplier: complex) -> float:
        return abs(float(np.angle(multiplier)))

    def equations(self, start: Start, scale: Array) -> Equations:
        return torus_system(start.shooting, scale), [start.angle]

    def leaves(self, z: Array) -> bool:
        return not NO_RESONANCE < z[-1] < np.pi - NO_RESONANCE

    def angle(self, z: Array) -> float:
        return float(z[-1])

    def criteria(self, tests: Tests) -> Iterator[Criterion]:
        yield Criterion(DEGENERATE_TORUS, tests.cubic, always)
        yield Criterion(ONE_TO_THREE, lambda z: (float(np.cos(z[-1])) + 0.5, 1.0), always)
        yield Criterion(ONE_TO_FOUR, lambda z: (float(np.cos(z[-1])), 1.0), always)
        count = tests.count
        if count > 2:
            yield Criterion(FOLD_AND_PAIR, lambda z: tests.singular(z, 1.0), always)
            yield Criterion(FLIP_AND_PAIR, lambda z: tests.singular(z, -1.0), always)
        if count > 3:
            yield tests.pairs(TWO_PAIRS, None)


class CycleBranchPointKind(BifurcationKind):
    """Branch points of cycles, BPC: the further unknown of their curves unfolds the equations."""

    singular = True
    switches = 1
    end = "unfolded"

    def occurs(self, change: MultiplierChange) -> bool:
        if change.folds:
            return False
        return change.crosses or (change.turns and not change.flat)

    def located(self, shooting: Shooting, u: Array, scale: Array, angle: float) -> LocatedOrbit:
        return locate_branch_point(shooting, u, scale)

    def equations(self, start: Start, scale: Array) -> Equations:
        return branch_point_system(start.shooting, scale), [0.0]

    def leaves(self, z: Array) -> bool:
        return bool(abs(z[-1]) > UNFOLDED)


class ContactKind(OrbitCurveKind):
    """Contacts of an orbit with an interface, or with an edge of a sliding set."""

    def equations(self, start: Start, scale: Array) -> Equations:
        assert start.contact is not None
        return ContactEquations(start.shooting, scale, *start.contact), []

    def criteria(self, tests: Tests) -> Iterator[Criterion]:
        if tests.start.touching:
            yield Criterion(DEGENERATE_CONTACT, tests.curvature, always)
        yield Criterion(FOLD_IN_CONTACT, lambda z: tests.singular(z, 1.0), always)
        yield Criterion(DOUBLING_IN_CONTACT, lambda z: tests.singular(z, -1.0), always)
        if tests.count > 1:
            yield tests.pairs(TORUS_IN_CONTACT, ())


class TouchKind(ContactKind):
    """Contacts at which the orbit touches."""

    touching = True


class GrazingSlidingKind(TouchKind):
    """Contacts with an interface on which the orbit slides beyond."""

    enters_sliding = True


class MarkedOrbitKind(OrbitCurveKind):
    """Zeros of an expression in the numbers of an orbit."""

    def equations(self, start: Start, scale: Array) -> Equations:
        assert start.mark is not None
        assert start.problem is not None
        return MarkEquations(start.problem, start.shooting, scale, start.mark), []


class HomoclinicKind(OrbitPointKind):
    """Homoclinic orbits, HC, at which a branch of cycles ends (`fastslow.orbits.ends`)."""

    ends_curves = True


class CornerKind(OrbitPointKind):
    """Corner collisions, CC, at which two events of the orbit exchange their order."""


FOLD = CycleFoldKind(kind_of(FOLD_OF_CYCLES))
DOUBLING = DoublingKind(kind_of(PERIOD_DOUBLING))
PAIR = TorusKind(kind_of(TORUS))
BRANCHING = CycleBranchPointKind(kind_of(BRANCH_POINT_OF_CYCLES))
MARKED = MarkedOrbitKind(kind_of(USER_VALUE))
CONNECTION = HomoclinicKind(kind_of(HOMOCLINIC))
CORNER = CornerKind(kind_of(CORNER_COLLISION))

#: The bifurcations that are located between the orbits of a branch.
BIFURCATIONS: tuple[BifurcationKind, ...] = (FOLD, BRANCHING, DOUBLING, PAIR)

#: All kinds with curves in two parameters, by code.
KINDS: Mapping[str, OrbitCurveKind] = MappingProxyType(
    {
        kind.code: kind
        for kind in (
            FOLD,
            DOUBLING,
            BRANCHING,
            PAIR,
            TouchKind(kind_of(GRAZING)),
            GrazingSlidingKind(kind_of(GRAZING_SLIDING)),
            TouchKind(kind_of(ADDING_SLIDING)),
            ContactKind(kind_of(CROSSING_SLIDING)),
            ContactKind(kind_of(SWITCHING_SLIDING)),
            MARKED,
        )
    }
)

#: Kinds of points from which another branch of orbits emanates, by code.
SWITCHES: Mapping[str, OrbitCurveKind] = MappingProxyType(
    {code: kind for code, kind in KINDS.items() if kind.switches}
)
