"""Models of more regions than are formed: chains of masses with dry friction and with backlash."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.model import structure

pytestmark = pytest.mark.slow

DAMPING, FRICTION, GAP, FREQUENCY, STOP = 0.1, 0.05, 0.1, 0.7, 0.25
T = sp.Symbol("t")


def symbols(n: int) -> tuple[tuple[sp.Symbol, ...], tuple[sp.Symbol, ...]]:
    return sp.symbols(f"x1:{n + 1}"), sp.symbols(f"v1:{n + 1}")


def sprung(x: tuple[sp.Symbol, ...], i: int) -> sp.Expr:
    """Forces of the springs on one mass; the support of the first moves."""
    before = x[i - 1] if i else sp.cos(FREQUENCY * T)
    return before - x[i] + (x[i + 1] - x[i] if i < len(x) - 1 else 0)


def on_ground(n: int) -> fs.Model:
    """Every mass slides on the ground."""
    x, v = symbols(n)
    rates = dict(zip(x, v, strict=True))
    for i in range(n):
        rates[v[i]] = sprung(x, i) - DAMPING * v[i] - FRICTION * sp.sign(v[i])
    return fs.Model(rates)


def on_each_other(n: int) -> fs.Model:
    """Every mass slides on the one before it."""
    x, v = symbols(n)
    rates = dict(zip(x, v, strict=True))
    force = [FRICTION * sp.sign(v[i] - (v[i - 1] if i else 0)) for i in range(n)]
    for i in range(n):
        following = force[i + 1] if i < n - 1 else 0
        rates[v[i]] = sprung(x, i) - DAMPING * v[i] - force[i] + following
    return fs.Model(rates)


def with_backlash(n: int) -> fs.Model:
    x, v = symbols(n)
    rates = dict(zip(x, v, strict=True))
    gaps = [x[i + 1] - x[i] for i in range(n - 1)]
    force = [sp.Piecewise((u - GAP, u > GAP), (u + GAP, u < -GAP), (0, True)) for u in gaps]
    for i in range(n):
        before = force[i - 1] if i else x[0] - sp.cos(FREQUENCY * T)
        following = force[i] if i < n - 1 else 0
        rates[v[i]] = following - before - DAMPING * v[i] - x[i] / 10
    return fs.Model(rates)


def between_stops(n: int) -> fs.Model:
    """Every mass has a stop, the first two hit each other as well, and springs have two slopes."""
    x, v = symbols(n)
    rates, half = dict(zip(x, v, strict=True)), sp.Rational(1, 2)
    for i in range(n):
        force = sp.cos(FREQUENCY * T + i) - x[i] + 1 + 2 * sp.Max(-x[i], 0)
        rates[v[i]] = force - DAMPING * v[i]
    resets = {one >= half: {speed: -speed / 3} for one, speed in zip(x, v, strict=True)}
    mean, apart = (v[0] + v[1]) / 2, (v[0] - v[1]) / 4
    resets[x[0] - x[1] >= 1] = {v[0]: mean - apart, v[1]: mean + apart}
    return fs.Model(rates, resets=resets)


def with_events(n: int) -> fs.Model:
    """A switch, kicks at instants of time, a sawtooth, and events that change stiffness."""
    x, v = symbols(n)
    k, q = sp.symbols("k q")
    rates = dict(zip(x, v, strict=True))
    for i in range(n):
        force = sp.cos(FREQUENCY * T + i) - k * x[i] + q / 2 + sp.Mod(T, 2) / 4
        rates[v[i]] = force - DAMPING * v[i] - FRICTION * sp.sign(v[i])
    return fs.Model(
        rates,
        parameters={k: 1},
        resets={sp.Eq(sp.Mod(T, 3), 0): {v[0]: v[0] + 1}},
        switches={q: (x[0] < 0, x[0] > sp.Rational(1, 2))},
        events={
            "stiffer": fs.Event(x[0] > 1, {k: k + sp.Rational(1, 4)}),
            "late": fs.Event(x[1] < 0, {v[0]: v[0] / 2}, delay=sp.Rational(3, 10)),
            "first": fs.Event(sp.Symbol("t") > -1, {x[0]: x[0] + 1}, initially=False),
        },
    )


@pytest.mark.parametrize(
    "chain", [on_ground, on_each_other, with_backlash, between_stops, with_events]
)
def test_runs_are_those_with_all_regions_formed(chain, monkeypatch):
    model = chain(3)
    values = np.sort(np.random.default_rng(3).normal(size=6)) / 3
    start = dict(zip(model.states, values, strict=True))
    start |= dict.fromkeys(model.switches, 0)
    every = fs.simulate(model, start, t=(0, 20))
    monkeypatch.setattr(structure, "MOST_REGIONS", 3)
    structure._partition.cache_clear()
    model = chain(3)
    assert "regions, named by the signs" in repr(model.regions)
    run = fs.simulate(model, start, t=(0, 20))
    structure._partition.cache_clear()
    assert len(run.crossing_table) > (5 if chain is between_stops else 20)
    np.testing.assert_allclose(run.end, every.end, rtol=0, atol=1e-12)
    for kind in ("crossing_table", "reset_table", "event_table", "switch_table"):
        one, other = (getattr(some, kind) for some in (run, every))
        assert one is other is None or len(one) == len(other)
        assert one is None or np.abs(one[:, 0] - other[:, 0]).max(initial=0.0) < 1e-11
    assert (chain is between_stops) == any("at rest on" in name for name in run.modes)


def events_of(rate, heights, until, state):
    """End of a run begun anew at every zero of one of some functions, which returns the mode."""
    time, mode = 0.0, heights.begin(state)
    count = 0
    while time < until:
        functions = heights.functions(mode)
        for function in functions:
            function.terminal = True
        step = solve_ivp(
            rate(mode), (time, until), state, "DOP853", rtol=1e-13, atol=1e-13, events=functions
        )
        time, state = step.t[-1], step.y[:, -1]
        if step.status == 1:
            (number,) = (k for k, found in enumerate(step.t_events) if len(found))
            mode, state = heights.after(mode, number, time, state)
            count += 1
    return state, count


class Backlash:
    """Sides of the gaps: 1, 0 or −1."""

    def __init__(self, n):
        self.n = n

    def begin(self, state):
        return (0,) * (self.n - 1)

    def functions(self, mode):
        found = []
        for i, side in enumerate(mode):
            # a tooth that is touched is left, one that is not is met
            levels = ((1, 1), (-1, -1)) if side == 0 else ((side, -side),)
            for level, direction in levels:

                def height(t, y, i=i, level=level):
                    return y[i + 1] - y[i] - level * GAP

                height.direction = direction
                height.moves = i, level if side == 0 else 0
                found.append(height)
        return found

    def after(self, mode, number, time, state):
        i, side = self.functions(mode)[number].moves
        return (*mode[:i], side, *mode[i + 1 :]), state

    def rate(self, mode):
        side, n = np.array(mode), self.n

        def of(t, y):
            x, v = y[:n], y[n:]
            force = np.where(side == 0, 0.0, np.diff(x) - side * GAP)
            before = np.append(x[0] - np.cos(FREQUENCY * t), force)
            return np.append(v, np.append(force, 0.0) - before - DAMPING * v - x / 10)

        return of


class Friction:
    """Of every mass the sign of its velocity, 0 where it sticks."""

    def __init__(self, n):
        self.n = n

    def force(self, t, x):
        before = np.append(np.cos(FREQUENCY * t), x[:-1]) - x
        return before + np.append(np.diff(x), 0.0)

    def begin(self, state):
        force = self.force(0.0, state[: self.n])
        return tuple((np.sign(force) * (np.abs(force) > FRICTION)).astype(int).tolist())

    def functions(self, mode):
        found = []
        for i, side in enumerate(mode):
            if side:

                def speed(t, y, i=i):
                    return y[self.n + i]

                speed.direction, speed.moves = -side, (i, 0)
                found.append(speed)
                continue
            for sign in (1, -1):

                def excess(t, y, i=i, sign=sign):
                    return sign * self.force(t, y[: self.n])[i] - FRICTION

                excess.direction, excess.moves = 1, (i, sign)
                found.append(excess)
        return found

    def after(self, mode, number, time, state):
        i, side = self.functions(mode)[number].moves
        state = state.copy()
        state[self.n + i] = 0.0
        if side == 0:
            force = self.force(time, state[: self.n])[i]
            side = int(np.sign(force)) if abs(force) > FRICTION else 0
        return (*mode[:i], side, *mode[i + 1 :]), state

    def rate(self, mode):
        side, n = np.array(mode), self.n

        def of(t, y):
            x, v = y[:n], y[n:]
            a = self.force(t, x) - DAMPING * v - FRICTION * side
            return np.append(np.where(side == 0, 0.0, v), np.where(side == 0, 0.0, a))

        return of


class Impacts(Backlash):
    """Sides of the gaps, and a stop of every mass."""

    def functions(self, mode):
        found = super().functions(mode)
        for i in range(self.n):

            def into(t, y, i=i):
                return y[i] - STOP

            into.direction, into.moves = 1, (i, None)
            found.append(into)
        return found

    def after(self, mode, number, time, state):
        i, side = self.functions(mode)[number].moves
        if side is not None:
            return (*mode[:i], side, *mode[i + 1 :]), state
        state = state.copy()
        state[i], state[self.n + i] = STOP, -state[self.n + i] / 2
        return mode, state


def with_impacts(n: int) -> fs.Model:
    x, v = symbols(n)
    model = with_backlash(n)
    resets = {one >= STOP: {speed: -speed / 2} for one, speed in zip(x, v, strict=True)}
    return fs.Model(model.rates, resets=resets)


@pytest.mark.parametrize(
    ("chain", "contacts", "count"),
    [(with_backlash, Backlash, 35), (on_ground, Friction, 20), (with_impacts, Impacts, 35)],
)
def test_chain_of_twelve_masses_agrees_with_restarts_of_scipy(chain, contacts, count):
    n, until = 12, 12.0
    model, other = chain(n), contacts(n)
    assert model.regions.count == (2**12 if chain is on_ground else 3**11)
    run = fs.simulate(model, dict.fromkeys(model.states, 0.0), t=(0, until))
    assert run.outcome
    reference, events = events_of(other.rate, other, until, np.zeros(2 * n))
    assert events > count
    np.testing.assert_allclose(run.end[1:], reference, rtol=0, atol=1e-10)


@pytest.mark.sample(0)
def test_sixty_masses_that_slide_on_each_other():
    model = on_each_other(60)
    assert model.regions.count == 2**60
    run = fs.simulate(model, dict.fromkeys(model.states, 0.0), t=(0, 10))
    assert run.outcome
    # many interfaces slide at once: the masses beyond the wave move as one
    assert max(name.count("-") - name.partition("|")[0].count("-") for name in run.modes) > 40
    stuck = run.modes[int(run.steps[-1, 2])]
    above, below = stuck.split("|")
    together = [i for i in range(60) if above[i] != below[i]]
    speeds = run.end[1:][60:]
    assert np.abs(np.diff(speeds)[[i - 1 for i in together if i]]).max() < 1e-13


def on_belt(n: int) -> fs.Model:
    """Every mass slides on a belt, and the first is pulled."""
    x, v = symbols(n)
    rates = dict(zip(x, v, strict=True))
    for i in range(n):
        before = x[i - 1] if i else sp.Symbol("pull")
        springs = before - x[i] + (x[i + 1] - x[i] if i < n - 1 else 0) - x[i] / 10
        rates[v[i]] = springs - DAMPING * v[i] - FRICTION * sp.sign(v[i] - 1)
    return fs.Model(rates, parameters={"pull": 2})


def test_equilibria_of_the_regions_that_are_named():
    model, n = on_belt(11), 11
    slipping = "-" * n
    (found,) = fs.equilibria(model, regions=[slipping])
    # all springs are linear, and the belt pulls every mass by the friction
    matrix = np.diag(np.full(n, 2.1)) - np.eye(n, k=1) - np.eye(n, k=-1)
    matrix[-1, -1] = 1.1
    load = np.full(n, FRICTION)
    load[0] += 2.0
    np.testing.assert_allclose(found.state[:n], np.linalg.solve(matrix, load), rtol=1e-12)
    assert (found.region, found.stability) == (slipping, "stable")
    branch = fs.continue_equilibria(model, "pull", (1, 3), regions=[slipping]).branches[0]
    assert branch["x1"][-1] != branch["x1"][0]
    with pytest.raises(fs.ModelError, match="11 interfaces bound 2048 regions"):
        fs.equilibria(model)
    with pytest.raises(fs.FastSlowError, match="unknown region"):
        fs.equilibria(model, regions=["S1"])


def test_a_run_is_stored_with_its_motions(tmp_path):
    model = on_ground(11)
    run = fs.simulate(model, dict.fromkeys(model.states, 0.0), t=(0, 3))
    run.save(tmp_path / "run.npz")
    again = fs.load(tmp_path / "run.npz")
    assert again == run
    assert list(again.modes) == list(run.modes)
    assert repr(model.regions) == "{2048 regions, named by the signs of 11 interfaces}"
    with pytest.raises(fs.ModelError, match="a run backwards needs all regions"):
        fs.simulate(model, run.final_state, t=(0, -1))


@pytest.mark.sample(0)
def test_an_orbit_through_many_regions_is_found_and_continued():
    n, phases = 11, 0.2 * np.arange(11)
    x, k = sp.symbols(f"x1:{n + 1}"), sp.Symbol("k")
    rates = {
        one: sp.cos(T + sp.Rational(i, 5)) - one - k * sp.Max(one, 0) for i, one in enumerate(x)
    }
    model = fs.Model(rates, parameters={k: 0.5})
    orbit = fs.find_orbit(model, [0.0] * n)
    assert orbit.outcome

    def rate(t, y):
        return np.cos(t + phases) - y - 0.5 * np.maximum(y, 0)

    end = orbit.t0 + 2 * np.pi * np.ceil(6 - orbit.t0 / (2 * np.pi))
    settled = solve_ivp(rate, (orbit.t0 - 12 * np.pi, end), np.zeros(n), "DOP853", rtol=1e-12,
                        atol=1e-13, max_step=0.01)  # fmt: skip
    np.testing.assert_allclose(orbit(orbit.t0), settled.y[:, -1], rtol=0, atol=1e-8)
    branch = fs.continue_orbits(orbit, "k", over=(0.5, 0.6))
    other = fs.find_orbit(model.with_parameters(k=0.6), [0.0] * n)
    assert float(branch["max(x1)"][-1]) == pytest.approx(float(other["max(x1)"]), abs=1e-9)
