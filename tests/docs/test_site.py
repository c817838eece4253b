"""The pages are built: their links resolve, nothing is warned of, and they fit into windows.

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
ELSEWHERE = ("how-to/two-inertias", "how-to/periodic-orbits", "how-to/cycles", "tutorial")

#: Sphinx with seldom garbage collection, and without what takes long and is not looked at: the
#: index of the search, the navigation, and the HTML of pages that are not opened, whose links are
#: resolved all the same. The first argument names the pages that are written.
SPHINX = """
import gc, sys
gc.set_threshold(50_000, 20, 20)
import furo
from sphinx.builders.html import StandaloneHTMLBuilder
from sphinx.cmd.build import main
written, write = sys.argv.pop(1).split(), StandaloneHTMLBuilder.write_doc
def write_doc(self, name, tree):
    if name in written:
        write(self, name, tree)
StandaloneHTMLBuilder.write_doc = write_doc
StandaloneHTMLBuilder.search = False
furo._compute_navigation_tree = lambda context: ""
sys.exit(main())
"""

#: Width and height of a desktop's and of a phone's window.
DESKTOP, PHONE = (1280, 900), (390, 844)

#: Largest height of a page on a desktop, in pixels.
HIGHEST = 6000

#: Pages to look things up in, and lessons.
HIGHER = ("reference/", "errors", "glossary", "notebooks/")

#: Pages that are written and opened in a browser besides those whose code is run.
OPENED = 8

#: Width and height of what a window shows, after the formulas are displayed.
SIZE = """async () => {
    if (window.MathJax?.startup) await MathJax.startup.promise;
    const page = document.documentElement;
    return [page.scrollWidth, page.scrollHeight];
}"""


@pytest.fixture(scope="module")
def site(kernel, tmp_path_factory):
    """The folder of the built pages, the build, and the pages that are written."""
    # a second, which only this process needs
    from jupyter_cache import get_cache
    from jupyter_cache.base import CacheBundleIn

    folder = tmp_path_factory.mktemp("site")
    notebooks = dict(pages_with_code())
    others = [name for name in notebooks if name not in (SHOWN, *ELSEWHERE)]
    chosen = (SHOWN, *(others[place] for place in places(len(others), SAMPLE)))
    kernel.execute({name: notebooks[name] for name in chosen}, folder / "run")
    outputs = get_cache(folder / "outputs")
    for name, notebook in notebooks.items():
        notebook.metadata.setdefault("language_info", {"name": "python"})
        outputs.cache_notebook_bundle(CacheBundleIn(notebook, name), check_validity=False)
    names = sorted(page.relative_to(DOCS).with_suffix("").as_posix() for page in DOCS.rglob("*.md"))
    opened = sorted({*chosen, *(names[place] for place in places(len(names), OPENED)), "claims"})
    quotes = "smartquotes=0"  # a second, for nothing that is looked at
    settings = ("nb_execution_mode=cache", f"nb_execution_cache_path={outputs.path}", quotes)
    strict = ["-W", "--keep-going", "-n", "-q"]
    options = [argument for setting in settings for argument in ("-D", setting)]
    built = subprocess.run(
        [sys.executable, "-c", SPHINX, " ".join(opened), *strict, *options, DOCS, folder / "pages"],
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert len(outputs.list_cache_records()) == len(notebooks), "Sphinx executed none"
    return folder / "pages", built, opened


@pytest.mark.sample(1)
def test_the_pages_are_built_without_a_warning(site):
    folder, built, _ = site
    assert built.returncode == 0, built.stdout + built.stderr
    page = (folder / f"{SHOWN}.html").read_text("utf-8")
    assert "Figure: fs.plot." in page
    (script,) = re.findall(r'src="([^"?]*mathjax[^"?]*)', page)
    assert (folder / "how-to" / script).is_file()


def test_pages_fit_into_the_windows_of_a_desktop_and_of_a_phone(site, browser_page):
    """Nothing is wider than the window, and no page is endless."""
    folder, _, opened = site
    found = []
    for name in opened:
        for width, height in (DESKTOP, PHONE):
            browser_page.set_viewport_size({"width": width, "height": height})
            if (width, height) == DESKTOP:
                browser_page.goto((folder / f"{name}.html").as_uri())
            across, down = browser_page.evaluate(SIZE)
            if across > width:
                found.append(f"{name} is {across} px wide in a window of {width}")
            if width == DESKTOP[0] and down > HIGHEST and not name.startswith(HIGHER):
                found.append(f"{name} is {down} px high")
    assert found == []
