"""Solutions by Newton's method against the proved pieces of curves."""

from dataclasses import dataclass, field

import numpy as np
import sympy as sp

from fastslow.certification.pruning import prune_window
from fastslow.kernels.intervals.printer import interval_program
from tests.certification.systems import SYSTEMS, window_of

#: Rounding of a solution by Newton's method, in units of the window.
ROUNDING = 1e-9


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
        report.solutions += len(solutions)
        report.lines.append(
            f"  {name}: {len(solutions)} solutions, {outside} outside {len(pieces.free)} pieces"
        )
    return report
