"""What the campaigns share that delete a part of the diagrams of random systems.

Cubic polynomials of one or two states over a parameter.
"""

from dataclasses import dataclass, field

import numpy as np
import sympy as sp

import fastslow as fs
from tests.certification.systems import cubic


@dataclass
class Report:
    """What a campaign has found."""

    parts: str
    seed: int
    deleted: int = 0
    found: int = 0
    skipped: int = 0
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        text = (
            f"seed {self.seed}: {self.found} of {self.deleted} deleted {self.parts} found again, "
            f"{self.skipped} systems without a complete certificate\n"
            f"  failures: {len(self.failures)}"
        )
        return "\n".join([text, *(f"    {one}" for one in self.failures[:20])])


def random_diagram(rng, n):
    """A random system of n states: its model, window and diagram over p."""
    rates, unknowns, ranges = cubic(n, int(rng.integers(2**31)))
    *states, p = unknowns
    model = fs.Model(dict(zip(states, rates, strict=True)), parameters={sp.Symbol(p.name): 0})
    window = {s.name: r for s, r in zip(states, ranges[:-1], strict=True)}
    return model, window, fs.continue_equilibria(model, "p", ranges[-1], window=window)


def repeated(one, parts, count, seed):
    """Delete so many parts, one of each random system."""
    rng = np.random.default_rng(seed)
    report = Report(parts, seed)
    number = 0
    while report.deleted < count:
        one(report, rng, number)
        number += 1
    return report
