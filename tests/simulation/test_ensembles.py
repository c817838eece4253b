"""Ensembles: run by run as `simulate` to the tolerance, bit for bit whatever the neighbours."""

import math
import pickle

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from fastslow.errors import ArgumentError, UnknownNameError
from fastslow.model.model import Model
from fastslow.results.trajectory.ensemble import Ensemble
from fastslow.simulation.many import simulate_many
from fastslow.simulation.one import simulate
from fastslow.simulation.settings import Execution, Integration

pytestmark = pytest.mark.slow

x, v, t = sp.symbols("x v t")
D = np.array([0.1, 0.25, 0.4, 0.25, 0.3, 0.05, 0.2])
C = np.array([3.5, 3.546, 2.0, 1.0, 5.0, 2.9, 4.0])


def assert_alike(many: Ensemble, i: int, run, since: float | None = None, tol=1e-9) -> None:
    """One of many is the trajectory that `simulate` gives, as far as both have its tolerance."""
    assert many.codes[i] == 0
    assert run.outcome
    assert many.outcomes[i] == run.outcome
    assert many.reached[i] == run.span[1]
    assert many.n_steps[i] == pytest.approx(len(run.steps), rel=0.02, abs=3)
    scale = 10 * tol * (1 + np.abs(run.end[1:]).max())
    assert many.final[i] == pytest.approx(run.end[1:], abs=scale)
    for column, name in enumerate(many.states):
        low, high = run.extremes(name, since=since)
        assert many.minimum[i, column] == pytest.approx(low, abs=scale)
        assert many.maximum[i, column] == pytest.approx(high, abs=scale)
    begin = run.span[0] if since is None else since
    for j, name in enumerate(many.interfaces):
        for k, direction in enumerate((1, -1)):
            expected = [
                c
                for c in run.crossings
                if c.interface == name and c.direction == direction and c.time >= begin
            ]
            assert many.hits[i, j, k] == len(expected)
            if since is None and name in run.interfaces:
                assert many.hits[i, j, k] == run.hits(name, direction=direction)
    assert many.regime[i] == (run.regime or "")


def assert_identical(one: Ensemble, other: Ensemble, order=slice(None)) -> None:
    for name in ("minimum", "maximum", "final", "reached", "hits", "regime", "n_steps", "codes"):
        assert np.array_equal(getattr(one, name)[order], getattr(other, name)), name


@pytest.fixture(scope="module")
def swept(gear):
    return simulate_many(gear, [0, 0], parameters={"D": D, "C": C}, periods=1)


def test_each_is_the_trajectory_by_itself(gear, swept):
    for i in range(len(D)):
        model = gear.with_parameters(D=D[i], C=C[i])
        assert_alike(
            swept, i, simulate(model, [0, 0], periods=1, integration=Integration(implicit=False))
        )
    assert set(swept.regime) >= {"bilateral", "unilateral upper"}
    assert swept.success.all()
    assert swept.minimum.shape == swept.maximum.shape == swept.final.shape == (7, 2)
    assert swept.hits.shape == (7, 2, 2)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_number_of_threads_changes_nothing(gear, swept, threads):
    again = simulate_many(
        gear, [0, 0], parameters={"D": D, "C": C}, periods=1, execution=Execution(threads=threads)
    )
    assert_identical(swept, again)


def test_the_order_and_the_neighbours_change_nothing(gear, swept):
    order = np.array([5, 3, 0, 6, 1, 4, 2])
    parameters = {"C": C[order], "D": D[order]}
    again = simulate_many(
        gear, [0, 0], parameters=parameters, periods=1, execution=Execution(threads=2)
    )
    assert_identical(swept, again, order)
    alone = simulate_many(gear, [[0, 0]], parameters={"D": D[2], "C": C[2:3]}, periods=1)
    assert_identical(swept, alone, [2])


