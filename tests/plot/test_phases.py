"""The strip of phases above a time series."""

from io import BytesIO

import pytest
from matplotlib.figure import Figure

import fastslow as fs
from fastslow.results.overlay.transitions import Phase


def test_a_figure_of_its_own_names_what_has_room(folded_overlay):
    run, phases = folded_overlay.run, folded_overlay.phases
    drawn = fs.plot.time_series(run, phases=phases)
    assert len(drawn.phases) == len(drawn.words) == len(phases)
    for word, box, phase in zip(drawn.words, drawn.phases, phases, strict=True):
        if phase.type == "quasi-static":
            assert word.get_text() == f"on {phase.stable_branches[0]}"
        room = box.get_window_extent().width
        assert word.get_visible() == (word.get_window_extent().width <= room)


def test_what_has_no_room_stays_hidden_when_drawn_again(folded_overlay):
    start, end = folded_overlay.run.span
    half = 0.5 * (start + end)
    phases = [
        Phase(start, half, "quasi-static", ("S1",)),
        Phase(half, half + 0.001 * (end - start), "quasi-static", ("S2",)),
    ]
    drawn = fs.plot.time_series(folded_overlay.run, phases=phases)
    for _ in range(3):
        drawn.ax.figure.draw_without_rendering()
        assert [word.get_visible() for word in drawn.words] == [True, False]


@pytest.mark.sample(2)
@pytest.mark.parametrize("dpi", [40, 72, 300, 600])
def test_what_has_no_room_stays_hidden_at_another_resolution(folded_overlay, dpi):
    start, end = folded_overlay.run.span
    part = 0.02 * (end - start)
    phases = [
        Phase(start, start + part, "quasi-static", ("S1",)),
        Phase(start + part, start + 2 * part, "quasi-static", ("S1", "S2", "S3")),
        Phase(start + 2 * part, end, "quasi-static", ("S2",)),
    ]
    drawn = fs.plot.time_series(folded_overlay.run, phases=phases)
    drawn.figure.draw_without_rendering()
    shown = [word.get_visible() for word in drawn.words]
    assert shown[1:] == [False, True]
    drawn.figure.savefig(BytesIO(), dpi=dpi)
    assert [word.get_visible() for word in drawn.words] == shown


@pytest.mark.parametrize(
    ("phase", "text"),
    [
        (Phase(0, 100, "quasi-static", ("S1", "S2")), "on S1 S2"),
        (Phase(0, 100, "oscillating", (), 7, "cycle"), "7 oscillations"),
        (Phase(0, 100, "outside"), "outside"),
        (Phase(0, 100, "jump", ("S1",)), ""),
    ],
)
def test_what_a_phase_is_called(folded_overlay, phase, text):
    drawn = fs.plot.time_series(folded_overlay.run, phases=[phase])
    assert drawn.words[0].get_text() == text


def test_no_phases_no_strip(folded_overlay):
    drawn = fs.plot.time_series(folded_overlay.run, ax=Figure().add_subplot())
    assert drawn.phases == drawn.words == ()
    assert drawn.ax.get_ylim()[1] == pytest.approx(1.15, abs=0.1)
