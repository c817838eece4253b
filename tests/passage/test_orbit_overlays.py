"""Trajectories over branches of forced orbits: strobes, distances, transitions and outcomes."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.overlay.transitions import TYPES

pytestmark = pytest.mark.slow

x, v, w, k, t = sp.symbols("x v w k t")
r, Omega, epsilon, c, D = sp.symbols("r Omega epsilon c D")


#: Error of the curve between the rows of a branch, in units of the states.
INTERPOLATED = 1e-3


def linear():
    """x' = w − x + cos(2t) with w = r t: the orbits are w + (cos(2t) + 2 sin(2t)) / 5."""
    return fs.Model({x: w - x + sp.cos(2 * t)}, forcing={w: r * t}, parameters={r: 0.01})


@cache
def of_linear():
    orbit = fs.find_orbit(linear().frozen(fast=["t"]).with_parameters(w=0.5), [0.0])
    return fs.continue_orbits(orbit, "w", over=(-0.1, 1.2))


@cache
def over_linear():
    # after transients the solution is that of the orbits at w(t - 1)
    fine = fs.Integration(rtol=1e-13)
    run = fs.simulate(linear(), [0.19], t=(0.0, 100.0), integration=fine)
    return fs.overlay(of_linear(), run)


def gear(law):
    """A gear pair with mesh stiffness 1 + ε cos Ωt and clearance ±D under a torque w."""
    mesh = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    return fs.Model(
        {x: v, v: w - c * v - k * mesh},
        forcing={k: 1 + epsilon * sp.cos(Omega * t), w: law},
        parameters={epsilon: 0.4, Omega: 0.8, c: 0.1, D: 0.5, r: 1e-3},
    )


@cache
def of_gear():
    orbit = fs.find_orbit(gear(r * t).frozen(fast=["k"]).with_parameters(w=1), [1.5, 0])
    return fs.continue_orbits(orbit, "w", over=(0.05, 1.0))


@cache
def over_gear():
    full = gear(0.45 - 0.35 * sp.cos(r * t))
    return fs.overlay(of_gear(), fs.simulate(full, [0.75, -0.2], t=(0.0, 2 * math.pi / 1e-3)))


def test_strobes_distance_and_lag_in_closed_form():
    overlay = over_linear()
    assert overlay.t == pytest.approx(math.pi * np.arange(32), abs=1e-12)
    assert overlay.slow == pytest.approx(0.01 * overlay.t, abs=1e-15)
    # x = w - r + (cos 2t + 2 sin 2t)/5 from the given initial state on
    assert overlay["x"] == pytest.approx(0.01 * overlay.t - 0.01 + 0.2, abs=1e-12)
    late = overlay[1:]
    assert late.lag == pytest.approx(np.ones(31), abs=1e-9)
    assert late.relaxation == pytest.approx(np.ones(31), abs=1e-9)
    width = float(overlay.extent[0])
    assert late.distance * width == pytest.approx(np.full(31, 0.01), abs=1e-11)
    assert set(late.labels) == {"O1"}
    assert overlay.outcome
    assert [phase.type for phase in overlay.phases] == ["quasi-static"]
    assert "median lag 1" in overlay.summary()


def test_the_envelope_is_that_of_the_closed_form():
    """x = w - r + A sin(2t + φ) with A = 1/√5, tan φ = 1/2, has x' = 0 at cos(2t + φ) = -r / 2A."""
    overlay = over_linear()
    size, phase = 1 / math.sqrt(5), math.atan2(1.0, 2.0)

    def solution(s):
        return 0.01 * (s - 1) + size * math.sin(2 * s + phase)

    turn = math.acos(-0.01 / (2 * size))
    for which, pick in (("max(x)", max), ("min(x)", min)):
        values = overlay[which]
        assert np.isnan(values[-1])
        for begin, value in zip(overlay.t[:-1].tolist(), values[:-1].tolist(), strict=True):
            inner = [begin + ((side * turn - phase) / 2) % math.pi for side in (1, -1)]
            exact = pick(map(solution, [begin, begin + math.pi, *inner]))
            assert value == pytest.approx(exact, abs=1e-12)
    with pytest.raises(fs.ArgumentError, match=r"rms\(x\) is a number of an orbit"):
        overlay["rms(x)"]


