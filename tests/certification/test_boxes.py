"""Tests of boxes as Python, against exact linear equations and known numbers of boxes."""

import numpy as np
import pytest
import sympy as sp

from fastslow.certification.boxes import following_kernel, krawczyk, pruning_kernel
from fastslow.certification.boxes.krawczyk import NO_ZERO, OPEN, PROVED, Rules
from fastslow.certification.boxes.linking import Arcs, CurveBoxes, IntervalProblem, halved
from fastslow.certification.boxes.pruning import prune_window, workspace
from fastslow.kernels.intervals.printer import interval_program
from fastslow.kernels.intervals.program import evaluate

x, y, p = sp.symbols("x y p", real=True)
LINEAR = [2 * x - y + 4 * p - 1, x + 3 * y - p]


def searched(rows, unknowns, low, high):
    """A program, and a workspace with a box over which everything is evaluated."""
    written = interval_program(rows, unknowns)
    space = workspace(written)
    space.box.low[:], space.box.high[:] = low, high
    program = written.program
    evaluate(program, space.box.low, space.box.high, space.registers)
    krawczyk.slopes(program, space.registers, space.box)
    krawczyk.centre(program, space.registers, space.box)
    return program, space


def test_sums_over_a_box_are_those_of_linear_equations():
    _, space = searched(LINEAR, (x, y, p), [-1, 0, 1], [3, 2, 2])
    box = space.box
    assert box.middle.tolist() == [1, 1, 1.5]
    assert box.slope_low.tolist() == box.slope_high.tolist() == [[2, -1, 4], [1, 3, -1]]
    # 2 x − y + 4 p − 1 from −1 to 13, without x at its middle, and the second without p
    for found, expected in [
        (krawczyk.row_sum(box, 0, -1), (-1, 13)),
        (krawczyk.row_sum(box, 0, 0), (3, 9)),
        (krawczyk.row_sum(box, 1, 2), (-2.5, 7.5)),
    ]:
        assert found == pytest.approx(expected, rel=1e-14)
        assert found[0] <= expected[0]
        assert found[1] >= expected[1]


def test_contraction_by_equations_solved_for_each_unknown():
    _, space = searched([x - 2 * p], (x, p), [-10, 0], [10, 2])
    assert krawczyk.contract_by_rows(space.box, -1) == pytest.approx(0.2, rel=1e-13)
    assert space.box.low == pytest.approx([0, 0], abs=1e-13)
    assert space.box.high == pytest.approx([4, 2], rel=1e-13)
    _, space = searched([x - 2 * p], (x, p), [1, 0], [3, 9])
    assert krawczyk.contract_by_rows(space.box, 1) == 1.0
    assert krawczyk.contract_by_rows(space.box, -1) == pytest.approx(1 / 9)
    _, space = searched([x - 2 * p], (x, p), [5, 0], [10, 2])
    assert krawczyk.contract_by_rows(space.box, -1) == -1.0


def test_intersections_of_sides():
    _, space = searched([x], (x, p), [0, 1], [4, 1])
    assert krawczyk.narrow(space.box, 0, (1.0, 9.0)) == 0.75
    assert krawczyk.narrow(space.box, 0, (-1.0, 2.5)) == 0.5
    assert krawczyk.narrow(space.box, 0, (3.0, 5.0)) == -1.0
    assert krawczyk.narrow(space.box, 1, (0.0, 5.0)) == 1.0
    assert (space.box.low[0], space.box.high[0]) == (1.0, 2.5)


@pytest.mark.parametrize("fixed", [-1, 0, 1, 2])
def test_the_preconditioner_inverts_the_derivatives_by_the_pivots(fixed):
    """In units 1, 1/4 and 2 the entries of p, 8 of 8, and of x are the largest."""
    _, space = searched(LINEAR, (x, y, p), [-1, 0, 1], [3, 2, 2])
    unit = np.array([1.0, 0.25, 2.0])
    free = krawczyk.precondition(space.box, unit, fixed, space.operator)
    assert free == (1 if fixed < 0 else fixed)
    others = [j for j in range(3) if j != free]
    assert space.operator.columns.tolist() == others
    matrix = space.box.slope_low[:, others]
    np.testing.assert_allclose(space.operator.inverse @ matrix, np.eye(2), atol=1e-15)


