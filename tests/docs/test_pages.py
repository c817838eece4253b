"""Documentation: complete reference, executed code, and correct numbers in the text."""

import inspect
import os
import re
import subprocess
import sys
from operator import attrgetter

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.base.result import Result
from fastslow.results.base.table import Table
from fastslow.results.point_types import POINT_TYPES

from .kernels import CELL, DOCS, ROOT, sources

pytestmark = pytest.mark.slow

PAGES = sorted(page for page in DOCS.rglob("*.md"))
ENTRY = re.compile(r"^\.\. auto(?!summary)\w+:: (\S+)$", flags=re.MULTILINE)
HEAD = "---\nfile_format: mystnb\nkernelspec:"


def public_names():
    for name in fs.__all__:
        if name not in ("__version__", "plot", "systems"):
            yield f"fastslow.{name}"
    for module in (fs.plot, fs.systems):
        for name in module.__all__:
            yield f"{module.__name__}.{name}"


def test_every_public_name_is_in_the_reference_once():
    pages = (DOCS / "reference").rglob("*.md")
    entries = [entry for page in pages for entry in ENTRY.findall(page.read_text("utf-8"))]
    assert sorted(set(public_names()) - set(entries)) == []
    assert len(entries) == len(set(entries))


def test_every_entry_of_the_reference_has_a_heading_with_its_name():
    """The search of the pages ranks headings first."""
    for page in (DOCS / "reference").rglob("*.md"):
        text = page.read_text("utf-8")
        headed = re.findall(
            r"^#{1,3} (\S+)\n\n```\{eval-rst\}\n\.\. auto(?!summary)\w+:: (\S+)$",
            text,
            re.MULTILINE,
        )
        assert [entry for _, entry in headed] == ENTRY.findall(text)
        for heading, entry in headed:
            inner = entry.startswith(("fastslow.plot.", "fastslow.systems."))
            assert heading == entry.split(".", 1 if inner else entry.count("."))[-1]