@pytest.mark.sample(1)
@pytest.mark.parametrize(("begin", "number"), [(0.2, 0), (0.39, -1)])
def test_strobed_states_are_those_of_find_orbit(begin, number):
    """A quasi-static run is within O(rate) of orbits that are solved for one by one."""
    frozen = gear(r * t).frozen(fast=["k"])
    slow = frozen.with_ramp("w", 1e-5, from_value=begin)
    start = of_gear().at(w=begin, stable=True)[number]
    overlay = fs.overlay(of_gear(), fs.simulate(slow, start(0.0), t=(0.0, 800.0)))
    for row in (20, 60, 100):
        orbit = fs.find_orbit(frozen.with_parameters(w=overlay.slow[row]), overlay.state[row])
        assert orbit(0.0) == pytest.approx(overlay.state[row], abs=4e-3)
        # the distance is that from the interpolated branch
        exact = np.linalg.norm((overlay.state[row] - orbit(0.0)) / overlay.extent)
        assert overlay.distance[row] == pytest.approx(exact, abs=INTERPOLATED)
    assert set(overlay.labels) == {("O1", "O2")[number]}


def test_jumps_at_folds_of_the_gear_pair_and_a_contact():
    branch, overlay = of_gear(), over_gear()
    assert [p.code for p in branch.special] == ["GR", "LPC", "LPC"]
    found = [(q.type, q.from_branch, q.to_branch, q.special.label) for q in overlay.transitions]
    assert found == [
        ("crossing", "O1", "O1", "GR1"),
        ("jump", "O1", "O2", "LPC1"),
        ("jump", "O2", "O1", "LPC2"),
    ]
    grazing, up, down = overlay.transitions
    assert grazing.delay == pytest.approx(0.0, abs=5e-3)
    assert up.value - branch["LPC1"]["w"] == pytest.approx(up.delay, abs=1e-12)
    assert branch["LPC2"]["w"] - down.value == pytest.approx(down.delay, abs=1e-12)
    assert 0.02 < up.delay < 0.08
    assert 0.02 < down.delay < 0.08
    assert np.isnan(overlay.transitions["predicted"]).all()
    assert [p.type for p in overlay.phases if p.type != "transient"] == [
        *("quasi-static", "jump", "quasi-static", "jump", "quasi-static"),
    ]
    assert "delays are measured, not predicted" in overlay.summary()
    # relaxation time 2/c where the motion remains in contact
    inside = overlay.labels == "O2"
    assert np.nanmin(overlay.relaxation[inside]) > 0


def test_the_delay_decreases_with_the_rate():
    delays = []
    for rate in (2e-4, 5e-5):
        frozen = gear(r * t).frozen(fast=["k"])
        ramp = frozen.with_ramp("w", rate, from_value=0.43)
        start = of_gear().at(w=0.43, stable=True)[0]
        run = fs.simulate(ramp, start(0.0), t=(0.0, 0.09 / rate))
        (jump,) = fs.overlay(of_gear(), run).transitions.select(type="jump")
        delays.append(jump.delay)
    # ε^(2/3), which the overlay does not predict
    assert delays[0] / delays[1] == pytest.approx(4 ** (2 / 3), rel=0.25)


def test_a_period_doubling_and_the_doubled_orbits():
    frozen, single = doubling().frozen(fast=["t"]), doubling_branch()
    (point,) = single.special("PD")
    twice = fs.continue_orbits(fs.find_orbit(frozen, point), "w", over=DOUBLING)
    begin, rate = 0.262, 5e-5
    (start,) = single.at(w=begin)
    full = frozen.with_ramp("w", rate, from_value=begin)
    run = fs.simulate(full, start(0.0) + 1e-3, t=(0.0, (DOUBLING[1] - begin) / rate))
    (left,) = fs.overlay(single, run).transitions
    assert (left.type, left.special.label, left.to_branch) == ("period doubling", "PD1", "")
    assert left.delay == pytest.approx(left.value - point["w"], abs=1e-12)
    # the contraction before the point is made up for by the growth beyond it
    passed = left.leave.value - point["w"]
    assert 0.5 < passed / (point["w"] - begin) < 3.0
    both = fs.overlay([single, twice], run)
    (landed,) = both.transitions.select(type="period doubling")
    (label,) = [s.label for s in both.stable_branches if s.branch == 1][:1]
    assert (landed.to_branch, both.labels[-1]) == (label, label)
    # consecutive strobes are the two states of the doubled orbit in turn
    double = twice.at(w=float(both.slow[-1]), stable=True)[0]
    states = sorted(double(np.array([0.0, both.period]))[0].tolist())
    assert sorted(both["x"][-2:].tolist()) == pytest.approx(states, abs=0.01)
    assert states[1] - states[0] > 0.05
    # the envelope is that over both periods
    tops = both["max(x)"][-8:-2]
    assert np.abs(np.diff(tops)).max() < 0.1 * (states[1] - states[0])


