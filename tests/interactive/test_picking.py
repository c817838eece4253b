"""Hover and click on figures, by Matplotlib's own mouse events."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import fastslow as fs
from fastslow.interactive.tooltips import text_of

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def overlay(folded):
    diagram = fs.continue_equilibria(folded.frozen(), "w", over=(-0.5, 0.5))
    return fs.overlay(diagram, fs.simulate(folded, [0, 0], periods=1))


@pytest.fixture(scope="module")
def panel(overlay):
    drawing = fs.plot.panel(overlay)
    drawing.figure.canvas.draw()
    return drawing


def drawn(result, *names):
    """A diagram in a figure that can be drawn."""
    ax = FigureCanvasAgg(Figure()).figure.add_subplot()
    return fs.plot.diagram(result, *names, ax=ax, legend=False)


def given(overlay, call):
    return eval(
        call, {"np": np, "overlay": overlay, "diagram": overlay.diagram, "run": overlay.run}
    )


def test_a_click_beside_a_branch_gives_the_equilibrium_there(overlay, mouse):
    drawing = drawn(overlay.diagram)
    picks = []
    pointer = fs.pick(drawing, overlay.diagram, on_click=picks.append)
    # on the stable branch in S1, between rows: x³ − D x² − 0.6 x + 0.6 D = w
    (near,) = overlay.diagram.at(w=0.3217, stable=True)
    mouse("button_press_event", drawing.ax, 0.3217, near["x"])
    point = pointer.selected.point
    assert picks == [pointer.selected]
    assert point["w"] == pytest.approx(0.3217, abs=2e-3)
    x = point["x"]
    assert x**3 - 0.25 * x**2 - 0.6 * x + 0.15 == pytest.approx(point["w"], abs=1e-12)
    assert (point.region, point.stability) == ("S1", "stable")
    assert given(overlay, pointer.selected.call).state.tolist() == point.state.tolist()
    assert pointer.selected.distance < 1.0


def test_a_click_in_axes_of_expressions_and_functions(overlay, mouse):
    drawing = drawn(overlay.diagram, lambda columns: columns["x"] ** 2)
    pointer = fs.pick(drawing, overlay.diagram)
    (near,) = overlay.diagram.at(w=0.3217, stable=True)
    mouse("button_press_event", drawing.ax, 0.3217, near["x"] ** 2)
    assert pointer.selected.point["x"] == pytest.approx(near["x"], abs=2e-3)
    motion = fs.plot.phase_portrait(overlay.run, "x + v", "x*v")
    pointer = fs.pick(motion, overlay.run)
    state = overlay.run(10.0)
    mouse("button_press_event", motion.ax, state.sum(), state.prod())
    assert pointer.selected.point.state == pytest.approx(state, abs=5e-3)
    with pytest.raises(fs.ArgumentError, match="in the plane"):
        fs.pick(fs.plot.phase_portrait(overlay.run, z="t"), overlay.run)


def test_a_marker_goes_before_the_line_it_lies_on(overlay, mouse):
    drawing = drawn(overlay.diagram)
    pointer = fs.pick(drawing, overlay.diagram)
    fold = overlay.diagram.folds[0]
    mouse("button_press_event", drawing.ax, fold["w"], fold["x"])
    assert pointer.selected.point is fold
    assert given(overlay, pointer.selected.call) is fold
    mouse("motion_notify_event", drawing.ax, fold["w"], fold["x"])
    assert pointer.near.text.splitlines()[:2] == [f"{fold.label}, fold", f"w = {fold['w']:.6g}"]


def test_hover_shows_a_box_and_takes_it_away(overlay, mouse):
    drawing = drawn(overlay.diagram)
    drawing.figure.canvas.draw()
    clean = np.array(drawing.figure.canvas.buffer_rgba())
    pointer = fs.pick(drawing, overlay.diagram)
    drawing.figure.canvas.draw()
    (at,) = overlay.diagram.at(w=0.3, stable=True)
    mouse("motion_notify_event", drawing.ax, 0.3, at["x"])
    assert "S1, stable focus" in pointer.near.text
    over = np.array(drawing.figure.canvas.buffer_rgba())
    assert (over != clean).any(axis=2).sum() > 500
    mouse("motion_notify_event", drawing.ax, -0.4, 0.9)
    assert pointer.near is None
    np.testing.assert_array_equal(np.array(drawing.figure.canvas.buffer_rgba()), clean)
    mouse("motion_notify_event", drawing.ax, 0.3, at["x"])
    pointer.release()
    drawing.figure.canvas.draw()
    np.testing.assert_array_equal(np.array(drawing.figure.canvas.buffer_rgba()), clean)


def test_far_from_everything_nothing_is_meant(overlay, mouse):
    drawing = drawn(overlay.diagram)
    pointer = fs.pick(drawing, overlay.diagram)
    mouse("button_press_event", drawing.ax, -0.4, 0.9)
    mouse("button_press_event", drawing.ax, 0.0, 0.0, button=3)
    assert pointer.selected is None


def test_every_part_of_a_panel_answers(overlay, panel, mouse):
    pointer = fs.pick(panel, overlay)
    run = overlay.run
    time = 0.37 * run.span[1]
    mouse("button_press_event", panel.time_series.ax, time, run(time)[0])
    moment = pointer.selected.point
    assert moment.time == pytest.approx(time, rel=2e-3)
    np.testing.assert_array_equal(moment.state, run(moment.time))
    np.testing.assert_array_equal(given(overlay, pointer.selected.call).state, moment.state)
    assert moment.slow["w"] == pytest.approx(0.4 * np.sin(0.02 * moment.time), abs=1e-9)
    again = fs.simulate(
        fs.systems.harmonic_gear(A=-0.6, B=0.0, C=0.4, omega=0.02),
        moment.state,
        t=(moment.time, run.span[1]),
    )
    np.testing.assert_allclose(again.end, run.end, atol=1e-7)

    mouse("button_press_event", panel.phase_portrait.ax, *run(time))
    np.testing.assert_allclose(pointer.selected.point.state, run(time), atol=0.02)

    change = overlay.transitions[0]
    mouse("button_press_event", panel.overlay.ax, change.value, change.state[0])
    assert pointer.selected.point is change
    assert given(overlay, pointer.selected.call) is change
    assert pointer.selected.text.startswith(change.type)


def test_crossings_are_given_back(overlay, panel, mouse):
    pointer = fs.pick(panel, overlay)
    crossing = run_crossing = overlay.run.crossings[0]
    mouse("button_press_event", panel.phase_portrait.ax, *crossing.state)
    found = pointer.selected.point
    assert found.interface == run_crossing.interface
    np.testing.assert_allclose(found.state, crossing.state, atol=0.02)
    assert given(overlay, pointer.selected.call) is found
    assert "→" in pointer.selected.text


def test_a_run_without_series_is_read_between_its_samples(folded, mouse):
    run = fs.simulate(folded, [0, 0], periods=1, dense=False, samples=400)
    drawing = fs.plot.time_series(run, "v", crossings=False)
    pointer = fs.pick(drawing, run)
    mouse("button_press_event", drawing.ax, run.t[200], run["v"][200])
    moment = pointer.selected.point
    expected = [np.interp(moment.time, run.t, run[name]) for name in run.states]
    np.testing.assert_allclose(moment.state, expected, rtol=1e-12)
    assert moment.interpolated
    np.testing.assert_array_equal(eval(pointer.selected.call, {"run": run}).state, moment.state)


def test_a_diagram_from_a_file_answers(overlay, tmp_path, mouse):
    overlay.diagram.save(tmp_path / "gear.npz")
    loaded = fs.load(tmp_path / "gear.npz")
    drawing = drawn(loaded, "x - 0.1")
    pointer = fs.pick(drawing, loaded)
    (at,) = overlay.diagram.at(w=0.3, stable=True)
    mouse("button_press_event", drawing.ax, 0.3, at["x"] - 0.1)
    found = pointer.selected.point
    (exact,) = overlay.diagram.at(w=found["w"], stable=True)
    assert found["x"] == pytest.approx(exact["x"], abs=1e-4)


def test_what_does_not_belong_together_is_refused(overlay):
    with pytest.raises(fs.ArgumentError, match="DiagramDrawing of a Trajectory"):
        fs.pick(fs.plot.diagram(overlay.diagram), overlay.run)


def test_pseudo_equilibria_have_their_infinite_eigenvalue_in_words():
    model = fs.systems.stick_slip(delta=0.0)
    found = fs.equilibria(model)
    (point,) = [p for p in found if not p.pseudo]
    assert "λ = " in text_of(point, "F_s")
