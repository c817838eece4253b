"""Explorers: sliders change the figure, with widgets and without."""

import asyncio
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import fastslow as fs
from fastslow.interactive.controls import DEBOUNCE

pytestmark = pytest.mark.slow

#: ipympl 0.10 makes its toolbar in a way that traitlets will refuse one day
IPYMPL = pytest.mark.filterwarnings("ignore:Passing unrecognized arguments:DeprecationWarning")


def pixels(figure):
    figure.canvas.draw()
    return np.array(figure.canvas.buffer_rgba())


def test_set_shows_other_values(explorer):
    before = pixels(explorer.figure)
    view = explorer.set(D=0.4)
    assert view is explorer.view
    assert sorted(point["x"] for point in view.diagram.boundary_equilibria) == [-0.4, 0.4]
    assert (pixels(explorer.figure) != before).any()
    explorer.set({"C": 0.3}, x=0.1)
    assert explorer.view.changes == {"D": 0.4, "C": 0.3}
    assert explorer.view.run(0.0)[0] == 0.1
    explorer.set({"D": 0.25, "C": 0.4, "x": 0.0})
    np.testing.assert_array_equal(pixels(explorer.figure), before)


def test_nothing_is_compiled_anew_by_a_slider(explorer, monkeypatch):
    explorer.set(D=0.4)
    from fastslow.kernels.compiler import store

    monkeypatch.setattr(store, "read", None)
    assert explorer.set(D=0.35).outcomes == ()


def test_threads_take_turns(explorer):
    values = np.linspace(0.2, 0.4, 3)
    with ThreadPoolExecutor(3) as pool:
        views = list(pool.map(lambda value: explorer.set(D=value), values))
    assert [view.model.parameters["D"] for view in views] == values.tolist()
    shown = pixels(explorer.figure)
    explorer.set()
    np.testing.assert_array_equal(pixels(explorer.figure), shown)


def test_unknown_names_and_numbers_that_are_none(explorer):
    with pytest.raises(fs.UnknownNameError, match="unknown parameter or state 'Dd'"):
        explorer.set(Dd=1)
    with pytest.raises(fs.ModelError, match="finite"):
        explorer.set(D=float("inf"))
    with pytest.raises(fs.ArgumentError, match="initial x"):
        explorer.set(x=float("nan"))
    assert explorer.view.changes == {}


@pytest.mark.parametrize(
    ("sliders", "message"),
    [
        ({"E": (0, 1)}, "unknown parameter or state 'E'"),
        ({"D": (0.3, 0.5)}, "does not contain its value, 0.25"),
        ({"D": (1, 0)}, "expected two finite numbers"),
        ({"D": 3}, "expected two finite numbers"),
        ({"x": (0.5, 1)}, "does not contain its value, 0"),
    ],
)
def test_wrong_sliders_raise_at_once(folded, sliders, message):
    with pytest.raises(fs.FastSlowError, match=message):
        fs.explore(folded, sliders=sliders)


def test_every_parameter_has_a_slider_by_default(folded):
    found = {s.name: (s.low, s.high) for s in fs.explore(folded, periods=1).sliders}
    assert found == {
        "A": (-1.2, 0.0), "B": (-1.0, 1.0), "C": (0.0, 0.8), "D": (0.0, 0.5), "omega": (0.0, 0.04),
    }  # fmt: skip


def test_a_gap_of_no_width_is_shown(explorer):
    view = explorer.set(D=0)
    assert view.run is not None
    assert view.diagram is not None
    exec(explorer.call(), {"fs": fs, "model": explorer.model})


def test_a_failure_stands_below_the_figure(explorer):
    explorer.set(omega=0)
    assert explorer.view.run is None
    assert any("common period" in text.get_text() for text in explorer.figure.texts)
    explorer.set(omega=0.02)
    assert not any("common period" in text.get_text() for text in explorer.figure.texts)


def test_a_click_selects_a_point_and_prints_the_call(explorer, mouse, capsys):
    fold = explorer.view.diagram.folds[0]
    (main,) = [ax for ax in explorer.figure.axes if ax.get_xlabel() == "$w$"]
    mouse("button_press_event", main, fold["w"], fold["x"])
    assert explorer.selected.point is fold
    names = {"fs": fs, "model": explorer.model}
    exec(capsys.readouterr().out, names)
    assert names["point"].label == fold.label
    assert names["point"]["w"] == fold["w"]
    exec(explorer.call(), names)
    assert names["point"].state.tolist() == fold.state.tolist()


def test_the_run_is_laid_over_the_diagram_and_stands_beside_it(explorer, mouse):
    run, overlay = explorer.view.run, explorer.view.overlay
    (main,) = [ax for ax in explorer.figure.axes if ax.get_xlabel() == "$w$"]
    (series,) = [ax for ax in explorer.figure.axes if ax.get_xlabel() == "$t$"]
    change = overlay.transitions[0]
    mouse("button_press_event", main, change.value, change.state[0])
    assert explorer.selected.point is change
    time = 0.37 * run.span[1]
    mouse("button_press_event", series, time, run(time)[0])
    assert explorer.selected.point.time == pytest.approx(time, rel=5e-3)