def test_initial_states_of_all_kinds(gear):
    states = np.array([[0.0, 0.0], [0.5, -1.0], [-1.0, 2.0]])
    many = simulate_many(gear, states, t=(1, 20))
    for i, state in enumerate(states):
        assert_alike(
            many, i, simulate(gear, state, t=(1, 20), integration=Integration(implicit=False))
        )
    named = simulate_many(gear, {v: states[:, 1], "x": states[:, 0]}, t=(1, 20))
    assert_identical(many, named)
    transposed = simulate_many(gear, np.asfortranarray(states), t=(1, 20))
    assert_identical(many, transposed)


def test_a_transient_left_out(gear):
    many = simulate_many(gear, [0, 3], parameters={"C": C}, periods=1, settle=0.6)
    for i in range(len(C)):
        run = simulate(
            gear.with_parameters(C=C[i]), [0, 3], periods=1, integration=Integration(implicit=False)
        )
        assert_alike(many, i, run, since=many.since[i])
    assert many.since == pytest.approx(np.full(7, 120 * math.pi))
    later = simulate_many(gear, [0, 3], t=(0, 10), settle=2.0)
    run = simulate(gear, [0, 3], t=(0, 10), integration=Integration(implicit=False))
    assert_alike(later, 0, run, since=2.0)


def test_own_periods(gear):
    omega = np.array([0.1, 0.25, 0.5])
    many = simulate_many(gear, [0, 0], parameters={"omega": omega}, periods=2, samples=50)
    assert many.span[:, 1] == pytest.approx(4 * math.pi / omega)
    assert many.t.shape == many["x"].shape == (3, 50)
    for i in range(3):
        run = simulate(
            gear.with_parameters(omega=omega[i]),
            [0, 0],
            periods=2,
            integration=Integration(implicit=False),
        )
        assert_alike(many, i, run)
        assert np.abs(many["x"][i] - run(many.t[i])[0]).max() < 1e-9
        assert np.abs(many["w"][i] - (2.372 + 3.546 * np.sin(omega[i] * many.t[i]))).max() < 1e-12
    given_periods = simulate_many(
        gear, [0, 0], parameters={"omega": omega}, periods=2, period=2 * np.pi / omega
    )
    assert_identical(many, given_periods)


def test_common_samples(gear):
    times = np.linspace(0, 30, 91)
    many = simulate_many(gear, [0, 0], parameters={"D": D}, t=(0, 30), samples=times)
    assert many.t.shape == (91,)
    assert many["v"].shape == (7, 91)
    run = simulate(
        gear.with_parameters(D=D[4]),
        [0, 0],
        t=(0, 30),
        integration=Integration(implicit=False),
        samples=times,
    )
    for name in ("x", "v", "w"):
        assert np.abs(many[name][4] - run[name]).max() < 1e-9
    counted = simulate_many(gear, [0, 0], t=(0, 30), settle=10, samples=3)
    assert counted.t.tolist() == [10, 20, 30]


def test_regions_that_some_values_empty(gear):
    # without clearance, or with an overlap, there is no gap
    clearance = np.array([0.25, 0.0, -0.1, 0.1])
    many = simulate_many(gear, [0, 0], parameters={"D": clearance}, t=(0, 30))
    for i, value in enumerate(clearance):
        assert_alike(
            many,
            i,
            simulate(
                gear.with_parameters(D=value),
                [0, 0],
                t=(0, 30),
                integration=Integration(implicit=False),
            ),
        )


def test_filippov(friction):
    mu = np.array([0.1, 0.3, 0.5, 1.5])
    many = simulate_many(friction, [2, 0], parameters={"mu": mu, "a": 1.2}, t=(0, 30))
    for i in range(4):
        run = simulate(
            friction.with_parameters(mu=mu[i], a=1.2),
            [2, 0],
            t=(0, 30),
            integration=Integration(implicit=False),
        )
        assert_alike(many, i, run)
    assert many.hits.sum() > 10


