"""The slow-load criterion: against mpmath, SciPy and the gear's own crossings."""

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import fastslow as fs
from fastslow.systems import slow_load_criterion, slow_load_gap

pytestmark = pytest.mark.slow


def deepest_rigid(B, C, omega, c):
    """Half the depth reached from a rigid contact, from an integral of the load."""
    with mpmath.workdps(30):
        B, C, omega, c = map(mpmath.mpf, (B, C, omega, c))
        first = (mpmath.pi + mpmath.asin(B / C)) / omega
        positive = (2 * mpmath.pi - mpmath.asin(B / C)) / omega

        def load(time):
            return B + C * mpmath.sin(omega * time)

        def speed(time):
            nodes = mpmath.linspace(first, time, 9)
            return mpmath.quad(lambda s: mpmath.exp(-c * (time - s)) * load(s), nodes)

        turn = mpmath.findroot(speed, (positive, positive + 2 / c), solver="anderson", tol=1e-25)
        return float(-mpmath.quad(load, mpmath.linspace(first, turn, 5)) / (2 * c))


@pytest.mark.parametrize(
    ("B", "C", "omega", "c"),
    [(2.372, 2.44316, 0.1, 1), (2.372, 2.44316, 0.02, 1), (1, 3, 0.3, 0.5), (0, 1, 0.1, 2)],
)
def test_exact_against_an_integral_at_30_digits(B, C, omega, c):
    expected = deepest_rigid(B, C, omega, c)
    assert slow_load_gap(B, C, omega, damping=c, exact=True) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("stiffness", [np.inf, 40.0, 4.0])
@pytest.mark.parametrize("damping", [1.0, 0.6])
def test_the_expansion_is_right_to_its_order(stiffness, damping):
    omega = 0.02 / 2.0 ** np.arange(5)
    settings = {"damping": damping, "stiffness": stiffness}
    exact = slow_load_gap(1.0, 2.0, omega, exact=True, **settings)
    error = np.abs(exact - slow_load_gap(1.0, 2.0, omega, **settings))
    # the error is of second order: a quarter at half the frequency
    ratios = error[:-1] / error[1:]
    assert ratios[-1] == pytest.approx(4, rel=0.01)
    assert np.all(np.diff(np.abs(ratios - 4)) < 0)


def test_the_size_of_the_errors_on_the_gear():
    # the numbers that the docstring states, against the simulated edge of the test below
    for omega, edge, expanded, leading in (
        (0.1, 0.105236240673, -0.0429, 0.0896),
        (0.02, 0.5707076445357, -2.88e-4, 4.60e-3),
    ):
        k = 41.67 + edge**2
        B, C = 2.372, 1.03 * 2.372
        assert slow_load_gap(B, C, omega, stiffness=k) / edge - 1 == pytest.approx(
            expanded, rel=0.01
        )
        root = np.sqrt(C**2 - B**2)
        first = (root - B * np.arccos(B / C)) / omega
        assert first / edge - 1 == pytest.approx(leading, rel=0.01)
        exact = slow_load_gap(B, C, omega, stiffness=k, exact=True)
        assert exact == pytest.approx(edge, rel=3e-9)


@pytest.mark.parametrize(("omega", "digits"), [(0.1, 4e-9), (0.02, 4e-10)])
def test_the_edge_found_by_simulation(gear, omega, digits):
    model = gear.with_parameters(omega=omega, C=1.03 * 2.372)
    edge = float(slow_load_criterion(model, exact=True).widest)
    low, high = 0.9 * edge, 1.1 * edge
    for _ in range(7):
        widths = np.linspace(low, high, 33)
        many = fs.simulate_many(
            model,
            [0, 0],
            parameters={"D": widths},
            periods=2,
            integration=fs.Integration(rtol=1e-11),
        )
        reached = many.regime == "bilateral"
        assert set(many.regime) == {"bilateral", "unilateral upper"}
        last = int(np.argmin(reached)) - 1
        assert not reached[last + 1 :].any()
        low, high = widths[last : last + 2]
    assert high - low < 1e-11
    at_edge = slow_load_criterion(model, {"D": low}, exact=True)
    assert at_edge.widest == pytest.approx(low, rel=digits)
    assert at_edge.regime == ("bilateral" if at_edge.widest >= low else "unilateral upper")


@pytest.mark.sample(1)
@pytest.mark.parametrize("omega", [0.1, 0.05])
def test_the_edge_and_its_gradient_as_a_grazing_orbit(omega):
    # the orbit that touches the far side of the gap; 1e-6 is asked for, 1e-7 is reached
    values = {"B": 2.372, "C": 1.03 * 2.372, "omega": omega}

    def closed(**changes):
        widest = 0.1
        for _ in range(20):
            # the stiffness of the contact depends on the width
            contact = 41.67 + widest**2
            widest = slow_load_gap(**{**values, **changes}, stiffness=contact, exact=True)
        return widest

    widest = closed()
    gear = fs.systems.harmonic_gear(**values, D=1.02 * widest)
    orbit = fs.find_orbit(gear, [1.1 * widest, 0])
    branch = fs.continue_orbits(orbit, "D", over=(0.98 * widest, 1.03 * widest))
    (grazing,) = branch.special.select(code="GR")
    assert grazing["D"] == pytest.approx(widest, rel=3e-9)
    for name, value in values.items():
        step = 1e-3 * value
        far, near = (
            closed(**{name: value + k * step}) - closed(**{name: value - k * step}) for k in (2, 1)
        )
        numeric = (8 * near - far) / (12 * step)
        assert grazing.gradient(name)["D"] == pytest.approx(numeric, rel=1e-7)


