"""Properties that every diagram, branch and curve has, whatever its model.

`violations` returns them as sentences. The tests call the public functions of continuation through
`checked`, so that each result that a test computes is examined (see ``tests/conftest.py``);
``python -m tests.campaigns invariants`` examines random models. Nothing here uses the code that
locates points or compares branches: eigenvalues are compared with what a point says of them, rows
with earlier rows, and branches with each other by their solutions at common parameter values.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from functools import wraps
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

import fastslow as fs
from fastslow.errors import FastSlowError, IncompleteWarning
from fastslow.results.point_types import POINT_TYPES

Array = NDArray[np.float64]

#: Relative error of a located eigenvalue or multiplier.
LOCATED = 1e-6

#: Error of the smallest eigenvalue in units of the largest one.
ROUNDED = 1e-10

#: Largest distance between two solutions that are one, in units of their columns.
SAME = 1e-8

#: Rows of a stretch that follows an earlier one.
STRETCH = 3

#: Distance from the earlier rows' interpolant, in steps, at which a row may follow them.
ALONG = 1e-2

#: Critical eigenvalues of each code of equilibria, and critical multipliers of each code of orbits.
CRITICAL = {
    **dict.fromkeys(("LP", "BP", "CP", "BF"), (0,)),
    **dict.fromkeys(("HB", "GH", "BH"), ("pair",)),
    "NSD": ("opposite",),
    "BT": (0, 0),
    "ZH": (0, "pair"),
    "HH": ("pair", "pair"),
    **dict.fromkeys(("LPC", "BPC", "CPC", "LPGR"), (1,)),
    **dict.fromkeys(("PD", "GPD", "PDGR"), (-1,)),
    **dict.fromkeys(("TR", "CH", "NSGR"), ("pair",)),
    "LPPD": (1, -1),
    "R1": (1, 1),
    "R2": (-1, -1),
    "R3": (np.exp(2j * np.pi / 3), np.exp(-2j * np.pi / 3)),
    "R4": (1j, -1j),
    "LPNS": (1, "pair"),
    "PDNS": (-1, "pair"),
    "NSNS": ("pair", "pair"),
}

#: Rows among which pairs are compared at once.
BLOCK = 256

#: Values of the parameter at which the branches of a diagram are compared.
VALUES = 3


def checked(function):
    """Return the function, whose results are examined."""

    @wraps(function)
    def examined(*args, **kwargs):
        result = function(*args, **kwargs)
        wrong = violations(result)
        assert not wrong, "\n".join(wrong)
        return result

    return examined


def violations(result) -> list[str]:
    """Return a sentence for each property that a result does not have."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IncompleteWarning)
        if isinstance(result, fs.Diagram):
            return list(_of_diagram(result))
        if isinstance(result, fs.OrbitBranch):
            return list(_of_orbits(result, "the branch"))
        if isinstance(result, fs.PointBranch):
            return list(_of_curve(result, "the curve"))
        if isinstance(result, fs.ThresholdCurve):
            return list(_of_thresholds(result))
        if isinstance(result, fs.PointCurves):
            return [s for k, one in enumerate(result) for s in _of_curve(one, f"curve {k}")]
        if isinstance(result, tuple):
            found = [s for k, one in enumerate(result) for s in _of_orbits(one, f"branch {k}")]
            return found + list(_same_orbits(result))
    raise TypeError(f"no properties of {type(result).__name__} are known")


def _of_diagram(diagram) -> Iterator[str]:
    for number, branch in enumerate(diagram.branches):
        name = f"branch {number}"
        if not np.isfinite(np.column_stack([branch.state, branch.values])).all():
            yield f"{name} has rows that are not finite"
            continue
        for point, row in zip(branch.special, branch.special_rows, strict=True):
            yield from _of_point(branch, point, row)
        yield from _retraced(branch, name, np.column_stack([branch.state, branch.values]))
    if diagram.completeness != "found":
        for change in diagram.unexplained:
            yield f"{diagram.completeness}, although {change}"
    yield from _same_equilibria(diagram)


