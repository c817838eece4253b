"""Branches of periodic orbits, with folds, doublings and contacts known from elsewhere."""

import re
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

import fastslow as fs
from fastslow.continuation import curves
from fastslow.orbits.find.orbit_curve import CurveSystem, same_direction
from fastslow.orbits.flow.segments import restarted
from fastslow.results.orbits.special_orbit import SpecialOrbits
from tests.orbits.models import gear_pair, t, two_sided, v, van_der_pol, x

pytestmark = pytest.mark.slow

#: Steps that are large enough where a test does not look at the rows between its points.
COARSE = fs.Continuation(max_step=0.1)

#: Where contact is lost: Fa W^2 = Fm sqrt((1 - W^2)^2 + 4 z^2 W^2), the positive roots.
Z, FM, FA = 0.05, 0.1, 0.05
GRAZINGS = np.sqrt(
    np.sort(
        np.roots([FA**2 - FM**2, FM**2 * (2 - 4 * Z**2), -(FM**2)]).real,
    )
)


@pytest.fixture(scope="module")
def gear():
    orbit = fs.find_orbit(gear_pair(W=0.75), [1.1, 0.0])
    return fs.continue_orbits(orbit, "W", over=(0.5, 1.6))


def test_folds_of_the_gear_pair(gear):
    assert gear.outcome
    folds = [point["W"] for point in gear.special("LPC")]
    assert np.abs(np.array(folds) - [0.8284639844, 0.7080316187]).max() < 6e-11
    assert all(point.converged for point in gear.special)
    assert np.abs(gear["LPC1"].multipliers - 1).min() < 1e-6


def test_grazings_of_the_gear_pair(gear):
    found = [point["W"] for point in gear.special("GR")]
    assert np.abs(np.array(found) - GRAZINGS).max() < 1e-12
    assert [point.type for point in gear.special("GR")] == ["transition"] * 2
    for point in gear.special("GR"):
        assert point.interface == "x - 1"
        assert abs(point.state[0] - 1) < 1e-12
        assert abs(point.state[1]) < 1e-10
        assert point.exponent == 1.5
        assert point.orbit["min(x)"] == pytest.approx(1, abs=1e-12)


def test_orbits_of_another_stability_are_not_solved_for(gear):
    solved = []

    def corrector(orbit, value):
        solved.append(value)
        return gear.corrector(orbit, value)

    counted = replace(gear, corrector=corrector)
    assert [len(counted.at(W=0.76, stable=stable)) for stable in (True, False)] == [2, 1]
    assert solved == [0.76] * 3


def test_queries_of_a_branch(gear):
    low, middle, high = gear.at(W=0.75)
    assert (low.stable, middle.stable, high.stable) == (True, False, True)
    assert low["max(x)"] < middle["max(x)"] < high["max(x)"]
    assert gear.at(W=0.75, stable=False)[0] == middle
    assert [len(found) for found in gear.at(W=[0.6, 0.8])] == [1, 3]
    # contact without loss: the linear response about 1 + Fm
    force, W = 0.05 * 0.75**2, 0.75
    gain = force / np.hypot(1 - W**2, 0.1 * W)
    assert low["max(x)"] == pytest.approx(1.1 + gain, abs=1e-12)
    assert low["rms(x - 11/10)"] == pytest.approx(gain / np.sqrt(2), abs=1e-12)
    assert gear["period"] == pytest.approx(2 * np.pi / gear["W"], rel=1e-14)
    assert np.abs(gear["x"] - [orbit(0.0)[0] for orbit in gear]).max() == 0
    assert set(gear["hits"]) == {0, 2}
    assert gear["max(x) - min(x)"].shape == gear.values.shape
    ends = gear.stable_intervals()
    assert ends == pytest.approx(
        np.array([[0.5, gear["LPC1"]["W"]], [gear["LPC2"]["W"], 1.6]]), rel=1e-15
    )
    (unstable,) = gear.select(stable=False)
    assert (~unstable.stable).all()
    assert len(gear.select(code="GR")) == 1
    losing = gear.select(itinerary=("S1", "S2"), stable=True)
    assert {tuple(sorted(route)) for part in losing for route in part.itineraries} == {("S1", "S2")}
    assert gear.at(W=0.75, itinerary=["S2", "S1"]) == [middle, high]
    with pytest.raises(fs.UnknownNameError, match="unknown itinerary 'S2 → S3'"):
        gear.select(itinerary=("S2", "S3"))
    assert len(gear.special("TR")) == 0
    assert gear[:] is gear
    with pytest.raises(fs.ArgumentError, match="rows 5 to 5 contain none of the"):
        gear[5:5]
    part = gear[10:20]
    assert part.outcome.code == "cut"
    assert part.values.tolist() == gear.values[10:20].tolist()
    assert part[0] == gear[10]
    assert gear.nearest(W=0.5) in (gear[0], gear[-1])
    # between rows it is solved for
    near = gear.nearest(W=0.7512, x=high(0.0)[0])
    assert near.parameters["W"] not in gear.values
    assert near.accuracy < 1e-12
    assert near["max(x)"] == pytest.approx(high["max(x)"], abs=0.02)
    assert gear["GR1"].code == "GR"
    assert gear[3].parameters["W"] == gear.values[3]
    assert set(gear.to_dict()) >= {"W", "period", "max(x)", "stability", "label"}