def test_the_image_of_a_box_is_the_solution_of_linear_equations():
    _, space = searched(LINEAR, (x, y, p), [-1, -1, 0], [3, 2, 1])
    assert krawczyk.precondition(space.box, np.ones(3), 2, space.operator) == 2
    assert krawczyk.image(space.box, 2, space.operator) < 1e-13
    ends = [np.linalg.solve([[2, -1], [1, 3]], [1 - 4 * q, q]) for q in (0.0, 1.0)]
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    assert space.operator.low == pytest.approx(low, abs=1e-13)
    assert space.operator.high == pytest.approx(high, abs=1e-13)
    assert (space.operator.low <= low).all()
    assert (space.operator.high >= high).all()
    # x from −8/7 to 3/7, of which the box contains the part above −1
    assert not krawczyk.maps_inside(space.box, space.operator)
    share = krawczyk.contract_by_image(space.box, space.operator)
    assert share == pytest.approx((high[0] + 1) / 4 * (high[1] - low[1]) / 3, rel=1e-12)
    assert krawczyk.maps_inside(space.box, space.operator) is False
    space.box.low[:2], space.box.high[:2] = low - 1, high + 1
    assert krawczyk.maps_inside(space.box, space.operator)


def test_the_norm_of_the_operator_is_in_units_of_the_box():
    """Of (x² + y, y − p): with Y the inverse at the middle, 1 − Y F' is x − m at most."""
    _, space = searched([x**2 / 2 + y, y - p], (x, y, p), [0.5, -1, 0], [1.5, 7, 1])
    assert krawczyk.precondition(space.box, np.array([1, 1, 1e-3]), -1, space.operator) == 2
    norm = krawczyk.image(space.box, 2, space.operator)
    assert norm == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize(
    ("low", "high", "found"), [(0.0, 0.0, PROVED), (0.5, 0.6, NO_ZERO), (-1e-9, 1e-9, PROVED)]
)
def test_curves_that_fill_a_box_are_proved_on_a_larger_one(low, high, found):
    """x³ + x = 0 for p from 0 to 1: exactly zero."""
    program, space = searched([x**3 + x], (x, p), [low, 0], [high, 1])
    free = krawczyk.precondition(space.box, np.ones(2), -1, space.operator)
    assert free == 1
    krawczyk.image(space.box, free, space.operator)
    rules = Rules(np.ones(2), -1, 1e-6)
    assert krawczyk.prove_on_larger_box(program, rules, space, free) == found


def test_a_fold_is_not_proved_with_its_parameter_free():
    program, space = searched([x**2 - p], (x, p), [-0.1, -0.1], [0.3, 0.1])
    assert krawczyk.precondition(space.box, np.ones(2), 0, space.operator) == 0
    assert krawczyk.precondition(space.box, np.array([10.0, 0.1]), 1, space.operator) == 1
    assert not krawczyk.image(space.box, 1, space.operator) < 1
    rules = Rules(np.ones(2), -1, 1e-6)
    assert krawczyk.prove_on_larger_box(program, rules, space, 1) == OPEN


def test_boxes_are_divided_at_their_widest_unknown_in_units():
    tables = {name: np.zeros((4, 2)) for name in ("stack_low", "stack_high", "left_low")}
    search = pruning_kernel.BoxSearch(
        **tables,
        left_high=np.zeros((4, 2)),
        piece_low=None,
        piece_high=None,
        free=None,
        counts=np.zeros(4, dtype=np.int64),
    )
    _, space = searched([x], (x, p), [0, 0], [2, 8])
    pruning_kernel._bisect(Rules(np.array([1.0, 8.0]), -1, 0.5), search, space.box)
    assert search.counts.tolist() == [2, 0, 0, 0]
    assert search.stack_high[0] == pytest.approx([1 + 2e-9, 8], rel=1e-15)
    assert search.stack_low[1] == pytest.approx([1 - 2e-9, 0], rel=1e-15)
    space.box.low[:], space.box.high[:] = [0, 0], [2, 8]
    pruning_kernel._bisect(Rules(np.array([1.0, 8.0]), 0, 0.5), search, space.box)
    assert search.stack_high[2] == pytest.approx([2, 4], rel=1e-8)
    space.box.low[:], space.box.high[:] = [0, 0], [0.4, 3.9]
    pruning_kernel._bisect(Rules(np.array([1.0, 8.0]), -1, 0.5), search, space.box)
    assert search.counts.tolist() == [4, 0, 1, 0]
    assert search.left_high[0].tolist() == [0.4, 3.9]


