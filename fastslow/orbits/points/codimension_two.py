"""Codimension-two points on curves of special points of periodic orbits.

Each has a test function along the curve, and is located by the search of
`fastslow.continuation.curve_points`. On curves of multipliers these are degenerate normal
forms (CPC, GPD, CH), strong resonances (R1 to R4) and further critical multipliers (LPPD, LPNS,
PDNS, NSNS; Kuznetsov 2004, chapter 9). A contact with an interface on them is the grazing of a
nonhyperbolic orbit (LPGR, PDGR, NSGR), also found on the curve of contacts; a second contact is
GRGR, and h'' = 0 at the touch a degenerate grazing DGR (types II, III and I of Kowalczyk et al.
2006).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion, always
from fastslow.continuation.point_kinds import PointKind
from fastslow.orbits.flow.equations import NODE
from fastslow.orbits.flow.flows import fields, flow
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.shooting import Shooting
from fastslow.orbits.points import normal_forms
from fastslow.orbits.points.contacts import ContactEquations
from fastslow.orbits.points.detection import multipliers_at
from fastslow.orbits.points.marks import OrbitMark
from fastslow.orbits.points.normal_forms import ReturnMap
from fastslow.results.point_types import (
    CHENCINER,
    CUSP_OF_CYCLES,
    DEGENERATE_GRAZING,
    DOUBLE_TORUS,
    FLIP_TORUS,
    FOLD_FLIP,
    FOLD_OF_CYCLES,
    FOLD_TORUS,
    GENERALIZED_DOUBLING,
    GRAZING_DOUBLING,
    GRAZING_FOLD,
    GRAZING_TORUS,
    PERIOD_DOUBLING,
    RESONANCE_1,
    RESONANCE_2,
    RESONANCE_3,
    RESONANCE_4,
    TORUS,
    TWO_CONTACTS,
)

Array = NDArray[np.float64]

#: The real multiplier on a curve.
MULTIPLIER = {FOLD_OF_CYCLES: 1.0, PERIOD_DOUBLING: -1.0}

#: Newton steps for the instant of a touch.
STEPS = 30

#: A pair of multipliers is complex if the sine of its argument exceeds this.
COMPLEX = 1e-6


@dataclass(frozen=True, eq=False)
class Start:
    """A special point of an orbit in the equations of two chosen parameters.

    Parameters
    ----------
    code : str
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

    code: str
    shooting: Shooting
    u: Array
    sizes: Array
    angle: float = np.nan
    contact: tuple[int, int, int] | None = None
    touching: bool = False
    mark: OrbitMark | None = None
    problem: OrbitProblem | None = None

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
        """The test functions of a curve of multipliers or of contacts."""
        code = self.start.code
        if self.start.contact is not None:
            yield from self._contact()
        elif code == TORUS:
            yield from self._torus()
        elif code in MULTIPLIER:
            yield from self._real(code)

    def _real(self, code: str) -> Iterator[Criterion]:
        mu, other = MULTIPLIER[code], -MULTIPLIER[code]
        if code == FOLD_OF_CYCLES:
            yield Criterion(PointKind.of(CUSP_OF_CYCLES), self._quadratic, always)
        else:
            yield Criterion(
                PointKind.of(GENERALIZED_DOUBLING),
                lambda z: normal_forms.flip_terms(self.at(z)),
                always,
            )
        count = len(self._multipliers(self.rows[0]))
        if count < 2:
            return
        double = RESONANCE_1 if code == FOLD_OF_CYCLES else RESONANCE_2
        yield Criterion(
            PointKind.of(double), lambda z: normal_forms.overlap(self.at(z), mu), always
        )
        yield Criterion(PointKind.of(FOLD_FLIP), lambda z: self._singular(z, other), always)
        if count > 2:
            both = FOLD_TORUS if code == FOLD_OF_CYCLES else FLIP_TORUS
            yield self._pairs(both, (mu,))

    def _torus(self) -> Iterator[Criterion]:
        yield Criterion(PointKind.of(CHENCINER), self._cubic, always)
        yield Criterion(
            PointKind.of(RESONANCE_3), lambda z: (float(np.cos(z[-1])) + 0.5, 1.0), always
        )
        yield Criterion(PointKind.of(RESONANCE_4), lambda z: (float(np.cos(z[-1])), 1.0), always)
        count = len(self._multipliers(self.rows[0]))
        if count > 2:
            yield Criterion(PointKind.of(FOLD_TORUS), lambda z: self._singular(z, 1.0), always)
            yield Criterion(PointKind.of(FLIP_TORUS), lambda z: self._singular(z, -1.0), always)
        if count > 3:
            yield self._pairs(DOUBLE_TORUS, None)

    def _contact(self) -> Iterator[Criterion]:
        if self.start.touching:
            yield Criterion(PointKind.of(DEGENERATE_GRAZING), self.curvature, always)
        yield Criterion(PointKind.of(GRAZING_FOLD), lambda z: self._singular(z, 1.0), always)
        yield Criterion(PointKind.of(GRAZING_DOUBLING), lambda z: self._singular(z, -1.0), always)
        if len(self._multipliers(self.rows[0])) > 1:
            yield self._pairs(GRAZING_TORUS, ())

    def _multipliers(self, z: Array) -> NDArray[np.complex128]:
        """All nontrivial multipliers."""
        at = self.at(z)
        return multipliers_at(at.shooting, at.u, at.last).nontrivial

    def _singular(self, z: Array, multiplier: float) -> tuple[float, float]:
        """Smallest singular value of A(±1), with the sign of its determinant."""
        matrix = self.at(z).matrix(multiplier).real
        sizes = np.linalg.svd(matrix, compute_uv=False)
        return float(np.linalg.slogdet(matrix)[0] * sizes[-1]), 1.0

    def _pairs(self, code: str, critical: tuple[float, ...] | None) -> Criterion:
        """Test for a further pair of multipliers on the unit circle."""

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
            return bool(abs(values[k[nearest]].imag) > COMPLEX)

        return Criterion(PointKind.of(code), value, genuine)

    def _quadratic(self, z: Array) -> tuple[float, float]:
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

    def _cubic(self, z: Array) -> tuple[float, float]:
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
        code = {
            FOLD_OF_CYCLES: GRAZING_FOLD,
            PERIOD_DOUBLING: GRAZING_DOUBLING,
            TORUS: GRAZING_TORUS,
        }.get(self.start.code, TWO_CONTACTS)
        height = partial(touch_height, shooting, segment, function, share)
        size = max(abs(height(z[:N])) for z in self.rows) or 1.0
        return Criterion(PointKind.of(code), lambda z: (height(z[:N]) / size, 1.0), always)

    def normal_form(self, code: str, z: Array) -> tuple[dict[str, float], str]:
        """Coefficients of the normal form at a point, and which ones are not computed."""
        forms: dict[str, Callable[[ReturnMap], dict[str, float]]] = {
            CUSP_OF_CYCLES: normal_forms.cusp_form,
            FOLD_FLIP: normal_forms.fold_flip_form,
            RESONANCE_1: normal_forms.first_resonance,
            RESONANCE_2: normal_forms.second_resonance,
            RESONANCE_3: normal_forms.third_resonance,
            RESONANCE_4: normal_forms.fourth_resonance,
        }
        found: dict[str, float] = {}
        note = NOT_COMPUTED.get(code, "")
        if code in forms:
            with np.errstate(all="ignore"):
                found = forms[code](self.at(z))
            lost = [name for name, value in found.items() if not np.isfinite(value)]
            if lost:
                note = f"{', '.join(lost)} undefined because a denominator vanishes"
        return {name: value for name, value in found.items() if np.isfinite(value)}, note


#: Coefficients that decide on the unfolding and are not computed.
NOT_COMPUTED = {
    GENERALIZED_DOUBLING: "coefficient of fifth order not computed",
    CHENCINER: "second Lyapunov coefficient not computed",
    RESONANCE_3: "cubic coefficient not computed",
    FOLD_FLIP: "cubic coefficients not computed",
    FOLD_TORUS: "normal form not computed",
    FLIP_TORUS: "normal form not computed",
    DOUBLE_TORUS: "normal form not computed",
    GRAZING_FOLD: "unfolding not computed",
    GRAZING_DOUBLING: "unfolding not computed",
    GRAZING_TORUS: "unfolding not computed",
    TWO_CONTACTS: "unfolding not computed",
}


def touch_height(shooting: Shooting, segment: int, function: int, share: float, u: Array) -> float:
    """A switching function where it is stationary inside a segment, near a fraction of it."""
    segments, _ = shooting.unpack(u)
    variations, p = shooting.variations, shooting.parameters_at(u)
    n, row = variations.n, slice(segment, segment + 1)
    duration = float(segments.durations[segment])
    offset = share * duration
    for _ in range(STEPS):
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