def test_doubled_orbits_are_followed_at_both_phases_and_counted_once():
    frozen = doubling().frozen(fast=["t"])
    (point,) = doubling_branch().special("PD")
    twice = fs.continue_orbits(fs.find_orbit(frozen, point), "w", over=DOUBLING)
    (double,) = twice.at(w=0.28)
    length = double.period / 2
    shifted = fs.find_orbit(frozen.with_parameters(w=0.28), double(length), multiple=2)
    assert shifted(0.0) == pytest.approx(double(length), abs=1e-9)
    again = fs.continue_orbits(shifted, "w", over=(0.275, 0.284))
    ramp = frozen.with_ramp("w", 1e-5, from_value=0.28)
    for state in (double(0.0), double(length)):
        run = fs.simulate(ramp, state, t=(0.0, 20 * length))
        overlay = fs.overlay([twice, again], run)
        assert [s.branch for s in overlay.stable_branches] == [0]
        assert overlay.shares() == {"O1": 1.0}
        assert overlay.distance.max() < 0.02


DOUBLING = (0.24, 0.285)


def doubling():
    """Duffing's equation with two wells at a slowly varying amplitude w of the forcing."""
    return fs.Model(
        {x: v, v: -0.3 * v + x - x**3 + w * sp.cos(1.2 * t)},
        forcing={w: 0.24 + r * t},
        parameters={r: 1e-4},
    )


@cache
def doubling_branch():
    start = fs.find_orbit(doubling().frozen(fast=["t"]).with_parameters(w=DOUBLING[0]), [1.0, 0.0])
    return fs.continue_orbits(start, "w", over=DOUBLING)


def test_a_slow_state_with_feedback_jumps_at_folds_of_the_averaged_cubic():
    """x' = x - x³/3 - w + q cos 5t has folds near w = ±(2/3) (1 - a²/2)^(3/2) with a = q/5."""
    q = 0.5
    full = fs.Model({x: x - x**3 / 3 - w + q * sp.cos(5 * t)}, slow={w: 0.01 * x})
    start = fs.find_orbit(full.frozen(fast=["t"]).with_parameters(w=-0.9), [2.0])
    branch = fs.continue_orbits(start, "w", over=(-1.0, 1.0))
    fold = 2 / 3 * (1 - (q / 5) ** 2 / 2) ** 1.5
    assert branch.special("LPC")["w"] == pytest.approx([fold, -fold], abs=2e-5)
    overlay = fs.overlay(branch, fs.simulate(full, [2.0, -0.2], t=(0.0, 400.0)))
    jumps = [(q.type, q.from_branch, q.to_branch, q.special.label) for q in overlay.transitions]
    assert jumps == [("jump", "O1", "O2", "LPC1"), ("jump", "O2", "O1", "LPC2")] * 2
    assert overlay.run.states == ("x", "w")
    assert overlay.states == ("x",)


def test_a_path_with_a_fast_forcing():
    u, g = sp.symbols("u g")
    laws = {k: sp.cos(2 * t), w: 2 * sp.cos(r * t) ** 2 - 1, u: sp.cos(r * t)}
    full = fs.Model({x: w + u - x + k}, forcing=laws, parameters={r: 0.01})
    frozen = full.frozen(slow={w: 2 * g**2 - 1, u: g}, fast=["k"])
    start = fs.find_orbit(frozen.with_parameters(g=0.5), [0.0])
    branch = fs.continue_orbits(start, "g", over=(0.4, 1.1))
    run = fs.simulate(full, [2.2], t=(0.0, 100.0))
    overlay = fs.overlay(branch, run)
    assert overlay.outcome
    assert overlay.slow == pytest.approx(np.cos(0.01 * overlay.t), abs=1e-9)
    # x(t) = X(w(t) - w' + w'' - …), so that the lag is 1 to first order in the rate
    assert np.nanmedian(overlay.lag) == pytest.approx(1.0, abs=0.02)
    other = fs.Model({x: w + 2 * u - x + k}, forcing=laws, parameters={r: 0.01})
    with pytest.raises(fs.ArgumentError, match="the orbits are of another model"):
        fs.overlay(branch, fs.simulate(other, [2.2], t=(0.0, 100.0)))


