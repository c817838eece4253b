"""Codimension-two points on curves of folds, Hopf points and boundary equilibria.

Each has a test function that changes sign along the curve; the point itself is
solved for as the curve's equations and the test together (Kuznetsov 2004,
sections 8.7 and 10.3).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.curves import Frame
from fastslow.continuation.location import newton
from fastslow.diagrams.defining import Defining, OnInterface, Pair
from fastslow.diagrams.detection import pair_sums
from fastslow.diagrams.normal_forms import (
    Vector,
    cusp_form,
    first_lyapunov,
    fold_form,
    forms_at,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Criterion:
    """What is watched along a curve.

    Parameters
    ----------
    code : str
        What its zero is.
    value : callable
        z to a number that is smooth near the zero.
    genuine : callable
        Whether a zero at z is one of that kind.
    region : int
        The region that it belongs to.
    interface : int, optional
        The interface it is about.
    """

    code: str
    value: Callable[[Array], float]
    genuine: Callable[[Array], bool]
    region: int
    interface: int | None = None


@dataclass(frozen=True, eq=False)
class Found:
    """A codimension-two point after a row of a curve."""

    row: int
    criterion: Criterion
    z: Array
    residual: float
    converged: bool
    correction: float


def criteria(system: Defining, others: list[int]) -> list[Criterion]:
    """Give the tests for a curve of one kind.

    Parameters
    ----------
    system : Defining
    others : list of int
        For boundary equilibria the regions that meet there, else empty.
    """
    if isinstance(system, OnInterface):
        found: list[Criterion] = []
        for region in others:
            found += _boundary_tests(system, region)
        return found
    found = list(_interface_tests(system))
    if system.code == "LP":
        found += _fold_tests(system)
    if isinstance(system, Pair):
        found += _pair_tests(system)
    return found


def search(
    system: Defining,
    rows: Array,
    watched: list[Criterion],
    frame: Frame,
    known_values: Mapping[str, Array],
) -> Iterator[Found]:
    """All points at which a test changes sign between rows, solved for.

    Parameters
    ----------
    system : Defining
    rows : ndarray, shape (M, N + 1)
    watched : list of Criterion
    frame : Frame
    known_values : mapping
        Code to test values at the rows that are at hand already.
    """
    for criterion in watched:
        values = known_values.get(criterion.code)
        if values is None:
            values = np.array([criterion.value(z) for z in rows])
        finite = np.abs(values[np.isfinite(values)])
        # the median, because some tests have poles; one that vanishes all along says nothing
        size = float(np.median(finite)) if finite.size else 0.0
        if size < 1e-12:
            continue
        known = np.flatnonzero(np.isfinite(values) & (np.abs(values) > 1e-11 * size))
        for k in np.flatnonzero(values[known][:-1] * values[known][1:] < 0):
            before, after = int(known[k]), int(known[k + 1])
            if after - before > 2 or not np.all(np.isfinite(values[before : after + 1])):
                continue
            point = _solved(system, rows, values, before, after, criterion, frame)
            if point is not None:
                yield point


def _solved(
    system: Defining,
    rows: Array,
    values: Array,
    before: int,
    after: int,
    criterion: Criterion,
    frame: Frame,
) -> Found | None:
    share = values[before] / (values[before] - values[after])
    guess = rows[before] + share * (rows[after] - rows[before])
    guide = system.renewed(guess)
    unit = abs(values[before] - values[after])

    def equations(z: Array) -> Array:
        if z.ndim > 1:
            return np.array([equations(one) for one in z])
        return np.append(system.residual(z, guide), criterion.value(z) / unit)

    z, residual, converged, correction = newton(equations, guess, frame.scale)
    width = system.width
    apart = np.abs((z - rows[before]) / frame.scale)[:width].max()
    length = np.abs((rows[after] - rows[before]) / frame.scale)[:width].max()
    if not np.all(np.isfinite(z)) or apart > 3.0 * length:
        return None
    z = system.renewed(z)
    if not criterion.genuine(z):
        return None
    return Found(before, criterion, z, residual, converged, correction)


def _always(_: Array) -> bool:
    return True


def _interface_tests(system: Defining) -> Iterator[Criterion]:
    field, region = system.field, system.region
    code = {"LP": "BF", "HB": "BH"}.get(system.code)
    if code is None:
        return
    for k in range(len(field.interfaces)):
        if field.signs[region, k] == 0:
            continue

        def height(z: Array, k: int = k) -> float:
            return float(field.at(region, z[: system.width])[2][k])

        def genuine(z: Array, k: int = k) -> bool:
            imaginary = not isinstance(system, Pair) or z[system.width] > 0
            return bool(imaginary) and system.inside(z, but=k)

        yield Criterion(code, height, genuine, region, k)


def _nulls(matrix: Array, v: Array) -> Array:
    """Left null vector, in a direction that is smooth along the curve."""
    n = len(matrix)
    left, _, _ = np.linalg.svd(matrix)
    w = left[:, -1]
    # bordering by the right null vector orients it: the determinant keeps its sign
    bordered = np.block([[matrix, w[:, None]], [v[None, :], np.zeros((1, 1))]])
    side = np.sign(np.linalg.det(bordered[: n + 1, : n + 1]))
    return np.asarray(w * (side if side != 0 else 1.0))


def _fold_tests(system: Defining) -> Iterator[Criterion]:
    n, w, region = system.n, system.width, system.region

    def quadratic(z: Array) -> float:
        matrix, v = system.jacobian(z), z[w : w + n]
        raw = (system.unit * v).astype(complex)
        bent = forms_at(system.field, region, z[:w]).form(raw, raw).real / system.unit
        return float(_nulls(matrix, v) @ bent)

    def overlap(z: Array) -> float:
        v = z[w : w + n]
        return float(_nulls(system.jacobian(z), v) @ v)

    yield Criterion("CP", quadratic, _always, region)
    if n < 2:
        return
    yield Criterion("BT", overlap, _always, region)
    if n < 3:
        return

    def rest(z: Array) -> Vector:
        values = np.linalg.eigvals(system.jacobian(z))
        return np.asarray(values[np.argsort(np.abs(values))[1:]])

    yield Criterion(
        "ZH", lambda z: float(pair_sums(rest(z))), lambda z: _imaginary(rest(z)), region
    )


def _pair_tests(system: Pair) -> Iterator[Criterion]:
    n, w, region = system.n, system.width, system.region

    def hopf(z: Array) -> bool:
        size = max(1e-300, float(np.abs(system.jacobian(z)).max()) ** 2)
        return float(z[w]) > 1e-9 * size

    yield Criterion("BT", lambda z: float(z[w]), _always, region)
    yield Criterion("GH", lambda z: _coefficient(system, z), hopf, region)
    if n < 3:
        return
    yield Criterion("ZH", lambda z: float(np.linalg.det(system.jacobian(z))), hopf, region)
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
        "HH", lambda z: float(pair_sums(rest(z))), lambda z: hopf(z) and _imaginary(rest(z)), region
    )


def _boundary_tests(system: OnInterface, region: int) -> Iterator[Criterion]:
    field, n, width = system.field, system.n, system.width

    def matrix(z: Array) -> Array:
        return field.curve(region, z[:width])[1][:, :n]

    def eigenvalues(z: Array) -> Vector:
        return np.linalg.eigvals(matrix(z))

    def determinant(z: Array) -> float:
        return float(np.linalg.det(matrix(z)))

    yield Criterion("BF", determinant, _always, region, system.interface)
    if n < 2:
        return
    yield Criterion(
        "BH",
        lambda z: float(pair_sums(eigenvalues(z))),
        lambda z: _imaginary(eigenvalues(z)),
        region,
        system.interface,
    )


def _imaginary(values: Vector) -> bool:
    """Whether the pair with the smallest sum is imaginary."""
    first, second = np.triu_indices(len(values), 1)
    k = int(np.argmin(np.abs(values[first] + values[second])))
    size = max(float(np.abs(values).max()), 1e-300)
    return bool((values[first[k]] * values[second[k]]).real > 1e-9 * size**2)


def coefficients(system: Defining, found: Found) -> dict[str, float]:
    """Normal-form data of a point: the cusp's cubic, the other pair's frequency, l₁."""
    n, w = system.n, system.width
    u, region = found.z[:w], found.criterion.region
    raw = system.field.curve(region, u)[1][:, :n]
    if found.criterion.code == "CP":
        return {"coefficient": cusp_form(forms_at(system.field, region, u), raw)}
    values = np.linalg.eigvals(raw)
    if found.criterion.code in ("ZH", "BH"):
        return {"frequency": float(np.abs(values.imag).max())}
    if found.criterion.code == "GH":
        return {"frequency": float(np.sqrt(found.z[w]))}
    if found.criterion.code == "HH":
        own = np.sqrt(found.z[w])
        others = sorted(values[values.imag > 0].imag, key=lambda f: -abs(f - own))
        return {"frequency": float(others[0])}
    return {}


def along(system: Defining, rows: Array) -> Array:
    """Coefficient at every row: a of folds, l₁ of Hopf points; NaN where there is none."""
    return np.array([_coefficient(system, z) for z in rows])


def _coefficient(system: Defining, z: Array) -> float:
    n, w, region = system.n, system.width, system.region
    hopf = isinstance(system, Pair) and z[w] > 0
    if not hopf and system.code != "LP":
        return np.nan
    raw = system.field.curve(region, z[:w])[1][:, :n]
    forms = forms_at(system.field, region, z[:w])
    return first_lyapunov(forms, raw, float(np.sqrt(z[w]))) if hopf else fold_form(forms, raw)
