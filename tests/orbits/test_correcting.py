"""The compiled equations of orbits, and the points of a branch that are solved for with them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.continuation import curves
from fastslow.orbits.find.correcting import ShootingCorrector
from fastslow.orbits.find.orbit_curve import CurveSystem
from fastslow.orbits.flow.equations import NODE
from fastslow.orbits.flow.flows import flow
from fastslow.orbits.flow.multipliers import multipliers_of_products
from fastslow.orbits.flow.problem import growth_of
from fastslow.orbits.flow.segments import divided
from fastslow.orbits.points.detection import kinds_between
from fastslow.orbits.points.multiplier_signs import MultiplierSigns, changes, multipliers_at
from fastslow.results.orbits.orbit_arrays import OrbitArrays
from tests.orbits.shooting_cases import GEAR_PAIR, orbit_of, t, v, w, x


@pytest.fixture(scope="module")
def gear():
    """An orbit of the gear pair with two crossings of an interface."""
    shooting, u, scale = orbit_of(GEAR_PAIR.with_parameters(w=0.95), "w", [1.5, 0], 60)
    assert len(shooting.form) == 3
    return shooting, u, scale


@pytest.fixture(scope="module")
def relay():
    """An orbit of a forced oscillator across x = 0, where both rates jump."""
    rates = {x: v - sp.sign(x) / 4, v: 2 * sp.sin(w * t) - x - v / 5 - sp.sign(x) / 2}
    model = fs.Model(rates, parameters={w: 0.7})
    shooting, u, scale = orbit_of(model, "w", [1.0, 0.0], 60, 2 * np.pi / 0.7)
    assert not shooting.variations.continuous.any()
    return shooting, u, scale


def with_nodes(shooting, u, scale):
    """The same orbit with divided segments, and other ratios of their durations."""
    form, period = shooting.unpack(u)
    growth = np.full(len(form), 9.0)

    def states_at(modes, states, times, offsets, _):
        parameters = shooting.parameters_at(u)
        return flow(shooting.variations, modes, states, times, offsets, parameters).ends

    form = divided(form, growth, states_at, 3.0)
    K, n = len(form), shooting.variations.n
    units = np.concatenate([np.tile(scale[:n], K), np.full(K + 1, period), scale[-1:]])
    at_nodes = np.append(replace(shooting, form=form).pack(form, period)[:-1], u[-1])
    ratios = form.durations * np.linspace(1.0, 2.0, K)
    return replace(shooting, form=replace(form, durations=ratios)), at_nodes, units


@pytest.mark.parametrize("nodes", [False, True])
def test_jacobian_is_the_derivative_of_the_residual(gear, nodes):
    shooting, u, scale = with_nodes(*gear) if nodes else gear
    assert (shooting.form.ends == NODE).any() == nodes
    last = shooting.linearised(u)
    for column, unit in enumerate(scale):
        step = 1e-6 * unit * np.eye(len(u))[column]
        ahead, behind = (shooting.linearised(u + s * step).residual for s in (1, -1))
        slope = (ahead - behind) / (2e-6 * unit)
        size = np.abs(last.jacobian[:, column]).max()
        np.testing.assert_allclose(last.jacobian[:, column], slope, atol=1e-8 * (1 + size))


@pytest.mark.parametrize("model", ["gear", "relay"])
def test_corrected_point(model, request):
    """As Newton's method on the same equations in NumPy finds it."""
    shooting, u, scale = request.getfixturevalue(model)
    frame = curves.Frame(len(u), scale, np.full(len(u), -np.inf), np.full(len(u), np.inf))
    settings = fs.Continuation()
    system = CurveSystem(shooting)
    along = curves.tangent(system, u, frame)
    guess = u + 1e-2 * along
    plain = curves.corrected(system, guess, along, frame, settings)
    point = ShootingCorrector(shooting, scale, settings.tolerance, settings.max_iterations)(
        guess, along
    )
    assert point.used == plain[1]
    np.testing.assert_allclose(point.u, plain[0], rtol=0, atol=1e-13)
    tangent = curves.tangent(system, point.u, frame)
    sign = np.sign(tangent @ (point.tangent / scale**2))
    np.testing.assert_allclose(point.tangent / scale, sign * tangent / scale, atol=1e-12)
    last = shooting.linearised(point.u)
    form, _ = shooting.unpack(point.u)
    units = scale[: shooting.variations.n]
    assert point.growth == pytest.approx(growth_of(last, form, units).max(), rel=1e-10)
    assert point.residual < 1e-13
    assert point.accuracy < 1e-10
    tables = (
        np.array([one]) for one in (point.product, point.scale, point.liouville, point.defect)
    )
    (found,) = multipliers_of_products(*tables)
    known = multipliers_at(shooting, point.u, last)
    np.testing.assert_allclose(found.values, known.values, rtol=1e-11)
    np.testing.assert_allclose(found.logs, known.logs, atol=1e-11)
    assert found.defect < 1e-12