def test_liouville_along_a_branch(gear):
    assert gear.log_multipliers.sum(axis=1) == pytest.approx(-2 * Z * gear.period, rel=1e-12)
    assert gear.errors[:, 0].max() < 1e-11
    assert gear.errors[:, 1:].max() < 1e-9


def test_no_jump_to_another_orbit(gear):
    steps = np.abs(np.diff(np.column_stack([gear.values, gear["max(x)"]]), axis=0))
    assert steps.max() < 0.1


def test_files_of_a_branch(gear, tmp_path):
    gear.save(tmp_path / "gear.npz")
    again = fs.load(tmp_path / "gear.npz")
    assert again == gear
    assert repr(again) == repr(gear)
    assert (again["rms(x)"] == gear["rms(x)"]).all()
    assert again["LPC1"]["W"] == gear["LPC1"]["W"]
    # between rows without equations: interpolated in each segment
    for W in (0.6, 0.76, 1.3):
        for exact, orbit in zip(gear.at(W=W), again.at(W=W), strict=True):
            assert "It is interpolated between rows, at W = " in str(orbit.outcome)
            assert orbit.itinerary == exact.itinerary
            assert orbit.parameters == exact.parameters
            assert orbit.period == pytest.approx(exact.period, rel=1e-4)
            assert orbit["max(x)"] == pytest.approx(exact["max(x)"], abs=1e-4)
            assert orbit["rms(v)"] == pytest.approx(exact["rms(v)"], abs=1e-4)
            assert orbit.log_multipliers == pytest.approx(exact.log_multipliers, abs=1e-3)
            times = np.linspace(0, exact.period, 100)
            assert np.abs(orbit(times) - exact(times)).max() < 1e-3
            assert np.isnan(orbit.residual)
    # across a contact the nearest row
    row = next(k for k in range(len(gear) - 1) if gear.itineraries[k] != gear.itineraries[k + 1])
    W = 0.9 * gear.values[row] + 0.1 * gear.values[row + 1]
    assert any("This is the row at" in str(one.outcome) for one in again.at(W=W))
    assert len(repr(gear).splitlines()) <= 10
    assert "<table>" in gear._repr_html_()


def test_grazing_of_the_bilinear_oscillator():
    z, omega, beta, f = sp.symbols("z omega beta f")
    rate = f * sp.cos(omega * t) - 2 * z * v - x - beta * sp.Max(x - 1, 0)
    values = {z: 0.01, omega: 0.8, beta: 5, f: 0.3}
    orbit = fs.find_orbit(fs.Model({x: v, v: rate}, parameters=values), [0.8, 0])
    branch = fs.continue_orbits(orbit, "f", over=(0.2, 0.4))
    assert branch.outcome
    (grazing,) = branch.special("GR")
    assert grazing["f"] == pytest.approx(0.36035538014576665953863666607, rel=1e-14)
    assert branch.itineraries[-1] == ("S1", "S2")
    # the multipliers are continuous there, and move like a square root
    doubling = branch["PD1"]
    assert abs(doubling.multipliers + 1).min() < 1e-9
    wider = fs.continue_orbits(orbit, "f", over=(0.2, 0.5))
    assert wider["PD1"]["f"] == pytest.approx(doubling["f"], rel=1e-11)


