"""The stories that the overlay tells of known models."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

FOLD_HR = 49 / 27  # z where x³ + 2x² + z = 3 folds, at x = −4/3
HOMOCLINIC_HR = 2.0856008819949  # by DOP853: tests/orbits/test_homoclinic.py


def laid(model, parameter, over, start, **span):
    diagram = fs.continue_equilibria(model.frozen(), parameter, over=over)
    return fs.overlay(diagram, fs.simulate(model, start, **span))


@pytest.fixture(scope="module")
def hindmarsh_rose():
    """Slow, and at the usual value of r; each computed when it is first used."""
    until = {0.001: 1400, 0.003: 900, 0.006: 800}

    @cache
    def overlay_at(r):
        model = fs.systems.hindmarsh_rose(r=r)
        return laid(model, "z", (1.5, 2.5), [-1.5, -10, 1.9], t=(0, until[r]))

    return overlay_at


@pytest.mark.sample(2)
@pytest.mark.parametrize("r", [0.001, 0.003, 0.006])
def test_hindmarsh_rose_is_quasi_static_up_to_the_fold(hindmarsh_rose, r):
    overlay = hindmarsh_rose(r)
    starts = [t for t in overlay.transitions if t.to_branch == "oscillating"][1:]
    assert len(starts) >= 2
    for start in starts:
        assert (start.type, start.from_branch, start.special.code) == ("jump", "S1", "LP")
        assert start.special["z"] == pytest.approx(FOLD_HR, abs=1e-12)
        # past the fold, which is passed with z falling
        assert start.delay > 0
        assert start.value == pytest.approx(FOLD_HR - start.delay, abs=1e-12)


@pytest.mark.sample(2)
@pytest.mark.parametrize(("r", "spikes"), [(0.001, 9), (0.003, 4), (0.006, 2)])
def test_hindmarsh_rose_spikes(hindmarsh_rose, r, spikes):
    """Counted again as the upward passages of x = 1, one for each spike."""
    overlay = hindmarsh_rose(r)
    bursts = [p for p in overlay.phases if p.type == "oscillating"][1:-1]
    assert {p.attractor for p in bursts} == {"cycle"}
    for phase in bursts:
        section = overlay.run.section(
            "x", level=1.0, direction=1, since=phase.start, until=phase.end
        )
        assert len(section.t) == phase.oscillations == spikes
        on = (overlay.t > phase.start) & (overlay.t < phase.end)
        assert np.all(overlay.followed[on] == -1)
        assert np.isnan(overlay.lag[on]).all()


def test_the_end_of_a_burst_is_no_bifurcation_of_equilibria(hindmarsh_rose):
    overlay = hindmarsh_rose(0.001)
    assert str(overlay.bursting) == "fold/homoclinic bursting"
    evidence = " ".join(overlay.bursting.evidence)
    assert "a bifurcation of the cycle, not of equilibria" in evidence
    assert "passes a saddle within" in evidence
    for phase in [p for p in overlay.phases if p.type == "oscillating"][1:-1]:
        # towards a saddle the period grows, the amplitude does not
        assert np.all(np.diff(phase.intervals) > 0)
        assert phase.intervals[-1] > 1.5 * np.median(phase.intervals)
        assert min(phase.sizes) > 0.7 * max(phase.sizes)
    ends = [t for t in overlay.transitions if t.type == "end of oscillation"]
    assert all(t.special is None for t in ends)
    assert all(t.value > FOLD_HR + 0.2 for t in ends)
    assert all(t.land.time > t.time for t in ends)


@pytest.mark.sample(1)
@pytest.mark.parametrize("r", [0.003, 0.006])
def test_with_two_oscillations_the_frozen_cycle_tells_how_it_ends(hindmarsh_rose, r):
    overlay = hindmarsh_rose(r)
    assert str(overlay.bursting) == "fold/homoclinic bursting"
    # z at which the frozen cycle ends, to the digits that are printed
    (end,) = [sentence for sentence in overlay.bursting.evidence if sentence.startswith("end")]
    value = float(end.split("they end at HC1, homoclinic, z = ")[1].split(";")[0])
    assert value == pytest.approx(HOMOCLINIC_HR, abs=1e-9)


def test_without_its_model_a_run_shows_candidates_only(hindmarsh_rose):
    """As read from a file: three oscillations and more show a period that grows, two do not."""

    def name(overlay):
        return str(fs.overlay(overlay.diagram, replace(overlay.run, model=None)).bursting)

    assert name(hindmarsh_rose(0.001)) == "fold/homoclinic (candidate) bursting"
    assert name(hindmarsh_rose(0.006)) == "unclassified bursting (onset: fold)"


def test_a_fast_forcing_is_no_bursting():
    """The gear at ω = 0.8 swings once in each period of its load."""
    overlay = laid(fs.systems.harmonic_gear(omega=0.8), "w", (-2, 6.5), [0, 0], periods=30)
    assert overlay.bursting is None


def _from_curve(overlay, rows):
    """Distance of samples from the branch in the space of the states and the load."""
    (branch,) = overlay.diagram.branches
    unit = np.append(overlay.extent, np.ptp(overlay.slow))
    curve = np.column_stack([branch.state, branch.values]) / unit
    points = np.column_stack([overlay.state, overlay.slow])[rows] / unit
    found = np.full(len(points), np.inf)
    for start, chord in zip(curve[:-1], np.diff(curve, axis=0), strict=True):
        part = np.clip((points - start) @ chord / (chord @ chord), 0.0, 1.0)
        away = np.linalg.norm(points - start - part[:, None] * chord, axis=1)
        found = np.minimum(found, away)
    return found


def test_van_der_pol_under_a_slow_load():
    """Hopf points at w = ±1: entered late, left where the cycle shrinks to the focus."""
    overlay = laid(fs.systems.van_der_pol(C=1.5, omega=0.005), "w", (-2, 2), [0.1, 0], periods=2)
    assert str(overlay.bursting) == "symmetric Hopf/Hopf bursting"
    leavings = [t for t in overlay.transitions if t.type == "Hopf"]
    assert len(leavings) == 4
    for t in leavings:
        assert t.delay > 0.5
        assert abs(t.special["w"]) == pytest.approx(1, abs=1e-12)
        assert t.value == pytest.approx(t.special["w"] * (1 - t.delay), abs=1e-12)
    for t in (t for t in overlay.transitions if t.type == "end of oscillation"):
        assert t.special.code == "HB"
        assert abs(abs(t.value) - 1) < 0.05
    # the branch is followed along its unstable part as well: there the lag has a meaning still
    unstable = (np.abs(overlay.slow) < 0.9) & (overlay.followed >= 0)
    # near means near the curve, which is measured here by itself: the distance to the branch at
    # the same load, which the overlay lists, is larger where the branch is steep
    assert _from_curve(overlay, unstable).max() < overlay.radius
    assert overlay.radius < overlay.distance[unstable].max() < 1.2 * overlay.radius
    assert np.isnan(overlay.relaxation[unstable]).all()


def test_fitzhugh_nagumo_passes_its_hopf_points_slowly():
    """Hopf points where v² = 1 − εb; the exit is late, and no cycle is small."""
    model = fs.systems.fitzhugh_nagumo(I_0=0.9, I_1=0.9, omega=0.001)
    overlay = laid(model, "I", (-0.2, 2), [-1.2, -0.6], periods=2)
    first, second = sorted(p["I"] for p in overlay.diagram.special("HB"))
    v = -np.sqrt(1 - 0.064)
    assert first == pytest.approx((v + 0.7) / 0.8 - v + v**3 / 3, abs=1e-12)
    leavings = [t for t in overlay.transitions if t.type == "Hopf"]
    assert {t.special["I"] for t in leavings} == {first, second}
    for t in leavings:
        assert t.special.criticality == "subcritical"
        assert 0.1 < t.delay < 0.2
    ends = [t for t in overlay.transitions if t.type == "end of oscillation"]
    assert all("not of equilibria" in t.note for t in ends)
    # two stable branches, one the image of the other
    assert overlay.bursting.name == "symmetric subHopf/fold cycle bursting"
    # the folds of cycles, symmetric about I = a/b = 0.875
    folds = {float(t.note.rsplit("I = ", 1)[1]) for t in ends if "LPC1" in t.note}
    assert sum(folds) == pytest.approx(1.75, abs=2e-9)


def test_fitzhugh_nagumo_under_a_ramp():
    """Entry and exit: ∫ Re λ dI between them vanishes, until rounding or the amplitude ends it."""
    i, t, v, r = sp.symbols("I t v r")
    parts = {v: v - v**3 / 3 - r + i, r: sp.Rational(8, 100) * (v + 0.7 - 0.8 * r)}
    model = fs.Model(parts, forcing={i: sp.Rational(1, 4) + t / 5000})
    overlay = laid(model, "I", (0.2, 0.7), [-1.03, -0.41], t=(0, 1500))
    (leaving, *_) = overlay.transitions
    assert leaving.type == "Hopf"
    assert leaving.special["I"] == pytest.approx(0.33128, abs=1e-5)
    assert leaving.slope == pytest.approx(1 / 5000, rel=1e-9)
    assert 0 < leaving.delay < 0.15
    assert overlay.phases[-1].type == "oscillating"
    assert overlay.transitions[-1].to_branch == "oscillating"


def test_relaxation_is_no_bursting():
    """van der Pol in Liénard's form: folds at y = ±2/3, a jump at each, no spike."""
    overlay = laid(
        fs.systems.van_der_pol_relaxation(epsilon=0.002),
        "y",
        (-1.2, 1.2),
        [2.0, 0.0],
        t=(0, 2000),
    )
    assert str(overlay.bursting) == "relaxation oscillation (symmetric fold/fold)"
    assert {p.type for p in overlay.phases} == {"quasi-static", "jump"}
    assert overlay.summary().count("jump at LP") == len(overlay.transitions)


