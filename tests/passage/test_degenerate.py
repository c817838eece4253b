"""Overlays of what has no stable branch, no forcing, no dense output, or no common range."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

x, v, w, t = sp.symbols("x v w t")


@pytest.fixture(scope="module")
def cusp():
    return fs.systems.cusp(omega=0.002)


@pytest.fixture(scope="module")
def diagram(cusp):
    return fs.continue_equilibria(cusp.frozen(), "p", over=(-1.2, 1.2))


@pytest.fixture(scope="module")
def overlay(cusp, diagram):
    return fs.overlay(diagram, fs.simulate(cusp, [-1.0], periods=2))


def covers(overlay):
    """The phases follow each other from the start of the run to its end."""
    ends = [phase.end for phase in overlay.phases]
    assert [phase.start for phase in overlay.phases] == [overlay.t[0], *ends[:-1]]
    assert ends[-1] == overlay.t[-1]


def test_phases_cover_the_run(overlay):
    covers(overlay)
    assert [p.type for p in overlay.phases] == ["quasi-static", "jump"] * 4 + ["quasi-static"]


def test_one_stable_sheet(gear):
    low = gear.with_parameters(B=3.0, C=0.5)
    only = fs.continue_equilibria(low.frozen(), "w", over=(2, 4))
    overlay = fs.overlay(only, fs.simulate(low, [0.3, 0], periods=1))
    assert [s.label for s in overlay.stable_branches] == ["S1"]
    assert overlay.transitions == ()
    assert overlay.bursting is None
    covers(overlay)


def test_no_stable_sheet_on_a_cycle():
    """Between its Hopf points the van der Pol oscillator has no stable equilibrium."""
    model = fs.Model({x: v, v: (1 - x**2) * v - x + w}, forcing={w: sp.sin(t / 100) / 2})
    none = fs.continue_equilibria(model.frozen(), "w", over=(-0.6, 0.6))
    overlay = fs.overlay(none, fs.simulate(model, [0.5, 0.0], periods=1))
    assert overlay.stable_branches == ()
    assert np.all(overlay.followed == -1)
    assert np.isinf(overlay.distance).all()
    (phase,) = overlay.phases
    assert (phase.type, phase.attractor) == ("oscillating", "cycle")
    # the period of the cycle at μ = 1 is 6.663 for w = 0
    assert np.median(phase.intervals) == pytest.approx(6.66, rel=0.03)
    assert "the diagram has no stable branch" in overlay.summary()


def test_no_stable_sheet_and_no_cycle():
    model = fs.Model({x: x - w}, forcing={w: sp.sin(t / 100) / 2})
    none = fs.continue_equilibria(model.frozen(), "w", over=(-0.6, 0.6))
    overlay = fs.overlay(none, fs.simulate(model, [0.0], t=(0, 3)))
    assert [p.type for p in overlay.phases] == ["transient"]


def test_a_run_that_leaves_the_range_of_the_diagram(cusp, overlay):
    narrow = fs.continue_equilibria(cusp.frozen(), "p", over=(-0.7, 1.2))
    cut = fs.overlay(narrow, overlay.run)
    assert cut.outcome.code == "outside the diagram"
    low, high = cut.slow.min(), cut.slow.max()
    assert (low, high) == (pytest.approx(-1, abs=1e-3), pytest.approx(1, abs=1e-3))
    assert f"p varies from {low:.6g} to {high:.6g}, the diagram covers -0.7 to 1.2" in cut.summary()
    outside = cut.slow < -0.7
    assert np.all(cut.followed[outside] == -1)
    assert np.isnan(cut.lag[outside]).all()
    # what lies inside is as it was
    assert [t_.time for t_ in cut.transitions] == pytest.approx(
        [t_.time for t_ in overlay.transitions]
    )
    assert [p.type for p in cut.phases].count("outside") == 2
    covers(cut)


def test_a_run_that_is_nowhere_in_the_diagram(cusp, overlay):
    far = fs.overlay(fs.continue_equilibria(cusp.frozen(), "p", over=(3, 4)), overlay.run)
    assert [p.type for p in far.phases] == ["outside"]
    assert far.transitions == ()
    assert np.all(far.followed == -1)


def test_without_dense_output(cusp, diagram, overlay):
    run = fs.simulate(cusp, [-1.0], periods=2, dense=False, samples=6000)
    light = fs.overlay(diagram, run)
    assert [t_.type for t_ in light.transitions] == ["jump"] * 4
    for one, other in zip(light.transitions, overlay.transitions, strict=True):
        assert one.time == pytest.approx(other.time, abs=1.1 * 6284 / 6000)
    covers(light)


def test_a_diagram_over_a_range_given_downwards(cusp, diagram, overlay):
    """Branches traced in the other sense, whose rows descend, give the same answer."""
    turned = fs.Diagram(
        **{
            **{k: getattr(diagram, k) for k in diagram.__dataclass_fields__},
            "branches": tuple(reversed_rows(b) for b in diagram.branches),
        }
    )
    other = fs.overlay(turned, overlay.run)
    assert [t_.time for t_ in other.transitions] == pytest.approx(
        [t_.time for t_ in overlay.transitions], abs=1e-7
    )
    assert [t_.special.label for t_ in other.transitions] == [
        t_.special.label for t_ in overlay.transitions
    ]
    assert other.distance == pytest.approx(overlay.distance, abs=1e-9)


def reversed_rows(b):
    last = len(b) - 1
    return fs.Branch(
        b.states,
        b.parameter,
        b.state[::-1],
        b.values[::-1],
        -b.tangent[::-1],
        b.eigenvalues[::-1],
        b.region[::-1],
        type(b.special)(b.special[::-1]),
        tuple(last - row for row in b.special_rows[::-1]),
        b.outcomes[::-1],
    )


def test_no_forcing_at_rest_and_on_the_way(cusp, diagram):
    still = cusp.with_parameters(a=0)
    rest = fs.overlay(diagram, fs.simulate(still, [-1.0], t=(0, 50)))
    assert [p.type for p in rest.phases] == ["quasi-static"]
    assert np.isnan(rest.lag).all()
    assert rest.turning == ()
    way = fs.overlay(diagram, fs.simulate(still, [-2.0], t=(0, 50)))
    assert [p.type for p in way.phases] == ["transient", "quasi-static"]
    assert way.transitions == ()
    assert way.distance[-1] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("amplitude", [0.386, 0.39])
def test_a_forcing_that_turns_at_the_fold(cusp, diagram, amplitude):
    """0.001 past the fold it turns too soon to be carried over, 0.005 past it is late enough."""
    model = cusp.with_parameters(a=amplitude, omega=0.01)
    overlay = fs.overlay(diagram, fs.simulate(model, [-1.0], periods=2))
    assert [m.value for m in overlay.turning] == pytest.approx(
        [amplitude, -amplitude, amplitude, -amplitude], rel=1e-4
    )
    if amplitude == 0.386:
        assert overlay.transitions == ()
    else:
        # the fold was passed, the jump takes place on the way back
        assert [t_.type for t_ in overlay.transitions] == ["jump"] * 4
        for jump, turn in zip(overlay.transitions, overlay.turning, strict=True):
            assert jump.time > turn.time
            assert abs(jump.value) < amplitude
    covers(overlay)


def test_turning_points(overlay):
    expected = np.pi / 0.002 * (np.arange(4) + 0.5)
    assert [m.time for m in overlay.turning] == pytest.approx(expected, rel=1e-5)
    assert [m.value for m in overlay.turning] == pytest.approx([1, -1, 1, -1], abs=1e-8)


def test_sheets_that_are_images_of_each_other(overlay):
    """The two halves of the cusp: what happens on one happens on the other half a period later."""
    up, down = overlay.transitions[:2]
    assert down.time - up.time == pytest.approx(np.pi / 0.002, abs=1e-5)
    assert down.delay == pytest.approx(up.delay, abs=1e-8)
    assert down.state == pytest.approx(-up.state, abs=1e-6)


@pytest.mark.parametrize("radius", [0.05, 0.2])
def test_the_radius_does_not_move_a_jump(diagram, overlay, radius):
    other = fs.overlay(diagram, overlay.run, radius=radius)
    assert [t_.time for t_ in other.transitions] == [t_.time for t_ in overlay.transitions]


def test_bad_arguments(diagram, overlay):
    with pytest.raises(fs.ArgumentError, match="radius = 0; expected a number between 0 and 1"):
        fs.overlay(diagram, overlay.run, radius=0)
    with pytest.raises(fs.UnknownNameError, match="unknown state 'y'"):
        fs.overlay(diagram, overlay.run, observed="y")
    other = fs.Model({v: w - v}, forcing={w: t})
    with pytest.raises(fs.UnknownNameError, match="unknown state of the trajectory 'x'"):
        fs.overlay(diagram, fs.simulate(other, [0], t=(0, 1)))


def test_a_run_that_ends_in_a_jump(cusp, diagram, overlay):
    first = overlay.transitions[0]
    run = fs.simulate(cusp, [-1.0], t=(0, 0.5 * (first.leave.time + first.time)))
    short = fs.overlay(diagram, run)
    (leaving,) = short.transitions
    assert leaving.land is None
    assert np.isnan(leaving.duration)
    assert leaving.to_branch == ""
    assert leaving.special.label == first.special.label
    assert "end of run" in short.summary()
    covers(short)


def test_one_sample(cusp, diagram):
    run = fs.simulate(cusp, [-1.0], t=(0, 1), dense=False, samples=[0.5])
    overlay = fs.overlay(diagram, run)
    assert (overlay.phases, overlay.transitions) == ((), ())
    assert overlay.followed.tolist() == [-1]
    assert "0 transitions over t = 0.5 to 0.5" in overlay.summary()
    assert fs.plot.overlay(overlay).handles


def test_a_run_that_grows_without_bound():
    """x' = w + x²: past the fold at w = 0 there is nothing to land on."""
    model = fs.Model({x: w + x**2}, forcing={w: t / 50 - 1})
    run = fs.simulate(model, [-1.0], t=(0, 100))
    assert not run.outcome
    overlay = fs.overlay(fs.continue_equilibria(model.frozen(), "w", over=(-1.2, 1.2)), run)
    (leaving,) = overlay.transitions
    assert (leaving.type, leaving.to_branch, leaving.land) == ("jump", "", None)
    assert 0 < leaving.delay < 2.338 * (1 / 50) ** (2 / 3)
    assert np.isfinite(overlay.lag[overlay.slow < -0.1]).all()
    covers(overlay)
