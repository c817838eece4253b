"""Diagrams of random polynomial systems with default windows: rows, repeated curves, ends.

The systems are those of `tests.campaigns.polynomial_systems`. A curve is traced twice where the
middle of one branch lies on another, away from their special points.
"""

from __future__ import annotations

import random
import time
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

import fastslow as fs
from tests.campaigns.polynomial_systems import OVER, System, random_system

Array = NDArray[np.float64]

#: Rows of one branch that are too many.
MOST = 3000

#: Distance from another branch's line, in parts of the length of its step, that is on it.
ON = 1e-2


@dataclass
class Report:
    """What was seen, over all numbers of states."""

    systems: Counter[int] = field(default_factory=Counter)
    branches: int = 0
    rows: int = 0
    longest: int = 0
    long: int = 0
    repeated: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    silent: int = 0
    seconds: float = 0.0
    faults: list[str] = field(default_factory=list)

    @property
    def failures(self) -> bool:
        """Whether a branch is too long, traced twice, or ends without a word."""
        return bool(self.long or self.repeated or self.silent)

    def __str__(self) -> str:
        kinds = ", ".join(f"{count} with {n}" for n, count in sorted(self.systems.items()))
        ends = ", ".join(f"{code!r} {count}" for code, count in self.ends.most_common())
        lines = [
            f"{self.systems.total()} systems ({kinds} states), {self.branches} branches with "
            f"{self.rows} rows, {self.rows / max(self.systems.total(), 1):.0f} a diagram, the "
            f"longest with {self.longest}; {self.long} with more than {MOST}, {self.repeated} "
            f"traced twice, {self.silent} ends unexplained; ends: {ends}; "
            f"{self.seconds / max(self.systems.total(), 1):.1f} s a diagram"
        ]
        return "\n".join(lines + [f"    {fault}" for fault in self.faults])


def check(system: System, report: Report, name: str) -> None:
    """Trace a diagram and look at its branches."""
    started = time.process_time()
    diagram = fs.continue_equilibria(system.model(), "p", OVER)
    report.seconds += time.process_time() - started
    report.systems[system.n] += 1
    lines = [branch.points / _units(diagram, system) for branch in diagram]
    faults = []
    for k, branch in enumerate(diagram):
        report.branches += 1
        report.rows += len(branch)
        report.longest = max(report.longest, len(branch))
        if len(branch) > MOST:
            report.long += 1
            faults.append(f"branch {k} has {len(branch)} rows: {branch.outcome}")
        for outcome, end in zip(branch.outcomes, (0, -1), strict=True):
            report.ends[outcome.code] += 1
            if not _explained(diagram, branch, outcome, end):
                report.silent += 1
                faults.append(f"an end of branch {k}: {outcome.code}, {outcome.message}")
        twice = [m for m in range(k) if _repeats(lines[k], lines[m])]
        report.repeated += bool(twice)
        faults += [f"branch {k} repeats branch {m}" for m in twice]
    report.faults += [f"{name} {fault}; {system}" for fault in faults]


def _units(diagram: fs.Diagram, system: System) -> Array:
    """Units of the states and the parameter in which a diagram has some width."""
    return np.array([*map(float, system.units), OVER[1] - OVER[0]])


def _explained(diagram: fs.Diagram, branch: fs.Branch, outcome: fs.Outcome, end: int) -> bool:
    """Whether an end is where its outcome says it is."""
    value, state = branch.values[end], branch.points[end, :-1]
    if outcome.code == "end of range":
        return bool(np.isclose(value, OVER, rtol=0, atol=1e-12).any())
    if outcome.code == "left the window":
        bounds = np.array([diagram.window[name] for name in diagram.window.states])
        return bool(np.isclose(state[:, None], bounds, rtol=1e-9, atol=0).any())
    if outcome.code == "closed loop":
        return bool(np.allclose(branch.points[0], branch.points[-1], rtol=1e-6, atol=1e-9))
    # any other end is where a point with a code says why
    return bool(np.isin(end % len(branch), branch.special_rows))


def _repeats(line: Array, other: Array) -> bool:
    """Whether three rows within one line all lie on another."""
    if len(line) < 4 or len(other) < 2:
        return False
    steps = np.diff(other, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    # rows of special points may repeat
    steps, other = steps[lengths > 0], other[:-1][lengths > 0]
    lengths = lengths[lengths > 0]
    for row in (len(line) // 4, len(line) // 2, 3 * len(line) // 4):
        gap = line[row] - other
        part = np.clip((gap * steps).sum(axis=1) / lengths**2, 0.0, 1.0)
        apart = np.linalg.norm(gap - part[:, None] * steps, axis=1)
        if not np.any(apart < ON * lengths):
            return False
    return True


def campaign(count: int = 300, seed: int = 1, states: int = 0) -> Report:
    """Random systems, a third each with one, two and three states, or all with one number."""
    generator = random.Random(seed)
    report = Report()
    for k in range(count):
        n = states or 1 + k % 3
        check(random_system(generator, n), report, f"system {k} of seed {seed},")
    return report
