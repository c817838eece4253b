"""Shared by the tests of results: a branch known in closed form, and what counts as the same."""

import dataclasses
from collections.abc import Mapping

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.base.outcome import Outcome
from fastslow.results.points import SpecialPoint, SpecialPoints

END = Outcome("end of range", "reached the end of the range.", True)
FOLD = 1 / np.sqrt(3)


def point(code, label, x, row_parameter):
    return SpecialPoint(
        code, label, ("x",), np.array([x]), {"p": row_parameter, "q": 2.0}, ("S1",),
        np.zeros(1, dtype=complex), np.array([1.0, 0.0]), 0.0, True,
    )  # fmt: skip


def s_curve(count=61, width=1.5):
    """The equilibria of x' = p + x − x³ with both folds on rows of their own."""
    x = np.union1d(np.linspace(-width, width, count), [-FOLD, FOLD])
    eigenvalues = 1 - 3 * x**2
    eigenvalues[np.isclose(np.abs(x), FOLD, atol=1e-12, rtol=0)] = 0.0
    slope = 3 * x**2 - 1
    rows = [int(np.argmin(np.abs(x - at))) for at in (-FOLD, FOLD)]
    parameter = x**3 - x
    special = [
        point("EP", "EP1", x[0], parameter[0]),
        *(point("LP", f"LP{k + 1}", x[r], parameter[r]) for k, r in enumerate(rows)),
        point("EP", "EP2", x[-1], parameter[-1]),
    ]
    return fs.Branch(
        ("x",),
        "p",
        x[:, None],
        parameter,
        np.column_stack([np.ones_like(x), slope]) / np.hypot(1, slope)[:, None],
        eigenvalues[:, None].astype(complex),
        np.full(len(x), "S1"),
        SpecialPoints(special),
        (0, *rows, len(x) - 1),
        (END, END),
        parameters={"q": 2.0},
    )


def same(one, other):
    """Whether two values are the same, bit for bit, but for what lives in a process only."""
    if isinstance(one, np.ndarray):
        alike = one.dtype == other.dtype and one.shape == other.shape
        return (
            alike and np.ascontiguousarray(one).tobytes() == np.ascontiguousarray(other).tobytes()
        )
    if isinstance(one, float):
        return isinstance(other, float) and np.float64(one).tobytes() == np.float64(other).tobytes()
    if isinstance(one, complex):
        return same(one.real, other.real) and same(one.imag, other.imag)
    if type(one) is not type(other):
        return False
    if isinstance(one, Mapping):
        return list(one) == list(other) and all(same(one[k], other[k]) for k in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(same, list(one), list(other)))
    if dataclasses.is_dataclass(one):
        return all(
            same(getattr(one, entry.name), getattr(other, entry.name))
            for entry in dataclasses.fields(one)
            if not entry.metadata.get("live")
        )
    return one == other


@pytest.fixture(scope="session", name="same")
def same_fixture():
    return same


@pytest.fixture(scope="session")
def cubic():
    """Gives the branch with so many rows."""
    return s_curve
