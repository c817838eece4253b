"""Eigenvalues of pairs, signs of determinants and nearest chords, against NumPy and mpmath."""

import mpmath
import numpy as np
import pytest

from fastslow.continuation.loops import loop
from fastslow.kernels.compiler.records import Matrix, Vector
from fastslow.kernels.loops import Loop, load_loop

GENERATOR = np.random.default_rng(7)


def in_place(values):
    return np.sort_complex(np.asarray(values))


def pairs_of(matrices):
    found = np.empty((len(matrices), 2), dtype=complex)
    loop("eigenvalues_of_2x2")(matrices, found)
    return found


def passed(points, scale, u, within):
    """The chords, as the compiled loop numbers them."""
    found = np.empty(len(points) - 1, dtype=np.int64)
    return found[: loop("nearby_chords")(points, scale, u, within, found, np.empty(len(found)))]


DISTANCE = Loop(
    "fastslow.continuation.evaluation",
    "signed_distance",
    {"matrix": Matrix, "least": Vector, "right": Vector},
    results=(float,),
)


def signed_distance(matrix, least):
    """As the loop that surveys rows computes it."""
    return load_loop(DISTANCE)(matrix, least, np.empty(len(matrix)))


def test_eigenvalues_of_pairs_are_those_of_lapack():
    matrices = GENERATOR.normal(size=(200, 2, 2)) * 10.0 ** GENERATOR.integers(-3, 4, (200, 2, 2))
    found = pairs_of(matrices)
    for one, expected in zip(found, map(np.linalg.eigvals, matrices), strict=True):
        size = np.abs(expected).max()
        np.testing.assert_allclose(in_place(one), in_place(expected), atol=1e-12 * size)
    triangular = pairs_of(np.array([[[3.0, 5.0], [0.0, 3.0]], [[2.0, 0.0], [1.0, -4.0]]]))
    assert in_place(triangular[0]).tolist() == [3, 3]
    assert in_place(triangular[1]).tolist() == [-4, 2]
    assert np.isnan(pairs_of(np.array([[[np.nan, 1.0], [0.0, 1.0]]]))).all()


@pytest.mark.parametrize("entries", [(1e8, 1.0, 1.0, 3e-9), (7, 1e-9, 1e-9, 0)])
def test_small_eigenvalues_beside_large_ones_keep_their_digits(entries):
    """Where the large one stands first, to what the last digits of the entries make of them."""
    a, b, c, d = map(float, entries)
    found = pairs_of(np.array([[[a, b], [c, d]]]))[0].real
    with mpmath.workdps(40):
        half = (mpmath.mpf(a) - d) / 2
        root = mpmath.sqrt(half**2 + mpmath.mpf(b) * c)
        exact = sorted([(mpmath.mpf(a) + d) / 2 - root, (mpmath.mpf(a) + d) / 2 + root], key=abs)
    small, large = sorted(found, key=abs)
    assert large == pytest.approx(float(exact[1]), rel=1e-15)
    terms = min(abs(a), abs(d)) + abs(b * c) / abs(float(exact[1]))
    assert abs(small - float(exact[0])) <= 4e-16 * terms


@pytest.mark.parametrize("size", [1, 2, 3, 6])
def test_the_sign_of_the_determinant_in_any_unit_of_the_rows(size):
    nothing = np.zeros(size)
    for _ in range(20):
        matrix = GENERATOR.normal(size=(size, size))
        found = signed_distance(matrix.copy(), nothing)
        assert np.sign(found) == np.sign(np.linalg.det(matrix))
        units = 10.0 ** GENERATOR.integers(-9, 10, size)
        again = signed_distance(matrix * units[:, None], nothing)
        assert again == pytest.approx(found, rel=1e-9)
        rows = matrix / np.linalg.norm(matrix, axis=1, keepdims=True)
        least = np.linalg.svd(rows, compute_uv=False)[-1]
        assert abs(found) >= least * (1 - 1e-9)


def test_singular_matrices_and_rows_that_are_too_small():
    nothing = np.zeros(2)
    assert signed_distance(np.array([[1.0, 2.0], [2.0, 4.0]]), nothing) == 0
    assert signed_distance(np.array([[1.0, 2.0], [0.0, 0.0]]), nothing) == 0
    assert np.isnan(signed_distance(np.array([[1.0, np.inf], [0.0, 1.0]]), nothing))
    plain = signed_distance(np.diag([1.0, 1e-8]), nothing)
    assert plain > 0.1
    # a row of 1e-8 in units of 1 is nearly none
    assert abs(signed_distance(np.diag([1.0, 1e-8]), np.array([1.0, 1.0]))) < 1e-7


def test_the_chords_of_a_curve_nearest_to_a_point():
    """Both arms of a hairpin pass the point, its turn does not; units count."""
    line = np.array([[0, 0], [1, 0], [2, 0], [3, 0.5], [2, 1], [1, 1], [0, 1]], dtype=float)
    ones = np.ones(2)
    assert passed(line, ones, np.array([0.5, 0.4]), 0.7).tolist() == [0, 5]
    assert passed(line, ones, np.array([0.5, 0.4]), 0.5).tolist() == [0]
    assert passed(line, np.array([1.0, 10.0]), np.array([0.5, 0.4]), 0.05).tolist() == [0]
    assert passed(line, ones, np.array([1.4, 0.0]), 1e-9).tolist() == [1]
    assert passed(line, ones, np.array([9.0, 9.0]), 1.0).tolist() == []


def dips(test, steps, share=0.5):
    found = np.empty(len(steps), dtype=np.int64)
    count = loop("possible_double_zeros")(np.array(test), np.array(steps), share, found)
    return found[:count].tolist()


def test_a_dip_is_where_both_neighbouring_chords_lead_below_the_smaller_value():
    assert dips([5.0, 3.0, 1.0, 1.0, 3.0], [1.0] * 4) == [2]
    assert dips([-5.0, -3.0, -1.0, -1.0, -3.0], [1.0] * 4) == [2]
    # the lines meet at 0.8, above half of the smaller value
    assert dips([1.4, 1.0, 1.0, 1.4], [1.0] * 3) == []
    assert dips([1.4, 1.0, 1.0, 1.4], [1.0] * 3, share=0.9) == [1]
    # the same in other units, in which the product of two values is zero
    assert dips(np.multiply(1e-200, [5.0, 3.0, 1.0, 1.0, 3.0]), [1.0] * 4) == [2]


def test_at_an_end_and_beside_a_change_of_sign_one_chord_alone_tells_a_dip():
    assert dips([1.0, 2.0, 4.0], [1.0, 1.0]) == [0]
    assert dips([4.0, 2.0, 1.0], [1.0, 1.0]) == [1]
    assert dips([-1.0, 1.0, 3.0, 6.0], [1.0] * 3) == [1]
    assert dips([2.0, 1.0], [1.0]) == dips([0.0, 0.0, 0.0], [1.0, 1.0]) == []
    # a step without a length, as between two copies of one row, tells nothing
    assert dips([3.0, 3.0, 1.0, 1.0, 3.0], [0.0, 1.0, 1.0, 0.0]) == [2]