def test_the_edge_against_scipy(gear):
    """DOP853 with an event at the turn, on both sides of the edge."""
    omega, C, A = 0.1, 1.03 * 2.372, 41.67
    model = gear.with_parameters(omega=omega, C=C)
    edge = float(slow_load_criterion(model, {"D": 0.105236}, exact=True).widest)
    for part, crossed in ((1 - 1e-6, True), (1 + 1e-6, False)):
        width = part * edge

        def rates(time, y, width=width):
            f = y[0] - np.clip(y[0], -width, width)
            return [y[1], 2.372 + C * np.sin(omega * time) - y[1] - (y[0] ** 2 + A) * f]

        def turn(time, y):
            return y[1]

        run = solve_ivp(
            rates, (0, 70), [0, 0], "DOP853", events=turn, rtol=1e-12, atol=1e-12, max_step=0.05
        )
        deepest = run.y_events[0][:, 0].min()
        assert (deepest < -width) == crossed
        # it comes 2 D* down from its near side, wherever that is
        assert deepest / edge == pytest.approx(part - 2, abs=1e-8)


def test_a_gap_with_other_damping_and_stiffness():
    pair = fs.systems.gear_pair()
    names = {"zeta": 0.45, "Omega": 0.05, "Fm": 0.1, "D": 1.0}
    # the amplitude of the load is Fa Ω²
    model = pair.with_parameters(Fa=0.12 / 0.05**2, **names)
    found = slow_load_criterion(model, exact=True)
    assert (found.damping, found.stiffness) == (pytest.approx(0.9), 1)
    assert found.amplitude == pytest.approx(0.12)
    edge = float(found.widest)
    widths = edge * np.array([1 - 1e-6, 1 + 1e-6])
    many = fs.simulate_many(
        model, [1, 0], parameters={"D": widths}, periods=4, integration=fs.Integration(rtol=1e-11)
    )
    assert many.regime.tolist() == ["bilateral", "unilateral upper"]
    assert slow_load_criterion(model).widest == pytest.approx(edge, rel=0.1)


@settings(max_examples=40)
@given(
    st.floats(0.1, 5), st.floats(1.1, 4), st.floats(0.001, 0.1), st.floats(0.3, 3),
    st.floats(2, 200), st.booleans(), st.floats(0.1, 10),
)  # fmt: skip
def test_laws(B, ratio, omega, c, k, exact, scale):
    keywords = {"damping": c, "exact": exact}
    C = ratio * B
    here = slow_load_gap(B, C, omega, stiffness=k, **keywords)
    assert here > 0
    # signs do not matter, length is as load, and time is free
    assert slow_load_gap(-B, -C, omega, stiffness=k, **keywords) == here
    scaled = slow_load_gap(scale * B, scale * C, omega, stiffness=k, **keywords)
    assert scaled == pytest.approx(scale * here, rel=1e-7, abs=1e-12)
    faster = slow_load_gap(
        B * scale**2, C * scale**2, omega * scale, damping=c * scale, stiffness=k * scale**2,
        exact=exact,
    )  # fmt: skip
    assert faster == pytest.approx(here, rel=1e-7, abs=1e-12)
    # from a rigid contact, less than what a massless body, x' = w/c, would cover
    massless = (np.sqrt(C**2 - B**2) - B * np.arccos(B / C)) / (omega * c)
    assert slow_load_gap(B, C, omega, **keywords) <= massless * (1 + 1e-9)


def test_bounds():
    assert slow_load_gap(2, 2, 0.1) == 0
    assert slow_load_gap(2, 1, 0.1, exact=True) == 0
    assert slow_load_gap(0, 1, 0.01, exact=True) == pytest.approx(100, rel=0.01)
    assert slow_load_gap([1, 2], [[2], [3]], 0.1).shape == (2, 2)
    # thrown off so fast, near resonance, that it does not turn before the load falls again
    assert np.isnan(slow_load_gap(0.01, 5, 1.0, damping=0.01, stiffness=1.0, exact=True))
    # so near to C = B that the contact smooths the load, and is never left
    assert slow_load_gap(1, 1 + 1e-9, 0.3, stiffness=2.0, damping=2.0, exact=True) == 0
    # there a body is thrown off for less than the load is negative
    assert 0 < slow_load_gap(1, 1.0001, 0.2, stiffness=50.0, exact=True) < 1e-3


