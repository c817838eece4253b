"""Where two curves meet, against closed forms and against trying every pair of steps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fastslow as fs
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.curve_intersections import _chord_intersections, _overlapping
from fastslow.results.points import SpecialPoints

END = Outcome("end of range", "reached the end of the range.", True)


@pytest.fixture(scope="module")
def branch(cubic):
    return cubic()


def line(slope, offset, count=7):
    p = np.linspace(-2, 2, count)
    x = slope * p + offset
    tangent = np.tile(np.array([slope, 1.0]) / np.hypot(slope, 1), (count, 1))
    nothing = np.zeros((count, 1), dtype=complex)
    return fs.Branch(
        ("x",), "p", x[:, None], p, tangent, nothing, np.full(count, "S1"), SpecialPoints(), (),
        (END, END),
    )  # fmt: skip


@pytest.mark.parametrize(("slope", "offset"), [(1.0, 0.013), (-2.0, 0.4), (0.1, 0.2), (0.0, -0.9)])
def test_where_curves_meet(branch, slope, offset):
    # x = s p + c on p = x³ − x: s x³ − (1 + s) x + c = 0
    roots = np.roots([slope, 0, -(1 + slope), offset]) if slope else np.array([offset])
    real = np.sort(roots.real[(np.abs(roots.imag) < 1e-9) & (np.abs(roots.real) <= 1.5)])
    met = branch.intersections(line(slope, offset), "p", "x")
    # cubics over steps of 0.05 are exact here up to the parametrisation
    assert met[:, 1] == pytest.approx(real, abs=2e-6)
    assert met[:, 0] == pytest.approx(real**3 - real, abs=5e-6)
    other = line(slope, offset).intersections(branch, "p", "x")
    assert np.sort(other[:, 1]) == pytest.approx(real, abs=2e-6)


def test_curves_that_do_not_meet(branch):
    assert branch.intersections(line(0.0, 3.0), "p", "x").shape == (0, 2)
    with pytest.raises(fs.ArgumentError, match="one curve, traced twice"):
        line(1.0, 0.0).intersections(line(1.0, 0.0), "p", "x")
    assert line(1.0, 0.0, 2)[:1].intersections(branch, "p", "x").shape == (0, 2)
    with pytest.raises(fs.ArgumentError, match="expected two different curves"):
        branch.intersections(branch, "p", "x")
    with pytest.raises(fs.ArgumentError, match="two different columns"):
        branch.intersections(line(1, 0), "p", "p")
    with pytest.raises(fs.UnknownNameError, match="unknown column 'y'"):
        branch.intersections(line(1, 0), "p", "y")


@given(seed=st.integers(0, 10**6), sizes=st.tuples(st.integers(2, 20), st.integers(2, 20)))
def test_intersections_are_found_as_by_trying_every_pair(seed, sizes):
    random = np.random.default_rng(seed)
    one, other = (random.normal(size=(n, 2)).cumsum(axis=0) for n in sizes)
    i, j = (k.reshape(-1) for k in np.indices((sizes[0] - 1, sizes[1] - 1)))
    _, meet = _chord_intersections(one, other, i, j)
    near_i, near_j = _overlapping(one, other)
    _, found = _chord_intersections(one, other, near_i, near_j)
    assert set(zip(near_i[found], near_j[found], strict=True)) == set(
        zip(i[meet], j[meet], strict=True)
    )
