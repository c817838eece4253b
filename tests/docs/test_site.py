"""The pages are built: their code runs, their links resolve, and nothing is warned of."""

import re
import subprocess
import sys

import pytest

from .kernels import ROOT

pytestmark = pytest.mark.slow

DOCS = ROOT / "docs"

#: Pages that `test_pages` executes and whose results it looks at; here they have no outputs.
ELSEWHERE = ("how-to/two-inertias", "how-to/periodic-orbits", "tutorial")

#: Sphinx with seldom garbage collection, and without the index of the search.
SPHINX = """
import gc, sys
gc.set_threshold(50_000, 20, 20)
from sphinx.builders.html import StandaloneHTMLBuilder
from sphinx.cmd.build import main
StandaloneHTMLBuilder.search = False
sys.exit(main())
"""


def pages_with_code():
    """The name of each page with code, and the page as a notebook."""
    from myst_nb.core.read import read_myst_markdown_notebook

    for page in sorted(DOCS.rglob("*.md")):
        text = page.read_text("utf-8")
        if "{code-cell}" in text:
            name = page.relative_to(DOCS).with_suffix("").as_posix()
            yield name, read_myst_markdown_notebook(text)


def test_the_pages_are_built_without_a_warning(kernel, tmp_path):
    # a second, which only this process needs
    from jupyter_cache import get_cache
    from jupyter_cache.base import CacheBundleIn

    notebooks = dict(pages_with_code())
    run = {name: page for name, page in notebooks.items() if name not in ELSEWHERE}
    kernel.execute(run, tmp_path / "run")
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
        [sys.executable, "-c", SPHINX, *strict, *options, DOCS, tmp_path / "site"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    assert len(outputs.list_cache_records()) == len(notebooks), "Sphinx executed none"
    page = (tmp_path / "site" / "how-to" / "figure-in-a-paper.html").read_text("utf-8")
    assert "Figure: fs.plot." in page
    (script,) = re.findall(r'src="([^"?]*mathjax[^"?]*)', page)
    assert (tmp_path / "site" / "how-to" / script).is_file()