def _of_point(branch, point, row: int) -> Iterator[str]:
    """Yield what a point says of its eigenvalues that they do not say themselves."""
    values = point.eigenvalues[np.isfinite(point.eigenvalues)]
    known = POINT_TYPES[point.code]
    if not point.converged or point.type == "candidate" or not len(values):
        return
    largest = np.abs(values).max()
    own = f"{point.label} at {branch.parameter} = {point[branch.parameter]:.9g}"
    near = branch.eigenvalues[max(row - 2, 0) : row + 3]
    near = np.where(np.isfinite(near), near, np.nan)
    if known.event == "zero":
        # in units of the same eigenvalue at the rows nearby
        beside = np.nanmax(np.nanmin(np.abs(near), axis=1), initial=0.0)
        if np.abs(values).min() > max(ROUNDED * largest, LOCATED * beside):
            yield f"{own} has no eigenvalue zero: {values}"
    if known.event in ("imaginary pair", "opposite pair"):
        pairs = [
            pair
            for pair in combinations(values, 2)
            if (abs(pair[0].imag) > 0) == (known.event == "imaginary pair")
        ]
        sums = [abs(one + other) for one, other in pairs]
        if not sums:
            yield f"{own} has no {known.event}: {values}"
            return
        one = pairs[int(np.argmin(sums))][0]
        if min(sums) > max(ROUNDED * largest, LOCATED * abs(one)):
            yield f"{own} has no {known.event}: {values}"
        if known.event == "imaginary pair" and point.frequency is not None:
            error = min(abs(abs(pair[0].imag) - point.frequency) for pair in pairs)
            if error > max(ROUNDED * largest, LOCATED * point.frequency):
                yield f"{own} has the frequency {point.frequency!r}, and eigenvalues {values}"


def _retraced(branch, name: str, rows: Array) -> Iterator[str]:
    """Yield a sentence for each stretch of rows that follows an earlier one."""
    scaled = rows / _units(rows)
    followed = _followed(scaled[: -STRETCH if branch.closed else None])
    run = 0
    for row, there in enumerate(followed):
        run = run + 1 if there >= 0 else 0
        if run < STRETCH:
            continue
        middle = row - STRETCH // 2
        if _solved_twice(branch, scaled, middle, int(followed[middle])):
            value = branch.values[middle]
            yield (
                f"{name}: rows {row - STRETCH + 1} to {row} follow rows from "
                f"{followed[row]} again, at {branch.parameter} = {value:.9g}"
            )
            return


def _units(rows: Array) -> Array:
    """Range of each column; one for those that are constant to rounding."""
    ranges, sizes = np.ptp(rows, axis=0), np.abs(rows).max(axis=0, initial=0.0)
    return np.where(ranges > 1e-12 * sizes, ranges, np.where(sizes > 0, sizes, 1.0))


def _followed(points: Array) -> NDArray[np.int64]:
    """For each row, the earlier row along whose secant it lies; −1 for none."""
    count = len(points)
    found = np.full(count, -1)
    if count < 2 * STRETCH:
        return found
    secant = np.diff(points, axis=0)
    length = np.linalg.norm(secant, axis=1)
    # secants around each row differ from the curve by half its turning
    turn = np.zeros(count - 1)
    unit = secant / np.where(length > 0, length, 1.0)[:, None]
    bend = np.linalg.norm(np.diff(unit, axis=0), axis=1)
    turn[1:] = bend
    turn[:-1] = np.maximum(turn[:-1], bend)
    for first in range(0, count, BLOCK):
        block = np.arange(first, min(first + BLOCK, count))
        gap = points[block, None] - points[None, :-1]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.einsum("ijk,jk->ij", gap, secant) / length**2
            away = np.linalg.norm(gap - np.clip(share, 0, 1)[..., None] * secant, axis=2)
        earlier = np.arange(count - 1)[None] < block[:, None] - STRETCH
        beside = (share > -0.01) & (share < 1.01) & earlier & (length > 0)[None]
        beside &= away <= (ALONG + turn)[None] * length[None]
        away = np.where(beside, away, np.inf)
        nearest = away.argmin(axis=1)
        found[block] = np.where(np.isfinite(away.min(axis=1)), nearest, -1)
    return found


def _solved_twice(branch, scaled: Array, row: int, earlier: int) -> bool:
    """Check whether two solutions of the branch at the value of a row are the row's own."""
    low, high = sorted((branch.values[earlier], branch.values[earlier + 1]))
    value = float(branch.values[row])
    if not low < value < high:
        gap = np.linalg.norm(scaled[row] - scaled[[earlier, earlier + 1]], axis=1)
        return bool(gap.min() <= SAME)
    if isinstance(branch, fs.Branch):
        if branch.region[row] != branch.region[earlier]:
            return False
        start = branch.state[earlier] + (value - branch.values[earlier]) / (
            branch.values[earlier + 1] - branch.values[earlier]
        ) * (branch.state[earlier + 1] - branch.state[earlier])
        solved = branch.corrector and branch.corrector(str(branch.region[row]), start, value)
        if not solved:
            return False
        units = _units(branch.state)
        return bool(np.abs((solved.state - branch.state[row]) / units).max() <= SAME)
    try:
        found = [
            _numbers(one) for one in branch[earlier : earlier + 2].at(**{branch.parameter: value})
        ]
    except FastSlowError:
        return False
    own = _numbers(branch[row])
    return any(np.abs(one - own).max() <= SAME * np.abs(own).max() for one in found)