def test_period_doubling_of_the_duffing_oscillator():
    F = sp.Symbol("F")
    rate = x - x**3 - 0.3 * v + F * sp.cos(1.2 * t)
    model = fs.Model({x: v, v: rate}, parameters={F: 0.2})
    branch = fs.continue_orbits(
        fs.find_orbit(model, [1, 0]), "F", over=(0.1, 0.3), continuation=COARSE
    )
    (point,) = branch.special("PD")
    assert abs(point.multipliers + 1).min() < 1e-9
    value = point["F"]
    below, above = (branch.at(F=value * k)[0] for k in (0.999, 1.001))
    assert below.stable
    assert above.stability == "unstable"
    assert branch.stable_intervals()[0][1] == value
    doubled = fs.find_orbit(model.with_parameters(F=value * 1.02), [1, 0], multiple=2)
    assert doubled.stable
    assert doubled.outcome.notes == ()


def test_changes_of_stability_without_a_special_point(gear):
    assert gear.unexplained == ()
    bare = replace(gear, special=SpecialOrbits(), special_rows=())
    folds = [
        row
        for point, row in zip(gear.special, gear.special_rows, strict=True)
        if point.code == "LPC"
    ]
    # the row of a fold has the multiplier 1, and no number of unstable ones
    assert [change.rows for change in bare.unexplained] == [(row - 1, row + 1) for row in folds]
    assert {(c.before, c.after) for c in bare.unexplained} == {(0, 1), (1, 0)}
    assert "0 to 1 unstable multipliers between W = " in repr(bare)


def test_autonomous_branch():
    branch = fs.continue_orbits(
        fs.find_orbit(van_der_pol(1), [2, 0]), "mu", over=(0.5, 2), continuation=COARSE
    )
    assert branch.outcome
    (orbit,) = branch.at(mu=1)
    assert abs(orbit.period - 6.66328685932) < 5e-12
    for mu, period in zip(branch.values[::5], branch.period[::5], strict=True):
        assert fs.find_orbit(van_der_pol(mu), [2, 0]).period == pytest.approx(period, rel=1e-12)
    assert branch.stable.all()


def test_two_touches_at_once_of_a_symmetric_orbit():
    orbit = fs.find_orbit(two_sided(F=1.5, omega=0.7), [0, 0])
    branch = fs.continue_orbits(orbit, "omega", over=(0.45, 0.85), continuation=COARSE)
    assert branch.outcome
    (grazing,) = branch.special("GR")
    assert grazing.orbit["max(x)"] == pytest.approx(-grazing.orbit["min(x)"], abs=1e-11)
    for number, orbit in enumerate(branch):
        if number not in branch.special_rows:
            assert np.abs(orbit(0.3) + orbit(0.3 + orbit.period / 2)).max() < 1e-10
    # symmetry is broken at a branch point
    assert [point.code for point in branch.special if point.code == "BPC"] == ["BPC"]


def test_an_event_that_passes_the_start_of_an_orbit_is_no_contact():
    orbit = fs.find_orbit(two_sided(F=1.5, omega=0.7), [0, 0])
    branch = fs.continue_orbits(orbit, "omega", over=(0.65, 1.3), continuation=COARSE)
    assert branch.outcome
    assert {point.code for point in branch.special} == {"BPC"}
    assert len(set(branch.itineraries)) == 1


def test_marks_are_rows():
    orbit = fs.find_orbit(gear_pair(W=0.6), [1.1, 0.0])
    branch = fs.continue_orbits(orbit, "W", over=(0.55, 0.65), marks=[0.57, 0.62])
    assert [point["W"] for point in branch.special("UZ")] == [0.57, 0.62]
    assert {0.57, 0.62} <= set(branch.values)


def test_stick_slip_branch():
    speed = sp.Symbol("speed")
    slip = v - speed
    friction = sp.sign(slip) * 0.3 / (1 + 3 * sp.Abs(slip))
    model = fs.Model({x: v, v: -x - 0.05 * v - friction}, parameters={speed: 0.2})
    branch = fs.continue_orbits(
        fs.find_orbit(model, [0.5, 0]), "speed", over=(0.1, 0.4), continuation=COARSE
    )
    assert branch.outcome
    assert (branch.log_multipliers[:, -1] == -np.inf).all()
    assert branch.stable.all()