def test_a_selected_point_belongs_to_the_view_it_was_selected_in(explorer, mouse):
    fold = explorer.view.diagram.folds[0]
    (main,) = [ax for ax in explorer.figure.axes if ax.get_xlabel() == "$w$"]
    mouse("button_press_event", main, fold["w"], fold["x"])
    explorer.set(D=0.4)
    assert explorer.selected.point is fold
    assert "point" not in explorer.call()


@pytest.mark.parametrize("system", ["cusp", "stick_slip", "hindmarsh_rose"])
def test_models_of_other_forms(system):
    model = getattr(fs.systems, system)()
    explorer = fs.explore(model, t=(0, 50))
    assert explorer.view.outcomes == ()
    assert len(explorer.figure.axes) == 3


def test_a_figure_of_the_users_own(folded):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 4))
    assert fs.explore(folded, periods=1, figure=figure).figure is figure


@IPYMPL
def test_widgets_move_the_figure(explorer):
    box = explorer.widget
    controls = explorer._widget
    assert box.children[1] is controls.canvas
    assert controls.canvas.figure is explorer.figure
    slider = controls.sliders["D"]
    assert (slider.min, slider.max, slider.value) == (0.1, 0.5, 0.25)
    before = pixels(explorer.figure)
    slider.value = 0.4
    assert explorer.view.changes == {"D": 0.4}
    assert (pixels(explorer.figure) != before).any()
    assert "&#x27;D&#x27;: 0.4" in controls.words.value
    assert "application/vnd.jupyter.widget-view+json" in explorer._repr_mimebundle_()


@IPYMPL
def test_a_slider_that_moves_is_followed_at_once_and_measured_when_it_rests(explorer):
    explorer.widget  # noqa: B018
    slider = explorer._widget.sliders["D"]
    seen = []

    async def drag():
        for value in (0.3, 0.35, 0.4):
            slider.value = value
            seen.append((explorer.view.changes["D"], explorer.view.overlay))
            await asyncio.sleep(0.01)
        await asyncio.sleep(2 * DEBOUNCE)

    asyncio.run(drag())
    assert seen == [(0.3, None), (0.35, None), (0.4, None)]
    assert explorer.view.changes == {"D": 0.4}
    assert explorer.view.overlay.diagram.parameters["D"] == 0.4


@IPYMPL
def test_the_value_of_the_model_lies_on_a_step(folded):
    explorer = fs.explore(folded, periods=1, sliders={"D": (0.1, 0.5), "C": (-1, 1)})
    explorer.widget  # noqa: B018
    for slider in explorer._widget.sliders.values():
        steps = (slider.value - slider.min) / slider.step
        assert steps == pytest.approx(round(steps), abs=1e-9)


@IPYMPL
def test_set_moves_the_widgets(explorer):
    sliders = explorer.widget and explorer._widget.sliders
    explorer.set(D=0.4, C=0.7)
    assert (sliders["D"].value, sliders["C"].value) == (0.4, 0.7)
    # beyond the end of the slider
    explorer.set(D=0.6)
    assert explorer.view.changes["D"] == 0.6


@IPYMPL
def test_a_click_in_the_widget_is_told_there(explorer, mouse, capsys):
    words = explorer.widget.children[2]
    fold = explorer.view.diagram.folds[0]
    (main,) = [ax for ax in explorer.figure.axes if ax.get_xlabel() == "$w$"]
    mouse("button_press_event", main, fold["w"], fold["x"])
    assert fold.label in words.value
    assert "point = diagram.special" in words.value
    assert capsys.readouterr().out == ""


def test_without_the_extra_the_figure_is_shown_and_the_extra_named(explorer, monkeypatch):
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    with pytest.raises(fs.MissingPackageError, match=r"pip install 'fastslow\[interactive\]'"):
        explorer.widget  # noqa: B018
    shown = explorer._repr_mimebundle_()
    assert shown["image/png"].startswith(b"\x89PNG")
    assert "fastslow[interactive]" in shown["text/plain"]


def test_exploring_imports_no_widgets_and_a_live_figure_leaves_the_backend_of_pyplot():
    code = (
        "import sys, fastslow as fs; fs.explore, fs.pick; "
        "print(sorted({'ipywidgets', 'ipympl', 'matplotlib.pyplot'} & set(sys.modules))); "
        "import matplotlib; matplotlib.use('svg'); "
        "fs.explore(fs.systems.cusp(), sliders={}, t=(0, 1)).widget; "
        "print(matplotlib.get_backend())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    assert done.stdout.split() == ["[]", "svg"]
