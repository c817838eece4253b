"""Results as plain arrays, data frames, labelled arrays, and tables in a notebook."""

from html.parser import HTMLParser

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.base import html
from fastslow.results.base.html import HTML_ROWS, cells_as_html

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def diagram(folded_gear):
    return fs.continue_equilibria(folded_gear.frozen(), "w", over=(-0.5, 0.5))


@pytest.fixture(scope="module")
def run(gear):
    return fs.simulate(gear, [0, 0], periods=1)


@pytest.fixture(scope="module")
def overlay(folded_gear):
    fast = fs.continue_equilibria(folded_gear.frozen(), "w", over=(-0.5, 0.5))
    return fs.overlay(fast, fs.simulate(folded_gear, [0, 0], periods=2))


@pytest.fixture(scope="module")
def results(gear, diagram, run, overlay):
    return {
        "transitions": overlay.transitions,
        "phases": overlay.phases,
        "diagram": diagram,
        "branch": diagram[0],
        "points": diagram.special,
        "run": run,
        "overlay": fs.overlay(fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6)), run),
        "ensemble": fs.simulate_many(gear, [[0, 0], [1, 0]], periods=1),
        "sweep": fs.bifurcation_sweep(gear, "C", [3.4, 3.5], [0, 0], settle=0, keep=1),
        "section": run.section(interface="x - D"),
        "spectrum": run.spectrum("x"),
    }


