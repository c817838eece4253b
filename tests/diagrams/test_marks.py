"""Zeros of expressions along branches of equilibria."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, w, a, b = sp.symbols("x y w a b")

#: x = w and y = x.
LINE = fs.Model({x: w - x, y: x - y}, parameters={w: 0})
#: w = x³ + a x² − b x.
CUBIC = fs.Model({x: w - (x**3 + a * x**2 - b * x)}, parameters={w: 0, a: 0.3, b: 0.8})

#: Expressions on x = y = w from −2 to 2, and their zeros.
ZEROS = {
    "level": ("x**2 - w - 0.5", [0.5 - np.sqrt(0.75), 0.5 + np.sqrt(0.75)]),
    "symbolic": (x - 2 * y + sp.Rational(1, 3), [1 / 3]),
    "touch": ("(x - 0.25)**2", [0.25]),
    "kink": ("Abs(x - 0.3)*(2.5 + x)", [0.3]),
    "pole": ("1/x", []),
    "jump": ("Piecewise((1, x < 0.1), (-1, True))", []),
    "pieces": ("Piecewise((x + 1, x < 0), (x - 1, True))", [-1.0, 1.0]),
    "first": ("x + 2", [-2.0]),
    "final": ("y - 2", [2.0]),
    "near": ("(x - 0.7)**2 - 1e-10", [0.7 - 1e-5, 0.7 + 1e-5]),
    "missed": ("(x - 0.7)**2 + 1e-8", []),
    "triple": ("(x - 0.1)**3", [0.1]),
    "fast": ("sin(100*x + 0.1)", (np.arange(-63, 64) * np.pi - 0.1) / 100),
    "same": ("x - y", []),
    "part": ("Max(x, 0) - x", []),
}


@pytest.fixture(scope="module")
def line():
    marks = {name: expression for name, (expression, _) in ZEROS.items()}
    return fs.continue_equilibria(LINE, "w", (-2, 2), marks={"w": [0.5], **marks})


@pytest.mark.parametrize("name", [n for n in ZEROS if n != "part"])
def test_zeros_are_located_to_rounding(line, name):
    found = line.special.select(mark=name)
    zeros = ZEROS[name][1]
    assert len(found) == len(zeros)
    if len(zeros):
        # extrema are located by differences
        within = 1e-11 if name in ("touch", "kink", "triple") else 1e-14
        assert np.abs(found["x"] - zeros).max() < within
        assert [p.label for p in found] == [f"{name}{k}" for k in range(1, len(zeros) + 1)]


def test_what_is_not_a_crossing_is_said(line):
    noted = {p.mark for p in line.special if "no change of sign" in p.note}
    assert noted == {"touch", "kink"}
    assert "same (x - y = 0) holds, to rounding" in line.outcome.message
    assert "part (Max(x, 0) - x = 0) holds" in line.outcome.message
    assert "pole" not in line.outcome.message


def test_values_and_expressions_are_given_together(line):
    (value,) = line.special.select(code="UZ", mark="")
    assert value["w"] == 0.5
    assert value.label == "UZ1"
    assert value.words == "user value"


def test_points_say_what_they_are(line, tmp_path):
    point = line["level2"]
    assert point.code == "UZ"
    assert point.words == "zero of x**2 - w - 0.5"
    assert "level2: zero of x**2 - w - 0.5; x = 1.36603" in repr(point)
    assert line[0]["level2"]["w"] == point["w"]
    assert len(line.select(code="level").branches) == 1
    assert [p.label for p in line.special("level")] == ["level1", "level2"]
    assert "level1" in " ".join(line[0].to_dict()["label"].tolist())
    with pytest.raises(fs.UnknownNameError, match="did you mean 'level2'"):
        line["level3"]
    with pytest.raises(fs.UnknownNameError, match="unknown special point code 'levl'"):
        line.special("levl")
    for suffix in ("npz", "nc"):
        line.save(tmp_path / f"line.{suffix}")
        again = fs.load(tmp_path / f"line.{suffix}")
        assert again["level2"].title == "level (x**2 - w - 0.5 = 0)"
        assert again["level2"]["x"] == point["x"]


def test_figures_name_them(line):
    few = fs.continue_equilibria(LINE, "w", (-2, 2), marks={"level": "x**2 - w - 0.5"})
    drawing = fs.plot.diagram(few, y="x")
    assert {t.get_text() for t in drawing.labels} >= {"level1", "level2"}
    assert "level (x**2 - w - 0.5 = 0)" in [t.get_text() for t in drawing.legend.get_texts()]


def test_random_polynomials():
    """Zeros of factored polynomials along a branch with two folds."""
    rng = np.random.default_rng(20261128)
    for _ in range(12):
        roots = np.sort(rng.uniform(-1.2, 1.2, rng.integers(2, 7)))
        text = "*".join(f"(x - ({float(r)!r}))" for r in roots)
        found = fs.continue_equilibria(CUBIC, "w", (-8, 8), marks={"zero": text}).special("zero")
        assert len(found) == len(roots)
        assert np.abs(np.sort(found["x"]) - roots).max() < 1e-13


def test_zeros_at_folds_and_interfaces():
    fold = fs.continue_equilibria(CUBIC, "w", (-8, 8)).folds[0]
    marks = {"state": f"x - ({fold['x']!r})", "value": f"w - ({fold['w']!r})"}
    found = fs.continue_equilibria(CUBIC, "w", (-8, 8), marks=marks)
    assert abs(found["state1"]["x"] - fold["x"]) < 1e-14
    touching = [p for p in found.special("value") if p.note]
    assert len(touching) == 1
    assert len(found.special("value")) == 2
    assert abs(touching[0]["w"] - fold["w"]) < 1e-14

    kinked = fs.Model({x: w - x - sp.Abs(x) / 2}, parameters={w: 0})
    found = fs.continue_equilibria(kinked, "w", (-1, 1), marks={"edge": "x", "level": "x - w/3"})
    assert len(found.special("BE")) == 1
    # w = x/2 below and 3x/2 above the interface
    assert abs(found["edge1"]["x"]) < 1e-15
    assert [p.label for p in found.special("edge")] == ["edge1"]
    assert len(found.special("level")) == 1


@pytest.mark.parametrize(
    ("marks", "error", "match"),
    [
        ({"LP": "x"}, fs.ArgumentError, "is the code of a fold"),
        ({"x": "x - 1"}, fs.ArgumentError, "is that of x"),
        ({"level2": "x - 1"}, fs.ArgumentError, "does not end with a digit"),
        ({"a b": "x - 1"}, fs.ArgumentError, "expected an identifier"),
        ({"level": "xx - 1"}, fs.UnknownNameError, "did you mean 'x'"),
        ({"level": "1 + 2"}, fs.ArgumentError, "is constant"),
        ({"level": "x > 1"}, fs.ArgumentError, "is a condition"),
        ({"level": "x +"}, fs.ArgumentError, "is not an expression"),
        ({"level": 1.0}, fs.UnknownNameError, "unknown parameter in marks 'level'"),
        ({"w": [3]}, fs.ArgumentError, "outside the range"),
    ],
)
def test_bad_marks(marks, error, match):
    with pytest.raises(error, match=match):
        fs.continue_equilibria(LINE, "w", (-2, 2), marks=marks)


def test_stored_models(tmp_path):
    diagram = fs.continue_equilibria(CUBIC, "w", (-8, 8))
    diagram.save(tmp_path / "cubic.npz")
    stored = fs.load(tmp_path / "cubic.npz")
    again = fs.continue_equilibria(
        stored.model, "w", (-8, 8), from_points=[{"x": 1.0, "w": 0.5}], marks={"one": "x - 1"}
    )
    assert abs(again["one1"]["w"] - 0.5) < 1e-15


@pytest.fixture(scope="module")
def cusp():
    return fs.Model({x: a + b * x - x**3}, parameters={a: 0, b: 1})


def test_zeros_are_continued_in_two_parameters(cusp, tmp_path):
    """x = a + 1/2 on a + b x = x³ is a = x − 1/2, b = x² − 1 + 1/(2x)."""
    diagram = fs.continue_equilibria(cusp, "a", (-1, 1), marks={"level": "x - a - 0.5"})
    point = diagram["level1"]
    over = {"a": (-1, 1), "b": (-2, 3)}
    marks = {"b": [0.75], "middle": "x - 3*a", "flat": "x - a - 1/2", "touch": "(b - 0.75)**2"}
    curve = fs.continue_points(point, ("a", "b"), over, marks=marks)
    assert curve.code == "UZ"
    assert curve.title == "level (x - a - 0.5 = 0)"
    assert "Curve of level (x - a - 0.5 = 0) in" in curve.summary()
    assert np.abs(curve["x"] - curve["a"] - 0.5).max() < 1e-14
    assert np.abs(curve["a"] + curve["b"] * curve["x"] - curve["x"] ** 3).max() < 1e-13
    # x = 3 a and x = a + 1/2
    (middle,) = curve.special("middle")
    assert abs(middle["a"] - 0.25) < 1e-13
    assert middle.label == "middle1"
    assert all(abs(p["b"] - 0.75) < 1e-15 for p in curve.special.select(code="UZ", mark=""))
    touching = curve.special("touch")
    assert len(touching) == len(curve.special.select(code="UZ", mark=""))
    assert np.abs(touching["b"] - 0.75).max() < 1e-7
    assert all("no change of sign" in p.note for p in touching)
    assert "The test for flat (x - a - 1/2 = 0) vanishes along the curve" in curve.outcome.message
    curve.save(tmp_path / "curve.npz")
    assert fs.load(tmp_path / "curve.npz").title == curve.title
    drawing = fs.plot.parameter_plane(curve)
    texts = [t.get_text() for t in drawing.legend.get_texts()]
    assert curve.title in texts
    assert "middle (x - 3*a = 0)" in texts


def test_curves_of_all_points_of_a_diagram(cusp):
    marks = {"a": [0.1], "level": "x - a - 0.5"}
    diagram = fs.continue_equilibria(cusp, "a", (-1, 1), marks=marks)
    over = {"a": (-1, 1), "b": (-2, 3)}
    everything = fs.continue_points(diagram, ("a", "b"), over)
    assert sorted(curve.code for curve in everything) == ["LP", "UZ"]
    (level,) = fs.continue_points(diagram, ("a", "b"), over, code="level")
    assert level.mark == "level"
    with pytest.raises(fs.ArgumentError, match="a zero of an expression given in marks="):
        fs.continue_points(diagram["UZ1"], ("a", "b"), over)
    with pytest.raises(fs.UnknownNameError, match="did you mean 'level'"):
        fs.continue_points(diagram, ("a", "b"), over, code="levl")
