"""Notes at the top of axes are wrapped: they stay inside, and do not reduce the axes."""

import pytest
import sympy as sp

import fastslow as fs
from fastslow.plot.layout.style import axes_for, note, rendered, root
from fastslow.plot.layout.typesetting import plain

pytestmark = pytest.mark.slow

WORDS = "the run ended early: the solution became too large for a floating-point number at t = 12"


@pytest.mark.parametrize("width", [40, 85, 170])
@pytest.mark.parametrize(
    "words", [WORDS, "W" * 30, "i i i " * 40, "10 % of $x_0$ & a long rest " * 5]
)
def test_notes_stay_within_their_axes(width, words):
    alone, noted = (axes_for(None, width) for _ in range(2))
    note(noted, words)
    for ax in (alone, noted):
        rendered(root(ax), "png", 100)
    inside, text = noted.get_window_extent(), noted.texts[0].get_window_extent()
    if " " in words:
        assert inside.x0 <= text.x0
        assert text.x1 <= inside.x1
    assert inside.width == pytest.approx(alone.get_window_extent().width, rel=1e-6)
    assert "".join(noted.texts[0].get_text().split()) == "".join(plain(words).split())


def test_the_note_of_an_overlay_whose_run_ended_early():
    x, p, t = sp.symbols("x p t")
    model = fs.Model({x: p + x**2}, forcing={p: t / 10 - 1})
    run = fs.simulate(model, [-1], t=(0, 30))
    assert not run.outcome
    diagram = fs.continue_equilibria(model.frozen(), "p", over=(-1.5, 1))
    drawn = fs.plot.overlay(fs.overlay(diagram, run), x="p", y="x", width=85)
    rendered(root(drawn.ax), "png", 100)
    (text,) = [one for one in drawn.ax.texts if "ended early" in one.get_text()]
    assert text.get_window_extent().x1 <= drawn.ax.get_window_extent().x1
    assert drawn.ax.get_window_extent().width > 0.6 * root(drawn.ax).bbox.width
