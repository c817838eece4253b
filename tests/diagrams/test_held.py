"""Equilibria held against the walls of resets, and boundary equilibria there."""

from itertools import product

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from tests.samples import WHOLE

pytestmark = pytest.mark.slow

x, v, F, k, c, r, sigma, mass, t, w = sp.symbols("x v F k c r sigma m t w")
a = sp.Symbol("a")


@pytest.fixture(scope="module")
def spring():
    """A mass on a spring against a stop, under a load."""
    return fs.Model(
        {x: v, v: (F - k * x - c * v) / mass},
        parameters={F: 0, k: 2, c: 0.3, r: 0.6, sigma: 1, mass: 1.6},
        resets={x >= sigma: {v: -r * v}},
    )


@pytest.fixture(scope="module")
def buckled():
    """A mass on a spring of negative stiffness against a stop, under a load."""
    return fs.Model(
        {x: v, v: a * x - x**3 - c * v - F},
        parameters={F: 0, c: 0.3, r: 0.6, sigma: 0.5, a: 1},
        resets={x >= sigma: {v: -r * v}},
    )


@pytest.mark.parametrize("load", [-3.0, 1.9, 2.0, 2.1, 7.5])
def test_a_mass_is_held_beyond_the_load_k_sigma(spring, load):
    found = fs.equilibria(spring, F=load, virtual=True)
    assert found.completeness == "complete"
    free, held = sorted(found, key=lambda e: e.held) if len(found) == 2 else (found[0], None)
    assert free["x"] == pytest.approx(load / 2, abs=1e-14)
    assert free.admissible == (load <= 2)
    if held is None:
        # the same state at lift-off
        assert load == 2
        return
    assert held.region == "S1 at rest on x = sigma"
    assert held.state.tolist() == [1.0, 0.0]
    assert held.contact_forces == {"x = sigma": pytest.approx((load - 2) / 1.6, abs=1e-14)}
    assert held.admissible == (load > 2)
    assert (held.stability, held.type, held.pseudo) == ("stable", "node", False)
    assert held.eigenvalues.tolist() == [-np.inf, -np.inf]


def test_a_branch_is_held_from_lift_off_on(spring):
    diagram = fs.continue_equilibria(spring, "F", (-1, 4))
    (branch,) = diagram
    assert diagram.completeness == "complete"
    assert branch.regions == ("S1", "S1 at rest on x = sigma")
    (point,) = diagram.special("BE")
    assert point["F"] == pytest.approx(2, abs=1e-14)
    assert (point.type, point.interface) == ("persistence", "x = sigma")
    assert point.regions == branch.regions
    (held,) = diagram.at(F=3)
    assert held["x"] == 1
    assert held.contact_forces["x = sigma"] == pytest.approx(1 / 1.6)
    assert diagram.interface_values == {"x = sigma": ("x", 1.0, 1)}


def test_a_spring_of_negative_stiffness_at_a_stop_has_a_non_smooth_fold(buckled):
    diagram = fs.continue_equilibria(buckled, "F", (-1, 1))
    (point,) = diagram.special("BE")
    assert point.type == "non-smooth fold"
    assert point["F"] == pytest.approx(0.375, abs=1e-14)
    held, free = (e for e in diagram.at(F=0.37) if e["x"] > 0)
    assert {held.stability, free.stability} == {"stable", "unstable"}
    assert not [e for e in diagram.at(F=0.3751) if e["x"] > 0]
    # with a < 3σ² the free equilibrium is stable
    stiff = fs.continue_equilibria(buckled.with_parameters(a=0.5), "F", (-1, 1))
    assert stiff.special("BE")[0].type == "persistence"


def test_boundary_equilibria_at_a_wall_in_two_parameters(buckled):
    diagram = fs.continue_equilibria(buckled, "F", (-1, 1))
    curve = fs.continue_points(
        diagram.special("BE")[0], ("F", "a"), over={"F": (-2, 2), "a": (-1, 2)}
    )
    assert np.abs(curve["F"] - 0.5 * curve["a"] + 0.125).max() < 1e-14
    (fold,) = curve.special
    assert (fold.code, fold["a"]) == ("BF", pytest.approx(0.75, abs=1e-12))


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", range(8))
def test_the_nature_follows_from_the_sign_of_c_inverse_jacobian_w(seed):
    rng = np.random.default_rng(seed)
    y, z = sp.symbols("y z")
    rows = np.round(rng.normal(size=(2, 4)), 3)
    rates = [sum(e * s for e, s in zip(row, (x, v, y, z), strict=True)) for row in rows]
    model = fs.Model(
        {x: v, v: rates[0] + F, y: z, z: rates[1]},
        parameters={F: 0},
        # the impact moves z too
        resets={x >= 1: {v: -v / 2, z: z - 3 * v / 10}},
    )
    jacobian = np.array([[0, 1, 0, 0], rows[0], [0, 0, 0, 1], rows[1]])
    # away from the wall is the direction of decreasing x
    number = np.array([-1, 0, 0, 0]) @ np.linalg.solve(jacobian, [0, -1.5, 0, -0.3])
    start = np.linalg.solve(
        np.vstack([np.column_stack([jacobian, [0, 1, 0, 0]]), [1, 0, 0, 0, 0]]), [0, 0, 0, 0, 1]
    )
    load = float(start[-1])
    span = (load - 1, load + 1)
    (point,) = fs.continue_equilibria(model, "F", span).special("BE")
    assert point["F"] == pytest.approx(load, rel=1e-12)
    assert point.type == ("persistence" if number < 0 else "non-smooth fold")


