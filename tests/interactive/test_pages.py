"""Exported pages, opened from a file in a real browser without network."""

import re

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.interactive.frames import Store, kept_rows
from fastslow.interactive.pages import page_data
from fastslow.interactive.tooltips import text_of

pytestmark = pytest.mark.slow

#: Numbers of a page are stored in 32 bits: seven digits.
DIGITS = 2e-7


class Opened:
    """A page in the browser, with all that it said and asked for."""

    def __init__(self, page, path, width=1200):
        page.set_viewport_size({"width": width, "height": 900})
        self.page = page
        self.said, self.asked = [], []
        self.noting = {
            "console": lambda message: self.said.append(message.text),
            "pageerror": lambda error: self.said.append(str(error)),
            "request": lambda request: self.asked.append(request.url),
        }
        for event, note in self.noting.items():
            page.on(event, note)
        page.goto(path.as_uri())
        assert self.asked.pop() == path.as_uri()

    def close(self):
        for event, note in self.noting.items():
            self.page.remove_listener(event, note)
        self.page.mouse.move(0, 0)
        assert self.said == []
        assert self.asked == []

    def move(self, number, steps):
        """Move a slider by the keyboard."""
        slider = self.page.locator("#sliders input").nth(number)
        slider.focus()
        for _ in range(abs(steps)):
            slider.press("ArrowRight" if steps > 0 else "ArrowLeft")

    def columns(self, table):
        values = self.page.evaluate(
            f"arrays[state.frame.tables[{table}].array]().map((column) => [...column])"
        )
        return np.array(values)

    def drawn(self, panel, look, number=0):
        """Data coordinates of a line, read off the path that is on the screen."""
        text, box, x, y = self.page.evaluate(
            "([panel, look, number]) => { const drawn = state.drawn[panel]; return ["
            "drawn.svg.querySelectorAll(`path.${look}`)[number].getAttribute('d'),"
            "drawn.box, drawn.x, drawn.y]; }",
            [panel, look, number],
        )
        at = np.array([part.split() for part in re.split("[ML]", text)[1:]], dtype=float).T
        across = (at[0] - box["left"]) / (box["right"] - box["left"])
        up = (box["bottom"] - at[1]) / (box["bottom"] - box["top"])
        return x[0] + across * (x[1] - x[0]), y[0] + up * (y[1] - y[0])

    def place(self, panel, x, y):
        """Where data coordinates are on the screen."""
        return self.page.evaluate(
            "([panel, x, y]) => { const drawn = state.drawn[panel];"
            "const frame = drawn.svg.getBoundingClientRect(), scale = frame.width / drawn.width;"
            "const { box } = drawn, part = (v, [low, high]) => (v - low) / (high - low);"
            "return [frame.left + scale * (box.left + part(x, drawn.x) * (box.right - box.left)),"
            "frame.top + scale * (box.bottom - part(y, drawn.y) * (box.bottom - box.top))]; }",
            [panel, x, y],
        )

    def text(self, name):
        return self.page.locator(f"#{name}").inner_text()


@pytest.fixture
def open_page(browser_page):
    opened = []

    def opens(path, **settings):
        opened.append(Opened(browser_page, path, **settings))
        return opened[-1]

    yield opens
    for page in opened:
        page.close()


@pytest.fixture(scope="module")
def explorer(folded):
    sliders = {"D": (0.1, 0.5), "omega": (0, 0.04)}
    return fs.explore(folded, over=(-0.5, 0.5), periods=1, sliders=sliders)


@pytest.fixture(scope="module")
def page_file(explorer, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "gear.html"
    source = (
        "import fastslow as fs\nmodel = fs.systems.harmonic_gear(A=-0.6, B=0.0, C=0.4, omega=0.02)"
    )
    values = {"D": [0.25, 0.4], "omega": 3}
    assert explorer.export(path, sliders=values, source=source, progress=False) == path
    return path


def direct(folded, **values):
    model = folded.with_parameters(values)
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-0.5, 0.5))
    return diagram, fs.simulate(model, [0, 0], periods=1)


