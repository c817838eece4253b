"""Parts of a certificate: equations along interfaces, ends of arcs, common windows, bounds."""

from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.certification.boxes.linking import Arcs
from fastslow.certification.boxes.missing import _common_window
from fastslow.certification.certifying import _inside
from fastslow.certification.equations import exact_equations
from fastslow.certification.spectra.spectra import Balls, _Discs

x, y, w = sp.symbols("x y w")


def test_the_other_interfaces_of_a_sliding_motion_are_those_of_its_signs():
    rates = {x: w - x - sp.sign(x) - sp.Abs(x - 2), y: sp.Max(y - 3, 0) - y}
    model = fs.Model(rates, parameters={w: 0})
    functions = {name: one.function for name, one in model.interfaces.items()}
    sliding = [e for e in exact_equations(model, "w") if e.slides]
    assert sliding
    for one in sliding:
        assert len(one.interfaces) == 2
        assert [functions[name] for name in one.interfaces] == list(one.heights)


def arcs(position):
    """Arcs of unit length along the first of two unknowns, one behind the other."""
    m = len(position)
    left = np.arange(m, dtype=float)
    low = np.column_stack([left, np.zeros(m)])
    ones = np.ones(m, dtype=int)
    edges = np.column_stack([left, left])
    ends = ("boxes left", "not continued")
    return Arcs(
        low, low + 1, 0 * ones, ones, edges, edges + 1, ones, np.array(position), ones, ends=ends
    )


def test_a_curve_divided_at_edges_keeps_its_own_ends_alone():
    problem = SimpleNamespace(low=np.array([-1.0, -1.0]), high=np.array([9.0, 2.0]))
    parts = _inside(problem, arcs([1, 1, 0, 0, 1]))
    assert [(len(part.low), part.ends, inside) for part, inside in parts] == [
        (2, ("boxes left", "edge"), True),
        (2, ("edge", "edge"), False),
        (1, ("edge", "not continued"), True),
    ]


@pytest.mark.parametrize("window", [None, {"x": (-1, 4)}])
def test_the_window_of_added_branches_contains_those_of_diagram_and_certificate(window):
    model = fs.Model(
        {x: sp.sin(x) - w, y: sp.cos(x) - y, "z": w - sp.Symbol("z")},
        parameters={w: 0.1},
        periodic={x: 2 * sp.pi},
    )
    diagram = fs.continue_equilibria(model, "w", (-0.5, 0.5), window=window)
    found = _common_window(diagram, {"x": (-2, 1), "y": (-5e4, 1), "z": (-40, 6e4)})
    low, high = diagram.window.lower, diagram.window.upper
    assert found["y"] == (-5e4, max(1, high[1]))
    assert found["z"] == (min(-40, low[2]), 6e4)
    assert found.get("x") == (None if window is None else (-2, 4))


def test_signs_of_crossings_are_those_of_perturbed_matrices():
    # a third of the bounds are so wide that the sign may be either
    rng = np.random.default_rng(11)
    m, n = 40_000, 2

    def random(size):
        return size * (rng.normal(size=(m, n, n)) + 1j * rng.normal(size=(m, n, n)))

    matrix, slope = random(0.4), random(0.4)
    matrix[:, 0, 0] = 0
    matrix[:, 1, 1] = -1 - rng.uniform(0, 1, m)
    slope[:, 0, 0] = 0.6 * rng.normal(size=m) + 1j * rng.normal(size=m)
    zero = np.zeros((m, n, n))
    balls = Balls(matrix, zero), Balls(slope, zero)
    found = _Discs.of(balls[0]).crossing(*balls, np.zeros((m, 1), dtype=int))
    values, right = np.linalg.eig(matrix)
    k = np.argmin(np.abs(values), axis=1)
    left = np.linalg.inv(right)
    each = np.arange(m)
    rate = np.einsum("mi,mij,mj->m", left[each, k], slope, right[each, :, k]).real
    decided = found != 0
    assert decided.mean() > 0.1
    assert (np.sign(rate[decided]) == found[decided]).all()


def test_a_sign_is_given_beyond_the_bound_of_its_derivation_alone():
    """With y, z of modulus 1/3 and c' = (c + d)/(1 + z y), |d| ≤ 2/3: from c = 6/7 on."""
    matrix = np.array([[[0.0, 2.0], [2.0, -10.0]]] * 2)
    slope = np.array([[[0.85, 1.0], [1.0, 0.0]], [[0.865, 1.0], [1.0, 0.0]]])
    zero = np.zeros_like(matrix)
    balls = Balls(matrix, zero), Balls(slope, zero)
    found = _Discs.of(balls[0]).crossing(*balls, np.zeros((2, 1), dtype=int))
    assert found.tolist() == [0, 1]
