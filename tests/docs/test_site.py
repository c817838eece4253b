"""The pages are built: their links resolve, nothing is warned of, and the code of a sample runs.

`tests/test_types.py` checks the names and arguments in the code of all; the campaign `samples`
runs it.
"""

import re
import subprocess
import sys

import pytest

from tests.samples import places

from .kernels import DOCS, pages_with_code

pytestmark = pytest.mark.slow

#: The page whose figure is looked at.
SHOWN = "how-to/figure-in-a-paper"

#: Pages besides whose code the test command runs.
SAMPLE = 10

#: Pages that `test_pages` executes and whose results it looks at.
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


@pytest.mark.sample(1)
def test_the_pages_are_built_without_a_warning(kernel, tmp_path):
    # a second, which only this process needs
    from jupyter_cache import get_cache
    from jupyter_cache.base import CacheBundleIn

    notebooks = dict(pages_with_code())
    others = [name for name in notebooks if name not in (SHOWN, *ELSEWHERE)]
    chosen = (SHOWN, *(others[place] for place in places(len(others), SAMPLE)))
    kernel.execute({name: notebooks[name] for name in chosen}, tmp_path / "run")
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
    page = (tmp_path / "site" / f"{SHOWN}.html").read_text("utf-8")
    assert "Figure: fs.plot." in page
    (script,) = re.findall(r'src="([^"?]*mathjax[^"?]*)', page)
    assert (tmp_path / "site" / "how-to" / script).is_file()
