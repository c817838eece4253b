"""Sets of equilibria of Filippov fields: sticking bands of dry friction."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import linprog

import fastslow as fs

pytestmark = pytest.mark.slow

x, v, w, y, u, a, V, t = sp.symbols("x v w y u a V t")


def block():
    return fs.Model({x: v, v: -x - v / 10 - sp.sign(v) / 2 + w}, forcing={w: 2 * sp.sin(t / 100)})


def two_blocks():
    rates = {
        x: v,
        v: -x - (x - y) / 2 - a * sp.sign(v) + w,
        y: u,
        u: -2 * y + (x - y) / 2 - a * sp.sign(u),
    }
    return fs.Model(rates, parameters={a: 0.3, w: 0.1})


def ends(points):
    return sorted(e.state[0] for e in points)


def test_the_sticking_band_of_a_block_is_listed_once():
    found = fs.equilibria(block().frozen(), w=0.3)
    assert found.completeness == "complete"
    (band,) = found.sets
    assert band["x"] == pytest.approx((-0.2, 0.8), abs=1e-14)
    assert band["v"] == (0.0, 0.0)
    assert (band.region, band.interfaces, band.dimension) == ("S1|S2", ("v",), 1)
    assert band.attracting
    assert band.stable
    # its ends in the list, and none of the foci of the regions that meet there
    assert ends(found) == pytest.approx([-0.2, 0.8], abs=1e-14)
    assert all(e.continuum and e.pseudo and e.region == "S1|S2" for e in found)


def test_the_band_of_a_block_is_in_its_diagram_with_its_edges():
    diagram = fs.continue_equilibria(block().frozen(), "w", over=(-1, 1))
    assert diagram.completeness == "complete"
    assert len(diagram) == 0
    (band,) = diagram.bands
    assert band.range == (-1.0, 1.0)
    assert np.abs(band.corners[:, :, 0] - band.values[:, None] - [-0.5, 0.5]).max() < 1e-14
    assert ends(diagram.at(w=0.123)) == pytest.approx([-0.377, 0.623], abs=1e-14)
    assert band.at(w=2.0) is None
    assert band.at(w=[2.0, 2.5]) == [None, None]
    assert "S1|S2 (sticking) on v = 0" in repr(diagram)
    part = diagram.select(between=(0.25, 0.5))
    assert part.bands[0].range == (0.25, 0.5)
    assert diagram.select(region="S1").bands == ()
    with pytest.raises(fs.UnknownNameError, match="unknown band parameter 'x'"):
        band.at(x=1.0)


def test_bands_are_kept_in_files(tmp_path):
    diagram = fs.continue_equilibria(block().frozen(), "w", over=(-1, 1))
    diagram.save(tmp_path / "block.npz")
    again = fs.load(tmp_path / "block.npz")
    (band,) = again.bands
    assert (band.corners == diagram.bands[0].corners).all()
    assert repr(again) == repr(diagram)
    assert ends(again.at(w=0.123)) == pytest.approx([-0.377, 0.623], abs=1e-14)


@pytest.mark.sample(1)
@pytest.mark.parametrize("force", [0.0, -0.17, 0.11])
def test_a_softening_spring_has_up_to_three_bands(force):
    # |w - x + x³| ≤ 1/5: cubic ends, from the roots of x - x³ = w ± 1/5
    model = fs.Model({x: v, v: -x + x**3 - v / 10 - sp.sign(v) / 5 + w}, parameters={w: 0})
    found = fs.equilibria(model, w=force)
    roots = [np.roots([1, 0, -1, force + k / 5]) for k in (-1, 1)]
    wanted = sorted(r.real for line in roots for r in line if abs(r.imag) < 1e-9)
    assert len(found.sets) == 3
    assert ends(found) == pytest.approx(wanted, abs=1e-12)
    assert found.completeness == "complete"
    # the middle one is a set of equilibria all the same: friction holds the block anywhere
    diagram = fs.continue_equilibria(model, "w", over=(-0.8, 0.8))
    edge = 2 / math.sqrt(27) + 0.2
    assert max(b.range[1] for b in diagram.bands if b.range[0] > -0.5 and b.range[1] < 0.7) == (
        pytest.approx(edge, abs=1e-9)
    )
    assert ends(diagram.at(w=force)) == pytest.approx(wanted, abs=1e-9)


def test_a_softening_pendulum_says_that_its_bands_were_searched_for():
    model = fs.Model({x: v, v: -sp.sin(x) - sp.sign(v) / 5}, parameters={})
    found = fs.equilibria(model)
    assert found.completeness == "found"
    half = math.asin(0.2)
    near = [one for one in found.sets if abs(one["x"][0]) < 1]
    assert near[0]["x"] == pytest.approx((-half, half), abs=1e-12)
    assert not near[0].exact
    assert "found by search" in repr(near[0])


def test_blocks_that_stick_together_have_a_polygon_with_exact_ranges():
    (found,) = fs.equilibria(two_blocks()).sets
    assert found.dimension == 2
    assert found.interfaces == ("v", "u")
    # |w - 3x/2 + y/2| ≤ a and |x/2 - 5y/2| ≤ a
    matrix = np.array([[-1.5, 0.5], [0.5, -2.5]])
    rows, right = np.vstack([matrix, -matrix]), [0.3 - 0.1, 0.3, 0.3 + 0.1, 0.3]
    for k, name in enumerate(("x", "y")):
        for sign, end in ((1, 0), (-1, 1)):
            cost = sign * np.eye(2)[k]
            best = linprog(cost, A_ub=rows, b_ub=right, bounds=[(None, None)] * 2)
            assert found[name][end] == pytest.approx(sign * best.fun, abs=1e-12)
    corners = [np.linalg.solve(matrix, [s * 0.3 - 0.1, r * 0.3]) for s in (1, -1) for r in (1, -1)]
    key = {tuple(np.round(c, 9) + 0.0) for c in corners}
    assert {tuple(np.round(c[[0, 2]], 9) + 0.0) for c in found.corners} == key


def test_runs_of_two_blocks_end_in_the_polygon():
    (found,) = fs.equilibria(two_blocks()).sets
    many = fs.simulate_many(
        two_blocks(), np.random.default_rng(4).normal(size=(20, 4)) * 2, t=(0, 80)
    )
    assert many.success.all()
    assert (np.array(many.modes)[many.last_mode] == "S1|S4").all()
    assert (many.final >= found.lower - 1e-12).all()
    assert (many.final <= found.upper + 1e-12).all()


def test_a_belt_that_moves_has_a_pseudo_equilibrium_and_one_at_rest_a_band():
    stribeck = sp.Rational(1, 2) + 1 / (1 + 3 * sp.Abs(v - V))
    model = fs.Model({x: v, v: -x - sp.sign(v - V) * stribeck}, parameters={V: 0.2})
    moving = fs.equilibria(model)
    assert moving.sets == ()
    assert [e.region for e in moving] == ["S2"]
    assert moving[0].state == pytest.approx([0.5 + 1 / 1.6, 0.0], abs=1e-12)
    still = fs.equilibria(model, V=0)
    (band,) = still.sets
    assert band["x"] == pytest.approx((-1.5, 1.5), abs=1e-12)
    assert ends(still) == pytest.approx([-1.5, 1.5], abs=1e-12)
    assert all(e.continuum for e in still)
    # as the belt slows down the equilibrium goes to the band's end
    slow = fs.equilibria(model, V=1e-6)
    assert slow[0].state[0] == pytest.approx(1.5, abs=1e-5)


def test_a_block_without_a_spring_rests_anywhere():
    model = fs.Model({x: v, v: w - sp.sign(v) / 2}, parameters={w: 0.2})
    (band,) = fs.equilibria(model).sets
    assert band["x"] == (-np.inf, np.inf)
    diagram = fs.continue_equilibria(model, "w", over=(-1, 1))
    assert diagram.bands[0].range == pytest.approx((-0.5, 0.5), abs=1e-12)


def test_fields_that_point_away_make_a_set_that_is_no_sticking_band():
    model = fs.Model({x: v, v: -x + sp.sign(v) / 2})
    (band,) = fs.equilibria(model).sets
    assert band.name == "S1|S2 (escaping)"
    assert not band.stable


def test_the_origin_of_a_relay_with_two_switches_is_an_equilibrium():
    # sliding along both keeps the origin, which no region and no single sliding motion has
    model = fs.Model({x: 0.3 - sp.sign(x) + sp.sign(y) / 4, y: w - sp.sign(y)}, parameters={w: 0.1})
    found = fs.equilibria(model)
    assert [e.region for e in found] == ["S1|S4"]
    assert found[0].state.tolist() == [0.0, 0.0]
    assert found[0].type == "pseudo-node"
    assert found[0].stable
    assert not found[0].continuum
    diagram = fs.continue_equilibria(model, "w", over=(-2, 2))
    assert diagram.bands[0].range == pytest.approx((-1, 1), abs=1e-9)


def test_an_overlay_knows_when_the_block_sticks_and_when_it_slips_along_the_edge():
    model = block()
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-2.1, 2.1))
    run = fs.simulate(model, [1, 0], t=(0, 600))
    overlay = fs.overlay(diagram, run)
    shares = overlay.shares()
    sticking = sum(s.duration for s in run.segments if s.region == "S1|S2") / 600
    assert shares["S1|S2 (sticking)"] == pytest.approx(sticking, abs=2e-3)
    assert shares["edge of S1|S2"] > 0.5
    assert shares[""] < 0.01
    rests = [p for p in overlay.phases if p.type == "sticking"]
    assert len(rests) == 3
    ends_at = [c.time for c in run.crossings if c.from_region == "S1|S2"]
    assert [p.end for p in rests] == pytest.approx(ends_at, abs=1e-9)
    # the block leaves where the spring, with the load, pulls as hard as friction can hold
    for time in ends_at:
        state = run(time)
        assert abs(2 * math.sin(time / 100) - state[0]) == pytest.approx(0.5, abs=1e-8)
    assert "in S1|S2 (sticking): 3 times" in overlay.summary()
    assert overlay.at(t=200.0)[0].stable_branch == "S1|S2 (sticking)"
    assert len(overlay.select(stable_branch="edge of S1|S2")) == 3


def test_a_friction_oscillator_with_a_filter_has_a_band_that_is_stable_across():
    # a state that follows: the set stays an interval, and the filter's eigenvalue decides
    for rate, stable in ((-1, True), (1, False)):
        rates = {x: v, v: -x - sp.sign(v) / 2, y: rate * (y - x)}
        (band,) = fs.equilibria(fs.Model(rates)).sets
        assert band["y"] == pytest.approx((-0.5, 0.5), abs=1e-14)
        assert band.stable is stable


def test_two_springs_with_dry_friction_have_a_set_that_is_searched_for():
    # 2 sinh x ∓ friction of both, sinh y ∓ friction of the second
    rates = {
        x: v,
        v: w - 2 * sp.sinh(x) - 0.3 * sp.sign(v) - 0.2 * sp.sign(u),
        y: u,
        u: -sp.sinh(y) - 0.2 * sp.sign(u),
    }
    found = fs.equilibria(fs.Model(rates, parameters={w: -0.1}))
    assert found.completeness == "found"
    (only,) = found.sets
    assert not only.exact
    assert only["y"] == pytest.approx((-math.asinh(0.2), math.asinh(0.2)), abs=1e-9)
    assert only["x"] == pytest.approx((-math.asinh(0.3), math.asinh(0.2)), abs=1e-9)


def test_a_window_ends_bands_where_they_leave_it():
    # the set |x - w| ≤ 1/2 has a part in x ≥ 0.2 from w = -0.3 on
    model = block().frozen()
    (band,) = fs.continue_equilibria(model, "w", over=(-1, 1), window={x: (0.2, 3)}).bands
    assert band.range == pytest.approx((-0.3, 1), abs=1e-12)
    assert fs.continue_equilibria(model, "w", over=(-1, 1), window={x: (2, 3)}).bands == ()
    assert fs.equilibria(model, w=0.3, window={x: (2, 3)}).sets == ()
    assert len(fs.equilibria(model, w=0.3, window={x: (0.2, 3)}).sets) == 1


def pendulum(friction):
    """θ'' = w − sin θ − friction · sign θ', with θ modulo 2π."""
    rates = {x: v, v: w - sp.sin(x) - friction * sp.sign(v)}
    return fs.Model(rates, parameters={w: 0}, periodic={x: 2 * sp.pi})