def test_settling_by_oscillations_is_point_point_bursting():
    """A double well with weak damping rings on each landing."""
    x, v, w, t = sp.symbols("x v w t")
    model = fs.Model({x: v, v: w + x - x**3 - v / 5}, forcing={w: sp.sin(t / 200)})
    overlay = laid(model, "w", (-1.2, 1.2), [-1, 0.0], periods=2)
    assert str(overlay.bursting) == "symmetric fold/fold bursting (point-point)"
    settling = [p for p in overlay.phases if p.type == "oscillating"]
    assert {p.attractor for p in settling} == {"equilibrium"}
    assert {t_.type for t_ in overlay.transitions} == {"jump"}
    # what settles follows the branch that it settles on
    for phase in settling:
        late = (overlay.t > phase.start + 0.8 * phase.duration) & (overlay.t < phase.end)
        assert {overlay.stable_branches[k].label for k in overlay.followed[late]} == set(
            phase.stable_branches
        )


def test_a_cycle_that_reaches_an_interface():
    """r' = (w − r²) r about the origin: at w = 1 the cycle touches x = 1, and is drawn away."""
    x, y, w, t = sp.symbols("x y w t")
    pull = sp.Max(x - 1, 0)
    growth = w - x**2 - y**2
    model = fs.Model(
        {x: growth * x - 4 * y + 40 * pull, y: growth * y + 4 * x - 8 * pull},
        forcing={w: sp.Rational(1, 2) - sp.cos(t / 60)},
    )
    overlay = laid(model, "w", (-0.6, 1.6), [0.3, 0], periods=1)
    # the motion stays where it lands: one burst is no rhythm
    assert overlay.bursting is None
    end = next(t_ for t_ in overlay.transitions if t_.type == "end of oscillation")
    assert end.value == pytest.approx(1.0, abs=0.02)
    assert "x - 1 is reached for the first time" in end.note
