"""Codimension-two points on curves of folds, Hopf points and boundary equilibria.

Each has a test function that changes sign along the curve; the point is located as a solution
of the defining system of the curve together with the test (Kuznetsov 2004, sections 8.7 and
10.3). All tests are dimensionless: they do not depend on the units of states and time, nor on
the rates of uninvolved states.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curve_points import Criterion, CurvePoint, always
from fastslow.continuation.location import slope_sizes
from fastslow.continuation.point_kinds import PointKind
from fastslow.diagrams.eigenvalue_pairs import pair_sums
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.boundary_equilibria import InterfaceSystem
from fastslow.diagrams.points.center_manifolds import (
    NoNormalForm,
    bogdanov_takens,
    double_hopf,
    double_hopf_case,
    generalized_hopf,
    zero_hopf,
    zero_hopf_case,
)
from fastslow.diagrams.points.defining import DefiningSystem, row_sizes
from fastslow.diagrams.points.folds import FoldSystem
from fastslow.diagrams.points.hopf_points import PairSystem
from fastslow.diagrams.points.normal_forms import Vector, cusp_form, forms_at
from fastslow.results.point_types import (
    BOGDANOV_TAKENS,
    CUSP,
    DOUBLE_HOPF,
    FOLD_ON_INTERFACE,
    GENERALIZED_HOPF,
    HOPF_ON_INTERFACE,
    POINT_TYPES,
    ZERO_HOPF,
)

Array = NDArray[np.float64]

#: A pair is imaginary if its product exceeds this fraction of the squared moduli.
IMAGINARY = 1e-9


class CodimensionTwo(PointKind):
    """Base class: the tests of a point along each kind of curve, none by default."""

    def on_folds(self, system: FoldSystem) -> Iterator[Criterion]:
        """Yield the tests along a curve of folds."""
        yield from ()

    def on_pairs(self, system: PairSystem) -> Iterator[Criterion]:
        """Yield the tests along a curve of Hopf points and neutral saddles."""
        yield from ()

    def on_boundaries(self, system: InterfaceSystem, region: int) -> Iterator[Criterion]:
        """Yield the tests along a curve of boundary equilibria, of one adjacent region."""
        yield from ()


class Cusp(CodimensionTwo):
    """The quadratic coefficient of a fold vanishes."""

    def on_folds(self, system: FoldSystem) -> Iterator[Criterion]:
        n, w, region = system.n, system.width, system.region

        def quadratic(z: Array) -> tuple[float, float]:
            v = z[w : w + n]
            raw = (system.unit * v).astype(complex)
            bent = forms_at(system.field, region, z[:w]).form(raw, raw).real / system.unit
            null = left_null(system.at(z)[1], v)
            return float(null @ bent), float(np.abs(null) @ np.abs(bent))

        yield Criterion(self, quadratic, always, region)

    def form(self, system: DefiningSystem, found: CurvePoint) -> dict[str, Any]:
        forms = forms_at(system.field, found.criterion.region, found.z[: system.width])
        return {"coefficient": cusp_form(forms, _jacobian(system, found), system.unit)}


class BogdanovTakens(CodimensionTwo):
    """A double zero eigenvalue."""

    #: The product of the pair of which a curve of Hopf points starts there.
    squared = 0.0

    def absorbs(self, other: PointKind) -> bool:
        """Return whether a point of another kind at the same place is this one: always."""
        return True

    def on_folds(self, system: FoldSystem) -> Iterator[Criterion]:
        n, w = system.n, system.width

        def overlap(z: Array) -> tuple[float, float]:
            v = z[w : w + n]
            return float(left_null(system.at(z)[1], v) @ v), 1.0

        if n > 1:
            yield Criterion(self, overlap, always, system.region)

    def on_pairs(self, system: PairSystem) -> Iterator[Criterion]:
        yield Criterion(self, lambda z: (system.relative(z), 1.0), always, system.region)

    def form(self, system: DefiningSystem, found: CurvePoint) -> dict[str, Any]:
        u, region = found.z[: system.width], found.criterion.region
        return _form(("a", "b"), bogdanov_takens, system.field, region, u, system.unit)


class GeneralizedHopf(CodimensionTwo):
    """The first Lyapunov coefficient vanishes."""

    def on_pairs(self, system: PairSystem) -> Iterator[Criterion]:
        yield Criterion(self, system.lyapunov, _hopf(system), system.region)

    def form(self, system: DefiningSystem, found: CurvePoint) -> dict[str, Any]:
        u, region = found.z[: system.width], found.criterion.region
        frequency = float(np.sqrt(found.z[system.width]))
        form = _form(("l2",), generalized_hopf, system.field, region, u, frequency)
        return {"frequency": frequency, **form}


class ZeroHopf(CodimensionTwo):
    """A zero eigenvalue and an imaginary pair."""

    def on_folds(self, system: FoldSystem) -> Iterator[Criterion]:
        def rest(z: Array) -> Vector:
            values = np.linalg.eigvals(system.jacobian(z))
            return np.asarray(values[np.argsort(np.abs(values))[1:]])

        if system.n > 2:
            yield Criterion(
                self, lambda z: smallest_sum(rest(z)), lambda z: _imaginary(rest(z)), system.region
            )

    def on_pairs(self, system: PairSystem) -> Iterator[Criterion]:
        def value(z: Array) -> tuple[float, float]:
            return smallest_value(system.at(z)[1], system.rate(z)), 1.0

        if system.n > 2:
            yield Criterion(self, value, _hopf(system), system.region)

    def form(self, system: DefiningSystem, found: CurvePoint) -> dict[str, Any]:
        u, region = found.z[: system.width], found.criterion.region
        names, frequency = ("s", "theta", "E"), _frequency(system, found)
        form = _form(names, zero_hopf, system.field, region, u, frequency, system.unit)
        return {"frequency": frequency, "type": zero_hopf_case(form["normal_form"]), **form}


class DoubleHopf(CodimensionTwo):
    """Two imaginary pairs."""

    def on_pairs(self, system: PairSystem) -> Iterator[Criterion]:
        w, hopf = system.width, _hopf(system)

        def rest(z: Array) -> Vector:
            values = np.linalg.eigvals(system.jacobian(z))
            root = np.sqrt(complex(-z[w]))
            kept = list(values)
            for target in (root, -root):
                kept.pop(int(np.argmin(np.abs(np.array(kept) - target))))
            return np.array(kept)

        if system.n > 3:
            yield Criterion(
                self,
                lambda z: smallest_sum(rest(z)),
                lambda z: hopf(z) and _imaginary(rest(z)),
                system.region,
            )

    def form(self, system: DefiningSystem, found: CurvePoint) -> dict[str, Any]:
        u, region = found.z[: system.width], found.criterion.region
        values = np.linalg.eigvals(_jacobian(system, found))
        own = float(np.sqrt(found.z[system.width]))
        others = sorted(values[values.imag > 0].imag, key=lambda f: -abs(f - own))
        other = float(others[0])
        listed = ("p11", "p12", "p21", "p22", "theta", "delta")
        form = _form(listed, double_hopf, system.field, region, u, (own, other), system.unit)
        return {"frequency": other, "type": double_hopf_case(form["normal_form"]), **form}


class OnInterface(CodimensionTwo):
    """Base class of points at which the points of a curve reach an interface."""

    def at_interfaces(
        self, system: DefiningSystem, genuine: Callable[[Array], bool]
    ) -> Iterator[Criterion]:
        """Yield the tests of all bounds of the region of a curve."""
        field, region = system.field, system.region
        sides = field.modes[region].sides
        for k in range(field.signs.shape[1]):
            if field.signs[region, k] == 0:
                continue

            def height(z: Array, k: int = k) -> tuple[float, float]:
                return float(system.heights(z)[k]), 1.0

            def inside(z: Array, k: int = k) -> bool:
                return genuine(z) and system.inside(z, but=k)

            if sides is None or k < len(field.interfaces):
                interface = field.surface_of(region, k)
                beyond = field.neighbour(region, interface)
                yield Criterion(self, height, inside, region, interface, beyond)
            else:
                # the last two rows of a sliding motion are the drifts of both sides: at a zero
                # the point is an equilibrium of that side, on the interface
                side = sides.above if k == field.signs.shape[1] - 2 else sides.below
                yield Criterion(self, height, inside, region, sides.interface, side)


class FoldOnInterface(OnInterface):
    """A fold reaches an interface."""

    ends_curves = True

    def on_folds(self, system: FoldSystem) -> Iterator[Criterion]:
        return self.at_interfaces(system, always)

    def on_boundaries(self, system: InterfaceSystem, region: int) -> Iterator[Criterion]:
        field, n, interface = system.field, system.n, system.interface

        def least(z: Array) -> Array:
            sizes = slope_sizes(
                lambda u: field.residual_and_jacobian(region, u), z[: system.width], system.scales
            )
            return sizes / system.unit

        def matrix(z: Array) -> Array:
            return _slopes(system, region, z)

        beyond = field.neighbour(region, interface)
        yield Criterion(
            self,
            lambda z: (smallest_value(matrix(z), least(z)), 1.0),
            always,
            region,
            interface,
            beyond,
        )
        sliding = None if beyond is None else _sliding(field, region, beyond)
        if beyond is None or sliding is None:
            return
        other = beyond

        def bordered(z: Array) -> tuple[float, float]:
            """[[F_x, E], [h_x, 0]] with the jump E, singular at folds of pseudo-equilibria."""
            u = z[: system.width]
            here, _, _, gradients = field.evaluate(region, u)
            inner, jump = matrix(z), (field.residual_and_jacobian(other, u)[0] - here) / system.unit
            size = float(np.abs(jump / row_sizes(inner)).max()) or 1.0
            edge = gradients[interface] * system.scales
            rows = np.column_stack([inner[:, :n], jump / size, inner[:, n:]])
            last = np.concatenate([edge[:n], [0.0], edge[n:]])
            return smallest_value(np.vstack([rows, last]), np.append(least(z), 0.0)), 1.0

        yield Criterion(self, bordered, always, sliding, interface, region)


class HopfOnInterface(OnInterface):
    """A Hopf point reaches an interface."""

    ends_curves = True

    def on_pairs(self, system: PairSystem) -> Iterator[Criterion]:
        return self.at_interfaces(system, lambda z: bool(z[system.width] > 0))

    def on_boundaries(self, system: InterfaceSystem, region: int) -> Iterator[Criterion]:
        def eigenvalues(z: Array) -> Vector:
            return np.linalg.eigvals(_slopes(system, region, z)[:, : system.n])

        if system.n > 1:
            yield Criterion(
                self,
                lambda z: smallest_sum(eigenvalues(z)),
                lambda z: _imaginary(eigenvalues(z)),
                region,
                system.interface,
                system.field.neighbour(region, system.interface),
            )

    def form(self, system: DefiningSystem, found: CurvePoint) -> dict[str, Any]:
        return {"frequency": _frequency(system, found)}


#: The kinds, in the order in which their tests are searched.
CODIMENSION_TWO: tuple[CodimensionTwo, ...] = (
    FoldOnInterface(POINT_TYPES[FOLD_ON_INTERFACE]),
    HopfOnInterface(POINT_TYPES[HOPF_ON_INTERFACE]),
    Cusp(POINT_TYPES[CUSP]),
    BogdanovTakens(POINT_TYPES[BOGDANOV_TAKENS]),
    GeneralizedHopf(POINT_TYPES[GENERALIZED_HOPF]),
    ZeroHopf(POINT_TYPES[ZERO_HOPF]),
    DoubleHopf(POINT_TYPES[DOUBLE_HOPF]),
)


def _hopf(system: PairSystem) -> Callable[[Array], bool]:
    """Return the function whether the pair of a curve is imaginary."""
    return lambda z: system.relative(z) > IMAGINARY


def _slopes(system: DefiningSystem, region: int, z: Array) -> Array:
    """[F_x F_p] of a region, in the units of a system."""
    slopes = system.field.residual_and_jacobian(region, z[: system.width])[1]
    return np.asarray(slopes * system.scales / system.unit[:, None])


def _jacobian(system: DefiningSystem, found: CurvePoint) -> Array:
    u = found.z[: system.width]
    slopes = system.field.residual_and_jacobian(found.criterion.region, u)[1]
    return np.asarray(slopes[:, : system.n])


def _frequency(system: DefiningSystem, found: CurvePoint) -> float:
    """Frequency of the pair nearest to the imaginary axis."""
    values = np.linalg.eigvals(_jacobian(system, found))
    turning = values[values.imag > 0]
    return float(abs(turning[np.argmin(np.abs(turning.real / turning))].imag))


def left_null(slopes: Array, v: Array) -> Array:
    """Left null vector of F_x, with a smooth orientation along the curve.

    Parameters
    ----------
    slopes : ndarray, shape (n, n + 2)
        [F_x F_p], by which the rows are scaled, for accuracy with fast states.
    v : ndarray, shape (n,)
        The right null vector.
    """
    size = row_sizes(slopes)
    matrix = slopes[:, : len(v)] / size[:, None]
    left, _, _ = np.linalg.svd(matrix)
    w = left[:, -1] / size
    # oriented by the sign of the determinant bordered with the right null vector
    bordered = np.block([[matrix, left[:, -1:]], [v[None, :], np.zeros((1, 1))]])
    side = np.linalg.slogdet(bordered)[0]
    return np.asarray(w / np.linalg.norm(w) * (side if side != 0 else 1.0))


def smallest_sum(values: Vector) -> tuple[float, float]:
    """Return `pair_sums` of eigenvalues as the value of a criterion."""
    return float(pair_sums(values, rounding=0.0)), 1.0


def smallest_value(matrix: Array, rate: Array | float = 0.0) -> float:
    """Smallest singular value of a matrix with unit rows, with the sign of the determinant.

    TracedRows far shorter than ``rate``, one number or one for each, stay short: in a plane that is
    invariant for all parameters the whole row of the state that leaves it vanishes.

    Parameters
    ----------
    matrix : ndarray, shape (n, n + 2)
        [F_x F_p]; the determinant is that of F_x, the length of a row includes F_p.
    """
    size = np.hypot(row_sizes(matrix), rate)
    inner = (matrix / size[:, None])[:, : len(matrix)]
    least = float(np.linalg.svd(inner, compute_uv=False)[-1])
    return float(np.linalg.slogdet(inner)[0]) * least


def _sliding(field: FrozenField, region: int, beyond: int) -> int | None:
    """Return the sliding motion between two regions, None if the field is continuous."""
    pair = {region, beyond}
    for number, mode in enumerate(field.modes):
        if mode.sides is not None and {mode.sides.above, mode.sides.below} == pair:
            return number
    return None


def _imaginary(values: Vector) -> bool:
    """Return whether the pair with the smallest relative sum is imaginary."""
    first, second = (values[k] for k in np.triu_indices(len(values), 1))
    size = np.maximum(np.abs(first), np.abs(second))
    size[size == 0] = 1.0
    k = int(np.argmin(np.abs(first + second) / size))
    return bool((first[k] * second[k]).real > IMAGINARY * size[k] ** 2)


def _form(
    names: Sequence[str], compute: Callable[..., dict[str, float]], *given: Any
) -> dict[str, Any]:
    """Return coefficients of a normal form, with a note on undefined ones."""
    listed = " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
    form: dict[str, float] = {}
    reason = ""
    try:
        with np.errstate(all="ignore"):
            form = compute(*given)
    except NoNormalForm as error:
        reason = str(error)
        if reason.startswith("undefined"):
            reason = f"{listed} {reason}"
    except np.linalg.LinAlgError:
        reason = f"{listed} undefined because the equations of the normal form are singular"
    except NotImplementedError as error:
        reason = f"{listed} undefined because a rate has no Taylor polynomial here: {error}"
    if not reason:
        lost = [n for n in names if not np.isfinite(form.get(n, np.nan))]
        if lost == ["theta", "delta"]:
            reason = "theta and delta undefined because p11 or p22 vanishes"
        elif lost:
            reason = f"{' and '.join(lost)} undefined because a term is not finite"
    kept = {n: v for n, v in form.items() if np.isfinite(v)}
    return {"normal_form": kept, "degeneracy": reason}
