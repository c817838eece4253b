"""Changes of the number of unstable eigenvalues that no point explains."""

from dataclasses import replace

import numpy as np
import pytest

from fastslow.results.branch.unexplained import (
    unexplained_changes,
    unexplained_rows,
    unstable_range,
)
from fastslow.results.points import SpecialPoints


def test_a_branch_whose_folds_were_lost_says_where_its_stability_changes(cubic):
    """x' = p + x − x³: unstable for |x| < 1/√3; at the two folds themselves it is undecided."""
    whole = cubic(61)
    assert unexplained_changes(whole.table) == ()
    lost = replace(whole, special=SpecialPoints([]), special_rows=())
    one, two = unexplained_changes(lost.table, number=3)
    rows = [int(np.argmin(np.abs(whole.state[:, 0] - at))) for at in (-1, 1) / np.sqrt(3)]
    for change, row, numbers in ((one, rows[0], (0, 1)), (two, rows[1], (1, 0))):
        assert change.branch == 3
        assert change.rows == (row - 1, row + 1)
        assert (change.before, change.after) == numbers
        assert change.parameter == "p"
        assert change.interval == pytest.approx(whole.values[[row - 1, row + 1]])
    assert str(one).startswith("branch 3: unstable eigenvalues change from 0 to 1 between p = 0.38")


def test_one_fold_explains_only_its_own_change(cubic):
    whole = cubic(61)
    kept = (whole.special[1],)
    half = replace(whole, special=SpecialPoints(kept), special_rows=(whole.special_rows[1],))
    (change,) = unexplained_changes(half.table)
    assert (change.before, change.after) == (1, 0)


@pytest.mark.parametrize(
    ("numbers", "steps", "jumps", "expected"),
    [
        ([0, 0, 2, 2], {}, (), [(1, 2)]),
        ([0, 0, 2, 2], {2: [2]}, (), []),
        ([0, 0, 2, 2], {2: [None]}, (), []),
        ([0, 0, 2, 2], {}, (2,), []),
        ([0, 0, 2, 2], {}, (1,), [(1, 2)]),
        ([0, 1, 3, 3], {1: [1], 2: [2]}, (), []),
        ([0, 9, 2, 2], {1: [1, 1]}, (), []),
        ([0, 9, 3, 3], {1: [1, 1]}, (), [(0, 2)]),
        ([2, 9, 2, 1], {1: [2]}, (), [(2, 3)]),
        ([0, 1, 0, 1], {}, (), [(0, 1), (1, 2), (2, 3)]),
    ],
)
def test_steps_and_jumps_explain_what_they_may(numbers, steps, jumps, expected):
    rows = np.array(numbers)
    assert unexplained_rows(rows, rows, steps, jumps) == expected


def test_the_range_of_the_number():
    values = [[1, -1], [1e-12, -1], [1e-8, -1], [np.nan, 1], [np.inf, -np.inf], [-np.inf, 0]]
    least, largest = unstable_range(np.array(values))
    assert least.tolist() == [1, 0, 1, 1, 1, 0]
    assert largest.tolist() == [1, 1, 1, 2, 1, 1]