def _by_enumeration(stiffness, load, walls):
    """States and forces of every subset of contacts with λ ≥ 0, and no mass beyond a wall."""
    n, found = len(load), []
    for active in product((False, True), repeat=len(walls)):
        held = [wall for wall, on in zip(walls, active, strict=True) if on]
        if len({i for i, _, _ in held}) < len(held):
            continue
        m = len(held)
        matrix, right = np.zeros((n + m, n + m)), np.zeros(n + m)
        matrix[:n, :n], right[:n] = stiffness, load
        for j, (i, side, at) in enumerate(held):
            matrix[i, n + j] = matrix[n + j, i] = side
            right[n + j] = at
        solved = np.linalg.solve(matrix, right)
        outside = all(side * solved[i] <= at + 1e-12 for i, side, at in walls)
        if outside and (solved[n:] >= 0).all():
            forces = dict(zip([(i, side) for i, side, _ in held], solved[n:], strict=True))
            found.append((solved[:n], forces))
    return found


@pytest.mark.sample(1)
@pytest.mark.parametrize(("n", "sides"), [(3, (1, 1)), (4, (1, -1, 1)), (5, (1, 1, -1, -1))])
def test_chains_between_walls_against_enumeration(n, sides):
    """Masses 1, 2, … have walls; with four, masses 1 and 2 have one on both sides."""
    where = [(j % 2 if len(sides) == 4 else j, side) for j, side in enumerate(sides)]
    place, speed = sp.symbols(f"x1:{n + 1}"), sp.symbols(f"v1:{n + 1}")
    loads, at = sp.symbols(f"f1:{n + 1}"), sp.symbols(f"s1:{len(sides) + 1}")
    springs = sp.symbols(f"k1:{n + 1}")
    joints = sp.symbols(f"j1:{n}")
    rates = dict(zip(place, speed, strict=True))
    for i in range(n):
        pull = loads[i] - springs[i] * place[i] - speed[i] / 5
        pull += joints[i - 1] * (place[i - 1] - place[i]) if i else 0
        pull += joints[i] * (place[i + 1] - place[i]) if i < n - 1 else 0
        rates[speed[i]] = pull
    resets = {
        side * place[i] >= s: {speed[i]: -speed[i] / 2}
        for (i, side), s in zip(where, at, strict=True)
    }
    names = [*loads, *at, *springs, *joints]
    model = fs.Model(rates, parameters=dict.fromkeys(names, 1.0), resets=resets)
    rng, counts = np.random.default_rng(n), []
    for _ in range(10 if WHOLE else 5):
        numbers = {s: float(rng.normal()) * 2 for s in loads}
        numbers |= {s: float(rng.uniform(0.1, 1.5)) for s in at}
        # negative springs: several equilibria, or none
        numbers |= {s: float(rng.normal()) for s in (*springs, *joints)}
        found = fs.equilibria(model, numbers)
        assert found.completeness == "complete"
        ks, js = ([numbers[s] for s in group] for group in (springs, joints))
        stiffness = np.diag(ks)
        for i, j in enumerate(js):
            stiffness[i : i + 2, i : i + 2] += [[j, -j], [-j, j]]
        walls = [(i, side, numbers[s]) for (i, side), s in zip(where, at, strict=True)]
        expected = _by_enumeration(stiffness, np.array([numbers[s] for s in loads]), walls)
        counts.append(len(expected))
        assert len(found) == len(expected)
        for state, forces in expected:
            near = min(found, key=lambda e: np.abs(e.state[:n] - state).max())
            assert np.abs(near.state[:n] - state).max() < 1e-12 * max(1, np.abs(state).max())
            given = sorted(near.contact_forces.values())
            assert given == pytest.approx(sorted(forces.values()), rel=1e-11, abs=1e-12)
    assert len(set(counts)) > 1


