"""Zeros along the steps of a run, on polynomials whose zeros are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastslow.results.trajectory.steps import step_roots
from fastslow.results.trajectory.steps.step_polynomials import StepPolynomials
from fastslow.results.trajectory.steps.step_roots import _refined, find_roots


def cut(polynomial, steps):
    """A polynomial on 0 ≤ u ≤ 1, cut into equal steps."""
    edges = np.linspace(0, 1, steps + 1)
    rows = np.zeros((steps, len(polynomial.coef)))
    for i in range(steps):
        piece = polynomial(np.polynomial.Polynomial([edges[i], edges[i + 1] - edges[i]])).coef
        rows[i, : len(piece)] = piece
    # what cutting rounds off is relative to the whole
    return StepPolynomials(rows, np.full(steps, 4 * np.abs(polynomial.coef).sum()))


def zeros(polynomial, steps):
    found = find_roots(cut(polynomial, steps))
    return (found.step + found.part) / steps, found.direction


@given(
    roots=st.lists(st.integers(-60, 160), min_size=1, max_size=4, unique=True),
    steps=st.integers(1, 7),
)
def test_every_zero_is_found_once(roots, steps):
    # roots at hundredths, so that many are on the ends and the middles of steps
    roots = np.sort(np.array(roots)) / 100
    polynomial = np.polynomial.Polynomial.fromroots(roots)
    where, direction = zeros(polynomial, steps)
    expected = roots[(roots > 0) & (roots <= 1)]
    assert where == pytest.approx(expected, abs=1e-9)
    slopes = np.sign(polynomial.deriv()(expected))
    assert np.array_equal(direction, slopes)


@pytest.mark.parametrize("steps", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("at", [0.25, 0.4, 0.5, 1 / 3])
def test_a_touch_counts_once(at, steps):
    where, direction = zeros(np.polynomial.Polynomial.fromroots([at, at]), steps)
    assert where == pytest.approx([at], abs=1e-7)
    assert direction.tolist() == [0]
    where, direction = zeros(np.polynomial.Polynomial.fromroots([at, at, at]), steps)
    assert where == pytest.approx([at], abs=1e-4)
    assert direction.tolist() == [1]


def test_two_zeros_close_together():
    near = np.polynomial.Polynomial.fromroots([0.3, 0.3 + 1e-6])
    where, direction = zeros(near, 2)
    assert where == pytest.approx([0.3, 0.3 + 1e-6], abs=1e-9)
    assert direction.tolist() == [-1, 1]
    apart = near + 1e-12
    assert not len(zeros(apart, 2)[0])


def test_a_rest_on_zero_counts_where_it_begins():
    rows = np.zeros((1000, 3))
    rows[0], rows[-1] = [1, -1, 0], [0, 0, -1]
    found = find_roots(StepPolynomials(rows, np.ones(1000)))
    assert (found.step + found.part).tolist() == [1.0]
    assert found.direction.tolist() == [-1]


def test_a_run_that_begins_on_zero_is_not_there_yet():
    where, direction = zeros(np.polynomial.Polynomial([0, 1]), 3)
    assert not len(where)
    where, direction = zeros(np.polynomial.Polynomial([-1, 1]), 3)
    assert where.tolist() == [1.0]
    assert direction.tolist() == [1]


class Counted(np.ndarray):
    """An array that counts how often it is read."""

    reads = 0

    def __getitem__(self, key):
        Counted.reads += 1
        return super().__getitem__(key)


def test_a_root_at_the_end_of_its_bracket_ends_the_search():
    """Where Newton's correction is below rounding, and not by halving the whole bracket again."""
    roots = np.random.default_rng(3).uniform(0.05, 0.95, 2000)
    # (s − r)(s + 1)(s + 2), of which rounding leaves something at most roots
    b = np.column_stack([-2 * roots, 2 - 3 * roots, 3 - roots, np.ones(2000)]).view(Counted)
    Counted.reads = 0
    found = _refined(b, np.zeros(2000), np.ones(2000), -np.ones(2000))
    assert Counted.reads <= 12 * 4
    assert np.asarray(found) == pytest.approx(roots, rel=1e-14)


def test_steps_far_from_zero_are_not_divided(monkeypatch):
    looked = []
    changes = step_roots._changes
    monkeypatch.setattr(
        step_roots, "_changes", lambda table: looked.append(len(table)) or changes(table)
    )
    found, directions = zeros(np.polynomial.Polynomial([-0.505, 1.0]), 100)
    assert found == pytest.approx([0.505])
    assert directions.tolist() == [1]
    # the step, and the next, of which only the size is compared
    assert looked == [2]