def test_a_torus_bifurcation_is_passed_late():
    """Van der Pol's equation, whose forced oscillation gives way to a torus as w decreases."""
    rate = 0.3 * (1 - x**2) * v - x + w * sp.cos(1.6 * t)
    frozen = fs.Model({x: v, v: rate}, forcing={w: t}).frozen(fast=["t"])
    start = fs.find_orbit(frozen.with_parameters(w=3.0), [0.0, 0.0])
    branch = fs.continue_orbits(start, "w", over=(1.8, 3.0))
    (point,) = branch.special("TR")
    ramp = frozen.with_ramp("w", -2e-4, from_value=point["w"] + 0.05)
    (state,) = [orbit(0.0) for orbit in branch.at(w=point["w"] + 0.05)]
    overlay = fs.overlay(branch, fs.simulate(ramp, state + 1e-2, t=(0.0, 1200.0)))
    (left,) = overlay.transitions
    assert (left.type, left.special.label, left.to_branch) == ("torus", "TR1", "")
    assert 0.05 < left.delay < 0.15
    assert overlay.phases[-1].type == "transient"
    # perturbations decay before the point at the rate at which they grow beyond it
    (before,) = overlay.select("t < 50")
    growth = branch.at(w=float(before.slow[0]))[0]
    assert before.relaxation[0] == pytest.approx(
        -growth.period / growth.log_multipliers.max(), rel=1e-3
    )


def test_a_branch_that_ends_at_a_contact():
    """x'' + 0.3x' + x = w + cos(2t)/2, with a push of 2 beyond x = 1: contact at w = 1 - a."""
    push = sp.Piecewise((2, x > 1), (0, True))
    full = fs.Model(
        {x: v, v: w + sp.cos(2 * t) / 2 - x - 0.3 * v + push},
        forcing={w: 0.6 + r * t},
        parameters={r: 1e-3},
    )
    frozen = full.frozen(fast=["t"])
    branches = [
        fs.continue_orbits(fs.find_orbit(frozen.with_parameters(w=0.5), [at, 0]), "w", (0.3, 1.1))
        for at in (0.5, 2.5)
    ]
    contact = 1 - 0.5 / math.hypot(3.0, 0.6)
    assert branches[0].special("GR")["w"] == pytest.approx([contact], abs=1e-12)
    (start,) = branches[0].at(w=0.6)
    run = fs.simulate(full, start(0.0), t=(0.0, 400.0))
    (left,) = fs.overlay(branches, run).transitions
    assert (left.type, left.from_branch, left.to_branch) == ("grazing", "O1", "O2")
    assert left.special.label == "GR1"
    # the run crosses x = 1 for the first time within a period of w = contact
    first = min(c.time for c in run.crossings)
    assert 0.6 + 1e-3 * first == pytest.approx(contact, abs=1e-3 * (math.pi + 2))
    assert left.delay == pytest.approx(0.0, abs=1e-3 * 4 * math.pi)
    alone = fs.overlay(branches[0], run)
    assert [(q.type, q.to_branch) for q in alone.transitions] == [("grazing", "")]
    assert alone.phases[-1].type == "transient"
    # the branch does not exist beyond the contact, which no wider range would change
    assert alone.outcome
    part = fs.overlay(branches[0].select(between=(0.3, 0.7))[0], run)
    assert (part.outcome.code, part.phases[-1].type) == ("outside the diagram", "outside")


def test_a_forcing_that_jumps():
    """x' = w - x + sign(sin t): the orbit is w - tanh(π/2) at whole periods."""
    law = sp.Piecewise((t / 50, t < 25), (sp.Rational(1, 2), True))
    full = fs.Model({x: w - x + sp.sign(sp.sin(t))}, forcing={w: law})
    start = fs.find_orbit(full.frozen(fast=["t"]).with_parameters(w=0.3), [0.0])
    branch = fs.continue_orbits(start, "w", over=(-0.1, 0.6))
    strobed = branch["x"] - branch["w"]
    assert strobed == pytest.approx(np.full(len(branch), -math.tanh(math.pi / 2)), abs=1e-12)
    overlay = fs.overlay(branch, fs.simulate(full, [-1.0], t=(0.0, 60.0)))
    (early,) = overlay.select("t > 10 and t < 25")
    assert (early["x"] - early["w"] + 1 / 50) == pytest.approx(strobed[0], abs=1e-4)
    assert early.lag == pytest.approx(np.ones(len(early)), abs=2e-2)