@pytest.mark.sample(1)
@pytest.mark.parametrize("force", [-0.3, 0.0, -0.1, 0.2])
def test_a_pendulum_modulo_a_turn_has_each_band_once(force):
    model, half = pendulum(0.2), math.pi
    found = fs.equilibria(model, w=force)
    low, high = math.asin(force - 0.2), math.asin(force + 0.2)
    hanging, standing = sorted(found.sets, key=lambda s: abs(s["x"][0] + s["x"][1]))
    assert hanging["x"] == pytest.approx((low, high), abs=1e-12)
    turn = 2 * half * round((standing["x"][0] - (half - high)) / (2 * half))
    assert np.array(standing["x"]) - turn == pytest.approx([half - high, half - low], abs=1e-12)
    assert abs(sum(standing["x"])) <= 2 * half + 1e-9
    assert len(found) == 4
    assert np.abs([e.state[0] for e in found]).max() <= half
    # θ = π is passed by the standing one where w changes its sign
    diagram = fs.continue_equilibria(model, "w", over=(-0.5, 0.5))
    assert [band.range for band in diagram.bands] == [(-0.5, 0.5)] * 2
    widths = [np.ptp(band.corners[:, :, 0], axis=1) for band in diagram.bands]
    assert widths[0] == pytest.approx(widths[1], abs=1e-12)
    assert len(diagram.at(w=force)) == 4
    # a window a turn further on holds the same set
    for turns in (0, 1):
        window = {x: (2 + 2 * math.pi * turns, 4 + 2 * math.pi * turns)}
        (kept,) = fs.equilibria(model, w=force, window=window).sets
        assert kept["x"] == standing["x"]