KINDS = [
    "transitions", "phases",
    "diagram", "branch", "points", "run", "overlay", "ensemble", "sweep", "section", "spectrum",
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_columns_are_the_same_in_every_form(results, kind):
    result = results[kind]
    plain = result.to_dict()
    assert all(type(values) is np.ndarray and values.ndim == 1 for values in plain.values())
    assert len({len(values) for values in plain.values()}) == 1
    frame = result.to_frame()
    assert list(frame.columns) == list(plain)
    labelled = result.to_xarray()
    assert set(labelled.variables) == set(plain)
    for name, values in plain.items():
        assert frame[name].to_numpy(dtype=values.dtype).tobytes() == values.tobytes()
        assert labelled[name].to_numpy().tobytes() == values.tobytes()
    assert frame.attrs["result"] == type(result).__name__


def test_what_stands_in_them(results, diagram, run):
    branch = diagram.to_dict()
    assert list(branch) == [
        "branch", "w", "x", "v", "region", "stability", "eigenvalue_1", "eigenvalue_2", "label",
    ]  # fmt: skip
    row = list(branch["label"]).index("LP1")
    assert branch["w"][row] == diagram.folds[0]["w"]
    corner = diagram.boundary_equilibria[0].label
    assert list(branch["label"]).count(corner) == 1
    motion = run.to_dict()
    assert motion["region"][0] == "S2"
    inside = motion["region"] == "S2"
    assert np.abs(motion["x"][inside]).max() <= 0.25 + 1e-12
    assert np.abs(motion["x"][~inside]).min() >= 0.25 - 1e-12
    assert run.to_xarray().indexes["t"].size == len(run.t)
    assert run.to_xarray().attrs["omega"] == 0.01
    many = results["ensemble"].to_frame()
    assert many["hits x - D upwards"].tolist() == results["ensemble"].hits[:, 0, 0].tolist()
    assert results["ensemble"].to_xarray().attrs["D"] == 0.25
    stable_branches = results["overlay"].to_dict()["stable_branch"]
    assert set(stable_branches) <= {"", *(s.label for s in results["overlay"].stable_branches)}
    points = diagram.special.to_frame()
    assert points["label"].tolist() == [p.label for p in diagram.special]
    assert points["A"].unique().tolist() == [-0.6]


def test_transitions_as_a_table(overlay):
    found = overlay.transitions
    assert found["t"].tolist() == [t.time for t in found]
    assert found["w"].tolist() == [t.value for t in found]
    assert found["x"].tolist() == [t.state[0] for t in found]
    jumps = found.select(type="jump")
    assert 0 < len(jumps) == sum(t.type == "jump" for t in found)
    late = jumps.select("delay > 0 and w > 0")
    assert [t.time for t in late] == [t.time for t in jumps if t.delay > 0 and t.value > 0]
    first = jumps[0]
    assert jumps.nearest(t=first.time + 1e-3) is first
    middle = 0.5 * (first.leave.time + first.land.time)
    assert list(found.at(t=middle)) == [first]
    assert first in found.at(w=0.5 * (first.leave.value + first.land.value))
    assert [len(some) for some in found.at(t=[middle, 0.0])] == [1, 0]
    assert found[:1] == (found[0],)
    assert found.select(type="Hopf") == ()
    assert found.select(type="Hopf")["delay"].shape == (0,)
    with pytest.raises(fs.UnknownNameError, match="did you mean 'jump'"):
        found.select(type="jmp")
    with pytest.raises(fs.UnknownNameError, match="unknown transition parameter 'v'"):
        found.at(v=0.0)


def test_phases_as_a_table(overlay):
    found = overlay.phases
    assert found["duration"] == pytest.approx([p.end - p.start for p in found])
    (now,) = found.at(t=0.5 * (found[1].start + found[1].end))
    assert now is found[1]
    long = found.select("duration > 5", type="quasi-static")
    assert len(long) > 1
    assert all(p.duration > 5 for p in long)
    assert found.nearest(start=found[2].start) is found[2]
    assert "quasi-static" in repr(long)
    with pytest.raises(fs.UnknownNameError, match="did you mean 'jump'"):
        found.select(type="jmp")


def test_a_run_that_made_no_step_is_an_empty_table():
    x = sp.Symbol("x")
    stuck = fs.simulate(fs.Model({x: -sp.log(x)}), [-1], t=(0, 1))
    assert stuck.to_dict()["region"].tolist() == [""]
    assert "not finite" in stuck._repr_html_()


class Cells(HTMLParser):
    """Gathers the cells, and checks that tags are closed in order."""

    def __init__(self):
        super().__init__()
        self.open, self.cells, self.rows = [], [], 0

    def handle_starttag(self, tag, attrs):
        if tag != "br":
            self.open.append(tag)
        self.rows += tag == "tr"
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.cells[-1] += data


def cells(result):
    parser = Cells()
    parser.feed(result._repr_html_())
    assert not parser.open
    return parser


def test_special_points_in_a_notebook(diagram):
    for result in (diagram, diagram[0], diagram.special):
        parsed = cells(result)
        assert {"LP1", "BE2", "fold", "x - D", "0.0894402"} <= set(parsed.cells)
        assert parsed.rows == 1 + len(diagram.special)
    assert "A" not in cells(diagram.special).cells


def test_crossings_in_a_notebook(run):
    parsed = cells(run)
    assert {"upwards", "x - D", "S1", "S2"} <= set(parsed.cells)
    assert parsed.rows == 1 + len(run.crossings)


def test_a_curve_of_points_in_a_notebook():
    x, p, q = sp.symbols("x p q")
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    fold = fs.continue_equilibria(model, "p", (-1, 1)).folds[0]
    curve = fs.continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)})
    parsed = cells(curve).cells
    assert "CP1" in parsed
    # the two parameters in the order in which they were asked for, whatever else varies
    assert parsed[:5] == ["point", "kind", "p", "q", "x"]
    # p² = 4 q³ / 27
    assert np.abs(curve["27*p**2 - 4*q**3"]).max() < 1e-9
    assert curve.to_dict()["label"].tolist().count("CP1") == 1
    assert curve.to_frame().shape[0] == len(curve)


def test_text_is_escaped_and_tables_end():
    text = cells_as_html("<b>& a > b", html.Cells(["<script>"], [["<i>"]] * (HTML_ROWS + 7)))
    assert "<script>" not in text
    assert "<b>" not in text
    assert "<i>" not in text
    assert "… 7 more" in text
    assert "a &gt; b" in text
    assert text.count("<tr>") == HTML_ROWS + 2


def test_models_and_derivations_are_typeset(gear):
    assert r"\begin{align*}" in gear._repr_latex_()
    odd = sp.Symbol("<img src=x onerror=alert(1)>")
    for text in (fs.Model({odd: -odd})._repr_latex_(), fs.Model({odd: -odd})._repr_html_()):
        assert "<img" not in text
    derivation = fs.derive(gear.frozen())
    assert "\\" in derivation._repr_latex_()
    assert gear.equations.splitlines()[0] == "x' = v"
