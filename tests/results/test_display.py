"""The repr and the HTML table of every public result."""

import dataclasses
import inspect
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from html.parser import HTMLParser

import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.base.display import LINES, brief
from fastslow.results.points import SpecialPoints
from fastslow.results.stored.model import StoredModel
from tests.errors.subjects import results
from tests.results.test_contract import orbit_overlay

pytestmark = pytest.mark.slow

#: Tags of a table; anything else is text that was not escaped.
TAGS = {"table", "caption", "thead", "tbody", "tr", "th", "td", "br"}

#: Public classes of `fastslow`, without errors and abstract ones.
CLASSES = {
    thing
    for thing in (getattr(fs, name) for name in fs.__all__)
    if inspect.isclass(thing) and not issubclass(thing, Exception) and not inspect.isabstract(thing)
}

#: Modules of classes that are no results but belong to how results are computed.
INNER = (
    "fastslow.diagrams.",
    "fastslow.kernels.",
    "fastslow.model.structure",
    "fastslow.passage.",
    "fastslow.results.stored.",
)
PLAIN = {StoredModel}


class Parsed(HTMLParser):
    """Collects tags and text, and what is not well-formed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.wrong, self.text = [], [], ""
        self.feed(text)
        self.close()
        self.wrong += [f"<{tag}> is not closed" for tag in self.open]

    def handle_starttag(self, tag, attrs):
        if tag not in TAGS:
            self.wrong.append(f"<{tag}>")
        if tag != "br":
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.wrong.append(f"</{tag}>")

    def handle_data(self, data):
        self.text += data


@cache
def examples():
    """Results of all kinds, whose attributes are results too."""
    r = dict(results())
    x, v, p, w, t = sp.symbols("x v p w t")
    forced = fs.Model({x: x - x**3 / 3 - w + sp.cos(5 * t) / 2}, slow={w: x / 100})
    orbit = fs.find_orbit(forced.frozen(fast=["t"]).with_parameters(w=-0.9), [2.0])
    orbits = fs.continue_orbits(orbit, "w", over=(-1.0, 0.0))
    block = fs.Model({x: v, v: p - x - sp.sign(v)}, parameters={p: 0})
    return [
        *r.values(),
        fs.Certification(),
        fs.Continuation(),
        fs.Integration(),
        fs.Execution(),
        fs.Observation(),
        fs.Refinement(),
        r["gear"].stored,
        r["map"].compare(lambda a, b: a < b),
        *r["laws"].values(),
        fs.tangencies(block, p=0.0),
        fs.equilibria(block, p=0.0),
        fs.continue_equilibria(block, "p", over=(-2, 2)),
        fs.continue_points(r["diagram"], ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)}),
        r["run"].at(x=0.0),
        r["spectrum"].peaks(),
        list(r["branch"].monotone_pieces()),
        r["overlay"].phases,
        fs.overlay(orbits, fs.simulate(forced, [2.0, -0.2], t=(0.0, 25.0))),
        SpecialPoints(),
        fs.Tabulated([0.0, 1.0], [1.0, 2.0]),
        fs.read_ode("x'=-x\nset a {x=1}"),
        fs.analyse(fs.read_ode("x'=x-x^3-u\nu'=.01*x\ninit x=1\n@ total=200")),
        fs.Event("x > 1", {"x": 0}),
        fs.simulate(fs.Model({x: 1}, events={x > 1: {x: 0}}), [0], t=(0, 3)),
        orbit_overlay(),
    ]


def own(value):
    return type(value).__module__.startswith("fastslow.")


def public(value):
    return (own(value) and not type(value).__module__.startswith(INNER)) or type(value) in PLAIN


def inside(value):
    """What belongs to a result: items, fields and properties."""
    if isinstance(value, Mapping | tuple | list):
        yield from list(value.values() if isinstance(value, Mapping) else value)[:3]
    if not public(value) or isinstance(value, fs.plot.Drawing):
        return
    for name in dir(type(value)):
        member = inspect.getattr_static(type(value), name)
        if not name.startswith("_") and not callable(member):
            with suppress(fs.FastSlowError):
                yield getattr(value, name)
    if dataclasses.is_dataclass(value):
        yield from (getattr(value, entry.name) for entry in dataclasses.fields(value))


@cache
def by_class():
    """At most twenty objects of every public class that is reached from a result."""
    seen, found = {}, {}

    def walk(value):
        if id(value) in seen:
            return
        seen[id(value)] = value
        if public(value):
            some = found.setdefault(type(value), [])
            if len(some) < 20:
                some.append(value)
        elif not isinstance(value, Mapping | tuple | list):
            return
        for item in inside(value):
            walk(item)

    for value in examples():
        walk(value)
    return found


def test_every_public_class_is_displayed():
    """A repr of at most ten lines, and a well-formed HTML table, for each class that is reached."""
    found = by_class()
    assert CLASSES - found.keys() == set()
    assert len(found) > 50
    wrong = []
    for kind, some in found.items():
        for value in some:
            if len(repr(value).splitlines()) > LINES:
                wrong.append(f"{kind.__name__}: a repr of {len(repr(value).splitlines())} lines")
            if "array([" in repr(value) or " object at 0x" in repr(value):
                wrong.append(f"{kind.__name__}: {repr(value)[:80]}")
            if not hasattr(value, "_repr_html_"):
                wrong.append(f"{kind.__name__}: no HTML")
            else:
                wrong += [f"{kind.__name__}: {e}" for e in Parsed(value._repr_html_()).wrong]
    assert list(dict.fromkeys(wrong)) == []


def test_names_are_escaped():
    x, p = sp.symbols("x p<b>&amp;")
    model = fs.Model({x: p - x}, parameters={p: 0}, regions={"<i>everywhere": sp.true})
    diagram = fs.continue_equilibria(model, p, over=(-1, 1))
    for result in (model, model.stored, diagram, diagram[0], diagram.special):
        parsed = Parsed(result._repr_html_())
        assert not parsed.wrong
        names = "p<b>", r"p\textless{}b\textgreater{}", "<i>everywhere"
        assert any(name in parsed.text for name in names)


def test_lines_beyond_ten_are_counted():
    text = brief([["head", "warning"], [f"  {k}" for k in range(30)], ["tail"]])
    shown = [f"  {k}" for k in range(6)]
    cut = "  … 24 more lines, see summary()"
    assert text.splitlines() == ["head", "warning", *shown, cut, "tail"]
    assert brief([["head"], [f"  {k}" for k in range(9)]]).splitlines()[-1] == "  8"
