"""The registry of laws of delay: one object for each, which nothing else asks for its class."""

import ast
from pathlib import Path

import pytest
import sympy as sp

import fastslow as fs
from fastslow.passage.delays import laws, predicting
from fastslow.passage.delays.delay_law import LocalLaw
from fastslow.passage.delays.local_field import delay_fields, passage_at
from fastslow.results.overlay import delays
from fastslow.results.overlay.delays import Delay, DelayTerm, PassageEnd
from fastslow.results.point_types import POINT_TYPES

ROOT = Path(fs.__file__).parent

#: Classes of predictions.
CLASSES = {n for n, v in vars(delays).items() if isinstance(v, type) and issubclass(v, Delay)}


def test_every_type_that_names_a_law_has_one_and_every_law_is_named():
    named = {known.law for known in POINT_TYPES.values()} - {""}
    assert {law.name for law in predicting.registered_laws()} == named


def test_every_module_of_the_folder_is_registered():
    files = {path.stem for path in Path(laws.__file__).parent.glob("*.py")} - {"__init__"}
    modules = {type(law).__module__.rsplit(".", 1)[-1] for law in predicting.registered_laws()}
    assert modules == files


def test_nothing_asks_for_the_class_of_a_prediction():
    asked = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in sorted(ROOT.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("isinstance", "type")
        for name in ast.walk(node)
        if getattr(name, "id", getattr(name, "attr", "")) in CLASSES
    ]
    assert asked == []


class CubicDelay(Delay):
    """The prediction of a law that the package does not have."""

    level = None

    @property
    def law(self):
        return "cubic"

    @property
    def end(self):
        return PassageEnd("", "x", 0.5)

    @property
    def terms(self):
        return (DelayTerm("eps^(1/3)", lambda eps: eps ** (1 / 3), 2.0),)

    @property
    def exponent(self):
        return 1 / 3


class CubicLaw(LocalLaw):
    name = "fold"

    def at_point(self, point, rate, *, level, parameter, model):
        local, drift = passage_at(point, rate, parameter, model)
        delay = 2.0 * abs(drift.rate) ** (1 / 3)
        return CubicDelay(**delay_fields(local, drift), delay=delay, validity="a test")

    def settling_distance(self, local, delay):
        return 0.1


@pytest.fixture
def cubic(monkeypatch):
    """The law of a new module, in place of that of a fold."""
    monkeypatch.setattr(predicting, "registered_laws", lambda: (CubicLaw(),))


@pytest.mark.usefixtures("cubic")
def test_a_new_law_needs_a_result_and_a_law():
    """It predicts, is differentiated, measured over rates and compared by overlays."""
    x, p = sp.symbols("x p")
    model = fs.Model({x: p + x**2}, parameters={p: -1})
    fold = fs.continue_equilibria(model, "p", over=(-1, 1)).folds[0]
    law = fs.predict_delay(fold, 1e-3)
    assert law.delay == pytest.approx(0.2)
    assert law.gradient("rate")["delay"] == pytest.approx(0.2 / 3e-3, rel=1e-9)
    measured = fs.delay_scaling(model, fold, [1e-4, 1e-5], level={"x": 0.5})
    assert (measured.terms, measured.law_exponent) == (("eps^(1/3)",), 1 / 3)
    assert measured.predicted == pytest.approx([2 * 1e-4 ** (1 / 3), 2 * 1e-5 ** (1 / 3)])
    # the delay of a fold, Ω₀ ε^(2/3) − 2 ε
    assert measured.exponent == pytest.approx(2 / 3, abs=0.02)


@pytest.mark.usefixtures("cubic")
def test_a_new_law_is_compared_by_overlays():
    full = fs.systems.cusp(omega=0.01)
    diagram = fs.continue_equilibria(full.frozen(), "p", over=(-1.2, 1.2))
    run = fs.simulate(full, [-1.0], t=(0, 200))
    jump = fs.overlay(diagram, run).transitions.select(type="jump")[0]
    assert isinstance(jump.law, CubicDelay)
    assert f"(predicted {2 * jump.slope ** (1 / 3):.3g}, without an error bound)" in (
        jump.description
    )
