"""Interfaces in combinations of states, sliding segments and pseudo-equilibria, as drawn."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def filippov():
    """A cycle that slides along y = x + P, and the equilibria over P, between them pseudo-ones."""
    x, y, P = sp.symbols("x y P")
    push = sp.Piecewise((-1, y > x + P), (1, True))
    model = fs.Model({x: -x, y: push - y / 2}, parameters={P: 0.5})
    diagram = fs.continue_equilibria(model, "P", over=(-3, 3))
    return fs.simulate(model, [1.0, 0.0], t=(0, 6)), diagram


def test_an_interface_in_a_combination_is_its_zero_set(filippov):
    run, _ = filippov
    (name,) = run.interfaces
    drawn = fs.plot.phase_portrait(run)
    drawn.figure.draw_without_rendering()
    (line,) = drawn.interfaces
    x, y = line.get_data()
    assert np.nanmax(np.abs(y - x - 0.5)) < 1e-12
    low, high = drawn.ax.get_xlim()
    drawn.ax.set_xlim(low - 1, high + 1)
    drawn.figure.draw_without_rendering()
    assert np.nanmin(line.get_xdata()) < low
    # over the interface's own function it is the level 0, over a state of it nothing
    (level,) = fs.plot.time_series(run, name).interfaces
    assert set(level.get_ydata()) == {0.0}
    assert fs.plot.time_series(run, "x").interfaces == ()
    assert fs.plot.phase_portrait(run, interface_values={name: ("x", 0.1)}).interfaces == ()


def test_sliding_is_a_double_line(filippov):
    run, _ = filippov
    drawn = fs.plot.phase_portrait(run)
    line = drawn.sliding
    assert [h.get_label() for h in drawn.handles] == ["trajectory", "sliding", "interface crossing"]
    assert len(line.get_path_effects()) == 2
    x, y = line.get_data()
    kept = np.isfinite(x)
    assert np.abs(y - x - 0.5)[kept].max() < 1e-9
    slid = sum(s.duration for s in run.segments if "|" in s.region)
    times = run.t[kept[: len(run.t)]]
    assert times[-1] - times[0] == pytest.approx(slid, rel=1e-2)
    assert fs.plot.time_series(run, "y").sliding is not None


def test_pseudo_equilibria_have_a_look_of_their_own(filippov):
    _, diagram = filippov
    drawn = fs.plot.diagram(diagram, "y")
    names = {line.get_label() for line in drawn.lines}
    assert "stable pseudo-equilibrium" in names
    for line in drawn.lines:
        sliding = "pseudo" in line.get_label()
        assert len(line.get_path_effects()) == 2 * sliding
        if sliding and len(line.get_xdata()) > 2:
            # equilibria of the sliding motion: x = 0, y = P
            inner = slice(1, -1)
            np.testing.assert_allclose(line.get_ydata()[inner], line.get_xdata()[inner], atol=1e-9)


def test_a_run_without_sliding(gear_run):
    drawn = fs.plot.phase_portrait(gear_run)
    assert drawn.sliding is None
    # x - D and x + D, as lines across
    assert [set(line.get_xdata()) for line in drawn.interfaces]