def test_corrector_fails_far_from_a_branch(gear):
    shooting, u, scale = gear
    solve = ShootingCorrector(shooting, scale, 1e-10, 8)
    along = np.eye(len(u))[-1] * scale
    assert solve(u + 0.5 * scale, along) is None
    # and again solves for the next point
    assert np.abs((solve(u, along).u - u) / scale).max() < 1e-12


def test_products_with_a_wide_range_of_multipliers_need_their_factors():
    products = np.array([np.diag([1.0, 1e-6]), np.diag([2.0, 0.5])])
    found = multipliers_of_products(products, np.zeros(2), np.zeros(2), np.zeros(2))
    assert found[0] is None
    assert found[1].values.tolist() == [2.0, 0.5]


def test_changes_are_those_of_the_codes(gear):
    """A fold, a period doubling, a torus bifurcation, and nothing."""
    values = np.array([[0.9, 0.5], [1.1, 0.5], [0.9, 0.5], [0.9, -0.5], [0.9, -1.5], [0.5, 0.4]])
    values = np.vstack([values, [[0.3 + 0.9j, 0.3 - 0.9j], [0.3 + 1.1j, 0.3 - 1.1j]]])
    slopes = [1.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0]
    template = OrbitArrays(*[None] * len(OrbitArrays._fields))
    rows = [
        (template._replace(multipliers=v, log_multipliers=np.log(np.abs(v))), slope)
        for v, slope in zip(values, slopes, strict=True)
    ]
    single = [MultiplierSigns.of(*row) for row in rows]
    codes = [bool(kinds_between(*pair)) for pair in pairwise(single)]
    found = changes(MultiplierSigns.of_rows(rows)).tolist()
    assert found == codes
    assert codes == [True, True, False, True, True, False, True]


def test_corrections_that_rounding_limits():
    """x is 10⁶ times its oscillation, and the multiplier 0.994: corrections remain near 1e-8."""
    a, k = sp.symbols("a k")
    model = fs.Model({x: a * sp.sin(t) - (x - k) / 1000}, parameters={a: 1, k: 10**6})
    branch = fs.continue_orbits(fs.find_orbit(model, [10**6]), "a", over=(0.5, 2))
    assert branch.range == (0.5, 2)
    amplitude = 0.5 * (branch["max(x)"] - branch["min(x)"]) * np.sqrt(1 + 1e-6)
    np.testing.assert_allclose(amplitude, branch.values, rtol=2e-9)
    limited = (branch.errors[:, 2] > 1e-10).sum()
    assert limited > 10
    assert f"Rounding limits Newton's corrections of {limited} orbits" in branch.outcome.message
    assert len(branch) < 70


def test_orbits_that_rounding_leaves_unsolved():
    a, k = sp.symbols("a k")
    model = fs.Model({x: a * sp.sin(t) - (x - k) / 1000}, parameters={a: 1, k: 10**7})
    branch = fs.continue_orbits(fs.find_orbit(model, [10**7]), "a", over=(0.5, 2))
    assert branch.outcome.code == "limited by rounding"
    assert "more than the 1e-07" in branch.outcome.message


def test_liouville_s_formula_across_a_reset():
    """The determinant of all matrices is that of the flow, times r² at an impact."""
    a, restitution = sp.symbols("a r")
    rates = {x: v, v: a * sp.cos(t) - x / 4 - v / 10}
    model = fs.Model(
        rates, parameters={a: 1, restitution: 0.7}, resets={x <= 0: {v: -restitution * v}}
    )
    shooting, u, scale = orbit_of(model, "a", [1.0, 0.0], 60, 2 * np.pi)
    along = np.eye(len(u))[-1] * scale
    point = ShootingCorrector(shooting, scale, 1e-10, 8)(u, along)
    impacts = (shooting.form.ends >= 0).sum()
    assert impacts
    expected = -0.1 * 2 * np.pi + 2 * impacts * np.log(0.7)
    assert point.liouville == pytest.approx(expected, abs=1e-11)
    _, log = np.linalg.slogdet(point.product)
    assert log + len(point.product) * point.scale == pytest.approx(expected, abs=1e-9)
