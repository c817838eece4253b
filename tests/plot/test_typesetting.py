"""Names of any kind in every figure, and how names and expressions are written."""

import pytest
import sympy as sp
from matplotlib.figure import Figure

import fastslow as fs
from fastslow.plot.layout.typesetting import as_given, plain, typeset, written

pytestmark = pytest.mark.slow

#: Names that Matplotlib, LaTeX or Python read as more than letters.
HOSTILE = ("m%", "a'b\"c", "x^2", "a&b", "$", "\\", "{", "}", "line\nfeed", "_", "#", "x_", "~")


def drawn(*texts):
    """Whether Matplotlib can draw texts."""
    figure = Figure()
    ax = figure.add_subplot()
    for text in texts:
        ax.text(0.5, 0.5, text)
        ax.plot([0, 1], label=text)
    assert len(ax.legend().get_texts()) == len(texts)
    figure.canvas.draw()


@pytest.mark.parametrize("name", [*HOSTILE, "$x$", "$\\foo$", "x__y", "omega_", "\\frac{1}", "\0"])
def test_every_name_is_drawn(name):
    drawn(typeset(name), plain(name), as_given(name), written(name), f"{typeset(name)} $x$")


@pytest.mark.parametrize(
    ("expression", "label"),
    [
        ("x**2 - (v - 1)", r"$x^{2} - (v - 1)$"),
        ("Abs(x)/(2*v)", r"$|x|/(2\,v)$"),
        ("1e-3*x", r"$1\cdot 10^{-3}\,x$"),
        ("atan2(-x, _x)", r"$\mathrm{atan2}(-x, \mathrm{\_x})$"),
        ("a'b", "a'b"),
        ("x - D", "$x - D$"),
    ],
)
def test_expressions(expression, label):
    assert written(expression) == label
    drawn(label)


def test_conditions_can_be_drawn():
    drawn(written("Piecewise((x, (x > D) & ~(v <= 0) | (x == 1)), (-x, True))"))


def test_mathematics_of_the_user_stays():
    assert as_given(r"at $\omega = 2$") == r"at $\omega = 2$"
    assert as_given("two\nlines") == "two\nlines"


@pytest.fixture(scope="module")
def odd():
    """A gear whose names are all hostile, with everything that can be drawn of it."""
    x, v, w = (sp.Symbol(name) for name in ("m%", "a'b\"c", "$"))
    A, D, omega = (sp.Symbol(name) for name in ("x^2", "{", "line\nfeed"))
    f = sp.Piecewise((x - D, x > D), (x + D, x < -D), (0, True))
    t = sp.Symbol("t")
    model = fs.Model(
        {x: v, v: w - v - (x**2 + A) * f},
        forcing={w: 2.4 + 3.5 * sp.sin(omega * t)},
        parameters={A: -0.5, D: 0.25, omega: 0.05},
        interfaces={"\\frac{": x - D, "_&": x + D},
        regions={"$upper": x > D, "_gap\n": (x < D) & (x > -D), "{\\lower%": x < -D},
    )
    diagram = fs.continue_equilibria(model.frozen(), w, over=(-2, 6))
    run = fs.simulate(model, [0, 0], periods=2)
    return model, diagram, run, fs.overlay(diagram, run)


def test_every_figure_survives_its_names(odd):
    model, diagram, run, overlay = odd
    fold = diagram.special("BE")[0]
    curve = fs.continue_points(fold, ("$", "x^2"), over={"$": (-2, 6), "x^2": (-1, 1)})
    wedge = fs.refined_map(
        lambda a, b: ["$in" if p > q else "_out{" for p, q in zip(a, b, strict=True)],
        {"m%": (0, 1), "x^2": (0, 1)},
        refinement=fs.Refinement(cells=(4, 4), levels=1),
    )
    swept = fs.bifurcation_sweep(model, "x^2", [-0.5, -0.4], [0, 0], settle=1, keep=2)
    figures = [
        fs.plot.diagram(diagram),
        fs.plot.diagram(diagram, "m%", legend=True),
        fs.plot.overlay(overlay, x="$", y="m%", z="a'b\"c"),
        # an overlay, a time series and a phase portrait
        fs.plot.panel(overlay, title="$\\nothing$ {"),
        fs.plot.section(run.section("m%"), "t", "$"),
        fs.plot.spectrum(run.spectrum("m%")),
        fs.plot.eigenvalue_path(diagram[0]),
        fs.plot.parameter_plane(curve),
        fs.plot.regime_map(wedge, annotate={"$a": (0.3, 0.5)}, curves={"_{": ([0, 1], [1, 0])}),
        fs.plot.sweep(swept),
    ]
    for one in figures:
        one.figure.draw_without_rendering()


def test_latex_of_every_name(odd):
    model, *_ = odd
    for text in (model.to_latex(), fs.derive(model.frozen()).to_latex()):
        assert r"\text{m\%}" in text
        assert r"\text{a'b" in text
        # brackets open and close, mathematics within a text is over
        assert text.replace(r"\{", "").replace(r"\}", "").count("{") == text.replace(
            r"\}", ""
        ).replace(r"\{", "").count("}")
        assert "$" not in text.replace(r"\$", "")


def test_what_is_printed_and_saved(odd, tmp_path):
    _, diagram, run, overlay = odd
    for result in (diagram, run, overlay):
        assert result._repr_html_() if hasattr(result, "_repr_html_") else repr(result)
        path = tmp_path / "odd.npz"
        result.save(path)
        again = fs.load(path)
        assert repr(again) == repr(result)
    assert run["a'b\"c"].shape == run.t.shape
    assert diagram.at(**{"$": 1.0})
