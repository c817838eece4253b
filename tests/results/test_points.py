"""Points: their numbers by name, stability, type, and the Clarke path."""

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.branch.equilibrium_sets import Equilibria
from fastslow.results.points import ClarkePath, stability_of, type_of


def equilibrium(eigenvalues, **other):
    return fs.Equilibrium(
        ("x", "v"),
        np.array([0.3, 0.0]),
        {"w": 1.0},
        "S1",
        other.pop("admissible", True),
        np.asarray(eigenvalues, dtype=complex),
        **other,
    )


@pytest.mark.parametrize(
    ("eigenvalues", "stability", "kind"),
    [
        ([-1, -2], "stable", "node"),
        ([1, 2], "unstable", "node"),
        ([-1 + 2j, -1 - 2j], "stable", "focus"),
        ([1 + 2j, 1 - 2j], "unstable", "focus"),
        ([1, -1], "unstable", "saddle"),
        ([0, -1], "neutral", "non-hyperbolic"),
        ([2j, -2j], "neutral", "non-hyperbolic"),
        ([1e-13, -1e3], "neutral", "non-hyperbolic"),
        ([1e-8, -1], "unstable", "saddle"),
        ([-1e-8, -1], "stable", "node"),
        ([1e-8 + 1j, 1e-8 - 1j], "unstable", "focus"),
        ([1, -1 + 1j, -1 - 1j], "unstable", "saddle-focus"),
        ([-1, -2 + 1j, -2 - 1j], "stable", "node"),
        ([-3, -2 + 1j, -2 - 1j], "stable", "focus"),
    ],
)
def test_stability_and_type(eigenvalues, stability, kind):
    assert str(stability_of(np.asarray(eigenvalues))) == stability
    assert type_of(eigenvalues) == kind


def test_an_equilibrium_says_what_it_is():
    point = equilibrium([-1 + 2j, -1 - 2j])
    assert (point["x"], point["w"]) == (0.3, 1.0)
    assert point.stable
    assert repr(point) == "Equilibrium(x = 0.3, v = 0; in S1; stable focus)"
    assert "virtual, of S1" in repr(equilibrium([1, -1], admissible=False))
    assert "one of a continuum" in repr(equilibrium([0, -1], continuum=True))


def test_unknown_name_of_a_point():
    with pytest.raises(fs.UnknownNameError, match=r"unknown state or parameter 'xx'.*'x'"):
        equilibrium([-1, -2])["xx"]


def test_a_list_says_how_sure_it_is():
    assert Equilibria([], "complete").completeness == "complete"
    assert Equilibria().completeness == "found"


def test_clarke_path_of_the_corner_of_the_gear():
    # outside det = A + D², trace −1; inside det = 0: eigenvalues turn complex at q = 1/(4(A + D²))
    stiffness = 41.67 + 0.25**2
    outside, inside = np.array([[0, 1], [-stiffness, -1]]), np.array([[0, 1], [0, -1.0]])
    path = ClarkePath(("S1", "S2"), np.array([outside, inside]))
    assert path.determinants == pytest.approx((stiffness, 0.0))
    assert path.q_zero is None
    assert path.q_hopf is None
    turn = 1 / (4 * stiffness)
    before, after = path.path([0.99 * turn, 1.01 * turn])
    assert np.all(before.imag == 0)
    assert np.all(after.imag != 0)


def test_clarke_path_crosses_zero_at_a_non_smooth_fold():
    path = ClarkePath(("S1", "S2"), np.array([np.diag([1.0, 1]), np.diag([-3.0, 1])]))
    assert path.q_zero == pytest.approx(0.75)
    assert np.abs(path.path(0.75)).min() < 1e-15


def test_clarke_path_with_a_hopf_point():
    path = ClarkePath(
        ("S1", "S2"), np.array([[[1.0, 2], [-2, 1]], [[-3, 2], [-2, -3]]], dtype=float)
    )
    assert path.q_hopf == pytest.approx(0.75)
    assert np.abs(path.path(0.75).real).max() < 1e-14