def test_a_pendulum_with_much_friction_rests_at_every_angle():
    (whole,) = fs.equilibria(pendulum(2)).sets
    assert whole["x"] == (-np.inf, np.inf)
    assert whole["v"] == (0.0, 0.0)


def test_a_set_of_two_dimensions_whose_states_are_no_functions_of_the_weights():
    """|x³ + x y| ≤ 1/2, |y + y³ − x y| ≤ 1/3: at x = 0 the first weight has no slope."""
    rates = {x: v, v: -(x**3) - x * y - sp.sign(v) / 2, y: u, u: -y - y**3 + x * y - sp.sign(u) / 3}
    found = fs.equilibria(fs.Model(rates))
    assert found.completeness == "found"
    (one,) = found.sets
    assert one.dimension == 2
    line = np.linspace(-2, 2, 2001)
    across, up = np.meshgrid(line, line, indexing="ij")
    held = (np.abs(across**3 + across * up) <= 0.5) & (np.abs(up + up**3 - across * up) <= 1 / 3)
    # each range of the grid is within, and not farther off than its cells
    for name, places in (("x", across[held]), ("y", up[held])):
        low, high = one[name]
        assert low <= places.min() < low + 0.01
        assert high - 0.01 < places.max() <= high
    for corner in one.corners:
        pulls = corner[0] ** 3 + corner[0] * corner[2], corner[2] ** 3 + corner[2] * (1 - corner[0])
        assert np.abs(pulls) == pytest.approx([1 / 2, 1 / 3], abs=1e-9)


