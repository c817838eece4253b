"""Every model of the gallery: its claims beside independent references, figure, page and code."""

import json
import re
import unicodedata

import numpy as np
import pytest

import fastslow as fs
from analyses import __main__ as everything
from analyses import gallery_pages
from analyses.claims import VERDICTS, Quantity
from analyses.gallery import About
from analyses.gallery_pages import MOST_LINES, Entry, entries
from analyses.output import Output
from fastslow.plot.drawings import Drawing

from .drawn import SAME, difference

pytestmark = pytest.mark.slow

DOCS = everything.DOCS / "gallery"

NUMBER = re.compile(r"-?\d+(?:\.\d*)?(?:e[+-]?\d+)?")


#: What draws the models takes seconds for each: the test command takes the same one of them.
some = pytest.mark.sample(1)


@pytest.fixture(scope="module", params=entries(), ids=lambda entry: entry.name)
def entry(request):
    return request.param


@pytest.mark.sample(5)
def test_every_claim_is_met(entry):
    assert entry.claims
    for k, claim in enumerate(entry.claims, 1):
        (finding,) = claim.findings
        assert claim.number == str(k)
        assert finding.verdict in VERDICTS
        assert finding.words.endswith(".")
        for one in claim.quantities:
            assert one.agrees, f"{one.name}: {one.computed!r}, {one.reference} by {one.how}"
        if finding.verdict == "holds":
            assert [one.name for one in claim.quantities if one.as_published is False] == []
    assert any(claim.quantities for claim in entry.claims)


def test_the_title_begins_with_the_authors_of_the_name(entry):
    authors, _, rest = entry.about.title.partition(": ")
    assert rest
    plain = unicodedata.normalize("NFD", authors).encode("ascii", "ignore").decode().lower()
    assert re.sub(r",? ", "_", plain).startswith(entry.name[:-4])


def test_the_code_is_short_and_public(entry):
    assert gallery_pages.lines_of_code(entry) <= MOST_LINES
    code = gallery_pages.script(entry)
    assert set(re.findall(r"^(?:import|from) (\w+)", code, re.MULTILINE)) <= {
        *("fastslow", "matplotlib", "numpy", "sympy")
    }
    assert all(not part.startswith("_") for part in re.findall(r"fs((?:\.\w+)+)", code))
    for name in entry.used:
        value = fs
        for part in name.split("."):
            value = getattr(value, part)


@some
def test_the_figure_is_that_of_the_page(entry, tmp_path):
    into = Output(tmp_path, ("png",), check=True)
    entry.draw(into)
    assert into.overlaps[entry.name] == ()
    assert difference(tmp_path, entry.name) < SAME


def alike(one, other):
    """Whether two texts have the same words, and numbers that differ in their last digit."""
    if NUMBER.split(one) != NUMBER.split(other):
        return False
    pair = [np.array(NUMBER.findall(text), dtype=float) for text in (one, other)]
    return np.allclose(*pair, rtol=1e-4, atol=1e-9)


@some
def test_the_stored_pages_are_those_written(entry):
    written = gallery_pages.texts([entry])
    for name, text in written.items():
        stored = (DOCS / name).read_text("utf-8")
        assert alike(stored, text), f"{name}: run python -m analyses --gallery --docs"


def test_every_stored_file_belongs_to_a_model():
    names = {entry.name for entry in entries()}
    others = {"cells", "index", "questions", "studies"}
    assert {path.stem for path in DOCS.iterdir()} == names | others


def test_a_notebook_has_the_code_of_its_script(entry):
    cells = json.loads(gallery_pages.notebook(entry))["cells"]
    code = "".join(cells[1]["source"])
    assert code in gallery_pages.script(entry)
    assert cells[2]["source"] == ["figure()"]


def test_what_is_missing_is_named():
    texts = {"title": "x", "why": "x", "source": "x", "field": "x", "slow": "x", "caption": "x"}
    with pytest.raises(ValueError, match="phenomena is empty"):
        About(**texts, phenomena=(), compared="x", unsaid=("x",))


def test_digits_that_differ_are_seen():
    one = Quantity("x", 0.4683264, "0.46831", "closed form", "0.47")
    assert not one.agrees
    assert one.as_published
    assert Quantity("x", 0.4683264, "0.4683264", "closed form", "0.45").as_published is False
    assert Quantity("x", 1.0, "1", "closed form", "about one").as_published is None
    assert Quantity("x", "1^2 1^3", "1^2 1^3", "counted").agrees


def test_one_model_is_drawn_alone(tmp_path):
    everything.main([str(tmp_path), "--gallery", "--png", "--only", "izhikevich2003"])
    assert [path.name for path in tmp_path.iterdir()] == ["izhikevich2003.png"]
    assert isinstance(Entry("izhikevich2003").figure(), Drawing)