def test_adding_sliding_is_crossed_in_both_directions():
    """While x follows y, x' = y' is known in closed form; sliding ends where |y'| = 2."""
    y, a = sp.symbols("y a")
    model = fs.Model({x: -2 * sp.sign(x - y), y: a * sp.cos(t) + sp.cos(2 * t) / 2 - y},
                     parameters={a: 2.6})  # fmt: skip

    def follows(time, amplitude):
        return (
            amplitude * (np.cos(time) + np.sin(time)) / 2
            + (np.cos(2 * time) + 2 * np.sin(2 * time)) / 10
        )

    def rate(time, amplitude):
        forced = amplitude * np.cos(time) + np.cos(2 * time) / 2
        return forced - follows(time, amplitude)

    times = np.linspace(1.5, 2.5, 100_001)
    exact = brentq(lambda amplitude: rate(times, amplitude).min() + 2, 2.6, 3.0, xtol=1e-13)
    leaves = brentq(lambda time: rate(time, 2.95) + 2, 1.5, 1.9)
    line = follows(leaves, 2.95) + 2 * leaves
    returns = brentq(lambda time: follows(time, 2.95) + 2 * time - line, leaves + 0.3, 3.5)
    for value in (2.6, 2.9):
        orbit = fs.find_orbit(model.with_parameters(a=value), [0, 0])
        branch = fs.continue_orbits(orbit, "a", (2.6, 3.0), marks=[2.95], continuation=COARSE)
        assert [point.code for point in branch.special] == ["AS", "UZ"]
        assert all(branch.outcomes)
        point, mark = branch.special
        assert point["a"] == pytest.approx(exact, rel=1e-9)
        assert point.type == "transition"
        phases = mark.orbit.trajectory.crossing_table[:, 0] % (2 * np.pi)
        for time in (leaves, returns):
            assert np.abs(phases - time).min() < 1e-9


def test_switching_sliding_is_crossed_in_both_directions():
    speed = sp.Symbol("speed")
    slip = v - speed
    friction = sp.sign(slip) * 0.3 / (1 + 3 * sp.Abs(slip))
    model = fs.Model({x: v, v: -x - 0.05 * v - friction}, parameters={speed: 0.5})
    up = fs.continue_orbits(
        fs.find_orbit(model, [0.5, 0]), "speed", over=(0.48, 0.54), continuation=COARSE
    )
    down = fs.continue_orbits(up.at(speed=0.53)[0], "speed", over=(0.49, 0.54), continuation=COARSE)
    for branch in (up, down):
        assert branch.outcome
        (point,) = branch.special("SS")
        # the drift beyond the belt's speed vanishes at the end of slip: x = -0.05 speed - 0.3
        value = point["speed"]
        assert point.state[0] == pytest.approx(-0.05 * value - 0.3, abs=1e-12)
        assert {len(route) for route in branch.itineraries} == {2, 3}
    assert up["SS1"]["speed"] == pytest.approx(down["SS1"]["speed"], rel=1e-12)


#: Jump of the force at x = 1, frequency and damping.
STOPS = np.random.default_rng(11).uniform([-1.5, 0.5, 0.05], [3, 2.5, 0.4], (8, 3)).round(2)


@pytest.mark.sample(2)
@pytest.mark.parametrize("values", STOPS, ids=str)
def test_square_root_grazing_ends_a_branch_or_is_passed(values):
    """The force jumps at a position: the linear orbit of amplitude 1 grazes."""
    k, omega, damping = values
    a = sp.Symbol("a")
    rate = a * sp.cos(omega * t) - x - damping * v - k * sp.Heaviside(x - 1)
    exact = np.hypot(1 - omega**2, damping * omega)
    model = fs.Model({x: v, v: rate}, parameters={a: 0.7 * exact})
    few = fs.Continuation(max_step=0.05)
    over = 0.5 * exact, 1.6 * exact
    branch = fs.continue_orbits(fs.find_orbit(model, [0, 0]), "a", over=over, continuation=few)
    touch = branch["GR1"]
    assert touch["a"] == pytest.approx(exact, rel=1e-12)
    assert touch.exponent == 0.5
    assert touch.orbit["max(x)"] == pytest.approx(1, abs=1e-5)
    # one orbit after another
    columns = branch.values / exact, branch["max(x)"], branch["min(x)"]
    assert np.abs(np.diff(columns)).max() < 0.1
    if touch.type:
        assert branch.outcome
        assert {len(route) for route in branch.itineraries} == {1, 2}
        return
    assert branch.outcome.code == "end at a contact"
    # what begins beside the orbit beyond the contact does not remain there
    beyond = model.with_parameters(a=1.001 * exact)
    state, period = touch.orbit(0.0), touch.orbit.period
    run = fs.simulate(beyond, state, t=(0, 40 * period))
    assert np.abs(run.end[1:] - state).max() > 0.1