def test_results_from_files_are_compared(tmp_path):
    of_linear().save(tmp_path / "branch.npz")
    over_linear().run.save(tmp_path / "run.npz")
    again = fs.overlay(fs.load(tmp_path / "branch.npz"), fs.load(tmp_path / "run.npz"))
    assert again == over_linear()
    assert again.outcome


def test_every_type_of_transition_has_a_marker():
    from fastslow.plot.layout.style import TRANSITIONS

    assert set(TRANSITIONS) == set(TYPES)


def test_files_and_slices(tmp_path):
    overlay = over_gear()
    overlay.save(tmp_path / "overlay.npz")
    again = fs.load(tmp_path / "overlay.npz")
    assert again == overlay
    assert again.summary() == overlay.summary()
    assert again["max(x)"] == pytest.approx(overlay["max(x)"], nan_ok=True, abs=0)
    (part,) = overlay.select("w > 0.5", stable_branch="O2")
    assert (part.slow > 0.5).all()
    assert set(part.labels) == {"O2"}
    points = overlay.at(w=0.3)
    assert [p.stable_branch for p in points] == ["O1", "O1"]
    assert all(abs(p["w"] - 0.3) < 2e-3 for p in points)
    assert overlay.select("w > 10") == ()
    up, down = (overlay.at(w=0.3, direction=way) for way in (1, -1))
    assert [*up, *down] == points
    assert overlay.at(w=0.3, region=points[0].region)[0] == points[0]
    with pytest.raises(fs.ArgumentError, match="takes an overlay of equilibria; received one of"):
        overlay.gradient(0, "r")
    jumps = overlay.select(type="jump")
    assert [part.transitions[0].special.label for part in jumps] == ["LPC1", "LPC2"]
    assert "<table" in overlay._repr_html_()
    assert sum(overlay.shares().values()) == pytest.approx(1.0)


def test_a_state_off_all_branches_is_on_none():
    far = fs.overlay(of_linear(), fs.simulate(linear(), [50.0], t=(0.0, 20.0)))
    assert far.followed[0] == -1
    assert far.labels[0] == ""
    assert far.phases[0].type == "transient"


def bad_linear(**laws):
    return fs.simulate(linear(), [0.0], **laws)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bad_linear(t=(0.0, 3.0)), "contains 1 whole multiples .* expected at least 3"),
        (lambda: bad_linear(t=(0.0, 50.0), samples=40, dense=False), "no dense output"),
        (
            lambda: fs.simulate(
                fs.Model({x: w - x + sp.cos(t)}, forcing={w: t / 50}), [0.0], t=(0.0, 50.0)
            ),
            r"another model: they have x' = w - x \+ cos\(2\*t\), the run x' = w - x \+ cos\(t\)",
        ),
        (
            lambda: fs.simulate(fs.Model({x: 1 - x + sp.cos(2 * t)}), [0.0], t=(0.0, 50.0)),
            r"the run x' = -x \+ cos\(2\*t\) \+ 1",
        ),
    ],
)
def test_runs_that_cannot_be_compared(call, message):
    with pytest.raises(fs.ArgumentError, match=message):
        fs.overlay(of_linear(), call())


def test_branches_that_cannot_be_compared():
    run = fs.simulate(linear(), [0.0], t=(0.0, 50.0))
    branch = of_linear()
    with pytest.raises(fs.ArgumentError, match="autonomous model, which has no phase"):
        fs.overlay(replace(branch, multiple=None), run)
    drifting = branch.period * np.linspace(1.0, 1.1, len(branch))
    with pytest.raises(fs.ArgumentError, match="the period of the forcing varies"):
        fs.overlay(replace(branch, period=drifting), run)
    with pytest.raises(fs.ArgumentError, match="branches differ in parameter"):
        fs.overlay([of_linear(), of_gear()], run)
    with pytest.raises(fs.ArgumentError, match="observed= is the state"):
        fs.overlay(of_linear(), run, observed="x")


def test_incomplete_overlays_have_an_outcome():
    run = fs.simulate(linear(), [0.0], t=(0.0, 150.0))
    overlay = fs.overlay(of_linear(), run)
    assert overlay.outcome.code == "outside the diagram"
    assert "continue the orbits over the whole range" in repr(overlay)
    assert overlay.phases[-1].type == "outside"