def test_every_function_has_a_page_and_is_in_the_index_of_the_reference():
    """A page of a plot function shows a figure and the code that draws it."""
    index = (DOCS / "reference" / "index.md").read_text("utf-8")
    for name in public_names():
        function = attrgetter(name.removeprefix("fastslow."))(fs)
        if inspect.isfunction(function) and not name.startswith("fastslow.systems."):
            page = DOCS / "reference" / "functions" / f"{name}.md"
            assert f"(functions/{page.name})" in index
            assert "See Also\n" in inspect.getdoc(function)
            if name.startswith("fastslow.plot."):
                assert (DOCS / "figures" / f"plot_{function.__name__}.png").is_file()
                assert f":pyobject: {function.__name__}\n" in page.read_text("utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(DOCS).as_posix())
def test_all_python_of_a_page_is_run(page):
    text = page.read_text("utf-8")
    assert not re.search(r"^[`~:]{3,}\s*(\{code-block\}\s*)?(i?python|py)", text, re.MULTILINE)
    # without this header the cells would be displayed but not executed
    assert text.startswith(HEAD) == bool(CELL.search(text))


def test_every_name_in_the_code_of_pages_and_notebooks_exists():
    """Types do not tell: names of the package are found when they are asked for."""
    for page, code in sources():
        for name in set(re.findall(r"\bfs\.((?:plot\.|systems\.)?\w+)", code)):
            assert attrgetter(name)(fs) is not None, (page, name)


def test_the_studies_show_every_figure_of_the_claims_and_its_script():
    gallery = (DOCS / "gallery" / "studies.md").read_text("utf-8")
    shown = re.findall(r"^:::\{figure\} \.\./(\S+)$", gallery, flags=re.MULTILINE)
    claims = (DOCS / "claims.md").read_text("utf-8")
    assert sorted(shown) == sorted(set(re.findall(r"!\[.*?\]\((.*?)\)", claims)))
    scripts = re.findall(r"<\.\./\.\./(analyses/\w+\.py)>", gallery)
    assert len(scripts) == len(shown)
    for figure, script in zip(shown, scripts, strict=True):
        assert (DOCS / figure).is_file()
        assert (ROOT / script).is_file()


def test_every_public_name_is_in_the_glossary():
    text = (DOCS / "glossary.md").read_text("utf-8")
    names = [name for name in fs.__all__ if name != "__version__"]
    assert [name for name in names if not re.search(rf"\b{name}\b", text)] == []


def test_every_special_point_is_in_the_glossary():
    listed = re.findall(
        r"^\| ([A-Z\d, ]+) \|", (DOCS / "glossary.md").read_text("utf-8"), re.MULTILINE
    )
    assert set(POINT_TYPES) - {code for cell in listed for code in cell.split(", ")} == set()


def test_every_file_of_the_architecture_page_exists():
    text = (DOCS / "architecture.md").read_text("utf-8")
    paths = set(re.findall(r"`((?:fastslow|tests|docs)/[\w./-]*)`", text))
    assert len(paths) > 100
    assert sorted(path for path in paths if not (ROOT / path).exists()) == []


@pytest.mark.sample(0)
def test_formulas_are_displayed_without_a_network(tmp_path):
    """The build warns of every remote file, and the files of MathJax are among the pages."""
    formula = "# Page\n\nA formula, $x^2$.\n"
    remote = '```{raw} html\n<script src="https://example.org/remote.js"></script>\n```\n'
    (tmp_path / "index.md").write_text(formula + remote, "utf-8")
    options = ["-q", "--no-color", "-c", DOCS]
    build = [sys.executable, "-m", "sphinx", *options, tmp_path, tmp_path / "built"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(build, capture_output=True, text=True, check=True, env=environment)
    assert done.stderr.strip() == "WARNING: index.html loads https://example.org/remote.js"

    page = (tmp_path / "built" / "index.html").read_text("utf-8")
    (script,) = re.findall(r'src="([^"?]*mathjax[^"?]*)', page)
    assert (tmp_path / "built" / script).is_file()
    fonts = (tmp_path / "built" / script).parent / "output" / "chtml" / "fonts" / "woff-v2"
    assert len(list(fonts.glob("*.woff"))) > 20


#: The class of every variable of the summary.
VARIABLES = {
    "branch": fs.Branch,
    "diagram": fs.Diagram,
    "model": fs.Model,
    "overlay": fs.Overlay,
    "point": fs.SpecialPoint,
    "result": Result,
    "run": fs.Trajectory,
    "table": Table,
}


def test_the_summary_lists_every_function_with_its_arguments():
    text = (DOCS / "summary.md").read_text("utf-8")
    codes = re.findall(r"`([^`]+)`", text)
    shown = set()
    for code in codes:
        call = re.fullmatch(r"(\w+)\.([\w.]+)(?:\((.*)\))?", code)
        if call is None or call[1] not in {*VARIABLES, "fs"}:
            continue
        owner = fs if call[1] == "fs" else VARIABLES[call[1]]
        names = getattr(owner, "__dataclass_fields__", {})
        first = call[2].split(".")[0]
        assert first in names or hasattr(owner, first), code
        if owner is fs:
            shown.add(first)
        function = getattr(owner, call[2], None)
        if not call[3] or not callable(function):
            continue
        parameters = {
            n: p for n, p in inspect.signature(function).parameters.items() if n != "self"
        }
        given = [argument.strip() for argument in call[3].split(",")]
        keywords = {argument.partition("=")[0] for argument in given if "=" in argument}
        if not any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
            assert keywords <= set(parameters), code
        positional = [argument for argument in given if "=" not in argument]
        if all(argument.isidentifier() for argument in positional):
            assert positional == list(parameters)[: len(positional)], code
    functions = {name for name in fs.__all__ if inspect.isfunction(getattr(fs, name))}
    assert functions - shown == set()
    plots = {name for name in fs.plot.__all__ if inspect.isfunction(getattr(fs.plot, name))}
    assert plots - {*codes, "diagram"} == set()


def test_the_readme_links_to_pages():
    links = re.findall(r"\]\((docs/[^)]*)\)", (ROOT / "README.md").read_text("utf-8"))
    assert "docs/tutorial.md" in links
    for link in links:
        assert (ROOT / link.split("#")[0]).exists(), link


@pytest.mark.sample(0)
def test_the_page_from_two_inertias_to_the_overlay(tmp_path, monkeypatch, capsys):
    """The cells run unchanged and give the results stated in the text."""
    monkeypatch.chdir(tmp_path)
    names = {}
    for cell in CELL.findall((DOCS / "how-to" / "two-inertias.md").read_text("utf-8")):
        exec(compile(cell, "two-inertias.md", "exec"), names)
    printed = capsys.readouterr().out

    assert "no equilibrium is isolated" in printed
    assert "reduce_states" in printed
    assert names["apart"] < 1e-11
    assert names["angles"][0, -1] > 50, "the gear turns as a whole"
    assert names["overlay"].run.regime == "bilateral"
    assert len(names["overlay"].transitions) == 6
    assert names["drawing"].ax.get_ylabel() == r"relative twist $\theta$ (mrad)"
    below, above = names["drawing"].ax.get_ylim()
    assert -40 < below < -17.5 < 17.5 < above < 40, "milliradians"
    seconds = names["crossing_time"](names["run"])
    scaled = names["crossing_time"](names["dimensionless"]) * names["scales"].time
    assert seconds == pytest.approx(scaled, rel=1e-6)


@pytest.mark.sample(0)
def test_the_pages_on_periodic_orbits(tmp_path, monkeypatch, capsys):
    """The cells run unchanged; folds and grazings are those known from elsewhere."""
    monkeypatch.chdir(tmp_path)
    names = {}
    for page in ("periodic-orbits.md", "cycles.md"):
        for cell in CELL.findall((DOCS / "how-to" / page).read_text("utf-8")):
            exec(compile(cell, page, "exec"), names)
    printed = capsys.readouterr().out

    for value in ("0.8284639844", "0.7080316187", "0.8206310877", "1.4070884660"):
        assert f"Omega = {value}" in printed
    assert np.abs(names["found_grazings"] - names["exact"]).max() < 1e-12
    assert names["branch"].outcome
    stable, unstable, other = names["branch"].at(Omega=0.75)
    assert (stable.stable, unstable.stable, other.stable) == (True, False, True)
    # every attractor is on the branch
    spans = sorted(motion["max(x) - min(x)"] for motion in names["found"].members)
    assert spans == pytest.approx([one["max(x) - min(x)"] for one in (stable, other)], rel=1e-9)
    assert names["found"].outcome
    assert sorted(names["plane"].labels) == ["A1", "A2"]
    for curve, point in (("fold", "LPC1"), ("grazing", "GR1")):
        assert names[curve].outcome
        away = np.abs(names[curve]["Omega"] - names["branch"][point]["Omega"])
        assert np.hypot(away, names[curve]["Fa"] - 0.05).min() < 1e-12
    assert names["cycle"].period == pytest.approx(6.66328685932, abs=5e-12)
    assert names["stick"].stable
    assert names["stick"].multipliers[-1] == 0
    assert names["stick"].log_multipliers[-1] == -np.inf


def test_the_tutorial(tmp_path, monkeypatch, capsys):
    """The cells run unchanged and give the results stated in the text."""
    monkeypatch.chdir(tmp_path)
    names = {}
    for page in ("tutorial.md", "tutorial-results.md"):
        for cell in CELL.findall((DOCS / page).read_text("utf-8")):
            exec(compile(cell, page, "exec"), names)
    printed = capsys.readouterr().out

    assert list(names["gear"].regions) == ["S1", "S2", "S3"]
    assert [str(form.admissible) for form in names["derivation"].folds].count("A < -D**2") == 2
    assert names["diagram"].completeness == "complete"
    assert len(names["diagram"].folds) == 2
    (bistable,) = names["diagram"].bistable()
    assert bistable == pytest.approx([-0.0894402097712473, 0.0894402097712473], abs=1e-12)
    assert names["run"].regime == "bilateral"
    assert names["overlay"].bursting.name.startswith("relaxation oscillation")
    assert {t.type for t in names["overlay"].transitions} == {"jump"}
    assert names["overlay"].delays == pytest.approx(0.024, abs=5e-5)
    assert "delay 0.024 (predicted 0.0249 ± 0.0011)" in printed
    assert names["again"].delays == pytest.approx(names["overlay"].delays, rel=1e-12)
    assert names["stiff_diagram"].folds == ()
    assert [p.type for p in names["stiff_diagram"].boundary_equilibria] == ["degenerate"] * 2
    assert {t.type for t in names["stiff_overlay"].transitions} == {"gap crossing"}
    assert len(names["stiff_run"].crossings) == 41

    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+)", (tmp_path / "overlay.pdf").read_bytes())
    assert float(box[1]) * 25.4 / 72 == pytest.approx(85, abs=0.01)