def test_a_belt_gives_grazing_sliding():
    """The mass slips until its velocity reaches that of the belt, as the linear one does."""
    a, omega, damping, belt = sp.Symbol("a"), 0.8, 0.1, 0.5
    friction = sp.Piecewise((-2, v > belt), (2, True))
    rate = a * sp.cos(omega * t) - x - damping * v + friction
    exact = belt * np.hypot(1 - omega**2, damping * omega) / omega
    model = fs.Model({x: v, v: rate}, parameters={a: 0.9 * exact})
    over = 0.85 * exact, 1.15 * exact
    branch = fs.continue_orbits(
        fs.find_orbit(model, [2.0, 0.0]), "a", over=over, continuation=COARSE
    )
    assert branch.outcome
    (touch,) = branch.special("GS")
    assert touch["a"] == pytest.approx(exact, rel=1e-12)
    assert (touch.exponent, touch.type) == (1.0, "transition")
    # beyond it the mass sticks, and one multiplier is 0
    beyond = branch.at(a=1.1 * exact)[0]
    assert len(beyond.itinerary) == 2
    assert beyond.log_multipliers[-1] == -np.inf
    run = fs.simulate(beyond.model, [2.0, 0.0], t=(0, 60 * beyond.period))
    assert np.abs(run.end[1:] - beyond(0.0)).max() < 1e-9


def test_dry_friction_gives_crossing_sliding():
    """Den Hartog (1931): motion without stops up to k = a V r² / √(1 + U² r⁴)."""
    k, r = sp.Symbol("k"), 0.9
    V, U = 1 / (1 - r**2), np.sin(np.pi / r) / (r * (1 + np.cos(np.pi / r)))
    exact = V * r**2 / np.hypot(1, U * r**2)
    rate = sp.cos(r * t) - x - k * sp.sign(v)
    model = fs.Model({x: v, v: rate}, parameters={k: 0.9 * exact})
    start = fs.simulate(model, [1.0, 0.0], t=(0, 200 * 2 * np.pi / r))
    orbit = fs.find_orbit(model, start)
    branch = fs.continue_orbits(orbit, "k", over=(0.85 * exact, 1.05 * exact), continuation=COARSE)
    assert branch.outcome
    (touch,) = branch.special("CS")
    assert touch["k"] == pytest.approx(exact, rel=1e-12)
    assert touch.type == "transition"
    assert [len(branch.itineraries[row]) for row in (0, -1)] == [2, 4]
    # beyond it there is a stop at both ends of the motion; back to the motion without
    stops = branch.at(k=1.04 * exact)[0]
    run = fs.simulate(stops.model, [1.0, 0.0], t=(0, 40 * stops.period))
    assert np.abs(run.end[1:] - stops(0.0)).max() < 1e-9
    back = fs.continue_orbits(stops, "k", over=(0.97 * exact, 1.05 * exact), continuation=COARSE)
    assert back.outcome
    assert back["CS1"]["k"] == pytest.approx(exact, rel=1e-12)
    assert {len(route) for route in back.itineraries} == {2, 4}


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("ratio", "start"),
    [(0.7, [0, 0]), (0.7, [1, 1]), (0.6, [0, 0])],
    ids=["", "other phase", "stops"],
)
def test_the_limit_of_stops_over_the_frequency(ratio, start):
    """An edge of sliding, also where the next segment touches the interface beyond it."""
    r = sp.Symbol("r")
    rate = sp.cos(r * t) - x - 0.6 * sp.sign(v)
    orbit = fs.find_orbit(fs.Model({x: v, v: rate}, parameters={r: ratio}), start)
    branch = fs.continue_orbits(orbit, "r", over=(0.55, 0.9), continuation=COARSE)
    assert branch.outcome
    (edge,) = branch.special()
    # root of the friction at the limit of stops (Den Hartog 1931) = 0.6
    assert (edge.code, edge.interface, edge.type) == ("CS", "v", "transition")
    assert edge["r"] == pytest.approx(0.6329711910101963, rel=1e-12)


GEAR = fs.systems.harmonic_gear(A=41.67, B=2.372, C=3.546, D=0.25, omega=7.5)


@pytest.mark.sample(0)
def test_the_same_points_from_both_ends():
    few = fs.Continuation(max_step=0.1)
    points = []
    for omega in (1.36, 1.5):
        orbit = fs.find_orbit(GEAR.with_parameters(omega=omega), [0.4, 0.0])
        branch = fs.continue_orbits(orbit, "omega", over=(1.36, 1.5), continuation=few)
        assert branch.outcome
        points.append(sorted((p.code, p.type, round(p["omega"], 9)) for p in branch.special))
        # a fixed time that is many periods from 0 would be another phase at another frequency
        assert max(abs(one.t0) for one in branch) <= branch.period.max()
    assert points[0] == points[1]
    assert [code for code, _, _ in points[0]].count("GR") >= 4