def test_a_free_mass_is_held_by_one_of_two_walls():
    model = fs.Model(
        {x: v, v: F - v}, parameters={F: 0}, resets={x >= 1: {v: -v / 2}, x <= -1: {v: -v / 2}}
    )
    assert [e["x"] for e in fs.equilibria(model, F=0.5)] == [1]
    diagram = fs.continue_equilibria(model, "F", (-1, 1))
    (branch,) = diagram
    assert branch.regions == ("S1 at rest on x = -1", "S1", "S1 at rest on x = 1")
    assert [p.type for p in diagram.special("BE")] == ["degenerate", "degenerate"]


def test_two_masses_in_contact():
    y, u, m, n = sp.symbols("y u m n")
    middle = (m * v + n * u) / (m + n)
    model = fs.Model(
        {x: v, y: u, v: (F - x - v / 10) / m, u: (-2 * y - u / 10) / n},
        parameters={F: 2, m: 1.5, n: 0.7, r: 0.5},
        resets={
            x - y >= 1: {
                v: middle - n * r * (v - u) / (m + n),
                u: middle + m * r * (v - u) / (m + n),
            }
        },
    )
    (held,) = fs.equilibria(model)
    assert held.state == pytest.approx([4 / 3, 1 / 3, 0, 0], abs=1e-14)
    # the contact force 2/3 accelerates both masses
    (force,) = held.contact_forces.values()
    assert force == pytest.approx(2 / 3 * (1 / 1.5 + 1 / 0.7))
    # the pair oscillates on both springs
    pair = np.roots([2.2, 0.2, 3])
    finite = held.eigenvalues[np.isfinite(held.eigenvalues)]
    assert np.sort_complex(finite) == pytest.approx(np.sort_complex(pair))


def test_a_slowly_moving_wall_is_frozen_with_the_relative_velocity():
    eps = sp.Symbol("epsilon")
    speed = sp.diff(sp.sin(eps * t), t)
    model = fs.Model(
        {x: v, v: sp.Rational(3, 2) - x - v},
        forcing={w: sp.sin(eps * t)},
        parameters={eps: 0.01, r: 0.6},
        resets={x >= w: {v: speed - r * (v - speed)}},
    ).frozen()
    assert str(model.resets["x >= w"]) == "x >= w: v → -r*v"
    assert "epsilon" not in model.parameters
    diagram = fs.continue_equilibria(model, w, (-1, 2))
    assert diagram[0].regions == ("S1 at rest on x = w", "S1")
    assert diagram.special("BE")[0]["w"] == pytest.approx(1.5)


def test_a_threshold_that_resets_ends_the_branch():
    model = fs.Model({v: F - v}, parameters={F: 0}, resets={v >= 1: {v: 0}})
    diagram = fs.continue_equilibria(model, "F", (0, 2))
    (branch,) = diagram
    assert [o.code for o in branch.outcomes] == ["end of range", "reset"]
    (point,) = diagram.special("BE")
    assert (point["F"], point.type) == (pytest.approx(1), None)
    assert not fs.equilibria(model, F=1.5)


def test_kicks_have_no_equilibria():
    model = fs.Model({v: F - v}, parameters={F: 0}, resets={sp.Eq(sp.Mod(t, 2), 0): {v: v + 1}})
    with pytest.raises(fs.ModelError, match="resets depend on time explicitly"):
        fs.equilibria(model)


def test_a_sticking_band_ends_at_the_wall():
    model = fs.Model(
        {x: v, v: F - x - sp.Rational(3, 10) * sp.sign(v)},
        parameters={F: 1.1},
        resets={x >= 1: {v: -v / 2}},
    )
    (band,) = fs.equilibria(model).sets
    assert (band.lower[0], band.upper[0]) == (pytest.approx(0.8), pytest.approx(1))
    # beyond F = 1.3 friction cannot hold the mass, the wall does
    (held,) = fs.equilibria(model, F=2)
    assert held.held
    assert held["x"] == 1


def test_held_branches_are_kept_in_files(spring, tmp_path):
    diagram = fs.continue_equilibria(spring, "F", (-1, 4))
    diagram.save(tmp_path / "diagram.npz")
    again = fs.load(tmp_path / "diagram.npz")
    assert again == diagram
    (held,) = again.at(F=3)
    assert held.held
    assert not held.pseudo
    traced = fs.continue_equilibria(again.model, "F", (-1, 4), from_points=[held])
    assert traced[0].regions == diagram[0].regions
    assert traced.special("BE")[0]["F"] == pytest.approx(2, abs=1e-14)
