"""Questions to a branch of a million points, and its files.

Run with ``pytest tests/benchmarks/bench_queries.py --benchmark-enable``.
"""

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.outcome import Outcome
from fastslow.results.points import SpecialPoints

ROWS = 1_000_000


@pytest.fixture(scope="module")
def branch():
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


def test_at(branch, benchmark):
    found = benchmark(lambda: branch.at(p=0.2, stable=True))
    assert len(found) == 2
    # below a millisecond, whatever the length
    assert benchmark.stats["median"] < 1e-3


def test_expression(branch, benchmark):
    assert len(benchmark(lambda: branch["x**2 + p"])) == ROWS


def test_nearest(branch, benchmark):
    assert benchmark(lambda: branch.nearest(p=0.2, x=1.0)).stable


def test_intersections(branch, benchmark):
    other = branch[ROWS // 2 :]
    benchmark(lambda: branch[: ROWS // 2].intersections(other, "p", "x"))


@pytest.mark.parametrize("ending", ["npz", "nc"])
def test_files(branch, benchmark, tmp_path, ending):
    def there_and_back():
        branch.save(tmp_path / f"branch.{ending}")
        return fs.load(tmp_path / f"branch.{ending}")

    assert len(benchmark(there_and_back)) == ROWS