def test_a_load_that_only_just_stays_positive(gear):
    # inertia amplifies the swing of the contact: let go of below C = B, at
    # C/B = √((1 − ω²/k)² + (c ω/k)²), here with D = 0.3, ω = 0.2
    omega, k = 0.2, 41.67 + 0.09
    limit = np.hypot(1 - omega**2 / k, omega / k)
    ratios = limit + np.array([-2e-5, 2e-5])
    assert ratios[1] < 1
    model = gear.with_parameters(D=0.3, omega=omega)
    loads = {"C": 2.372 * ratios}
    many = fs.simulate_many(
        model, [0.35, 0], parameters=loads, periods=4, integration=fs.Integration(rtol=1e-12)
    )
    assert many.regime.tolist() == ["meshed upper", "unilateral upper"]
    assert slow_load_criterion(model, loads, exact=True).regime.tolist() == many.regime.tolist()
    assert slow_load_criterion(model, loads).regime.tolist() == ["meshed upper"] * 2


def test_regimes(gear):
    gear = gear.with_parameters(omega=0.02)
    widths, loads = [0.5, 0.6, 0.25, 0.0, -0.1], [2.44316, 2.44316, 2.0, 3, 3]
    found = slow_load_criterion(gear, {"D": widths, "C": loads})
    expected = ["bilateral", "unilateral upper", "meshed upper", "no gap", "no gap"]
    assert found.regime.tolist() == expected
    wide = {"D": widths[:3], "C": loads[:3]}
    assert (
        fs.simulate_many(gear, [0, 0], parameters=wide, periods=2).regime.tolist() == expected[:3]
    )
    mirrored = slow_load_criterion(gear.with_parameters(B=-2.372), {"D": widths, "C": loads})
    assert mirrored.regime.tolist()[:3] == ["bilateral", "unilateral lower", "meshed lower"]
    assert "bilateral: 1, meshed upper: 1, no gap: 2, unilateral upper: 1" in repr(found)
    # negative stiffness in contact, or no mean load
    assert slow_load_criterion(gear, {"A": -0.6}).regime == "undecided"
    assert slow_load_criterion(gear, {"B": 0.0}).regime == "undecided"
    assert slow_load_criterion(gear, {"B": 0.0}).widest == pytest.approx(177.3, abs=0.1)


def test_the_load_in_other_words(gear):
    x, v, w, t, D = sp.symbols("x v w t D")
    f = sp.Piecewise((x - D, x > D), (x + D / 2, 2 * x < -D), (0, True))
    model = fs.Model(
        {x: v, v: 3 * w - 2 * v - 10 * f},
        forcing={w: 1 + sp.cos(t / 10) - 2 * sp.sin(t / 10)},
        parameters={D: 1},
    )
    found = slow_load_criterion(model)
    assert (found.mean, found.half_width, found.stiffness) == (3, 0.75, 10)
    assert (found.damping, found.omega) == (2, 0.1)
    assert found.amplitude == pytest.approx(3 * np.sqrt(5), rel=1e-14)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate": "w - v - x"}, "expected a model with a gap"),
        ({"rate": "w - v - v**3 - f"}, "expected a damping proportional to v and a load"),
        ({"rate": "w - v - x/9 - f"}, "expected a damping proportional to v"),
        ({"rate": "w*x - v - f"}, "expected a damping proportional to v"),
        ({"rate": "w - v - (1 + w)*f"}, "the stiffness at x . 1 is"),
        ({"rate": "w - v - jump"}, "the force jumps at x . 1"),
        ({"load": "1 + sin(t) + sin(2*t)"}, "expected a mean and one harmonic"),
        ({"load": "exp(sin(t))"}, "expected a mean and one harmonic"),
        ({"load": "2"}, "expected a mean and one harmonic"),
        ({"speed": "2*v"}, "x' = 2.v; expected v"),
    ],
)
def test_models_of_another_kind(change, message):
    x, v, w, t = sp.symbols("x v w t")
    names = {
        "x": x,
        "v": v,
        "w": w,
        "t": t,
        "f": sp.Piecewise((x - 1, x > 1), (x + 1, x < -1), (0, True)),
        "jump": sp.Piecewise((x, x > 1), (x, x < -1), (0, True)),
    }
    rate = sp.sympify(change.get("rate", "w - v - f"), locals=names)
    speed = sp.sympify(change.get("speed", "v"), locals=names)
    load = sp.sympify(change.get("load", "1 + 2*sin(t)"), locals=names)
    with pytest.raises(fs.ArgumentError, match=message):
        slow_load_criterion(fs.Model({x: speed, v: rate}, forcing={w: load}))


def test_wrong_arguments(gear):
    with pytest.raises(fs.ArgumentError, match="expected two states x, v and forcing, received"):
        slow_load_criterion(gear.frozen())
    with pytest.raises(fs.UnknownNameError, match="'omga'; did you mean 'omega'"):
        slow_load_criterion(gear, {"omga": 1})
    with pytest.raises(fs.ArgumentError, match="frequency vanishes"):
        slow_load_criterion(gear, {"omega": [0.1, 0.0]})
    with pytest.raises(fs.ArgumentError, match="omega = 0; expected positive"):
        slow_load_gap(1, 2, 0)
    with pytest.raises(fs.ArgumentError, match="B = nan; expected finite"):
        slow_load_gap(np.nan, 2, 1)
