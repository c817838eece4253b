"""The first diagram of a model of many states, against the eigenvalues of its rows alone.

The model is the Brusselator on
a line, two states for each cell, with a feed that no earlier run has had, so that everything
from its equations to the diagram is counted: elimination, generated code, its compilation,
the search for equilibria, the branch, its special points and their normal forms. Loops
that serve every model are compiled before. The peer is ``numpy.linalg.eigvals``, one matrix
after another, for the Jacobian at every row of the branch, which no diagram with stability
can do without. Processor time, with one thread in linear algebra.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

import fastslow as fs
from tests.benchmarks.measuring import Line, medians, used
from tests.diagrams.models import LENGTH, brusselator

OVER = (0.2, 2.0)
STATES = (10, 60, 200)


def jacobians(branch: fs.Branch) -> np.ndarray:
    """Jacobians of the rates at every row, in closed form."""
    rows, n = branch.state.shape
    cells = n // 2
    x, y = branch.state[:, :cells], branch.state[:, cells:]
    spread = np.eye(cells, k=1) + np.eye(cells, k=-1) - 2 * np.eye(cells)
    scale = ((cells + 1) / branch.values[:, None, None]) ** 2 * spread
    found = np.empty((rows, n, n))
    found[:, :cells, :cells] = 0.008 * scale
    found[:, cells:, cells:] = 0.004 * scale
    k = np.arange(cells)
    found[:, :cells, cells:] = found[:, cells:, :cells] = 0.0
    found[:, k, k] += 2 * x * y - 6.45
    found[:, k, cells + k] = x**2
    found[:, cells + k, k] = 5.45 - 2 * x * y
    found[:, cells + k, cells + k] -= x**2
    return found


def lines() -> Iterator[Line]:
    """First diagrams of models of more and more states, and the eigenvalues of their rows."""
    model, _ = brusselator(2)
    fs.continue_equilibria(model, LENGTH, OVER)
    fresh = 2.0 + (time.time_ns() % 10**9) * 1e-12
    for states in STATES:
        work = f"first diagram of a model of {states} states"
        begin = used()
        model, _ = brusselator(states // 2, fresh)
        diagram = fs.continue_equilibria(model, LENGTH, OVER)
        whole = 1e3 * (used() - begin)
        (branch,) = diagram.branches
        matrices = jacobians(branch)
        alone = medians({"": lambda: np.linalg.eigvals(matrices)}, repeats=1)[""]  # noqa: B023
        # the peer computes the same numbers
        values = np.linalg.eigvals(matrices)
        assert np.allclose(values.real.max(axis=1), branch.eigenvalues.real.max(axis=1))
        points = len(branch.special("HB"))
        yield Line(work, "fastslow", whole, "ms", None, f"{len(branch)} rows, {points} Hopf points")
        yield Line(work, "numpy.linalg.eigvals of the rows alone", alone, "ms", alone / whole)
