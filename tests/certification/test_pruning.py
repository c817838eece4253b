"""Branch and prune: every solution is in a piece, and what is not proved is left over."""

import numpy as np
import pytest
import sympy as sp

from fastslow.certification.boxes.pruning import prune_window
from fastslow.kernels.intervals.printer import interval_program
from tests.campaigns.certificates import campaign
from tests.certification.systems import SYSTEMS, cusp, window_of

x, y, p = sp.symbols("x y p", real=True)


def pruned(rates, unknowns, ranges, **options):
    options = {"max_boxes": 100_000, "width": 1e-6} | options
    return prune_window(interval_program(rates, unknowns), *window_of(ranges), **options)


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", [n for n in SYSTEMS if n != "cubic n = 4"])
def test_newton_solutions_are_inside_the_pieces(name):
    # python -m tests.campaigns certificates 20000
    report = campaign(100, 5, [name])
    assert report.failures == []
    assert report.solutions >= 100


def test_pieces_of_the_cusp_cover_the_curve_once():
    found = pruned(*cusp())
    assert found.complete
    # p = x³ − x, x from −3 to 3: every point of the curve, and nothing else
    values = np.linspace(-1.6, 1.6, 1001)
    points = np.column_stack([values, values**3 - values])
    points = points[np.abs(points[:, 1]) < 2]
    inside = (found.low[:, None] <= points) & (points <= found.high[:, None])
    assert inside.all(axis=2).any(axis=0).all()
    # every piece contains a solution at the middle of its free unknown
    for low, high, free in zip(found.low, found.high, found.free, strict=True):
        middle = 0.5 * (low[free] + high[free])
        roots = np.roots([-1, 0, 1, middle]) if free == 1 else np.array([middle**3 - middle])
        real = roots[np.abs(roots.imag) < 1e-9].real
        other = 1 - free
        assert np.sum((low[other] <= real) & (real <= high[other])) == 1


def test_a_branch_point_is_left_over():
    # two curves cross at 0: exact branch points cannot be proved
    found = pruned([x * (p - x**2)], [x, p], [(-1, 1), (-1, 1)], width=1e-5)
    assert not found.complete
    middle = 0.5 * (found.left_low + found.left_high)
    assert np.abs(middle).max() < 1e-3


def test_a_pole_in_the_window_is_left_over():
    # along a line, which smaller boxes would not resolve
    found = pruned([p - 1 / x], [x, p], [(-1, 1), (-5, 5)])
    assert np.abs(found.left_low[:, 0]).max() < 1e-2
    assert len(found.left_low) < 5000
    assert len(found.open_low) == 0


def test_boxes_not_searched_are_reported():
    found = pruned(*cusp(), max_boxes=20)
    assert not found.complete
    assert found.searched == 20
    assert len(found.open_low) > 0
    whole = pruned(*cusp())
    # what was found is unchanged, and what is missing is in the open boxes
    assert len(found.free) < len(whole.free)


def test_full_tables_are_emptied(monkeypatch):
    whole = pruned(*cusp())
    monkeypatch.setattr("fastslow.certification.boxes.pruning.CAPACITY", 3)
    monkeypatch.setattr("fastslow.certification.boxes.pruning.BOXES_BETWEEN_PAUSES", 7)
    again = pruned(*cusp())
    assert np.array_equal(whole.low, again.low)
    assert whole.searched == again.searched


def test_an_interrupt_keeps_what_was_found(monkeypatch):
    calls = []

    def interrupted(*arguments):
        calls.append(arguments)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return run(*arguments)

    from fastslow.certification.boxes import pruning

    run = pruning.load_loop(pruning.PRUNE)
    monkeypatch.setattr(pruning, "BOXES_BETWEEN_PAUSES", 20)
    monkeypatch.setattr(pruning, "load_loop", lambda loop: interrupted)
    found = pruned(*cusp())
    assert found.interrupted
    assert found.searched == 40
    assert not found.complete


def test_badly_scaled_unknowns_give_the_same_pieces():
    # powers of two change no digit
    big, small = 2.0**60, 2.0**-60
    plain = pruned([p + x - x**3], [x, p], [(-3, 3), (-2, 2)])
    scaled = pruned(
        [p * sp.Rational(small) + x * sp.Rational(big) - (x * sp.Rational(big)) ** 3],
        [x, p],
        [(-3 * small, 3 * small), (-2 * big, 2 * big)],
    )
    assert len(plain.free) == pytest.approx(len(scaled.free), abs=3)
    assert scaled.complete
