"""Orbits of chains of masses: many unknowns, whose equations are kept as blocks."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.orbits.flow import shooting
from fastslow.orbits.flow.problem import OrbitProblem
from fastslow.orbits.flow.segments import segments_of, winding_of

pytestmark = pytest.mark.slow

x, v, t, a, w = sp.symbols("x v t a w")
LOAD = a * sp.cos(13 * t / 10) - x - v / 10
CASES = {
    "stick-slip": fs.Model({x: v, v: LOAD - 3 * sp.sign(v) / 10}, parameters={a: 1.0}),
    "impact": fs.Model({x: v, v: LOAD}, resets={x <= -0.5: {v: -0.7 * v}}, parameters={a: 1.0}),
    "cycle with nodes": fs.Model({x: v, v: 8 * (1 - x**2) * v - a * x}, parameters={a: 1.0}),
    "slides all the time": fs.Model(
        {x: v - 2 * sp.sign(x), v: a * sp.cos(t) - v}, parameters={a: 1.0}
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_blocks_are_the_jacobian_and_solve_it(case, monkeypatch):
    model = CASES[case]
    orbit = fs.find_orbit(model, [2.0 if case == "cycle with nodes" else 0.0, 0.1])
    assert orbit.outcome
    problem = OrbitProblem.of(model, orbit.multiple or 1, None, None, ("a",))
    winding = winding_of(orbit.trajectory, orbit.t0, orbit.period)
    known = winding, problem.variations, problem.parameters
    segments = segments_of(orbit.trajectory, orbit.t0, orbit.period, *known)
    equations, solution = problem.solve(segments, orbit.period, winding, orbit.trajectory)
    u = solution.u * (1 + 1e-3 * np.random.default_rng(0).normal(size=len(solution.u)))
    equations = equations.with_phase(u)
    whole = equations.linearised(u)
    monkeypatch.setattr(shooting, "BLOCKS_FROM", 0)
    blocks = equations.linearised(u)
    np.testing.assert_allclose(blocks.residual, whole.residual, rtol=0, atol=1e-13)
    largest = np.abs(whole.jacobian).max()
    np.testing.assert_allclose(blocks.jacobian, whole.jacobian, rtol=0, atol=1e-14 * largest)
    scale = np.append(equations.scales(*equations.unpack(u)), 0.7)
    matrix = whole.jacobian * scale
    step = np.linalg.solve(matrix[:, :-1], -whole.residual)
    fixed = shooting._inverse_of(blocks, equations.size, scale[:-1])
    assert fixed.is_isolated
    np.testing.assert_allclose(fixed.step(blocks.residual), step, rtol=0, atol=1e-12)
    null = np.linalg.svd(matrix / np.abs(matrix).max(axis=1)[:, None])[2][-1]
    normal = np.random.default_rng(1).normal(size=len(u))
    inverse = shooting.BlockInverse.of(blocks, scale)
    moved, along = inverse.step_in_plane(blocks.residual, normal, 0.3)
    np.testing.assert_allclose(np.abs(along @ null), 1.0, rtol=1e-12)
    np.testing.assert_allclose(matrix @ moved, -whole.residual, rtol=0, atol=1e-12)
    assert moved @ normal == pytest.approx(0.3, abs=1e-12)


COUNT, GAP = 8, 0.1


def geared(n):
    """Masses with backlash between neighbours, each with a weak spring; the first is driven."""
    places, speeds = sp.symbols(f"x1:{n + 1}"), sp.symbols(f"v1:{n + 1}")
    gaps = [places[i] - places[i - 1] for i in range(1, n)]
    force = [sp.Piecewise((u - GAP, u > GAP), (u + GAP, u < -GAP), (0, True)) for u in gaps]
    rates = dict(zip(places, speeds, strict=True))
    for i in range(n):
        before = force[i - 1] if i else places[0] - sp.cos(w * t)
        after = force[i] if i < n - 1 else 0
        rates[speeds[i]] = after - before - speeds[i] / 2 - places[i] / 10 + sp.Rational(1, 10)
    return fs.Model(rates, parameters={w: 0.7})


def test_orbit_of_a_chain_of_eight_masses_and_its_branch():
    model = geared(COUNT)
    assert model.regions.count == 3 ** (COUNT - 1)
    orbit = fs.find_orbit(model, dict.fromkeys(model.states, 0.0))
    assert orbit.outcome
    assert len(orbit.trajectory.crossing_table) > 20

    def rate(time, y, frequency=0.7):
        places, speeds = np.split(y, 2)
        gap = np.diff(places)
        force = gap - np.clip(gap, -GAP, GAP)
        before = np.append(places[0] - np.cos(frequency * time), force)
        return np.append(speeds, np.append(force, 0) - before - speeds / 2 - places / 10 + 0.1)

    def slopes(time, y):
        """Monodromy with the states: the rates are continuous, so that it has no jumps."""
        state, matrix = y[: 2 * COUNT], y[2 * COUNT :].reshape(2 * COUNT, 2 * COUNT)
        touching = (np.abs(np.diff(state[:COUNT])) > GAP).astype(float)
        stiff = np.diag(-np.append(touching, 0) - np.append(1.0, touching) - 0.1)
        stiff += np.diag(touching, 1) + np.diag(touching, -1)
        below = matrix[COUNT:]
        return np.concatenate(
            [rate(time, state), below.ravel(), (stiff @ matrix[:COUNT] - below / 2).ravel()]
        )

    span = orbit.t0, orbit.t0 + orbit.period
    start = orbit(orbit.t0)
    known = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-11, "max_step": 0.05}
    begin = np.concatenate([start, np.eye(2 * COUNT).ravel()])
    end = solve_ivp(slopes, span, begin, **known).y[:, -1]
    np.testing.assert_allclose(end[: 2 * COUNT], start, rtol=0, atol=1e-8)
    multipliers = np.linalg.eigvals(end[2 * COUNT :].reshape(2 * COUNT, 2 * COUNT))
    np.testing.assert_allclose(
        np.sort(np.abs(orbit.multipliers)), np.sort(np.abs(multipliers)), rtol=0, atol=1e-6
    )
    # two events exchange their order on the way
    steps = fs.Continuation(step=0.2, max_step=0.5)
    branch = fs.continue_orbits(orbit, "w", over=(0.7, 0.704), continuation=steps)
    assert branch.outcome
    assert [one.code for one in branch.special] == ["CC"]
    last = branch[-1]
    assert last.parameters["w"] == 0.704
    span, start = (last.t0, last.t0 + 2 * np.pi / 0.704), last(last.t0)
    end = solve_ivp(rate, span, start, args=(0.704,), **known).y[:, -1]
    np.testing.assert_allclose(end, start, rtol=0, atol=1e-8)
