"""Special points between the rows of a piece, solved for to rounding."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import (
    Located,
    branch_point,
    fold,
    turning_pair,
)
from fastslow.diagrams.brackets import Search
from fastslow.diagrams.fields import FrozenField
from fastslow.diagrams.normal_forms import first_lyapunov, fold_form, forms_at
from fastslow.diagrams.walking import Piece, Window

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Detected:
    """A special point after row ``row`` of a piece."""

    row: int
    code: str
    located: Located
    coefficient: float | None = None
    frequency: float | None = None
    lyapunov: float | None = None


@np.errstate(all="ignore")
def special_points(
    field: FrozenField, piece: Piece, window: Window, marks: Sequence[float]
) -> tuple[list[Detected], NDArray[np.complex128]]:
    """All special points of a piece, in order along it, and the finite eigenvalues of its rows."""
    branching, eigenvalues = field.survey(piece.region, piece.u, piece.tangents, window.scale)
    found = [
        *_folds(field, piece, window),
        *_branch_points(field, piece, window, branching),
        *_turning_pairs(field, piece, window, eigenvalues),
        *_marks(field, piece, window, marks),
    ]
    found = [d for d in found if _between(d.located.u, piece, d.row, window)]
    # where two branches cross the parameter may turn as well: that is no fold
    crossings = [d.located.u for d in found if d.code == "BP"]
    found = [
        d
        for d in found
        if d.code != "LP"
        or all(np.abs((d.located.u - c) / window.scale).max() > 1e-4 for c in crossings)
    ]
    found = sorted(found, key=lambda d: (d.row, _ahead(d.located.u, piece, d.row, window)))
    return found, eigenvalues


def _folds(field: FrozenField, piece: Piece, window: Window) -> Iterator[Detected]:
    test = piece.tangents[:, -1] / window.scale[-1]
    test = np.where(np.abs(test) < 1e-10, 0.0, test)

    def curve(u: Array) -> tuple[Array, Array]:
        return field.curve(piece.region, u)

    def turning(u: Array, along: Array) -> float:
        tangent, _ = field.tangent(piece.region, u, window.weight)
        side = 1.0 if (tangent * window.weight) @ along >= 0 else -1.0
        return float(side * tangent[-1] / window.scale[-1])

    search = Search(field, piece, window, turning)
    for bracket in search.brackets(test):
        located = search.solve(bracket, lambda u: fold(curve, u, window.scale))
        jacobian = curve(located.u)[1][:, : field.n]
        coefficient = fold_form(forms_at(field, piece.region, located.u), jacobian)
        yield Detected(bracket.row, "LP", located, coefficient=coefficient)


def _branch_points(
    field: FrozenField, piece: Piece, window: Window, test: Array
) -> Iterator[Detected]:
    test = np.where(np.abs(test) < 1e-14, 0.0, test)

    def locate(u: Array) -> Located:
        return branch_point(lambda z: field.curve(piece.region, z), u, window.scale)

    def crossing(u: Array, along: Array) -> float:
        _, slopes = field.curve(piece.region, u)
        tangent, _ = field.tangent(piece.region, u, window.weight)
        side = 1.0 if (tangent * window.weight) @ along >= 0 else -1.0
        rows = np.vstack([slopes * window.scale, side * tangent / window.scale])
        size = np.linalg.norm(rows, axis=1).prod()
        return float(np.linalg.det(rows) / (size if size > 0 else 1.0))

    search = Search(field, piece, window, crossing)
    for bracket in search.brackets(test):
        located = search.solve(bracket, locate)
        if located.converged:
            yield Detected(bracket.row, "BP", located)


@cache
def _pairs(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the two members of every pair of n."""
    first, second = np.triu_indices(n, 1)
    return first, second


def pair_sums(eigenvalues: NDArray[np.complex128]) -> Array:
    """Product of the sums of all pairs, each in units of the largest eigenvalue."""
    first, second = _pairs(eigenvalues.shape[-1])
    sums = eigenvalues[..., first] + eigenvalues[..., second]
    size = np.maximum(np.abs(eigenvalues).max(axis=-1, keepdims=True), np.finfo(float).tiny)
    return np.asarray(np.prod(sums / size, axis=-1).real)


def _turning_pairs(
    field: FrozenField, piece: Piece, window: Window, eigenvalues: NDArray[np.complex128]
) -> Iterator[Detected]:
    n, region = field.n, piece.region
    if eigenvalues.shape[1] < 2:
        return
    first, second = _pairs(eigenvalues.shape[1])
    test = pair_sums(eigenvalues)

    def curve(u: Array) -> tuple[Array, Array]:
        return field.curve(region, u)

    def locate(u: Array) -> Located:
        values = field.finite_eigenvalues(region, u)
        pair = int(np.argmin(np.abs(values[first] + values[second])))
        squared = float((values[first[pair]] * values[second[pair]]).real)
        return turning_pair(curve, u, window.scale, squared)

    search = Search(
        field, piece, window, lambda u, _: float(pair_sums(field.finite_eigenvalues(region, u)))
    )
    for bracket in search.brackets(np.where(np.abs(test) < 1e-14, 0.0, test)):
        located = search.solve(bracket, locate)
        kappa = float(located.extra[0])
        if kappa > 0:
            frequency = float(np.sqrt(kappa))
            jacobian = curve(located.u)[1][:, :n]
            lyapunov = first_lyapunov(forms_at(field, region, located.u), jacobian, frequency)
            yield Detected(bracket.row, "HB", located, frequency=frequency, lyapunov=lyapunov)
        else:
            yield Detected(bracket.row, "NSD", located)


def _marks(
    field: FrozenField, piece: Piece, window: Window, marks: Sequence[float]
) -> Iterator[Detected]:
    along = np.zeros(field.n + 1)
    along[-1] = 1.0
    for mark in marks:
        search = Search(field, piece, window, lambda u, _, mark=mark: float(u[-1] - mark))  # type: ignore[misc]
        for bracket in search.brackets(piece.u[:, -1] - mark):
            located = search.solve(
                bracket,
                lambda u, mark=mark: field.refined(  # type: ignore[misc]
                    piece.region, u, window.scale, normal=along, point=mark * along
                ),
            )
            yield Detected(bracket.row, "UZ", located)


def _ahead(u: Array, piece: Piece, row: int, window: Window) -> float:
    return float(((u - piece.u[row]) * window.weight) @ piece.tangents[row])


def _between(u: Array, piece: Piece, row: int, window: Window) -> bool:
    """Whether a solution stayed near the rows that bracketed it."""
    if not np.all(np.isfinite(u)):
        return False
    here = piece.u[row]
    there = piece.u[min(row + 2, len(piece.u) - 1)]
    length = float(np.linalg.norm((there - here) / window.scale))
    return float(np.linalg.norm((u - here) / window.scale)) <= 2.0 * length