def test_a_slow_quantity_at_rest_and_branches_without_stable_orbits():
    rest = gear(r * t).frozen(fast=["k"]).with_ramp("w", 0.0, from_value=0.3)
    (start,) = of_gear().at(w=0.3)
    overlay = fs.overlay(of_gear(), fs.simulate(rest, start(0.0), t=(0.0, 100.0)))
    assert overlay.outcome.code == "at rest"
    assert overlay.distance.max() < 1e-6
    assert np.isnan(overlay.lag).all()
    unstable = [part for part in of_gear().select(stable=False) if len(part) > 2]
    none = fs.overlay(unstable, over_gear().run)
    assert "the branches have no stable orbit" in repr(none)
    assert (none.stable_branches, set(none.labels)) == ((), {""})
    assert np.isinf(none.distance).all()


def test_strobes_are_whole_periods_of_the_forcing_from_time_zero():
    late = fs.simulate(linear(), [0.0], t=(1.0, 50.0))
    assert fs.overlay(of_linear(), late).t == pytest.approx(math.pi * np.arange(1, 16), abs=1e-12)


def stepped(law):
    """The gear pair with one or two pairs of teeth in mesh, of different stiffness."""
    mesh = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    period = 2 * sp.pi / Omega
    stiffness = sp.Piecewise(
        (1 + epsilon, sp.Mod(t, period) < sp.Rational(3, 5) * period), (1 - epsilon, True)
    )
    return fs.Model(
        {x: v, v: w - c * v - k * mesh},
        forcing={k: stiffness, w: law},
        parameters={epsilon: 0.3, Omega: 0.8, c: 0.1, D: 0.5, r: 1e-3},
    )


def test_a_run_is_followed_through_corner_collisions():
    full = stepped(0.45 - 0.35 * sp.cos(r * t))
    orbit = fs.find_orbit(full.frozen(fast=["k"]).with_parameters(w=1), [1.5, 0])
    branch = fs.continue_orbits(orbit, "w", over=(0.05, 1.0))
    (start,) = branch.at(w=0.1, stable=True)
    run = fs.simulate(full, start(0.0), t=(0.0, 2 * math.pi / 1e-3))
    overlay = fs.overlay(branch, run)
    assert overlay.outcome
    corners = [one for one in overlay.transitions if one.special and one.special.code == "CC"]
    assert [one.special.label for one in corners] == ["CC1", "CC3", "CC3", "CC2"]
    period = 2 * math.pi / 0.8
    for one in corners:
        assert one.type == "crossing"
        assert not one.note
        assert 0 < one.delay < 0.01
        # the run crosses the interface on the other side of the instant from that strobe on
        name = one.special.interface.split(" and ")[0]
        phase = one.special.time % period
        times = np.array([at.time for at in run.crossings(name)])
        beside = [
            times[np.argmin(np.abs(times - (one.time + n * period + phase)))]
            - (one.time + n * period + phase)
            for n in (-1, 0)
        ]
        assert beside[0] * beside[1] < 0
        assert max(map(abs, beside)) < 0.05 * period
    jumps = overlay.transitions.select(type="jump")
    assert [one.special.label for one in jumps] == ["LPC1", "LPC2"]


def test_an_impact_by_event_is_followed_until_the_orbit_loses_it():
    # the amplitude of the linear motion is w / |−3 + 0.4i|, 1 at the grazing
    def bouncing(**given):
        bounce = fs.Event((x > 1) & (v > 0), {v: -v / 2})
        rates = {x: v, v: -x - v / 5 + w * sp.cos(2 * t)}
        return fs.Model(rates, events={"bounce": bounce}, **given)

    frozen = bouncing(parameters={w: 2})
    branches = [
        fs.continue_orbits(
            fs.find_orbit(frozen.with_parameters(w=start), [0, 0]), "w", over=(1.5, 5)
        )
        for start in (4.5, 2)
    ]
    run = fs.simulate(bouncing(forcing={w: 4.5 - r * t}, parameters={r: 2e-3}), [0, 0], t=(0, 1400))
    overlay = fs.overlay(branches, run)
    (transition,) = overlay.transitions
    assert (transition.from_branch, transition.to_branch) == ("O1", "O2")
    assert transition.value == pytest.approx(abs(-3 + 0.4j), abs=0.02)
    assert np.nanmedian(overlay.distance) < 0.01
    assert len(run.events) > 200