def test_one_that_fails_stops_no_other():
    many = simulate_many(Model({x: x**2}), [[1], [-1], [0.1]], t=(0, 3), settle=2.0, samples=4)
    assert many.success.tolist() == [False, True, True]
    assert many.outcomes[0].code == "blow-up"
    assert many.reached == pytest.approx([1, 3, 3], abs=1e-9)
    assert many.final[1:, 0] == pytest.approx([-0.25, 1 / 7], abs=1e-9)
    assert np.isnan(many.minimum[0, 0])
    assert many.minimum[1:, 0] == pytest.approx([-1 / 3, 1 / 8], abs=1e-9)
    assert np.isnan(many["x"][0]).all()
    assert np.isfinite(many["x"][1:]).all()
    assert many.hits.shape == (3, 0, 2)
    assert set(many.regime) == {""}
    assert "2 of 3 reached the end of the time span" in repr(many)
    assert "trajectory 0: the state grew" in repr(many)
    whole = simulate_many(Model({x: x**2}), [[1], [-1], [0.1]], t=(0, 3))
    assert whole.maximum[0, 0] > 1e6


def test_a_start_that_is_not_in_the_domain():
    many = simulate_many(Model({x: -sp.log(x)}), [[-1], [2]], t=(0, 1))
    assert many.outcomes[0].code == "not finite at start"
    assert many.minimum[0, 0] == many.maximum[0, 0] == many.final[0, 0] == -1
    assert many.success.tolist() == [False, True]


def test_slow_states():
    e = sp.Symbol("e")
    y = sp.Symbol("y")
    model = Model({x: y - x}, slow={y: -e * y}, parameters={e: 0.1})
    many = simulate_many(model, [1, 2], parameters={e: [0.1, 0.2]}, t=(0, 5))
    assert many.states == ("x", "y")
    assert many.final[:, 1] == pytest.approx(2 * np.exp(-5 * np.array([0.1, 0.2])), abs=1e-9)
    assert many.parameters["e"].tolist() == [0.1, 0.2]


def test_values_of_a_frozen_model(gear):
    many = simulate_many(gear.frozen(), [0, 0], parameters={"w": [0.5, 1.0, 2.0]}, t=(0, 60))
    ends = many.final[:, 0]
    assert (ends**2 + 41.67) * (ends - 0.25) == pytest.approx([0.5, 1.0, 2.0], abs=1e-7)
    with pytest.raises(ArgumentError, match="w of this frozen model has no value"):
        simulate_many(gear.frozen(), [0, 0], t=(0, 60))


def test_extremes_within_a_step():
    # the extremes of a harmonic motion, 1 whatever the steps
    k = sp.Symbol("k")
    model = Model({x: v, v: -(k**2) * x}, parameters={k: 1})
    rates = np.linspace(0.3, 3, 12)
    many = simulate_many(
        model, [0, 1], parameters={k: rates}, t=(0, 25), integration=Integration(rtol=1e-12)
    )
    assert np.abs(many.maximum[:, 0] * rates - 1).max() < 1e-10
    assert np.abs(many.minimum[:, 0] * rates + 1).max() < 1e-10
    assert np.abs(many.maximum[:, 1] - 1).max() < 1e-10


@settings(max_examples=25)
@given(
    st.lists(
        st.tuples(st.floats(-1.5, 1.5), st.floats(-3, 3), st.floats(0.01, 1), st.floats(0, 6)),
        min_size=1,
        max_size=5,
    )
)
def test_mirrored_without_a_mean_load(gear, rows):
    # x -> -x, C -> -C maps solutions to solutions, bit for bit
    table = np.array(rows)
    unloaded = gear.with_parameters(B=0)
    there, back = (
        simulate_many(
            unloaded,
            s * table[:, :2],
            parameters={"D": table[:, 2], "C": s * table[:, 3]},
            t=(0, 9),
        )
        for s in (1, -1)
    )
    assert np.array_equal(there.final, -back.final)
    assert np.array_equal(there.minimum, -back.maximum)
    assert np.array_equal(there.hits, back.hits[:, ::-1, ::-1])


