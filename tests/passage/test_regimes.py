"""Regime maps of the gear: the same as single runs, and their boundary on the criterion's curve."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.systems import slow_load_criterion, slow_load_gap

pytestmark = pytest.mark.slow

OVER = {"D": (0.02, 0.3), "ratio": (0.95, 1.1)}


@pytest.fixture(scope="module")
def slow(gear):
    return gear.with_parameters(omega=0.1)


@pytest.fixture(scope="module")
def found(slow):
    return fs.regime_map(
        slow,
        OVER,
        [0, 0],
        parameters={"C": "B*ratio"},
        refinement=fs.Refinement(cells=(4, 5), levels=3),
        periods=2,
    )


def test_every_point_is_the_run_by_itself(slow, found):
    assert found.labels == ("bilateral", "meshed upper", "unilateral upper")
    for row in range(0, len(found.points), 37):
        width, ratio = found.points[row]
        run = fs.simulate(slow.with_parameters(D=width, C=2.372 * ratio), [0, 0], periods=2)
        assert run.regime == found.point_labels[row]


def test_the_criterion_beside_it(slow, found):
    def says(exact):
        return found.compare(
            lambda width, ratio: (
                slow_load_criterion(slow, {"D": width, "C": 2.372 * ratio}, exact=exact).regime
            )
        )

    exact, expanded = says(True), says(False)
    assert exact.share == 1
    assert 0.99 < expanded.share < 1
    # the expansion gives too narrow a gap at this frequency
    assert set(expanded.disagreements) == {("bilateral", "unilateral upper")}


def test_clocks_do_not_change_regimes():
    """A load sin(2 π Mod(t, T) / T) is sin(2 π t / T), though each instant ends a step."""
    x, v, t, D, C = sp.symbols("x v t D C")
    gap = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))

    def driven(load):
        rates = {x: v, v: C * load - v - 30 * gap + sp.Rational(1, 5)}
        return fs.Model(rates, parameters={C: 1.0, D: 0.2})

    clock, smooth = (driven(sp.sin(sp.pi / 4 * time)) for time in (sp.Mod(t, 8), t))
    assert clock.period() == pytest.approx(smooth.period())
    over, cells = {"C": (0.05, 1.5), "D": (0.1, 0.5)}, fs.Refinement(cells=(2, 2), levels=0)
    one, other = (fs.regime_map(m, over, [0, 0], refinement=cells) for m in (clock, smooth))
    assert len(set(one.point_labels.tolist())) > 2
    assert one.point_labels.tolist() == other.point_labels.tolist()
    # under a sawtooth, whose jumps push the teeth apart
    saw = driven(sp.Mod(t, 8) / 4 - 1).with_parameters(C=0.5375)
    found = fs.classify_regime(saw, [[0, 0]])
    spectrum = fs.lyapunov(saw, [0, 0], periods=300)
    assert (found.label, spectrum.chaotic) == ("chaotic", True)
    assert spectrum.values.sum() == pytest.approx(-1, abs=1e-10)
    steady = saw.with_parameters(C=1)
    run = fs.simulate(steady, [0, 0], periods=40)
    assert run.regime == fs.classify_regime(steady, [[0, 0]]).label == "bilateral"


def test_the_criterion_is_for_slow_loads(gear):
    fast = fs.regime_map(
        gear,
        {"omega": (0.1, 3), "C": (1.5, 8)},
        [0, 0],
        refinement=fs.Refinement(cells=(6, 5), levels=1),
        periods=30,
    )
    beside = fast.compare(
        lambda omega, C: slow_load_criterion(gear, {"omega": omega, "C": C}, exact=True).regime
    )
    assert beside.share == pytest.approx(0.84, abs=0.04)
    # the criterion knows nothing of chaos, which is the most of what it misses
    missed = {found for found, _ in beside.disagreements}
    assert {"chaotic", "bilateral"} <= missed
    wrong = np.concatenate(list(beside.disagreements.values()))
    assert wrong[:, 0].min() > 0.3


def test_the_boundary_in_the_width(slow):
    """At C/B = 1.03, a line of the grid, D* to the accuracy of the bisection."""
    omega = 0.02
    narrow = fs.regime_map(
        slow.with_parameters(omega=omega),
        {"D": (0.5, 0.65), "ratio": (1.02, 1.04)},
        [0, 0],
        parameters=lambda width, ratio: {"D": width, "C": 2.372 * ratio},
        refinement=fs.Refinement(cells=(2, 2), levels=1, resolution=1e-9),
        periods=2,
        integration=fs.Integration(rtol=1e-11),
    )
    (line,) = narrow.boundary("bilateral", "unilateral upper")
    (row,) = np.flatnonzero((line.points[:, 1] == 1.03) & (line.accuracy[:, 1] == 0))
    edge, uncertain = line.points[row, 0], line.accuracy[row, 0]
    assert uncertain <= 1.5e-10
    k = 41.67 + edge**2
    B, C = 2.372, 1.03 * 2.372
    exact = slow_load_gap(B, C, omega, stiffness=k, exact=True)
    assert exact == pytest.approx(edge, abs=uncertain + 3e-10)
    # the expansion at rigid contact, and its first term alone: off by 0.05 % and 0.46 %
    assert slow_load_gap(B, C, omega) / edge - 1 == pytest.approx(-5.29e-4, rel=0.01)
    # all points of the line lie on the criterion's curve
    curve = slow_load_gap(
        B, B * line.points[:, 1], omega, stiffness=41.67 + line.points[:, 0] ** 2, exact=True
    )
    slope = np.gradient(curve) / np.gradient(line.points[:, 1])
    allowed = line.accuracy[:, 0] + 1.1 * slope * line.accuracy[:, 1] + 3e-10
    assert np.all(np.abs(curve - line.points[:, 0]) <= allowed)


def test_axes_that_are_parameters_themselves(slow):
    D, omega = sp.symbols("D omega")
    direct = fs.regime_map(
        slow,
        {D: (0.05, 0.3), "C": (2.3, 2.6)},
        {"x": 0, "v": 0},
        refinement=fs.Refinement(cells=(2, 2), levels=2),
        periods=2,
    )
    assert direct.names == ("D", "C")
    run = fs.simulate(slow.with_parameters(D=0.3, C=2.3), [0, 0], periods=2)
    assert direct.at(0.3, 2.3) == run.regime == "meshed upper"
    # an axis may be turned into another value of itself
    doubled = fs.regime_map(
        slow,
        {"D": (0.025, 0.15), "C": (2.3, 2.6)},
        [0, 0],
        parameters={D: 2 * D},
        refinement=fs.Refinement(cells=(2, 2), levels=2),
        periods=2,
    )
    assert np.array_equal(doubled.codes, direct.codes)
    assert omega.name in slow.parameters


def test_degenerate_points_keep_their_own_label(slow):
    closing = fs.regime_map(
        slow,
        {"D": (0, 0.2), "C": (2.4, 2.6)},
        [0, 0],
        refinement=fs.Refinement(cells=(2, 2), levels=0),
        periods=2,
    )
    assert closing.at(0, 2.5) == "no gap"
    assert closing.at(0.1, 2.6) == "bilateral"
    stopped = fs.regime_map(
        slow,
        {"D": (0.1, 0.2), "C": (2.4, 2.6)},
        [0, 0],
        refinement=fs.Refinement(cells=(1, 1), levels=1),
        integration=fs.Integration(max_steps=10),
        periods=2,
    )
    assert stopped.labels == ("failed",)
    assert len(stopped.failures) == 4
    assert "10 steps" in stopped.failures[0][1]
    # a frequency of zero has no period: that point fails alone
    still = fs.regime_map(
        slow,
        {"omega": (0, 0.2), "D": (0.1, 0.2)},
        [0, 0],
        refinement=fs.Refinement(cells=(2, 1), levels=0),
        periods=2,
    )
    assert still.labels[-1] == "failed"
    assert len(still.failures) == 2
    assert "has a common period" in still.failures[0][1]


def test_wrong_arguments(slow):
    with pytest.raises(fs.UnknownNameError, match="unknown parameter 'ratio'"):
        fs.regime_map(slow, OVER, [0, 0])
    with pytest.raises(fs.UnknownNameError, match="unknown parameter 'c'"):
        fs.regime_map(slow, OVER, [0, 0], parameters={"c": "B*ratio"})
    with pytest.raises(fs.UnknownNameError, match="unknown name in an expression 'b'"):
        fs.regime_map(slow, OVER, [0, 0], parameters={"C": "b*ratio"})
    x, k, c = sp.symbols("x k c")
    plain = fs.Model({x: c - k * x}, parameters={k: 1, c: 0})
    with pytest.raises(fs.ArgumentError, match="no gap anywhere"):
        fs.regime_map(
            plain,
            {"k": (1, 2), "c": (0, 1)},
            [0],
            refinement=fs.Refinement(cells=(1, 1), levels=0),
            periods=1,
            period=1,
        )


def test_regimes_of_a_model_with_events_are_those_of_its_runs():
    x, v, t, w, share = sp.symbols("x v t w share")
    gap = sp.Piecewise((x - 0.5, x > 0.5), (x + 0.5, x < -0.5), (0, True))
    model = fs.Model(
        {x: v, v: sp.cos(w * t) / 2 + sp.Rational(1, 4) - 4 * gap - v / 5},
        parameters={w: 0.9, share: 0.5},
        events={"kick": fs.Event(x > sp.Rational(3, 5), {v: share * v})},
    )
    run = fs.simulate(model, [0, 0], periods=200)
    assert len(run.events) > 200
    assert fs.classify_regime(model, [0, 0]).label == run.regimes().label == "bilateral"
    # the largest exponent by its variational equations is positive as well
    kicked = model.with_parameters(share=1.2)
    assert fs.classify_regime(kicked, [0, 0]).label == "chaotic"
    assert fs.lyapunov(kicked, [0, 0], periods=400).chaotic
    over = {"share": (0.5, 1.2), "w": (0.9, 1.0)}
    found = fs.regime_map(model, over, [0, 0], refinement=fs.Refinement(cells=(1, 1), levels=1))
    assert (found.at(share=0.5, w=0.9), found.at(share=1.2, w=0.9)) == ("bilateral", "chaotic")
