"""Curves of special points of periodic orbits: their kinds, and test functions along them.

A zero of a test function is a codimension-two point, located by the search of
`fastslow.continuation.curve_points`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion, always
from fastslow.continuation.point_kinds import PointKind
from fastslow.orbits.flow.equations import NODE
from fastslow.orbits.flow.flows import fields, flow
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points import normal_forms
from fastslow.orbits.points.codimension_two import SECOND_CONTACT, OrbitCodimensionTwo
from fastslow.orbits.points.contacts import ContactEquations
from fastslow.orbits.points.location import Extended
from fastslow.orbits.points.marks import OrbitMark
from fastslow.orbits.points.multiplier_signs import multipliers_at
from fastslow.orbits.points.normal_forms import ReturnMap
from fastslow.results.orbits.orbit import Orbit
from fastslow.results.orbits.special_orbit import SpecialOrbit

Array = NDArray[np.float64]

#: Newton steps for the instant of a touch.
TOUCH_NEWTON_STEPS = 30

#: A pair of multipliers is complex if the sine of its argument exceeds this.
COMPLEX_ARGUMENT = 1e-6


class OrbitPointKind(PointKind):
    """Base class: special points of branches of orbits."""

    def point(
        self,
        parameter: str,
        orbit: Orbit,
        errors: tuple[float, float] = (np.nan, np.nan),
        converged: bool | None = None,
        **entries: Any,
    ) -> SpecialOrbit:
        """Return the special point at an orbit, whose label is given by its branch.

        Parameters
        ----------
        parameter : str
            The parameter of the branch.
        orbit : Orbit
        errors : (float, float)
            Residual of the equations, and the last Newton correction.
        converged : bool, optional
            By default whether the residual is known.
        **entries
            Of `SpecialOrbit`.
        """
        solved = bool(np.isfinite(errors[0])) if converged is None else converged
        return SpecialOrbit(self.code, "", parameter, orbit, *errors, solved, **entries)


class OrbitCurveKind(OrbitPointKind, ABC):
    """Base class: special points of orbits that are continued as a curve in two parameters."""

    #: The point at which the orbits of a curve touch an interface.
    touch: ClassVar[OrbitCodimensionTwo] = SECOND_CONTACT

    #: Whether the orbit touches at a contact, so that a segment is divided there.
    touching: ClassVar[bool] = False

    #: Whether a sliding segment begins at a contact.
    enters_sliding: ClassVar[bool] = False

    #: Number of periods of the orbits that branch off, 0 for none.
    switches: ClassVar[int] = 0

    #: Why a curve ends where a further unknown leaves its range; see `leaves`.
    end: ClassVar[str] = ""

    @abstractmethod
    def equations(
        self, start: Start, scale: Array
    ) -> tuple[Callable[[Array], Extended], list[float]]:
        """Return the equations of the curve, and first values of unknowns beside the orbit."""

    def criteria(self, tests: Tests) -> Iterator[Criterion]:
        """The test functions of codimension-two points on a curve."""
        yield from ()

    def leaves(self, z: Array) -> bool:
        """Whether the curve ends at a row by its further unknown."""
        return False

    def angle(self, z: Array) -> float:
        """Argument of the critical multipliers at a row, NaN without a pair."""
        return np.nan


@dataclass(frozen=True, eq=False)
class Start:
    """A special point of an orbit in the equations of two chosen parameters.

    Parameters
    ----------
    kind : OrbitCurveKind
    shooting : Shooting
        With both parameters of the plane chosen.
    u : ndarray, shape (N + 2,)
    sizes : ndarray, shape (n,)
        Range of every state along the orbit.
    angle : float
        Of the multipliers of TR.
    contact : (int, int, int), optional
        Segment, function and mode of a contact with an interface.
    touching : bool
        Whether the orbit touches at the contact, so that a segment is divided there.
    mark : OrbitMark, optional
        The expression that vanishes.
    problem : OrbitProblem, optional
        Of both parameters, for the numbers in the expression.
    """

    kind: OrbitCurveKind
    shooting: Shooting
    u: Array
    sizes: Array
    angle: float = np.nan
    contact: tuple[int, int, int] | None = None
    touching: bool = False
    mark: OrbitMark | None = None
    problem: OrbitProblem | None = None

    @property
    def code(self) -> str:
        return self.kind.code

    @property
    def smooth(self) -> Shooting:
        """The equations without the event of a touch, regular where the orbit grazes."""
        if not self.touching or self.contact is None:
            return self.shooting
        form = self.shooting.form
        ends = form.ends.copy()
        ends[self.contact[0]] = NODE
        return replace(self.shooting, form=replace(form, ends=ends))

    @property
    def width(self) -> int:
        """Number of the entries of z that are orbit and parameters."""
        return self.shooting.size + 2


@dataclass(eq=False)
class Tests:
    """The test functions of a curve, at unknowns z of its equations.

    Parameters
    ----------
    start : Start
    scale : ndarray, shape (N + 2,)
        Units of the unknowns.
    rows : ndarray, shape (M, …)
        Rows of the curve, along which its null vector is oriented.
    """

    start: Start
    scale: Array
    rows: Array
    null: list[Array] = field(default_factory=list)
    key: bytes = b""
    known: ReturnMap | None = None

    def at(self, z: Array) -> ReturnMap:
        """The return map at a point."""
        if self.known is None or z.tobytes() != self.key:
            u = z[: self.start.width]
            self.known, self.key = ReturnMap(self.start.smooth, u, self.scale), z.tobytes()
        return self.known

    def criteria(self) -> Iterator[Criterion]:
        """The test functions of codimension-two points on the curve."""
        yield from self.start.kind.criteria(self)

    @property
    def count(self) -> int:
        """Number of nontrivial multipliers."""
        return len(self._multipliers(self.rows[0]))

    def _multipliers(self, z: Array) -> NDArray[np.complex128]:
        """All nontrivial multipliers."""
        at = self.at(z)
        return multipliers_at(at.shooting, at.u, at.last).nontrivial

    def singular(self, z: Array, multiplier: float) -> tuple[float, float]:
        """Smallest singular value of A(±1), with the sign of its determinant."""
        matrix = self.at(z).matrix(multiplier).real
        sizes = np.linalg.svd(matrix, compute_uv=False)
        return float(np.linalg.slogdet(matrix)[0] * sizes[-1]), 1.0

    def pairs(self, kind: PointKind, critical: tuple[float, ...] | None) -> Criterion:
        """Test for a further pair of multipliers on the unit circle, beside critical ones.

        None for a critical pair at the last unknown of the curve.
        """

        def rest(z: Array) -> NDArray[np.complex128]:
            values = list(self._multipliers(z))
            own = (np.exp(1j * z[-1]), np.exp(-1j * z[-1])) if critical is None else critical
            for value in own:
                values.pop(int(np.argmin(np.abs(np.array(values) - value))))
            return np.array(values)

        def value(z: Array) -> tuple[float, float]:
            values = rest(z)
            first, second = (values[k] for k in np.triu_indices(len(values), 1))
            gaps = first * second - 1.0
            # the sign of the product with the size of the factor that vanishes
            return float(np.sign(np.prod(gaps / np.abs(gaps)).real) * np.abs(gaps).min()), 1.0

        def genuine(z: Array) -> bool:
            values = rest(z)
            k, m = np.triu_indices(len(values), 1)
            nearest = int(np.argmin(np.abs(values[k] * values[m] - 1.0)))
            return bool(abs(values[k[nearest]].imag) > COMPLEX_ARGUMENT)

        return Criterion(kind, value, genuine)

    def quadratic(self, z: Array) -> tuple[float, float]:
        if not self.null:
            self.null = list(self._oriented())
        N = self.start.width
        gaps = np.abs((self.rows[:, :N] - z[:N]) / self.scale).max(axis=1)
        return normal_forms.fold_terms(self.at(z), self.null[int(np.argmin(gaps))])

    def _oriented(self) -> Iterator[Array]:
        """Null vectors at the rows, each oriented along that before."""
        before: Array | None = None
        for z in self.rows:
            v = self.at(z).critical(1.0)[0].real
            before = v if before is None or v @ before >= 0 else -v
            yield before

    def cubic(self, z: Array) -> tuple[float, float]:
        return normal_forms.torus_terms(self.at(z), float(z[-1]))

    def curvature(self, z: Array) -> tuple[float, float]:
        """H'' at the contact, and the size of its terms."""
        assert self.start.contact is not None
        system = ContactEquations(self.start.shooting, self.scale, *self.start.contact)
        f, _, _, slopes = system.at(z[: self.start.width], self.start.contact[2])
        terms = np.append(slopes[: len(f)] * f, slopes[len(f)])
        return float(terms.sum()), float(np.abs(terms).sum())

    def touch(self, segment: int, offset: float, function: int) -> Criterion:
        """The test of a touch inside a segment, near an offset at the last row."""
        shooting, N = self.start.shooting, self.start.width
        share = offset / float(shooting.unpack(self.rows[-1][:N])[0].durations[segment])
        height = partial(touch_height, shooting, segment, function, share)
        size = max(abs(height(z[:N])) for z in self.rows) or 1.0
        return Criterion(self.start.kind.touch, lambda z: (height(z[:N]) / size, 1.0), always)


def touch_height(shooting: Shooting, segment: int, function: int, share: float, u: Array) -> float:
    """A switching function where it is stationary inside a segment, near a fraction of it."""
    segments, _ = shooting.unpack(u)
    variations, p = shooting.variations, shooting.parameters_at(u)
    n, row = variations.n, slice(segment, segment + 1)
    duration = float(segments.durations[segment])
    offset = share * duration
    for _ in range(TOUCH_NEWTON_STEPS):
        states = flow(
            variations,
            segments.modes[row],
            segments.states[row],
            segments.times[:-1][row],
            np.array([offset]),
            p,
            segments.constants[row],
        ).ends
        place = states, segments.times[row] + offset, p, segments.constants[row]
        point = variations, segments.modes[row], *place
        drift = fields(*point, drifts=True)
        slopes = drift.g_u[0, function]
        bent = float(slopes[:n] @ drift.f[0] + slopes[n])
        step = -float(drift.g[0, function]) / bent if bent else 0.0
        if abs(step) <= 1e-15 * abs(duration):
            break
        offset += float(np.clip(step, -0.1 * duration, 0.1 * duration))
    return float(fields(*point).g[0, function])