def test_progress_and_pickle(gear, swept, capsys):
    simulate_many(gear, [0, 0], t=(0, 1), execution=Execution(progress=True))
    assert "100%" in capsys.readouterr().err
    again = pickle.loads(pickle.dumps(swept))
    assert_identical(swept, again)
    assert again.outcomes == swept.outcomes
    assert "Ensemble of 7 trajectories of x, v, w for t from 0 to 628.319" in repr(again)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        (
            {"parameters": {"D": [1, 2, 3], "C": [1, 2, 3, 4]}},
            r"parameters broadcast to one length: received D \(3,\), C \(4,\)",
        ),
        ({"parameters": {"D": [[1, 2]]}}, r"parameter D has shape \(1, 2\)"),
        ({"parameters": {"D": [1, math.nan]}}, "D = nan of trajectory 1; expected a finite"),
        ({"parameters": {"D": []}}, "received no trajectory"),
        ({"parameters": {"D": "wide"}}, "parameter D: expected numbers"),
        ({"states": [[0, 0], [0, math.inf]]}, "v = inf of trajectory 1"),
        ({"states": [0, 0, 0]}, r"shape \(3,\); expected \(m, 2\) or \(2,\), for x, v"),
        ({"states": {"x": [0, 1]}}, "no value for v"),
        ({"states": {"x": [0, 1], "v": [0, 1, 2]}}, r"received x \(2,\), v \(3,\)"),
        (
            {"states": np.zeros((3, 2)), "parameters": {"D": [1, 2]}},
            r"broadcast to one length: received states \(3, 2\), D \(2,\)",
        ),
        ({"t": None}, "received neither"),
        ({"periods": 1}, "received both"),
        ({"t": (1, 0)}, "start < end"),
        ({"settle": 1}, "settle = 1; expected less than the length of the run"),
        ({"settle": -1}, "settle = -1; expected a number from 0"),
        ({"period": [1, 2, 3]}, r"period has shape \(3,\)"),
        ({"samples": 1}, "samples = 1; expected an integer from 2"),
        ({"samples": [0, 2]}, "samples from 0 to 2 are outside the runs"),
        ({"integration": 1e-9}, "integration: expected an Integration, received a float"),
    ],
)
def test_wrong_arguments(gear, keywords, message):
    arguments = {"states": [0, 0], "t": (0, 1), **keywords}
    with pytest.raises(ArgumentError, match=message):
        simulate_many(gear, **arguments)


def test_wrong_names(gear, swept):
    with pytest.raises(UnknownNameError, match="unknown parameter 'omga'; did you mean 'omega'"):
        simulate_many(gear, [0, 0], parameters={"omga": [1, 2]}, t=(0, 1))
    with pytest.raises(UnknownNameError, match="unknown state 'y'"):
        simulate_many(gear, {"x": 0, "y": 0}, t=(0, 1))
    with pytest.raises(ArgumentError, match="has no samples"):
        swept["x"]
    with pytest.raises(UnknownNameError, match="unknown column 'z'"):
        swept["z"]


def test_a_model_without_a_period(gear):
    with pytest.raises(ArgumentError, match="nothing in trajectory 1 has a common period"):
        simulate_many(gear, [0, 0], parameters={"omega": [0.1, 0.0]}, periods=1)


def test_constants_of_mathematics_in_lanes():
    """pi and e stand in the generated source by name."""
    x, t = sp.symbols("x t")
    switch = sp.Piecewise((1, sp.sin(sp.pi * t) > sp.exp(-1)), (-1, True))
    model = Model({x: switch - sp.E * x})
    starts = np.linspace(-1, 1, 8)
    many = simulate_many(model, starts[:, None], t=(0.25, 5))
    alone = [simulate(model, [start], t=(0.25, 5)).end[-1] for start in starts]
    assert many.final.ravel() == pytest.approx(alone, rel=1e-8)
