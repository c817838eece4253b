"""Sphinx configuration; build with `sphinx-build -W --keep-going -n -j auto docs build/docs`."""

import os
import re
import sys
from collections import defaultdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from docutils.nodes import image, literal_block
from sphinx.application import Sphinx
from sphinx.util.logging import getLogger
from sphinx.util.nodes import make_refnode

ROOT = Path(__file__).parent.parent

# document and run the sources of this checkout, not an installed package
sys.path.insert(0, str(ROOT))
os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])

import fastslow  # noqa: E402
from analyses.gallery_pages import entries  # noqa: E402

# a package of files; as an extension it would not declare itself safe for parallel reading
MATHJAX = Path(find_spec("sphinx-mathjax-offline").origin).parent / "static"
REMOTE = re.compile(r"""<(?:script[^>]*\ssrc|link[^>]*\shref)=["'](https?:[^"']*)""")
CALL = re.compile(r"\bfs\.((?:plot\.)?\w+)\(")
ABSOLUTE = re.compile(r"(``.*?``)|(?<!\\)\|")

project = "fastslow"
author = "the fastslow developers"
copyright = "2026, the fastslow developers"
version = release = fastslow.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
]
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}
default_role = "py:obj"
exclude_patterns = ["gallery/*.ipynb"]  # downloads; the page of each model shows their code

html_theme = "furo"
html_title = f"fastslow {version}"
html_static_path = ["_static", str(MATHJAX)]
mathjax_path = "mathjax/tex-chtml.js"
html_css_files = ["pages.css"]

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

nb_execution_mode = "force"
nb_execution_in_temp = True  # pages may write files
# stored with their output; a test executes them
nb_execution_excludepatterns = ["notebooks/*"]
nb_execution_raise_on_error = True
nb_execution_timeout = 180
nb_merge_streams = True
nb_mime_priority_overrides = [("html", "text/latex", 25)]  # before the HTML of a notebook
nb_ipywidgets_js = {}  # no page displays a widget

autosummary_generate = False  # the pages of the functions are in reference/functions
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings give types, with shapes
maximum_signature_line_length = 88
toc_object_entries_show_parents = "hide"
napoleon_google_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False
# classes of these packages are documented elsewhere; no inventories are fetched
nitpick_ignore_regex = [
    (r"py:.*", r"(abc|collections|enum|matplotlib|numpy|sympy|typing)\..*"),
    (r"py:class", r"Figure"),
]


#: The pages that use a public name, theory only where no other does, and models of the gallery.
USERS: dict[str, tuple[list[str], list[str]]] = defaultdict(lambda: ([], []))
for folder in ("tutorial*.md", "how-to/*.md", "theory/*.md"):
    known = {name for name, (pages, _) in USERS.items() if pages and folder.startswith("theory")}
    for page in sorted(Path(__file__).parent.glob(folder)):
        link = f":doc:`/{page.relative_to(Path(__file__).parent).with_suffix('')}`"
        for name in sorted({f"fastslow.{call}" for call in CALL.findall(page.read_text("utf-8"))}):
            if name not in known:
                USERS[name][0].append(link)
for entry in entries():
    for name in entry.used:
        USERS[f"fastslow.{name}"][1].append(f":doc:`{entry.label} </gallery/{entry.name}>`")


def prepare(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Escape |x|, an absolute value in docstrings, for reStructuredText."""
    in_example = False
    for row, line in enumerate(lines):
        in_example = line.lstrip().startswith(">>>") or (in_example and bool(line.strip()))
        if not in_example:
            lines[row] = ABSOLUTE.sub(lambda m: m[1] or r"\|", line)
    if what == "property":
        lines[:0] = [
            "..",
            "",
        ]  # an empty comment; without it Napoleon reads text before a colon as a type


def link_users(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Add the pages and the models of the gallery that use a public name."""
    if name in USERS:
        for introduction, users in zip(
            ("On the pages", "In the gallery:"), USERS[name], strict=True
        ):
            if users:
                lines += ["", f"{introduction} {', '.join(users)}."]


def by_last_name(app: Sphinx, env: Any, node: Any, child: Any) -> Any:
    """Resolve names such as `Ensemble.regime` in any docstring, fields by their class."""
    if node.get("refdomain") != "py":
        return None
    objects = env.get_domain("py").objects
    target = node["reftarget"]
    for wanted in (target, target.rpartition(".")[0]):
        ends = [
            name
            for name, place in objects.items()
            if wanted and name.endswith(f".{wanted}") and not place.aliased
        ]
        if len(ends) == 1:
            place = objects[ends[0]]
            return make_refnode(
                app.builder, node["refdoc"], place.docname, place.node_id, child, ends[0]
            )
    return None


def describe_figures(app: Sphinx, doctree: Any) -> None:
    """Add the plot call of a cell as the alternative text of its figure."""
    for cell in doctree.findall(
        lambda n: "cell" in getattr(n, "attributes", {}).get("classes", ())
    ):
        source = "\n".join(block.astext() for block in cell.findall(literal_block))
        calls = re.findall(r"fs\.plot\..*", source)
        for picture in cell.findall(image):
            if not picture.get("alt"):
                picture["alt"] = f"Figure: {calls[-1] if calls else 'output of the code above'}"


def link_figures(app: Sphinx, doctree: Any) -> None:
    """Open a figure in its full size by a click: Sphinx links images with a scale."""
    for picture in doctree.findall(image):
        if picture["uri"].endswith(".png"):
            picture.setdefault("scale", 100)


def report_remote_files(app: Sphinx, error: Exception | None) -> None:
    """Warn about scripts, fonts and style sheets that a page would fetch from a network."""
    for page in [] if error else sorted(Path(app.outdir).rglob("*.html")):
        for address in REMOTE.findall(page.read_text("utf-8")):
            getLogger(__name__).warning("%s loads %s", page.relative_to(app.outdir), address)


def setup(app: Sphinx) -> None:
    """Connect the functions above to Sphinx events."""
    app.connect("autodoc-process-docstring", prepare, priority=400)  # before Napoleon
    app.connect("autodoc-process-docstring", link_users, priority=600)  # after Napoleon
    app.connect("missing-reference", by_last_name)
    app.connect("doctree-read", describe_figures)
    app.connect("doctree-read", link_figures)
    app.connect("build-finished", report_remote_files)