def _of_curve(curve, name: str) -> Iterator[str]:
    """Yield what rows and points of a curve in two parameters say of their eigenvalues wrongly."""
    rows = np.column_stack([curve.state, curve.values])
    if not np.isfinite(rows).all():
        yield f"{name} has rows that are not finite"
        return
    orbits = POINT_TYPES[curve.code].orbits
    known = np.isfinite(curve.eigenvalues).all(axis=1)
    values = curve.eigenvalues[known]
    if not values.size:
        return
    scale, free = 1.0, 0
    if orbits:
        # the multiplier along the orbit of an autonomous model
        ones = (np.abs(values - 1) < LOCATED ** (1 / 3)).sum(axis=1).min()
        free = int(ones > (1 in CRITICAL.get(curve.code, ())))
    else:
        scale = float(np.abs(values).max())
        if scale < SAME:
            # of one state: every eigenvalue is the critical one
            return
    said = [(str(code), one, "a row") for code, one in zip(curve.codes[known], values, strict=True)]
    said += [
        (point.code, point.eigenvalues, point.label)
        for point in curve.special
        if point.converged and np.isfinite(point.eigenvalues).all()
    ]
    wrong = set()
    for code, own, label in said:
        lost = _lost(own / scale, (*CRITICAL.get(code, ()), *[1] * free), orbits)
        if lost and (code, label) not in wrong:
            wrong.add((code, label))
            yield f"{name}: {label} {code} has no critical value {', '.join(lost)}: {own}"
    yield from _curve_retraced(curve, name, rows, orbits)


def _lost(values: NDArray[np.complex128], wanted, orbits: bool) -> list[str]:
    """The critical values that are not among given ones; each is used once."""
    left, lost = list(values), []
    for one in wanted:
        count = sum(other == one for other in wanted)
        if isinstance(one, str):
            test = [
                (_off(a, b, one, orbits), i, j)
                for (i, a), (j, b) in combinations(enumerate(left), 2)
            ]
            off, *used = min(test, default=(np.inf,))
        else:
            off, *used = min(((abs(a - one), i) for i, a in enumerate(left)), default=(np.inf,))
            # a multiple one that is defective is known to a root of the error only
            near = sorted(abs(a - one) for a in values)[:count]
            crowd = sorted(abs(a - one) for a in values)[:3]
            off = min(off, float(np.prod(near)), float(np.prod(np.minimum(crowd, 1.0))))
        if off > max(LOCATED, 1e-12 * float(np.abs(values).max())):
            lost.append(str(one))
            continue
        for k in sorted(used, reverse=True):
            del left[k]
    return lost


def _off(one: complex, two: complex, kind: str, orbits: bool) -> float:
    """How far two values are from a critical pair."""
    if orbits:
        return abs(one * two - 1) if abs(one - np.conj(two)) < LOCATED else np.inf
    small = max(abs(one), abs(two)) < LOCATED ** (1 / 3)
    if (abs(one.imag) > 0) != (kind == "pair") and not small:
        return np.inf
    return abs(one + two)


def _curve_retraced(curve, name: str, rows: Array, orbits: bool) -> Iterator[str]:
    """Yield a sentence for a stretch of rows of a curve that follows an earlier one.

    Orbits of a curve do not begin at one phase: they are compared by their multipliers.
    """
    if orbits:
        values = np.where(np.isfinite(curve.eigenvalues), curve.eigenvalues, 0)
        order = np.argsort(-np.abs(values), axis=1, kind="stable")
        moduli = np.abs(np.take_along_axis(values, order, axis=1))
        sums = np.stack([values.sum(axis=1), (values**2).sum(axis=1)], axis=1).real
        rows = np.column_stack([curve.values, moduli, sums])
    scaled = rows / _units(rows)
    count = len(rows) - STRETCH if curve.closed else len(rows)
    followed, run = _followed(scaled[:count]), 0
    for row, there in enumerate(followed):
        near = there >= 0 and _off_cubic(scaled, row, int(there)) <= SAME ** (1 / 2)
        run = run + 1 if near else 0
        if run >= STRETCH:
            first, second = curve.parameter_names
            yield (
                f"{name}: rows {row - STRETCH + 1} to {row} follow rows from {there} again, at "
                f"{first} = {curve.values[row, 0]:.9g}, {second} = {curve.values[row, 1]:.9g}"
            )
            return


def _off_cubic(points: Array, row: int, there: int) -> float:
    """Distance of a row from the cubic through four earlier rows, in units of their distance."""
    first = min(max(there - 1, 0), len(points) - 4)
    four = points[first : first + 4]
    length = np.linalg.norm(points[there + 1] - points[there])
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(four, axis=0), axis=1)))
    if not (np.diff(along) > 0).all():
        return np.inf
    cubic = np.linalg.solve(np.vander(along, increasing=True), four)
    s = np.linspace(along[there - first], along[there - first + 1], 2001)
    away = np.vander(s, 4, increasing=True) @ cubic - points[row]
    return float(np.linalg.norm(away, axis=1).min() / length)