def test_a_slider_draws_the_run_of_its_value(folded, page_file, open_page):
    opened = open_page(page_file)
    assert opened.page.locator("#sliders output").all_inner_texts() == ["0.25", "0.02"]
    opened.move(0, 1)
    assert opened.page.locator("#sliders output").all_inner_texts() == ["0.4", "0.02"]
    diagram, run = direct(folded, D=0.4)
    times, *columns = opened.columns(0)
    np.testing.assert_allclose(times, run.t[kept_rows(run)], rtol=DIGITS)
    exact = run.dense_columns(np.clip(times, *run.span))
    # states change by as much as their time is rounded, at the fastest
    np.testing.assert_allclose(columns, exact, atol=2e-5)
    # and what is on the screen is that, to a pixel of 500 and 250
    t, x = opened.drawn(0, "trajectory")
    np.testing.assert_allclose(t, times, atol=run.span[1] / 500)
    np.testing.assert_allclose(x, columns[0], atol=np.ptp(columns[0]) / 250)
    branch = diagram.branches[0]
    table = opened.columns(1)
    np.testing.assert_allclose(table[0], branch.values, rtol=DIGITS, atol=DIGITS)
    np.testing.assert_allclose(table[1], branch["x"], rtol=DIGITS, atol=DIGITS)
    np.testing.assert_allclose(table[3:5].T, branch.eigenvalues.real, rtol=DIGITS, atol=DIGITS)
    np.testing.assert_allclose(table[5:7].T, branch.eigenvalues.imag, rtol=DIGITS, atol=DIGITS)
    dashed = opened.page.locator("#panels .main path.unstable")
    assert dashed.first.get_attribute("stroke-dasharray")
    assert not opened.page.locator("#panels .main path.followed").first.get_attribute(
        "stroke-dasharray"
    )