@pytest.mark.parametrize(
    ("rows", "unknowns", "most", "pieces"),
    [
        ([p - x**3 + x], (x, p), 39, 12),
        ([p - x + x * y, y + y**3 - x], (x, y, p), 36, 10),
        ([sp.sin(3 * x) - p], (x, p), 1, 1),
    ],
)
def test_a_search_takes_no_more_boxes_than_it_needs(rows, unknowns, most, pieces):
    n = len(unknowns)
    found = prune_window(
        interval_program(rows, unknowns),
        -2 * np.ones(n),
        2 * np.ones(n),
        max_boxes=9999,
        width=1e-6,
    )
    assert found.complete
    assert found.searched <= most, found.searched
    assert len(found.free) <= pieces, len(found.free)


def test_wide_boxes_around_a_curve_are_replaced_by_narrow_ones():
    """x³ + x = p from p = 0 to 0.01 in |x| < 1, where I − Y F' is too large to contract."""
    program, space = searched([x**3 + 0.3 * x - p], (x, p), [-1, 0], [1, 0.01])
    found, norm = following_kernel._contracted(program, np.ones(2), 1, space)
    assert found == 1
    space.box.low[:], space.box.high[:] = [-1, 0], [1, 0.01]
    if norm > following_kernel.WIDEST_NORM:
        assert following_kernel._located(program, np.ones(2), 1, space)
        exact = np.sort(np.roots([1, 0, 0.3, -0.01]).real)[-1]
        assert space.box.low[0] <= 0
        assert exact <= space.box.high[0] < 0.06


def test_positions_and_signs_of_boxes():
    problem = IntervalProblem(None, None, (), np.array([0.0, 1.0]), np.array([2.0, 1.0]))
    assert problem.unit.tolist() == [2.0, 1.0]
    boxes = CurveBoxes(
        *(np.zeros((3, 2)),) * 2,
        np.array([[-1, 1], [2, -3], [0, -4]]),
        np.array([[1, 2], [3, -1], [0, 0]]),
    )
    assert boxes.signs(0).tolist() == [0, 1, 0]
    assert boxes.signs(1).tolist() == [1, -1, 0]
    assert boxes.signs(1, np.array([1, 2])).tolist() == [-1, 0]


def test_arcs_are_halved_at_the_middle_of_their_free_unknown():
    low, high = np.array([[0.0, 4], [1, 4], [7, 7]]), np.array([[1.0, 8], [3, 5], [8, 9]])
    ones = np.ones(3, dtype=int)
    arcs = Arcs(
        low, high, np.array([1, 0, 0]), np.array([-1, 1, 1]), np.array([[8.0, 8], [1, 1], [7, 7]]),
        np.array([[4.0, 4], [3, 3], [8, 8]]), ones, ones, ones,
    )  # fmt: skip
    parts, halves = halved(arcs, np.array([True, True, False]))
    assert halves.tolist() == [True, True, True, True, False]
    assert parts.first[:, 0].tolist() == [8, 6, 1, 2, 7]
    assert parts.last[:, 1].tolist() == [6, 4, 2, 3, 8]
    assert parts.low.tolist() == [[0, 6], [0, 4], [1, 4], [2, 4], [7, 7]]
    assert parts.high.tolist() == [[1, 8], [1, 6], [2, 5], [3, 5], [8, 9]]
