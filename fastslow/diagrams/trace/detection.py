"""Detection and location of special points on a segment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import Located, branch_point, fold, hopf_or_neutral_saddle
from fastslow.continuation.marks import ExpressionMark, Mark, ValueMark
from fastslow.diagrams.eigenvalue_pairs import (
    ROUNDING,
    pair_sums,
    product_of_pair,
    vanishing_count,
)
from fastslow.diagrams.field import FrozenField
from fastslow.diagrams.points.normal_forms import first_lyapunov, fold_form, forms_at
from fastslow.diagrams.trace.across_regions import Segment, Window
from fastslow.diagrams.trace.brackets import Search
from fastslow.diagrams.trace.marked_points import MarkSearch
from fastslow.diagrams.trace.own_eigenvalues import own_pair, without_zero
from fastslow.diagrams.trace.row_tests import ALIKE, RowTests, divided, mostly, resolved
from fastslow.results.branch.unexplained import unexplained_rows
from fastslow.results.point_types import (
    BRANCH_POINT,
    CANDIDATE,
    FOLD,
    HOPF,
    NEUTRAL_SADDLE,
    POINT_TYPES,
    USER_VALUE,
)

Array = NDArray[np.float64]

#: Narrowings of a bracket of a Hopf point before the first Newton iteration, which costs dozens
#: of evaluations for many states.
NARROWED_FIRST = 3

#: Distance of two curves, in units of the window, up to which they intersect if rounding leaves
#: this open; for rates of the size of their terms it is about 1e-7.
INTERSECTION_DISTANCE = 1e-5

#: Distance of two solutions for the same point, in units of the window.
SAME_SOLUTION = 1e-8

#: Largest relative sum of the pair at a Hopf point or neutral saddle.
PAIR_SUM = 1e-5

#: Product of two eigenvalues of opposite sign, relative to that at the rows around it, below which
#: both are zero to rounding.
DOUBLE_ZERO_PRODUCT = 1e-9

#: Note on a point with two such eigenvalues.
BOTH = (
    "two eigenvalues vanish there, as where several curves intersect by symmetry, or at a "
    "Bogdanov-Takens point"
)

#: Divisions of steps whose special points do not explain the change of the number of unstable
#: eigenvalues: neutral saddles may mask a Hopf point.
DIVISIONS = 12


@dataclass(frozen=True, eq=False)
class Detected:
    """A special point after row ``row`` of a segment, or at it."""

    row: int
    code: str
    located: Located
    at_row: bool = False
    mark: ExpressionMark | None = None
    coefficient: float | None = None
    frequency: float | None = None
    lyapunov: float | None = None
    type: str | None = None
    note: str = ""


@np.errstate(all="ignore")
def special_points(
    field: FrozenField,
    segment: Segment,
    window: Window,
    marks: Sequence[Mark],
    *,
    opening: bool = True,
) -> tuple[list[Detected], Segment, NDArray[np.complex128]]:
    """Locate all special points of a segment, in order along it.

    Parameters
    ----------
    opening : bool
        Whether the first row belongs to no other segment.

    Returns
    -------
    found : list of Detected
    segment : Segment
        The segment, with rows added in steps that contain several points.
    eigenvalues : ndarray of complex
        Finite eigenvalues at its rows.
    """
    segment, tests = resolved(field, segment, window)
    found = _between_rows(field, segment, window, tests, marks, opening)
    for _ in range(DIVISIONS):
        finer = segment
        # backwards, so that the numbers of the preceding rows do not change
        for first, last in reversed(_unexplained(tests, found)):
            finer = divided(field, finer, window, first, last)
        if len(finer.u) == len(segment.u):
            break
        segment, tests = resolved(field, finer, window)
        found = _between_rows(field, segment, window, tests, marks, opening)
    return found, segment, tests.eigenvalues


def _unexplained(tests: RowTests, found: Sequence[Detected]) -> list[tuple[int, int]]:
    """Return pairs of rows with an unexplained change of the number of unstable eigenvalues."""
    low, high = tests.unstable
    known = [d for d in found if POINT_TYPES[d.code].changes_stability]
    # a row for every point, at which the number is undetermined
    places = [d.row + 1 for d in known]
    row_of = np.insert(np.arange(len(low)), places, -1)
    points = np.flatnonzero(row_of < 0).tolist()
    steps = {k: [POINT_TYPES[d.code].unstable] for k, d in zip(points, known, strict=True)}
    rows = unexplained_rows(np.insert(low, places, 0), np.insert(high, places, high.max()), steps)
    return [(int(row_of[since]), int(row_of[row])) for since, row in rows]


def _between_rows(
    field: FrozenField,
    segment: Segment,
    window: Window,
    tests: RowTests,
    marks: Sequence[Mark],
    opening: bool,
) -> list[Detected]:
    """Locate all special points of a segment, in order along it."""
    steps = segment.chords(window.scale)
    found = [
        *_folds(field, segment, window, steps, tests),
        *_branch_points(field, segment, window, steps, tests),
        *_hopf_and_neutral_saddles(field, segment, window, steps, tests),
        *_values(field, segment, window, steps, marks),
        *_zeros(field, segment, window, marks, opening),
    ]
    found = [d for d in found if _between(d.located.u, segment, d.row, window)]
    # at a branch point the parameter may have an extremum without a fold
    crossings = [d.located.u for d in found if POINT_TYPES[d.code].branching]
    found = [
        d
        for d in found
        if not POINT_TYPES[d.code].turning
        or all(np.abs((d.located.u - c) / window.scale).max() > 1e-4 for c in crossings)
    ]
    return sorted(
        found,
        key=lambda d: (d.row, not d.at_row, _ahead(d.located.u, segment, d.row, window)),
    )


def _folds(
    field: FrozenField, segment: Segment, window: Window, steps: Array, tests: RowTests
) -> Iterator[Detected]:
    def curve(u: Array) -> tuple[Array, Array]:
        return field.residual_and_jacobian(segment.region, u)

    def turning(u: Array, along: Array) -> float:
        return float(_tangent(field, segment, u, along, window)[-1] / window.scale[-1])

    search = Search(field, segment, window, steps, turning)
    for bracket in search.brackets(tests.turning):
        located = search.solve(bracket, lambda u: fold(curve, u, window.scale))
        if located is not None:
            jacobian = curve(located.u)[1][:, : field.n]
            coefficient = fold_form(
                forms_at(field, segment.region, located.u), jacobian, window.scale[:-1]
            )
            note = without_zero(
                field.finite_eigenvalues(segment.region, located.u), tests, bracket.row
            )
            if note and _keeps_orientation(tests.eigenvalues[bracket.row : bracket.row + 2]):
                continue
            yield Detected(
                bracket.row,
                FOLD,
                located,
                coefficient=coefficient,
                type=CANDIDATE if note else None,
                note=note,
            )


def _keeps_orientation(eigenvalues: NDArray[np.complex128]) -> bool:
    """Return whether the determinant has the same sign, not zero, at neighbouring rows.

    The parameter then changes its direction by rounding alone, as at an asymptote.
    """
    modulus = np.abs(eigenvalues)
    if not np.isfinite(modulus).all() or not modulus.all():
        return False
    signs = np.sign((eigenvalues / modulus).prod(axis=-1).real)
    return bool((signs == signs[0]).all())


def _branch_points(
    field: FrozenField, segment: Segment, window: Window, steps: Array, tests: RowTests
) -> Iterator[Detected]:
    def locate(u: Array) -> Located:
        return branch_point(
            lambda z: field.residual_and_jacobian(segment.region, z), u, window.scale
        )

    def crossing(u: Array, along: Array) -> float:
        tangent = _tangent(field, segment, u, along, window)
        return float(field.branching(segment.region, u[None], tangent[None], window.scale)[0])

    search = Search(field, segment, window, steps, crossing)
    found: list[Array] = []
    for bracket in search.brackets(tests.branching):
        located = search.solve(bracket, locate)
        if located is not None:
            found.append(located.u)
            own = field.finite_eigenvalues(segment.region, located.u)
            yield _branch_point(bracket.row, located, without_zero(own, tests, bracket.row))
    # a branch that leaves the window at a branch point has no row beyond it
    for end, row in ((0, 0), (-1, len(segment.u) - 2)):
        u = segment.u[end]
        if row >= 0 and window.at_bounds(u).any() and abs(tests.branching[end]) < SAME_SOLUTION:
            located = locate(u)
            known = any(_coincide(located.u, other, window) for other in found)
            if located.converged and _coincide(located.u, u, window) and not known:
                yield _branch_point(row, located)


def _branch_point(row: int, located: Located, note: str = "") -> Detected:
    """Return a branch point, a candidate unless its defining equations are solved to rounding.

    ``note`` is what contradicts it.
    """
    if note:
        pass
    elif not located.extra.size:
        note = (
            "its defining equations are singular; two curves may pass each other there without "
            "an intersection"
        )
    else:
        distance, resolution = located.extra.tolist()
        if distance == 0 and resolution <= INTERSECTION_DISTANCE:
            return Detected(row, BRANCH_POINT, located)
        note = (
            f"two curves intersect, or pass each other nearer than {resolution:.1g} of the window, "
            "which rounding of the rates does not decide"
            if distance == 0
            else f"two curves pass each other at {distance:.1g} of the window, without an "
            "intersection, nearer than the smallest steps"
        )
    return Detected(row, BRANCH_POINT, located, type=CANDIDATE, note=note)


def _hopf_and_neutral_saddles(
    field: FrozenField, segment: Segment, window: Window, steps: Array, tests: RowTests
) -> Iterator[Detected]:
    n, region = field.n, segment.region

    def curve(u: Array) -> tuple[Array, Array]:
        return field.residual_and_jacobian(region, u)

    # a sum that vanishes at most rows, as for a conservative oscillator, is left out; any other
    # is small only near the point to be located
    lost = tests.pairs != pair_sums(tests.eigenvalues, rounding=0.0)
    rounding, alike = ROUNDING if mostly(lost) else 0.0, tests.alike

    def sums(u: Array, along: Array) -> float:
        return float(pair_sums(field.finite_eigenvalues(region, u), rounding, alike))

    search = Search(field, segment, window, steps, sums)

    def product_at(u: Array) -> float:
        return product_of_pair(field.finite_eigenvalues(region, u), rounding, alike)

    for bracket in search.brackets(tests.pairs):
        nearer = int(abs(bracket.values[1]) < abs(bracket.values[0]))
        product = product_at(bracket.u[nearer])
        around = max(abs(product_at(u)) for u in bracket.u)
        ends = (field.finite_eigenvalues(region, u) for u in bracket.u)
        usual = min(vanishing_count(values, ALIKE) for values in ends)

        def locate(
            u: Array, product: float = product, around: float = around, usual: int = usual
        ) -> Located:
            here = product_at(u)
            squared = product if np.isnan(here) else here
            found = hopf_or_neutral_saddle(curve, u, window.scale, squared)
            solved = float(found.extra[0]) if found.extra.size else squared
            # a pair whose sum vanishes all along solves the same equations
            own = field.finite_eigenvalues(region, found.u)
            more = vanishing_count(own, PAIR_SUM) > usual
            return (
                found
                if more or abs(solved) <= DOUBLE_ZERO_PRODUCT * around
                else replace(found, converged=False)
            )

        located = search.solve(bracket, locate, narrowings=NARROWED_FIRST)
        if located is None:
            continue
        own = field.finite_eigenvalues(region, located.u)
        # in a bracket at rounding, the pair at its ends may be another one
        beside = product if rounding else product_of_pair(own, rounding, alike)
        solved = float(located.extra[0]) if located.extra.size else beside
        if abs(solved) <= DOUBLE_ZERO_PRODUCT * around:
            yield Detected(bracket.row, BRANCH_POINT, located, type=CANDIDATE, note=BOTH)
            continue
        kappa, note = own_pair(own, solved, tests, bracket.row)
        kind = CANDIDATE if note else None
        if kappa > 0:
            frequency = float(np.sqrt(kappa))
            jacobian = curve(located.u)[1][:, :n]
            lyapunov = first_lyapunov(forms_at(field, region, located.u), jacobian, frequency)
            yield Detected(
                bracket.row,
                HOPF,
                located,
                frequency=frequency,
                lyapunov=lyapunov,
                type=kind,
                note=note,
            )
        else:
            yield Detected(bracket.row, NEUTRAL_SADDLE, located, type=kind, note=note)


def _coincide(u: Array, other: Array, window: Window) -> bool:
    """Return whether two solutions are equal to their accuracy."""
    return bool(np.abs((u - other) / window.scale).max() < SAME_SOLUTION)


def _tangent(field: FrozenField, segment: Segment, u: Array, along: Array, window: Window) -> Array:
    """Return the unit tangent at a point, oriented along the segment."""
    tangent, _ = field.tangent(segment.region, u, window.weight)
    return tangent if (tangent * window.weight) @ along >= 0 else -tangent


def _zeros(
    field: FrozenField, segment: Segment, window: Window, marks: Sequence[Mark], opening: bool
) -> Iterator[Detected]:
    for mark in marks:
        if isinstance(mark, ExpressionMark):
            for one in MarkSearch(field, segment, window, mark).zeros(first=opening, last=True):
                yield Detected(
                    one.row, USER_VALUE, one.located, at_row=one.at_row, mark=mark, note=one.note
                )


def _values(
    field: FrozenField, segment: Segment, window: Window, steps: Array, marks: Sequence[Mark]
) -> Iterator[Detected]:
    along = np.zeros(field.n + 1)
    along[-1] = 1.0
    for mark in (one.value for one in marks if isinstance(one, ValueMark)):
        search = Search(
            field,
            segment,
            window,
            steps,
            lambda u, _, mark=mark: float(u[-1] - mark),  # type: ignore[misc]
        )
        for bracket in search.brackets(segment.u[:, -1] - mark):
            located = search.solve(
                bracket,
                lambda u, mark=mark: field.refined(  # type: ignore[misc]
                    segment.region, u, window.scale, normal=along, point=mark * along
                ),
            )
            if located is not None:
                yield Detected(bracket.row, USER_VALUE, located)


def _ahead(u: Array, segment: Segment, row: int, window: Window) -> float:
    return float(((u - segment.u[row]) * window.weight) @ segment.tangents[row])


def _between(u: Array, segment: Segment, row: int, window: Window) -> bool:
    """Return whether a solution is near the rows that bracket it."""
    if not np.all(np.isfinite(u)):
        return False
    here = segment.u[row]
    there = segment.u[min(row + 2, len(segment.u) - 1)]
    length = float(np.linalg.norm((there - here) / window.scale))
    return float(np.linalg.norm((u - here) / window.scale)) <= 2.0 * length