def test_hover_says_what_is_there_and_a_click_how_to_get_it(folded, page_file, open_page):
    opened = open_page(page_file)
    opened.move(0, 1)
    diagram, run = direct(folded, D=0.4)
    fold = diagram.folds[0]
    branch = next(b for b in diagram if fold in b.special)
    unstable = np.flatnonzero(branch.stability == "unstable")
    row = int(unstable[len(unstable) // 3])
    place = opened.place(2, branch.values[row], branch["x"][row])
    opened.page.mouse.move(*place)
    # six digits of parameter, states and eigenvalues, region, stability and type
    assert opened.text("tip") == text_of(branch[row], "w")
    opened.page.mouse.click(*place)
    assert opened.text("chosen") == text_of(branch[row], "w")
    names = {}
    exec(opened.text("call"), names)
    assert names["model"].parameters["D"] == 0.4
    np.testing.assert_array_equal(names["run"].end, run.end)
    np.testing.assert_allclose(names["point"].state, branch[row].state, atol=DIGITS)
    assert names["point"]["w"] == pytest.approx(branch.values[row], abs=DIGITS)

    opened.page.mouse.click(*opened.place(2, fold["w"], fold["x"]))
    exec(opened.text("call"), names)
    assert opened.text("chosen").startswith(f"{fold.label}, fold")
    assert names["point"].state.tolist() == fold.state.tolist()

    times, *columns = opened.columns(0)
    row = len(times) // 3
    opened.page.mouse.click(*opened.place(0, times[row], columns[0][row]))
    exec(opened.text("call"), names)
    np.testing.assert_allclose(names["point"], [columns[0][row], columns[1][row]], atol=1e-3)
    shown = float(re.search(r"t = (\S+)", opened.text("chosen"))[1])
    np.testing.assert_allclose(run(shown), names["point"], atol=1e-3)


def test_a_failed_frame_says_why_and_shows_the_rest(folded, page_file, open_page):
    opened = open_page(page_file)
    opened.move(1, -1)
    assert "common period" in opened.text("outcomes")
    assert opened.page.evaluate("state.drawn.length") == 1
    diagram, _ = direct(folded, D=0.25)
    np.testing.assert_allclose(opened.columns(0)[1], diagram.branches[0]["x"], atol=DIGITS)
    names = {}
    exec(opened.text("call"), names)
    assert "run" not in names
    opened.move(1, 1)
    assert opened.text("outcomes") == ""
    assert opened.page.evaluate("state.drawn.length") == 3


def test_a_telephone_needs_no_sideways_scrolling(page_file, open_page):
    opened = open_page(page_file, width=400)
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= 400
    wide = opened.page.evaluate("state.drawn.map((drawn) => drawn.width)")
    assert all(300 < width <= 400 for width in wide)
    opened.page.set_viewport_size({"width": 1000, "height": 800})
    opened.page.wait_for_function("state.drawn[2].width > 450")


def test_names_are_text_and_never_markup(tmp_path, open_page):
    x, w, t, k = sp.symbols("x w t k")
    bad = "</script><img src=x onerror=alert(1)><b>{{data}}"
    model = fs.Model(
        {x: w - sp.Abs(x - k)},
        forcing={w: 1 + sp.sin(0.1 * t)},
        parameters={k: 0.5},
        interfaces={bad: x - k},
    )
    explorer = fs.explore(model, sliders={"k": (0, 1)}, periods=1)
    path = explorer.export(tmp_path / "bad.html", sliders={"k": 2}, title=bad, progress=False)
    opened = open_page(path)
    assert opened.page.locator("h1").inner_text() == bad
    assert opened.page.locator("img").count() == 0
    assert opened.page.locator("b").count() == 0
    point = opened.page.evaluate("state.frame.panels[2].marks.find((m) => m.look === 'BE').points")
    assert any(bad in text for _, _, text, *_ in point)


@pytest.mark.sample(2)
@pytest.mark.parametrize("system", ["hindmarsh_rose", "stick_slip", "cusp"])
def test_pages_of_other_models(system, tmp_path, open_page):
    model = getattr(fs.systems, system)()
    explorer = fs.explore(model, t=(0, 200))
    opened = open_page(explorer.export(tmp_path / "page.html", sliders={}, progress=False))
    assert opened.text("outcomes") == ""
    assert opened.page.evaluate("state.drawn.length") == 3
    np.testing.assert_allclose(opened.columns(0)[1, -1], explorer.view.run.end[1], rtol=1e-5)


def test_lines_are_dotted_at_jumps(tmp_path, open_page):
    explorer = fs.explore(fs.systems.impact_oscillator(), periods=6)
    opened = open_page(explorer.export(tmp_path / "page.html", sliders={}, progress=False))
    drawn = opened.page.locator("path.reset").nth(1)
    assert drawn.get_attribute("d").count("M") >= 2
    same = opened.page.locator("path.earlier").first
    assert drawn.get_attribute("stroke") == same.get_attribute("stroke")
    assert len(drawn.get_attribute("stroke-dasharray").split()) == 2


def test_frames_share_what_does_not_change(explorer):
    one = page_data(explorer, {"omega": [0.02]})
    two = page_data(explorer, {"omega": [0.02, 0.03]})
    # a second run, and no second diagram
    assert len(two["arrays"]) == len(one["arrays"]) + 1


def test_numbers_that_are_none_survive():
    store = Store()
    store.add(np.array([[np.inf, 1.0, 100.0], [-np.inf, np.nan, 101.0]]))
    assert store.arrays[0]["first"] == [0.0, 0.0, 100.0]


def test_too_many_frames_are_refused_with_their_number(explorer, tmp_path):
    path = tmp_path / "page.html"
    with pytest.raises(
        fs.ArgumentError, match=r"900 frames \(30 of D × 30 of omega\).*max_frames=500"
    ):
        explorer.export(path, sliders={"D": 30, "omega": 30})
    assert not path.exists()


@pytest.mark.parametrize(
    ("sliders", "message"),
    [
        ({"A": 3}, "unknown slider 'A'"),
        ({"D": 0}, "at least one value"),
        ({"D": []}, "finite values"),
        ({"D": [0.1, np.nan]}, "finite values"),
        ({"D": "all"}, "finite values"),
    ],
)
def test_wrong_values_raise_before_anything_is_computed(explorer, tmp_path, sliders, message):
    with pytest.raises(fs.FastSlowError, match=message):
        explorer.export(tmp_path / "page.html", sliders=sliders)


def test_a_folder_that_is_not_there(explorer, tmp_path):
    with pytest.raises(fs.FileError, match="cannot be written"):
        explorer.export(tmp_path / "none" / "page.html", sliders={"D": [0.25]}, progress=False)


def test_branches_that_cross_name_their_branch_point_once():
    x, w, t = sp.symbols("x w t")
    model = fs.Model({x: x * (w - x)}, forcing={w: sp.sin(t / 10)})
    data = page_data(fs.explore(model, over=(-1, 1.3), state=[1]), {})
    for frame in data["frames"]:
        for panel in frame["panels"]:
            names = [p[4] for mark in panel["marks"] for p in mark["points"] if len(p) > 4]
            assert names.count("BP1") <= 1
    assert "BP1" in str(data["frames"])
