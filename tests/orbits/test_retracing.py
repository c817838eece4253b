"""Branches keep their direction where rounding is amplified, and do not repeat their rows."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.orbits.find.orbit_curve import OrbitCurve
from fastslow.orbits.flow.segments import SEGMENT_GROWTH
from fastslow.orbits.trace import restarts, tracer
from tests.orbits.models import v, x

pytestmark = pytest.mark.slow

COARSE = fs.Continuation(max_step=0.1)

a, e = sp.symbols("a e")


def canards(ratio, *, inline):
    """Van der Pol's oscillator over the canard explosion, with the Hopf point at a = 1."""
    slow = sp.Rational(str(ratio)) if inline else e
    values = {a: 1.01} if inline else {a: 1.01, e: ratio}
    model = fs.Model({x: (v - x**3 / 3 + x) / slow, v: a - x}, parameters=values)
    return fs.continue_equilibria(model, "a", over=(0.95, 1.02))


@pytest.mark.sample(1)
@pytest.mark.parametrize("inline", [True, False])
@pytest.mark.parametrize("ratio", [0.005, 0.0075, 0.01, 0.02, 0.05, 0.015, 0.03, 0.07, 0.1])
def test_a_canard_explosion_ends_in_relaxation_cycles(ratio, inline):
    (branch,) = fs.continue_cycles(canards(ratio, inline=inline), continuation=COARSE)
    assert [outcome.code for outcome in branch.outcomes] == ["Hopf point", "end of range"]
    assert branch.values[-1] == 0.95
    # from the fold at (-1, 2/3) a relaxation cycle jumps to x = 2
    assert branch["max(x)"][-1] == pytest.approx(2, abs=3 * ratio ** (2 / 3))
    assert branch["min(x)"][-1] == pytest.approx(-2, abs=3 * ratio ** (2 / 3))
    # canards with and without head, of one parameter to eight digits
    assert np.ptp(branch.values[(branch["min(x)"] > -1) & (branch["max(x)"] > 1.2)]) < 0.1 * ratio
    assert branch["max(x)"].max() == pytest.approx(branch["max(x)"][-1], abs=0.05)
    assert not list(branch.special("BPC"))


def test_a_branch_that_turns_back_ends_there_and_says_so(monkeypatch):
    keep, turned = restarts.same_direction, []

    def reversed_once(known, other):
        turned.append(known)
        return -keep(known, other) if len(turned) == 2 else keep(known, other)

    diagram = canards(0.02, inline=False)
    with monkeypatch.context() as patch:
        patch.setattr(restarts, "same_direction", reversed_once)
        (cut,) = fs.continue_cycles(diagram)
    assert len(turned) == 2
    assert not cut.outcome
    assert cut.outcomes[1].code == "retraced"
    assert "the same orbits were computed again" in str(cut.outcomes[1])
    assert "the same orbits were computed again" in repr(cut)
    # up to the row at which it turned
    shooting, u, _ = turned[1]
    last = float(u[shooting.size - 1])
    assert cut.period[-1] == pytest.approx(last, rel=0.03)
    assert (np.diff(cut.period[:-2]) > 0).all()


def test_repeated_rows_are_found_by_the_invariants_of_the_tests(monkeypatch):
    monkeypatch.setattr(tracer.Retracing, "first_repeated", lambda *_: None)
    keep, count = restarts.same_direction, []

    def reversed_once(known, other):
        count.append(1)
        return -keep(known, other) if len(count) == 1 else keep(known, other)

    monkeypatch.setattr(restarts, "same_direction", reversed_once)
    with pytest.raises(AssertionError, match="follow rows"):
        fs.continue_cycles(canards(0.07, inline=False))


def pituitary():
    """A lactotroph with calcium-dependent bursting; the multiplier of its cycles reaches -8829."""
    n, b, c, g = sp.symbols("n b c g_K")
    R = sp.Rational

    def gate(half, width):
        return 1 / (1 + sp.exp((half - v) / width))

    calcium = 2 * gate(-20, 12) * (v - 60)
    fast = 10 * gate(-20, 10) * b * (v + 75)
    activated = R(17, 10) * c**2 / (c**2 + R(16, 100)) * (v + 75)
    return fs.Model(
        {
            v: -(calcium + g * n * (v + 75) + fast + activated + (v + 50) / 5) / 10,
            n: (gate(-5, 10) - n) / 30,
            b: (1 / (1 + sp.exp((v + 60) / 5)) - b) / 20,
            c: -R(1, 100) * (R(15, 10000) * calcium + R(16, 100) * c),
        },
        parameters={g: 4},
    )


@pytest.fixture(scope="module")
def bursting():
    model = pituitary()
    return fs.find_orbit(model, fs.simulate(model, [-60, 0.01, 0.3, 0.3], t=(0, 6000)))


@pytest.mark.sample(1)
@pytest.mark.parametrize("seed", range(50))
def test_branches_of_perturbed_orbits_are_the_same(bursting, seed):
    first = bursting(bursting.t0)
    first = first * (1 + 1e-7 * np.random.default_rng(seed).standard_normal(4))
    orbit = fs.find_orbit(bursting.model, first, period=bursting.period)
    assert orbit.period == pytest.approx(bursting.period, rel=1e-12)
    branch = fs.continue_orbits(orbit, "g_K", over=(2.7, 4), continuation=COARSE)
    assert [outcome.code for outcome in branch.outcomes] == ["end of range"] * 2
    (doubling,) = branch.special
    assert doubling["g_K"] == pytest.approx(3.280628882065, abs=1e-11)
    assert np.abs(doubling.multipliers + 1).min() < 1e-9
    assert np.abs(branch.log_multipliers[:, 0]).max() > np.log(1e3)


def test_nodes_leave_little_growth(bursting, monkeypatch):
    """Nodes are chosen anew from a growth of 1000 on, which one step may pass."""
    confirm, known = OrbitCurve.confirmed, []

    def watched(curve, shooting, solved):
        known.append((solved.growth, len(shooting.form)))
        return confirm(curve, shooting, solved)

    monkeypatch.setattr(OrbitCurve, "confirmed", watched)
    branch = fs.continue_orbits(bursting, "g_K", over=(2.4, 4), continuation=COARSE)
    assert branch.log_multipliers.max() > np.log(1e3)
    growth, nodes = np.array(known).T
    assert 500 < growth.max() < 3 * SEGMENT_GROWTH
    assert nodes.max() > 2


@pytest.mark.sample(0)
def test_long_steps_do_not_end_on_simple_orbits(bursting):
    """z(T/2) - z(0) turns by more than a right angle in a step far from a period doubling."""
    branch = fs.continue_orbits(bursting, "g_K", over=(2, 4.5), continuation=COARSE)
    assert branch.range == (2, 4.5)
