"""Questions to a branch of a million points, and its files, against bare NumPy."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import fastslow as fs
from fastslow.results.base.outcome import Outcome
from fastslow.results.points import SpecialPoints
from tests.benchmarks.measuring import Line, against, medians

ROWS = 1_000_000


def cubic() -> fs.Branch:
    """A million equilibria of x' = p + x − x³."""
    x = np.linspace(-2, 2, ROWS)
    slope = 3 * x**2 - 1
    end = Outcome("end of range", "reached the end of the range.", True)
    return fs.Branch(
        ("x",),
        "p",
        x[:, None],
        x**3 - x,
        np.column_stack([np.ones_like(x), slope]) / np.hypot(1, slope)[:, None],
        -slope[:, None] + 0j,
        np.full(ROWS, "S1"),
        SpecialPoints(),
        (),
        (end, end),
    )


def lines() -> Iterator[Line]:
    """Look-up, expressions, intersections, files."""
    branch = cubic()
    x, p = np.array(branch["x"]), np.array(branch["p"])

    def scanned() -> np.ndarray:
        """Where p passes 0.2, by looking at every row."""
        above = p > 0.2
        return x[:-1][above[1:] != above[:-1]]

    times = medians({"fastslow, branch.at": lambda: branch.at(p=0.2), "numpy, all rows": scanned})
    yield from against("states at a value, of a million rows", "fastslow, branch.at", times)
    times = medians({"fastslow, a column": lambda: branch["x**2 + p"], "numpy": lambda: x**2 + p})
    yield from against("an expression over a million rows", "fastslow, a column", times)
    other, half = branch[ROWS // 2 :], branch[: ROWS // 2]
    found = medians({"fastslow": lambda: half.intersections(other, "p", "x")}, repeats=3)
    yield from against("intersections of two curves of half a million rows", "fastslow", found)
    with tempfile.TemporaryDirectory() as name:
        for ending in ("npz", "nc"):
            path = Path(name) / f"branch.{ending}"

            def there_and_back(path: Path = path) -> None:
                branch.save(path)
                fs.load(path)

            bare = Path(name) / "bare.npz"

            def arrays(bare: Path = bare) -> None:
                np.savez(bare, x=x, p=p, t=branch.tangent, e=branch.eigenvalues)
                with np.load(bare) as file:
                    [file[key] for key in file]

            times = medians({"fastslow": there_and_back, "numpy.savez": arrays}, repeats=3)
            yield from against(f"a million rows to .{ending} and back", "fastslow", times)