@pytest.mark.sample(0)
def test_a_set_that_ends_just_within_the_bounds_of_the_search_has_its_ranges():
    """|a³ + a y| ≤ 22.2 for a = arsinh x: down to −9.9, where the search ends at −10."""
    a = sp.asinh(x)
    pull = sp.Rational(111, 5)
    rates = {x: v, v: a**3 + a * y - pull * sp.sign(v), y: u, u: -y - y**3 - a * y - sp.sign(u) / 3}
    (one,) = fs.equilibria(fs.Model(rates)).sets
    low = one["x"][0]
    assert -10 < low < -9.75
    # where both weights are at an end of theirs
    across = math.asinh(low)
    up = (-22.2 - across**3) / across
    assert -up - up**3 - across * up == pytest.approx(1 / 3, abs=1e-8)


def test_products_of_signs_are_said_not_to_be_complete():
    """The origin is at rest, but no sliding motion is derived there."""
    rates = {x: -sp.sign(x) * (2 + sp.sign(y)), y: -sp.sign(y)}
    assert fs.equilibria(fs.Model(rates)).completeness == "found"
    forced = {x: w - sp.sign(x) * (2 + sp.sign(y)), y: -sp.sign(y)}
    diagram = fs.continue_equilibria(fs.Model(forced, parameters={w: 0}), "w", over=(-0.5, 0.5))
    assert diagram.completeness == "found"
