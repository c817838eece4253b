"""The pages are built: their code runs, their links resolve, and nothing is warned of."""

import os
import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from jupyter_cache import get_cache
from jupyter_cache.base import CacheBundleIn
from myst_nb.core.read import read_myst_markdown_notebook
from nbclient import NotebookClient

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"

#: Pages that `test_pages` executes and whose results it looks at; here they have no outputs.
ELSEWHERE = ("how-to/two-inertias", "how-to/periodic-orbits")

#: As ``%reset -f``, which collects garbage several times: a third of a second for each page.
FORGET = "(lambda shell: (shell.user_ns.clear(), shell.init_user_ns()))(get_ipython())"


def pages_with_code():
    """The name of each page with code, and the page as a notebook."""
    for page in sorted(DOCS.rglob("*.md")):
        text = page.read_text("utf-8")
        if "{code-cell}" in text:
            name = page.relative_to(DOCS).with_suffix("").as_posix()
            yield name, read_myst_markdown_notebook(text)


def execute(notebooks, folder):
    """Run notebooks one after another in one kernel, each without names and files of the others.

    A kernel for each of them would import the same packages again.
    """
    whole = nbformat.v4.new_notebook()
    for name, notebook in notebooks.items():
        own = folder / re.sub(r"\W", "_", name)
        own.mkdir(parents=True)
        fresh = nbformat.v4.new_code_cell(f"{FORGET}\n%cd -q {own}")
        whole.cells += [fresh, *notebook.cells]
    client = NotebookClient(whole, timeout=180, kernel_name="python3", record_timing=False)
    client.execute(env={**os.environ, "PYTHONPATH": str(ROOT)})
    for notebook in notebooks.values():
        notebook.metadata.language_info = whole.metadata.language_info


def test_the_pages_are_built_without_a_warning(tmp_path):
    notebooks = dict(pages_with_code())
    execute({n: page for n, page in notebooks.items() if n not in ELSEWHERE}, tmp_path / "run")
    outputs = get_cache(tmp_path / "outputs")
    for name, notebook in notebooks.items():
        notebook.metadata.setdefault("language_info", {"name": "python"})
        outputs.cache_notebook_bundle(CacheBundleIn(notebook, name), check_validity=False)
    settings = (
        "nb_execution_mode=cache",
        f"nb_execution_cache_path={outputs.path}",
        # one page of another test is built with the navigation of this theme, which takes long
        "html_theme=basic",
    )
    strict = ["-W", "--keep-going", "-n", "-q"]
    options = [argument for setting in settings for argument in ("-D", setting)]
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", *strict, *options, DOCS, tmp_path / "site"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    assert len(outputs.list_cache_records()) == len(notebooks), "Sphinx executed none"
    assert "Figure: fs.plot." in (tmp_path / "site" / "tutorial.html").read_text("utf-8")
