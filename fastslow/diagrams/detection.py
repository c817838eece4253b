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
    with_condition,
)
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


def _changes(test: Array) -> Iterator[tuple[int, int]]:
    """Pairs of rows, next to each other but for zeros, between which a test changes sign."""
    if not (np.any(test < 0) and np.any(test > 0)):
        return
    rows = np.flatnonzero(test != 0)
    signs = np.sign(test[rows])
    for k in np.flatnonzero(signs[:-1] * signs[1:] < 0):
        yield int(rows[k]), int(rows[k + 1])


def _meeting(test: Array, piece: Piece, before: int, after: int) -> Array:
    """Where the test vanishes by linear interpolation."""
    part = test[before] / (test[before] - test[after])
    return np.asarray(piece.u[before] + part * (piece.u[after] - piece.u[before]))


def _folds(field: FrozenField, piece: Piece, window: Window) -> Iterator[Detected]:
    test = piece.tangents[:, -1] / window.scale[-1]
    test = np.where(np.abs(test) < 1e-10, 0.0, test)

    def curve(u: Array) -> tuple[Array, Array]:
        return field.curve(piece.region, u)

    for before, after in _changes(test):
        if after - before > 2:
            continue
        located = fold(curve, _meeting(test, piece, before, after), window.scale)
        jacobian = field.curve(piece.region, located.u)[1][:, : field.n]
        coefficient = fold_form(forms_at(field, piece.region, located.u), jacobian)
        yield Detected(before, "LP", located, coefficient=coefficient)


def _branch_points(
    field: FrozenField, piece: Piece, window: Window, test: Array
) -> Iterator[Detected]:
    for before, after in _changes(np.where(np.abs(test) < 1e-14, 0.0, test)):
        if after - before > 2:
            continue
        guess = _meeting(test, piece, before, after)
        located = branch_point(lambda u: field.curve(piece.region, u), guess, window.scale)
        if located.converged:
            yield Detected(before, "BP", located)


@cache
def _pairs(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the two members of every pair of n."""
    first, second = np.triu_indices(n, 1)
    return first, second


def _turning_pairs(
    field: FrozenField, piece: Piece, window: Window, eigenvalues: NDArray[np.complex128]
) -> Iterator[Detected]:
    n = field.n
    if eigenvalues.shape[1] < 2:
        return
    first, second = _pairs(eigenvalues.shape[1])
    sums = eigenvalues[:, first] + eigenvalues[:, second]
    size = np.maximum(np.abs(eigenvalues).max(axis=1, keepdims=True), np.finfo(float).tiny)
    test = np.prod(sums / size, axis=1).real
    for before, after in _changes(np.where(np.abs(test) < 1e-14, 0.0, test)):
        guess = _meeting(test, piece, before, after)
        near = before if abs(test[before]) < abs(test[after]) else after
        pair = int(np.argmin(np.abs(sums[near])))
        squared = float((eigenvalues[near, first[pair]] * eigenvalues[near, second[pair]]).real)
        located = turning_pair(lambda u: field.curve(piece.region, u), guess, window.scale, squared)
        kappa = float(located.extra[0])
        if kappa > 0:
            frequency = float(np.sqrt(kappa))
            lyapunov = first_lyapunov(
                forms_at(field, piece.region, located.u),
                field.curve(piece.region, located.u)[1][:, :n],
                frequency,
            )
            yield Detected(before, "HB", located, frequency=frequency, lyapunov=lyapunov)
        else:
            yield Detected(before, "NSD", located)


def _marks(
    field: FrozenField, piece: Piece, window: Window, marks: Sequence[float]
) -> Iterator[Detected]:
    along = np.zeros(field.n + 1)
    along[-1] = 1.0
    for mark in marks:
        for before, after in _changes(piece.u[:, -1] - mark):
            located = with_condition(
                lambda u: field.curve(piece.region, u),
                lambda u, mark=mark: (u[-1] - mark, along),  # type: ignore[misc]
                _meeting(piece.u[:, -1] - mark, piece, before, after),
                window.scale,
            )
            yield Detected(before, "UZ", located)


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