def _same_equilibria(diagram) -> Iterator[str]:
    """Yield a sentence for each pair of branches with the same equilibria."""
    branches = [b for b in diagram.branches if b.corrector is not None and len(b) > STRETCH]
    for number, branch in enumerate(branches):
        rows = np.unique((np.array([0.29, 0.5, 0.71]) * (len(branch) - 1)).astype(int))
        for other in branches[:number]:
            if other.admissible != branch.admissible:
                continue
            # a branch far away must not set the unit of two that are near zero
            units = _units(np.concatenate([branch.state, other.state]))
            if all(_on(other, branch, row, units) for row in rows):
                yield (
                    f"two branches have the same equilibria, "
                    f"e.g. at {diagram.parameter} = {branch.values[rows[0]]:.9g}"
                )


def _on(other, branch, row: int, units: Array) -> bool:
    """Check whether a row of one branch is an equilibrium of another one."""
    value, region = float(branch.values[row]), str(branch.region[row])
    low, high = other.range
    if not low <= value <= high:
        return False
    found = other._at(value, None, region)
    return any(np.abs((one.state - branch.state[row]) / units).max() <= SAME for one in found)


def _numbers(orbit) -> Array:
    """Numbers that do not depend on the phase: period and extremes of the states."""
    states = orbit.states
    return np.array([orbit.period, *(orbit[f"{w}({s})"] for s in states for w in ("min", "max"))])


def _of_orbits(branch, name: str) -> Iterator[str]:
    for point in branch.special:
        yield from _of_orbit(branch, point)
    if len(branch) < 2 * STRETCH:
        return
    columns = [branch.period, branch.values]
    columns += [branch[f"{which}({state})"] for state in branch.states for which in ("min", "max")]
    rows = np.column_stack(columns)
    finite = np.isfinite(rows).all(axis=1)
    if not finite[1:-1].all():
        yield f"{name} has rows that are not finite"
        return
    kept = branch[int(not finite[0]) : len(branch) - int(not finite[-1])]
    yield from _retraced(kept, name, rows[finite])


def _of_orbit(branch, point) -> Iterator[str]:
    """Yield what a special orbit says of its multipliers that they do not say themselves."""
    known = POINT_TYPES[point.code]
    if not point.converged or not known.event:
        return
    values = point.multipliers[np.isfinite(point.multipliers)]
    own = f"{point.label} at {branch.parameter} = {point.parameters[branch.parameter]:.9g}"
    error = max(LOCATED, 1e-12 * float(np.abs(values).max(initial=1.0)))
    if known.event == "multiplier pair":
        critical = np.exp(1j * point.angle)
        if min(abs(values - critical)) > error:
            yield f"{own} has no multipliers exp(±i {point.angle:.6g}): {values}"
        return
    at = {"multiplier 1": 1.0, "multiplier -1": -1.0}[known.event]
    autonomous = branch.multiple is None
    needed = 2 if at == 1.0 and autonomous else 1
    # a double multiplier 1 that is defective is known to the square root of the error only
    allowed = np.sqrt(error) if needed == 2 else error
    if np.count_nonzero(np.abs(values - at) <= allowed) < needed:
        yield f"{own} has no {known.event}: {values}"


def _of_thresholds(curve: fs.ThresholdCurve) -> Iterator[str]:
    """A curve of critical rates is finite and goes on in one direction."""
    steps = np.diff(curve.values, axis=0)
    if not np.isfinite(curve.values).all() or not np.abs(steps).max(axis=1).all():
        yield "the curve has a row that is not finite, or one twice"
    if (np.einsum("ij,ij->i", curve.tangent[1:], curve.tangent[:-1]) <= 0.0).any():
        yield "the curve turns back"


def _same_orbits(branches) -> Iterator[str]:
    """Yield a sentence for each pair of branches with the same orbits."""
    for (k, one), (j, other) in combinations(enumerate(branches), 2):
        if len(other) <= STRETCH or len(one) <= STRETCH:
            continue
        low, high = one.range
        rows = np.unique((np.array([0.29, 0.5, 0.71]) * (len(other) - 1)).astype(int))
        if all(low <= other.values[row] <= high for row in rows) and all(
            _among(one, other, int(row)) for row in rows
        ):
            yield f"branches {k} and {j} have the same orbits"


def _among(one, other, row: int) -> bool:
    own = _numbers(other[row])
    try:
        found = one.at(**{one.parameter: float(other.values[row])})
    except FastSlowError:
        return False
    return any(np.abs(_numbers(orbit) - own).max() <= SAME * np.abs(own).max() for orbit in found)
