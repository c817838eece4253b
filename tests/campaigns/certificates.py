"""Solutions by Newton's method against the proved pieces of curves and their stability."""

from dataclasses import dataclass, field

import numpy as np
import sympy as sp

from fastslow.certification.boxes.linking import IntervalProblem, curves_of
from fastslow.certification.boxes.pruning import prune_window
from fastslow.certification.equations import ExactEquations
from fastslow.certification.spectra.linearisations import linearisation
from fastslow.certification.spectra.stability import examined
from fastslow.kernels.intervals.printer import interval_program
from tests.certification.systems import SYSTEMS, window_of

#: Rounding of a solution by Newton's method, in units of the window.
ROUNDING = 1e-9

#: Real parts of eigenvalues below this fraction of the largest modulus have no certain sign.
NEUTRAL = 1e-7


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    solutions: int = 0
    failures: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)

    def __str__(self):
        text = f"seed {self.seed}: {self.solutions} solutions, failures: {len(self.failures)}"
        return "\n".join([text, *self.lines, *(f"    {one}" for one in self.failures[:20])])


#: Random points from which Newton's method starts at once.
STARTS = 2000


def newton(rates, unknowns, low, high, rng, count):
    """Solutions in a window from random points, by steps of least norm, shape (m, N)."""
    values = sp.lambdify(unknowns, rates, "numpy", cse=True)
    slopes = sp.lambdify(unknowns, [f.diff(u) for f in rates for u in unknowns], "numpy", cse=True)
    n, extent = len(rates), high - low

    def stacked(function, u, shape):
        with np.errstate(all="ignore"):
            columns = np.broadcast_arrays(*function(*u.T), u[:, 0])[:-1]
        return np.stack(columns, axis=1).reshape(len(u), *shape)

    found = []
    while sum(map(len, found)) < count:
        u = low + rng.random((STARTS, len(low))) * extent
        for _ in range(40):
            matrix = stacked(slopes, u, (n, n + 1)) * extent
            step = np.zeros_like(u)
            good = np.isfinite(matrix).all(axis=(1, 2))
            residual = stacked(values, u, (n, 1))
            good &= np.isfinite(residual).all(axis=(1, 2))
            step[good] = (np.linalg.pinv(matrix[good]) @ residual[good])[..., 0] * extent
            u = u - step
            done = good & (np.abs(step / extent).max(axis=1) < 1e-14)
            found.append(u[done & ((u >= low) & (u <= high)).all(axis=1)])
            u = u[good & ~done]
            if not len(u):
                break
    return np.concatenate(found)[:count]


def unstable(rates, unknowns, points):
    """Numbers of eigenvalues with positive real part at solutions; −1 where rounding decides."""
    jacobian = sp.Matrix(rates).jacobian(unknowns[:-1])
    values = sp.lambdify(unknowns, list(jacobian), "numpy", cse=True)
    columns = np.broadcast_arrays(*values(*points.T), points[:, 0])[:-1]
    matrices = np.stack(columns, axis=1).reshape(len(points), *jacobian.shape)
    found = np.linalg.eigvals(matrices.astype(float))
    certain = np.abs(found.real).min(axis=1) > NEUTRAL * np.abs(found).max(axis=1)
    return np.where(certain, (found.real > 0).sum(axis=1), -1)


def wrong_stability(rates, unknowns, low, high, pieces, solutions):
    """Number of solutions that are on arcs, and those whose proved stability is another one."""
    problem = IntervalProblem(interval_program(rates, unknowns), None, (), low, high)
    equations = ExactEquations("S1", tuple(unknowns), tuple(rates), (), (), ())
    found = examined(problem, linearisation(equations), (), curves_of(problem, pieces))
    arcs_low, arcs_high, proved = (
        np.concatenate([getattr(curve, name) for curve in found.curves])
        for name in ("low", "high", "unstable")
    )
    numbers = unstable(rates, unknowns, solutions)
    on_arcs, wrong = 0, []
    for point, number in zip(solutions, numbers, strict=True):
        inside = ((arcs_low <= point) & (point <= arcs_high)).all(axis=1) & (proved >= 0)
        if inside.any() and number >= 0:
            on_arcs += 1
            if set(proved[inside]) != {number}:
                wrong.append((point, number, proved[inside].tolist()))
    return on_arcs, wrong


def campaign(count=20_000, seed=0, names=tuple(SYSTEMS)):
    """Compare so many solutions of each system."""
    report = Report(seed)
    for name in names:
        rates, unknowns, ranges = SYSTEMS[name]()
        low, high = window_of(ranges)
        pieces = prune_window(
            interval_program(rates, unknowns), low, high, max_boxes=3_000_000, width=1e-6
        )
        if not pieces.complete:
            report.failures.append(f"{name}: {len(pieces.left_low)} boxes are left over")
        solutions = newton(rates, unknowns, low, high, np.random.default_rng(seed), count)
        more = ROUNDING * (high - low)
        outside = 0
        for point in solutions:
            inside = (pieces.low <= point + more) & (point - more <= pieces.high)
            if not inside.all(axis=1).any():
                outside += 1
                report.failures.append(f"{name}: {point.tolist()} is in no piece")
        on_arcs, wrong = wrong_stability(rates, unknowns, low, high, pieces, solutions)
        for point, number, proved in wrong:
            report.failures.append(
                f"{name}: {point.tolist()} has {number} unstable eigenvalues, not {proved}"
            )
        report.solutions += len(solutions)
        report.lines.append(
            f"  {name}: {len(solutions)} solutions, {outside} outside {len(pieces.free)} pieces; "
            f"stability compared at {on_arcs}, {len(wrong)} wrong"
        )
    return report
