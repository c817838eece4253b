"""Canards at folded nodes and saddles, against closed forms and published numbers."""

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, z, t = sp.symbols("x y z t")
mu, k, lam, eps, a, omega = sp.symbols("mu k lambda epsilon a omega")


def normal_form(ratio):
    """x' = μy/2 − (μ + 1)z, y' = 1, z' = x + z², with the fast state z."""
    slow = {x: mu * y / 2 - (mu + 1) * z, y: 1}
    return fs.Model({z: x + z**2}, slow=slow, parameters={mu: ratio})


def koper(value, ratio):
    return fs.Model(
        {x: (k * y - x**3 + 3 * x - lam) / eps},
        slow={y: x - 2 * y + z, z: y - z},
        parameters={k: -10, lam: value, eps: ratio},
    )


def node_of(model):
    return next(p for p in fs.slow_flow(model).points if p.code in ("FN", "FS"))


@pytest.fixture(scope="module")
def nine():
    """The canards of Koper's model where √ε is not small beside μ = 0.0685."""
    model = koper(7, 1e-2)
    return fs.find_canards(model, node_of(model))


@pytest.mark.sample(2)
@pytest.mark.parametrize(("ratio", "count"), [(0.5, 2), (0.22, 3), (0.12, 5), (0.0685, 8)])
def test_normal_form_has_as_many_as_the_theory_says(ratio, count):
    """The strong canard has x = 1/2 and the weak one x = μ/2 at y = z = 0, in closed form."""
    model = normal_form(ratio)
    found = fs.find_canards(model, node_of(model))
    assert (len(found), found.expected) == (count, count)
    assert found.outcome
    assert [one.type for one in found] == ["strong", *["secondary"] * (count - 2), "weak"]
    assert found[0]["x"] == pytest.approx(0.5, abs=1e-12)
    assert found[-1]["x"] == pytest.approx(ratio / 2, abs=1e-9)
    # the symmetry (x, y, z, t) → (x, −y, −z, −t) maps every canard to itself
    assert np.abs(found["z"]).max() < 1e-8
    assert np.abs(found["residual"]).max() < 1e-8
    # the path of the strong canard is z = y/2, that of the weak one z = μy/2
    for one, slope in ((found[0], 0.5), (found[-1], ratio / 2)):
        along, fast = one.path[:, one.states.index("y")], one.path[:, one.states.index("z")]
        middle = np.abs(along) < 0.5 * np.abs(along).max()
        assert np.abs(fast - slope * along)[middle].max() < 1e-4
        assert along[0] < 0 < along[-1]


@pytest.mark.parametrize("number", [0, 1])
def test_canards_separate_two_motions_of_scipy(number):
    """For μ = 0.22: beside a canard solutions escape at once, or fall to the attracting sheet."""
    model = normal_form(0.22)
    canard = fs.find_canards(model, node_of(model))[number]
    lowest = []
    for side in (-1, 1):
        rates = lambda _, u: [0.11 * u[1] - 1.22 * u[2], 1.0, u[0] + u[2] ** 2]  # noqa: E731
        event = lambda _, u: u[2] - 20  # noqa: E731
        event.terminal = True
        begin = [canard["x"] + side * 1e-8, 0, 0]
        run = solve_ivp(rates, (0, 60), begin, rtol=1e-11, atol=1e-13, events=event)
        lowest.append(run.y[2].min())
    assert max(lowest) == 0
    assert min(lowest) < -2


@pytest.mark.sample(0)
def test_koper(nine):
    """8 canards at ε = 1e-3, as s + 1; 9 at 1e-2."""
    model = koper(7, 1e-3)
    found = fs.find_canards(model, node_of(model))
    assert (len(found), found.expected) == (8, 8)
    assert found["z"] == pytest.approx(np.full(8, -0.8), abs=1e-12)
    assert (len(nine), nine.outcome.code) == (9, "another number")
    assert "8 were expected" in repr(nine)
    # the strong canard moves away from the fold by √ε to leading order
    distances = [-1 - one[0]["x"] for one in (found, nine)]
    assert distances[1] / distances[0] == pytest.approx(10, rel=0.05)


def test_folded_saddle_has_one_canard_besides_a_faux_one():
    model = koper(9, 1e-3)
    found = fs.find_canards(model, node_of(model))
    assert [(one.type, found.code) for one in found] == [("saddle", "FS")]
    assert found.outcome


def test_phase_of_a_forcing_is_a_slow_variable():
    """Forced van der Pol at a folded saddle."""
    forced = fs.Model(
        {x: (y - x**3 / 3 + x) / eps},
        slow={y: a * sp.sin(omega * t) - x},
        parameters={a: 2, omega: 1, eps: 0.01},
    )
    saddle = next(p for p in fs.slow_flow(forced).points if p.code == "FS" and p.values["x"] > 0)
    found = fs.find_canards(forced, saddle)
    assert (len(found), found[0].states) == (1, ("x", "y", "t"))
    # a run of the model from the attracting sheet passes the same state
    begin = found[0].path[100]
    length = found[0]["t"] - begin[2]
    run = fs.simulate(forced, begin[:2], t=(begin[2], begin[2] + length))
    assert run.end[1:] == pytest.approx(found[0].state[:2], abs=1e-7)


def test_bad_input():
    model = koper(7, 1e-2)
    points = fs.slow_flow(model).points
    focus = next(p for p in points if p.code == "FF")
    with pytest.raises(fs.ArgumentError, match="folded focus"):
        fs.find_canards(model, focus)
    planar = fs.Model({x: y - x**3 / 3 + x}, slow={y: a - x}, parameters={a: 0.5})
    (point,) = fs.slow_flow(planar).points
    with pytest.raises(fs.ArgumentError, match="find_canard computes the maximal canard"):
        fs.find_canards(planar, point)
    backwards = fs.Model(
        {x: (k * y - x**3 + 3 * x - lam) / eps},
        slow={y: -(x - 2 * y + z), z: -(y - z)},
        parameters={k: -10, lam: 7, eps: 0.01},
    )
    with pytest.raises(fs.ArgumentError, match="faux canards only"):
        fs.find_canards(backwards, node_of(backwards))


def test_file_keeps_curves_and_outcome(nine, tmp_path):
    nine.save(tmp_path / "canards.npz")
    again = fs.load(tmp_path / "canards.npz")
    assert again.outcome == nine.outcome
    assert not again.outcome
    np.testing.assert_array_equal(again.attracting, nine.attracting)
    assert again == nine
