"""Insets of delays that their markers hide, with the predicted delays."""

import dataclasses

import numpy as np
import pytest

import fastslow as fs
from fastslow.plot.layout.collisions import overlaps
from fastslow.results.overlay.transitions import Transitions

pytestmark = pytest.mark.slow


def test_a_gap_crossing_is_magnified_with_its_law(gear_overlay):
    drawn = fs.plot.overlay(gear_overlay)
    inset = drawn.inset
    passages = [t for t in gear_overlay.transitions if t.type == "gap crossing"]
    assert len(inset.laws) == len(passages)
    low, high = inset.ax.get_xlim()
    for t, line in zip(passages, inset.laws, strict=True):
        w, x = line.get_data()
        # from the near interface to the predicted crossing of the far one
        assert np.abs(x[[0, -1]]) == pytest.approx(0.25, abs=1e-9)
        assert x[0] == pytest.approx(t.leave["x"], abs=1e-9)
        assert w[-1] == t.law.value == pytest.approx(t.land.value, rel=1e-3)
        assert low < w.min() < w.max() < high
        # the run itself is close to the parabola, within the neglected relaxation
        path = gear_overlay.run(np.linspace(t.leave.time, t.land.time, 60))[0]
        slow = np.interp(
            np.linspace(t.leave.time, t.land.time, 60), gear_overlay.t, gear_overlay.slow
        )
        order = np.argsort(w)
        assert np.abs(np.interp(slow, w[order], x[order]) - path).max() < 0.06 * 0.5
    assert "predicted delay" in drawn.data
    assert overlaps(drawn.figure) == ()
    assert fs.plot.overlay(gear_overlay, inset=None).inset is None


def test_only_what_the_marker_hides_is_magnified(folded_overlay):
    # a delay of 0.07 over a width of 1.1
    assert fs.plot.overlay(folded_overlay).inset is None
    wide = fs.plot.overlay(folded_overlay, legend=False)
    wide.ax.set_xlim(-20, 20)
    again = fs.plot.overlay(folded_overlay, ax=wide.ax)
    (law, *_) = again.inset.laws
    assert law.get_xdata().tolist() == [t.law.value for t in folded_overlay.transitions[:1]] * 2
    low, high = again.inset.ax.get_xlim()
    assert high - low < 1.0


def test_another_axis_than_the_slow_quantity(gear_overlay):
    assert fs.plot.overlay(gear_overlay, "v", x="x").inset is None


def test_an_unknown_word(gear_overlay):
    with pytest.raises(fs.FastSlowError, match="inset"):
        fs.plot.overlay(gear_overlay, inset="always")


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ["gear_overlay", "folded_overlay"])
def test_a_delay_without_a_prediction_is_not_magnified(name, request):
    overlay = request.getfixturevalue(name)
    unknown = [
        dataclasses.replace(t, law=dataclasses.replace(t.law, delay=np.nan))
        for t in overlay.transitions
    ]
    overlay = dataclasses.replace(overlay, transitions=Transitions(unknown))
    ax = fs.plot.overlay(overlay, legend=False).ax
    if name == "folded_overlay":
        # the delay is smaller than its marker
        ax.set_xlim(-20, 20)
    assert fs.plot.overlay(overlay, ax=ax).inset is None


def test_an_inset_does_not_cover_the_note_of_an_incomplete_overlay(gear_overlay):
    run = gear_overlay.run
    low, high = np.percentile(gear_overlay.slow, [1, 100])
    model = fs.systems.harmonic_gear()
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(float(low), float(high) + 1))
    overlay = fs.overlay(diagram, run)
    ax = fs.plot.overlay(overlay, legend=False).ax
    # all of the free space is at the top
    ax.set_ylim(-0.7, 2.5)
    drawn = fs.plot.overlay(overlay, ax=ax)
    note, *_ = (one for one in drawn.ax.texts if "leaves the range" in one.get_text())
    drawn.figure.canvas.draw()
    assert drawn.inset is not None
    assert not drawn.inset.ax.get_window_extent().overlaps(note.get_window_extent())
    assert not any(one.get_text() for one in drawn.inset.ax.texts)
