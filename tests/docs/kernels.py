"""The code of pages and notebooks, and its execution in one kernel."""

import os
import re
from pathlib import Path

import nbformat

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"

#: The code of a cell of a page.
CELL = re.compile(r"^```\{code-cell\}.*?\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)

NOTEBOOKS = {path.stem: path for path in sorted((DOCS / "notebooks").glob("*.ipynb"))}

#: As ``%reset -f``, which collects garbage several times: a third of a second for each notebook.
FORGET = """\
import gc
gc.set_threshold(50_000, 20, 20)
get_ipython().user_ns.clear()
get_ipython().init_user_ns()
"""


def pages_with_code():
    """The name of each page with code, and the page as a notebook."""
    from myst_nb.core.read import read_myst_markdown_notebook

    for page in sorted(DOCS.rglob("*.md")):
        text = page.read_text("utf-8")
        if "{code-cell}" in text:
            name = page.relative_to(DOCS).with_suffix("").as_posix()
            yield name, read_myst_markdown_notebook(text)


def sources():
    """The code of each page and notebook, without tags of cells and commands of IPython."""
    cells = {
        page.relative_to(DOCS).with_suffix("").as_posix(): CELL.findall(page.read_text("utf-8"))
        for page in sorted(DOCS.rglob("*.md"))
    }
    for name, path in NOTEBOOKS.items():
        notebook = nbformat.read(path, as_version=4)
        cells[name] = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    for name, found in cells.items():
        if found:
            yield name, re.sub(r"^[%:].*", "", "\n".join(found), flags=re.MULTILINE)


class Kernel:
    """A kernel for all pages and notebooks: another one would import the same packages again."""

    def __init__(self):
        from nbclient import NotebookClient  # half a second, which only this process needs

        self._client = NotebookClient(
            nbformat.v4.new_notebook(),
            timeout=300,
            kernel_name="python3",
            record_timing=False,
            coalesce_streams=True,
            shutdown_kernel="immediate",  # it has nothing to end: three seconds otherwise
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._client.nb = nbformat.v4.new_notebook()
        self._client.execute(cleanup_kc=True)

    def execute(self, notebooks, folder):
        """Run notebooks one after another, each without names and files of the others.

        Parameters
        ----------
        notebooks : dict
            Notebooks by their names; they get the outputs.
        folder : Path
            Where each gets a folder of its own.
        """
        whole = nbformat.v4.new_notebook()
        for name, notebook in notebooks.items():
            own = folder / re.sub(r"\W", "_", name)
            own.mkdir(parents=True)
            whole.cells += [nbformat.v4.new_code_cell(f"{FORGET}%cd -q {own}"), *notebook.cells]
        self._client.nb = whole
        self._client.execute(env={**os.environ, "PYTHONPATH": str(ROOT)}, cleanup_kc=False)
        for notebook in notebooks.values():
            notebook.metadata.language_info = whole.metadata.language_info
            code = [cell for cell in notebook.cells if cell.cell_type == "code"]
            for count, cell in enumerate(code, 1):
                for part in (cell, *(o for o in cell.outputs if "execution_count" in o)):
                    part.execution_count = count
