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
from fastslow.continuation.zeros import ROUNDING
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.center_manifolds import (
    NoNormalForm,
    bogdanov_takens,
    double_hopf,
    double_hopf_case,
    generalized_hopf,
    zero_hopf,
    zero_hopf_case,
)
from fastslow.diagrams.points.defining import DefiningSystem, OnInterface, Pair, row_sizes
from fastslow.diagrams.points.normal_forms import (
    Vector,
    cusp_form,
    fold_form,
    forms_at,
    lyapunov_terms,
)
from fastslow.diagrams.trace.row_tests import pair_sums
from fastslow.results.point_types import (
    BOGDANOV_TAKENS,
    CUSP,
    DOUBLE_HOPF,
    FOLD,
    FOLD_ON_INTERFACE,
    GENERALIZED_HOPF,
    HOPF,
    HOPF_ON_INTERFACE,
    USER_VALUE,
    ZERO_HOPF,
)

Array = NDArray[np.float64]

#: A pair is imaginary if its product exceeds this fraction of the squared moduli.
IMAGINARY = 1e-9


def criteria(
    system: DefiningSystem, others: list[int], marks: Sequence[tuple[int, float]] = ()
) -> list[Criterion]:
    """Return the test functions for a curve of one kind.

    Parameters
    ----------
    system : DefiningSystem
    others : list of int
        For boundary equilibria the adjacent regions, otherwise empty.
    marks : sequence of (int, float)
        Number of a parameter, 0 or 1, and its value at a point UZ.
    """
    at_marks = [_mark(system, k, value) for k, value in marks]
    if isinstance(system, OnInterface):
        found: list[Criterion] = []
        for region in others:
            found += _boundary_tests(system, region)
        return [*found, *at_marks]
    found = list(_interface_tests(system))
    if system.code == FOLD:
        found += _fold_tests(system)
    if isinstance(system, Pair):
        found += _pair_tests(system)
    return [*found, *at_marks]


def _mark(system: DefiningSystem, k: int, value: float) -> Criterion:
    place, span = system.n + k, system.span[k]
    return Criterion(
        PointKind.of(USER_VALUE),
        lambda z: (float(z[place] - value) / span, 1.0),
        always,
        system.region,
    )


def _interface_tests(system: DefiningSystem) -> Iterator[Criterion]:
    """Yield tests for folds and Hopf points on an interface or at the boundary of sliding."""
    field, region = system.field, system.region
    code = {FOLD: FOLD_ON_INTERFACE, HOPF: HOPF_ON_INTERFACE}.get(system.code)
    if code is None:
        return
    sides = field.modes[region].sides
    for k in range(field.signs.shape[1]):
        if field.signs[region, k] == 0:
            continue

        def height(z: Array, k: int = k) -> tuple[float, float]:
            return float(system.heights(z)[k]), 1.0

        def genuine(z: Array, k: int = k) -> bool:
            imaginary = not isinstance(system, Pair) or z[system.width] > 0
            return bool(imaginary) and system.inside(z, but=k)

        if sides is None or k < len(field.interfaces):
            interface = field.surface_of(region, k)
            beyond = field.neighbour(region, interface)
            yield Criterion(PointKind.of(code), height, genuine, region, interface, beyond)
        else:
            # the last two rows of a sliding motion are the drifts of both sides: at a zero
            # the point is an equilibrium of that side, on the interface
            side = sides.above if k == field.signs.shape[1] - 2 else sides.below
            yield Criterion(PointKind.of(code), height, genuine, region, sides.interface, side)


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


def _fold_tests(system: DefiningSystem) -> Iterator[Criterion]:
    n, w, region = system.n, system.width, system.region

    def quadratic(z: Array) -> tuple[float, float]:
        v = z[w : w + n]
        raw = (system.unit * v).astype(complex)
        bent = forms_at(system.field, region, z[:w]).form(raw, raw).real / system.unit
        null = left_null(system.at(z)[1], v)
        return float(null @ bent), float(np.abs(null) @ np.abs(bent))

    def overlap(z: Array) -> tuple[float, float]:
        v = z[w : w + n]
        return float(left_null(system.at(z)[1], v) @ v), 1.0

    yield Criterion(PointKind.of(CUSP), quadratic, always, region)
    if n < 2:
        return
    yield Criterion(PointKind.of(BOGDANOV_TAKENS), overlap, always, region)
    if n < 3:
        return

    def rest(z: Array) -> Vector:
        values = np.linalg.eigvals(system.jacobian(z))
        return np.asarray(values[np.argsort(np.abs(values))[1:]])

    yield Criterion(
        PointKind.of(ZERO_HOPF),
        lambda z: smallest_sum(rest(z)),
        lambda z: _imaginary(rest(z)),
        region,
    )


def _pair_tests(system: Pair) -> Iterator[Criterion]:
    n, w, region = system.n, system.width, system.region

    def turning(z: Array) -> tuple[float, float]:
        rate = system.rate(z)
        return float(z[w]) / (rate**2 if rate > 0 else 1.0), 1.0

    def hopf(z: Array) -> bool:
        return turning(z)[0] > IMAGINARY

    def lyapunov(z: Array) -> tuple[float, float]:
        return _lyapunov(system, z)

    yield Criterion(PointKind.of(BOGDANOV_TAKENS), turning, always, region)
    yield Criterion(PointKind.of(GENERALIZED_HOPF), lyapunov, hopf, region)
    if n < 3:
        return
    yield Criterion(
        PointKind.of(ZERO_HOPF),
        lambda z: (smallest_value(system.at(z)[1], system.rate(z)), 1.0),
        hopf,
        region,
    )
    if n < 4:
        return

    def rest(z: Array) -> Vector:
        values = np.linalg.eigvals(system.jacobian(z))
        root = np.sqrt(complex(-z[w]))
        kept = list(values)
        for target in (root, -root):
            kept.pop(int(np.argmin(np.abs(np.array(kept) - target))))
        return np.array(kept)

    yield Criterion(
        PointKind.of(DOUBLE_HOPF),
        lambda z: smallest_sum(rest(z)),
        lambda z: hopf(z) and _imaginary(rest(z)),
        region,
    )