def test_a_fold_beside_a_non_smooth_fold():
    """Orbits of two periods graze, turn, and turn again 4e-9 below."""
    orbit = fs.find_orbit(GEAR.with_parameters(omega=1.12), [0.4, 0.0])
    simple = fs.continue_orbits(orbit, "omega", over=(1.11, 1.16))
    point = min(simple.special("PD"), key=lambda one: one["omega"])
    double = fs.find_orbit(GEAR, point)
    branch = fs.continue_orbits(double, "omega", over=(1.13, 1.1345))
    touch, fold = branch["GR1"], branch["LPC1"]
    assert touch.type == "non-smooth fold"
    assert fold.converged
    assert 0 < touch["omega"] - fold["omega"] < 1e-8
    assert abs(fold.multipliers - 1).min() < 1e-6


def test_a_tangent_keeps_its_direction_at_a_fold_where_the_start_moves(gear):
    source = gear["LPC2"].source
    shooting, u = source.shooting, source.u
    here = source.problem.at(shooting.parameters_at(u))
    segments, period = shooting.unpack(u)
    moved = restarted(segments, period, shooting.winding, here.variations, here.parameters)
    assert abs(moved.start - shooting.form.start) > 1e-3 * period
    other = replace(shooting, form=moved)
    again = np.append(other.pack(moved, period)[: other.size], u[-1])
    pairs = []
    for equations, unknowns in ((shooting, u), (other, again)):
        frame = curves.Frame(len(u), np.ones(len(u)), *np.empty((2, 0)))
        pairs.append((equations, unknowns, curves.tangent(CurveSystem(equations), unknowns, frame)))
    known, (_, _, turned) = pairs
    n = 2
    for sign in (1.0, -1.0):
        kept = same_direction(known, (other, again, sign * turned))
        # the velocities at both events
        assert kept[n : 3 * n] @ known[2][n : 3 * n] > 0


def found():
    return fs.find_orbit(gear_pair(W=0.6), [1.1, 0.0])