def _boundary_tests(system: OnInterface, region: int) -> Iterator[Criterion]:
    field, n, width = system.field, system.n, system.width

    def matrix(z: Array) -> Array:
        slopes = field.residual_and_jacobian(region, z[:width])[1]
        return np.asarray(slopes * system.scales / system.unit[:, None])

    def least(z: Array) -> Array:
        sizes = slope_sizes(
            lambda u: field.residual_and_jacobian(region, u), z[:width], system.scales
        )
        return sizes / system.unit

    def eigenvalues(z: Array) -> Vector:
        return np.linalg.eigvals(matrix(z)[:, :n])

    interface = system.interface
    beyond = field.neighbour(region, interface)
    yield Criterion(
        PointKind.of(FOLD_ON_INTERFACE),
        lambda z: (smallest_value(matrix(z), least(z)), 1.0),
        always,
        region,
        interface,
        beyond,
    )
    sliding = None if beyond is None else _sliding(field, region, beyond)
    if beyond is not None and sliding is not None:
        other = beyond

        def bordered(z: Array) -> tuple[float, float]:
            """[[F_x, E], [h_x, 0]] with the jump E, singular at folds of pseudo-equilibria."""
            u = z[:width]
            here, _, _, gradients = field.evaluate(region, u)
            inner, jump = matrix(z), (field.residual_and_jacobian(other, u)[0] - here) / system.unit
            size = float(np.abs(jump / row_sizes(inner)).max()) or 1.0
            edge = gradients[interface] * system.scales
            rows = np.column_stack([inner[:, :n], jump / size, inner[:, n:]])
            last = np.concatenate([edge[:n], [0.0], edge[n:]])
            return smallest_value(np.vstack([rows, last]), np.append(least(z), 0.0)), 1.0

        yield Criterion(
            PointKind.of(FOLD_ON_INTERFACE), bordered, always, sliding, interface, region
        )
    if n < 2:
        return
    yield Criterion(
        PointKind.of(HOPF_ON_INTERFACE),
        lambda z: smallest_sum(eigenvalues(z)),
        lambda z: _imaginary(eigenvalues(z)),
        region,
        interface,
        beyond,
    )


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


def coefficients(system: DefiningSystem, found: CurvePoint) -> dict[str, Any]:
    """Return normal-form coefficients of a point, by field names of a special point."""
    n, w = system.n, system.width
    code, u, region = found.criterion.code, found.z[:w], found.criterion.region
    field = system.field
    if code not in (
        CUSP,
        BOGDANOV_TAKENS,
        GENERALIZED_HOPF,
        ZERO_HOPF,
        DOUBLE_HOPF,
        HOPF_ON_INTERFACE,
    ):
        return {}
    raw = field.residual_and_jacobian(region, u)[1][:, :n]
    if code == CUSP:
        return {"coefficient": cusp_form(forms_at(field, region, u), raw, system.unit)}
    values = np.linalg.eigvals(raw)
    if code == GENERALIZED_HOPF:
        frequency = float(np.sqrt(found.z[w]))
        form = _form(("l2",), generalized_hopf, field, region, u, frequency)
        return {"frequency": frequency, **form}
    if code == DOUBLE_HOPF:
        own = float(np.sqrt(found.z[w]))
        others = sorted(values[values.imag > 0].imag, key=lambda f: -abs(f - own))
        other = float(others[0])
        listed = ("p11", "p12", "p21", "p22", "theta", "delta")
        form = _form(listed, double_hopf, field, region, u, (own, other), system.unit)
        return {"frequency": other, "type": double_hopf_case(form["normal_form"]), **form}
    if code == BOGDANOV_TAKENS:
        return _form(("a", "b"), bogdanov_takens, field, region, u, system.unit)
    turning = values[values.imag > 0]
    pair = turning[np.argmin(np.abs(turning.real / turning))]
    frequency = float(abs(pair.imag))
    if code == HOPF_ON_INTERFACE:
        return {"frequency": frequency}
    names = ("s", "theta", "E")
    form = _form(names, zero_hopf, field, region, u, frequency, system.unit)
    return {"frequency": frequency, "type": zero_hopf_case(form["normal_form"]), **form}


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


def along(system: DefiningSystem, rows: Array) -> Array:
    """Return the coefficient at every row: a of folds, l₁ of Hopf points; otherwise NaN."""
    return np.array([_coefficient(system, z) for z in rows])


def _coefficient(system: DefiningSystem, z: Array) -> float:
    if isinstance(system, Pair):
        value, size = _lyapunov(system, z)
        return 0.0 if abs(value) <= ROUNDING * size else value
    if system.code != FOLD:
        return np.nan
    u = z[: system.width]
    raw = system.field.residual_and_jacobian(system.region, u)[1][:, : system.n]
    return fold_form(forms_at(system.field, system.region, u), raw, system.unit)


def _lyapunov(system: Pair, z: Array) -> tuple[float, float]:
    """Return the first Lyapunov coefficient and the size of its terms; NaN at neutral saddles."""
    w, region = system.width, system.region
    if not z[w] > 0:
        return np.nan, np.nan
    raw = system.field.residual_and_jacobian(region, z[:w])[1][:, : system.n]
    return lyapunov_terms(forms_at(system.field, region, z[:w]), raw, float(np.sqrt(z[w])))