WRONG = {
    "range": (lambda: fs.continue_orbits(found(), "W", over=(1, 2)), "outside over"),
    "mark": (
        lambda: fs.continue_orbits(found(), "W", over=(0.5, 0.7), marks=[3]),
        "mark W = 3 is outside the range",
    ),
    "parameter": (lambda: fs.continue_orbits(found(), "V", over=(0, 1)), "unknown parameter"),
    "orbit": (lambda: fs.continue_orbits(gear_pair(), "W", over=(0, 1)), "expected an Orbit"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_arguments(case):
    call, words = WRONG[case]
    with pytest.raises(fs.FastSlowError, match=words):
        call()


def test_a_touched_threshold_of_a_switch_is_named():
    # a van der Pol oscillator with a relay, whose cycle no longer reaches v = 1/2
    v, w, q, a = sp.symbols("v w q a")
    half = sp.Rational(1, 2)
    relay = fs.Model(
        {v: w, w: (1 - v**2) * w / 2 - v + a * (1 - 2 * q)},
        switches={q: (v > half, v < -half)},
        parameters={a: -0.1},
    )
    orbit = fs.find_orbit(relay, {v: 2, w: 0})
    assert "0 crossings, 2 changes of switches" in repr(orbit)
    branch = fs.continue_orbits(orbit, "a", over=(-0.6, -0.1), continuation=COARSE)
    assert branch["GR1"].interface == "threshold of q"


def test_a_family_of_linear_centres_has_no_folds():
    # at a = 0 the motion below x = 1 is x'' + x = 0, and all cycles there have the period 2 pi
    a = sp.Symbol("a")
    model = fs.Model({x: v, v: -x + a * v - sp.Max(x - 1, 0) * v}, parameters={a: 0.1})
    branch = fs.continue_orbits(
        fs.find_orbit(model, [1, 0]), "a", over=(-0.1, 0.1), continuation=COARSE
    )
    assert branch.outcomes[0].code == "Hopf point"
    assert np.isclose(branch["period"].min(), 2 * np.pi, rtol=0, atol=1e-12)
    (touch,) = branch.special()
    assert touch.code == "GR"
    assert abs(touch["a"]) < 1e-12


def test_cycles_end_at_a_hopf_point_that_is_passed_at_a_small_distance():
    # the power system of Dobson and Chiang (1989): beside the second Hopf point, at 11.406747558842
    # (mpmath), the phase of the cycles turns in two steps, and the branch was traced backwards
    d, V, w, dm, Q = sp.symbols("d V w dm Q")
    fast, near = sp.cos(d - dm - 0.08727) * V, sp.cos(d - dm - 0.01241) * V
    load = 496.87181 * V**2 - 166.66667 * fast - 666.66667 * sp.cos(d - 0.20944) * V
    sag = -78.76384 * V**2 + 26.21722 * near + 104.86887 * sp.cos(d - 0.13458) * V
    model = fs.Model(
        {
            dm: w,
            w: 16.66667 * sp.sin(d - dm + 0.08727) * V - 0.16667 * w + 1.88074,
            d: load - 93.33333 * V + 33.33333 * Q + 43.33333,
            V: sag + 14.52288 * V - 5.22876 * Q - 7.03268,
        },
        parameters={Q: 11.4},
    )
    begin = fs.simulate(model, {dm: 0.3445, w: 0, d: 0.1362, V: 0.9426}, t=(0, 100)).final_state
    orbit = fs.find_orbit(model, begin)
    # the last cycle is so small that rounding limits the equilibrium in units of its range
    settings = fs.Continuation(max_step=0.055)
    branch = fs.continue_orbits(orbit, "Q", over=(11.4 - 1e-9, 11.42), continuation=settings)
    assert branch.outcome.code == "Hopf point"
    assert abs(branch["Q"][-1] - 11.406747558842) < 1e-4
    assert (np.diff(branch["Q"]) > 0).all()
    assert len(branch.special) == 0


def test_cycles_that_shrink_to_an_equilibrium_on_an_interface_are_no_hopf_cycles():
    """Predators feed on prey above a refuge c: m = 0.6 x/(0.3 + x) at x = 0.15, so c = 0.15."""
    prey, c = sp.symbols("prey c")
    eaten = sp.Piecewise((prey * v / (0.3 + prey), prey > c), (0, True))
    model = fs.Model(
        {prey: prey * (1 - prey) - eaten, v: 0.6 * eaten - v / 5},
        parameters={c: 0.14},
        interfaces={"refuge": prey - c},
    )
    branch = fs.continue_orbits(fs.find_orbit(model, [0.2, 0.4]), "c", over=(0.138, 0.16))
    assert [o.code for o in branch.outcomes] == ["end of range", "boundary equilibrium"]
    assert "on refuge at c = 0.15." in str(branch.outcomes[1])


@pytest.mark.parametrize("factor", [1, 0.9])
def test_a_cycle_through_a_two_fold_ends_its_branch(factor):
    """With a < 0 both fields of the relay leave x = 0 at v = 0, where the last cycle passes.

    Half of it solves x'' = (1 - x**2) x' - x - a from (0, 0) to (0, 0); its a and period are
    from SciPy (rtol = 1e-12, fsolve).
    """
    a = sp.Symbol("a")
    relay = fs.Model({x: v, v: (1 - x**2) * v - x - a * sp.sign(x)}, parameters={a: -0.85})
    settings = fs.Continuation(step=0.01 * factor, max_step=0.02 * factor)
    branch = fs.continue_orbits(
        fs.find_orbit(relay, [3, 0]), "a", over=(-1, -0.8), continuation=settings
    )
    assert [outcome.code for outcome in branch.outcomes] == ["end at a contact", "end of range"]
    assert "two-fold" in str(branch.outcomes[0])
    (end,) = branch.special()  # no branch point beside it, and no sliding
    assert end.code == "GR"
    assert np.isclose(end["a"], -0.91855338, rtol=0, atol=1e-8)
    assert np.isclose(end.orbit.period, 2 * 6.98755602, rtol=0, atol=2e-5)
    assert np.abs(end.state).max() < 1e-6
    assert np.isnan(end.multipliers).all()


def test_cycles_that_grow_without_bound_end_their_branch(monkeypatch):
    # r' = r (a - r/(1 + r)): a cycle of radius a/(1 - a)
    monkeypatch.setattr("fastslow.orbits.trace.branch_ends.LARGEST_GROWTH", 4.0)
    a, r = sp.Symbol("a"), sp.sqrt(x**2 + v**2)
    rates = {x: x * (a - r / (1 + r)) - v, v: v * (a - r / (1 + r)) + x}
    orbit = fs.find_orbit(fs.Model(rates, parameters={a: 0.5}), [1, 0])
    branch = fs.continue_orbits(orbit, "a", over=(0.45, 2), continuation=COARSE)
    assert branch.outcomes[1].code == "amplitude unbounded"
    assert 0.8 < branch["a"].max() < 0.85


def test_a_switch_whose_threshold_is_reached_with_speed_zero_ends_a_branch():
    """The current of a boost converter with hysteresis turns back before its lower threshold.

    Without the input the flow is linear with the focus (1/2, 5). The orbit with i = I - δ and
    v = 5 at the end of this phase is solved for by SciPy (expm, fsolve).
    """
    i, u, q, level = sp.symbols("i u q I")
    tenth = sp.Rational(1, 10)
    boost = fs.Model(
        {i: 5 - (1 - q) * u, u: 10 * (1 - q) * i - u},
        switches={q: (i < level - tenth, i > level + tenth)},
        parameters={level: 0.55},
    )
    branch = fs.continue_orbits(fs.find_orbit(boost, {i: 0, u: 0}), "I", over=(0.5, 0.56))
    assert branch.outcomes[0].code == "end at a contact"
    touch, doubling = branch.special()
    assert (touch.code, doubling.code) == ("GR", "PD")
    assert touch.interface == "threshold of q"
    assert np.isclose(touch["I"], 0.51943969418194, rtol=0, atol=1e-12)
    assert np.allclose(touch.state, [0.41943969418194, 5], rtol=0, atol=1e-10)
    assert np.isnan(touch.multipliers).all()


@pytest.mark.sample(1)
@pytest.mark.parametrize(("decay", "share"), [(2, 0.5), (0.5, 1e-4)])
def test_a_saddle_in_a_model_with_resets_ends_a_branch(decay, share):
    """From x = p + c y_1, y = 1 the saddle x' = x, y' = -d y takes T = -ln x to x = 1.

    There y_1 = x**d, so that p = x - c x**d with x = exp(-T), whatever is the smaller eigenvalue.
    """
    p = sp.Symbol("p")
    model = fs.Model(
        {x: x, v: -decay * v}, resets={x >= 1: {x: p + share * v, v: 1}}, parameters={p: 0.1}
    )
    branch = fs.continue_orbits(fs.find_orbit(model, [0.1, 1]), "p", over=(-0.1, 0.2))
    near = np.exp(-branch.period)
    assert np.allclose(branch["p"], near - share * near**decay, rtol=0, atol=1e-13)
    end = branch.outcomes[0]
    assert end.code == "homoclinic with resets"
    assert "a candidate for a homoclinic orbit" in str(end)
    assert float(re.search("≈ (.*?),", str(end))[1]) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("factor", [1, 0.97])
def test_a_corner_of_two_interfaces_is_crossed_with_the_itinerary_of_a_run(factor):
    """Ice grows with the rate A/(1 - E) and melts with A = p + cos t, water cools with -E.

    E = 0 is touched at a zero of A, where two events appear or vanish at once. At the end of
    melting, t = b = arccos(-p), E = 0; growth to 2 pi - b gives (E - E**2/2) = ∫ A. Without ice
    E = p + (cos t + sin t)/2 has the minimum p - 2**-0.5.
    """
    E, p = sp.symbols("E p")
    A = p + sp.cos(t)
    grows = sp.Piecewise((A, A > 0), (A / (1 - E), True))
    model = fs.Model({E: sp.Piecewise((A - E, E > 0), (grows, True))}, parameters={p: -0.2})

    def surplus(p):
        b = np.arccos(-p)
        thickest = 1 - np.sqrt(1 - 2 * (2 * p * (np.pi - b) - 2 * np.sin(b)))
        return thickest + 2 * p * b + 2 * np.sin(b)

    settings = fs.Continuation(step=0.01 * factor, max_step=0.02 * factor)
    branch = fs.continue_orbits(
        fs.find_orbit(model, [-3]), "p", over=(-0.3, 0.9), continuation=settings
    )
    first, last = branch.special("GR")
    assert np.isclose(first["p"], brentq(surplus, -0.5, 0.5, xtol=1e-14), rtol=0, atol=1e-10)
    assert np.isclose(last["p"], 2**-0.5, rtol=0, atol=1e-10)
    assert {outcome.code for outcome in branch.outcomes} == {"end of range"}
    free = branch["p"] > last["p"] + 1e-3
    assert np.allclose(branch["min(E)"][free], branch["p"][free] - 2**-0.5, rtol=0, atol=1e-9)
