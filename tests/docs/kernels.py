"""Execution of pages and notebooks in one kernel."""

import os
import re
from pathlib import Path

import nbformat

ROOT = Path(__file__).parents[2]

#: As ``%reset -f``, which collects garbage several times: a third of a second for each notebook.
FORGET = """\
import gc
gc.set_threshold(50_000, 20, 20)
get_ipython().user_ns.clear()
get_ipython().init_user_ns()
"""


def execute(notebooks, folder):
    """Run notebooks one after another in one kernel, each without names and files of the others.

    A kernel for each of them would import the same packages again.

    Parameters
    ----------
    notebooks : dict
        Notebooks by their names; they get the outputs.
    folder : Path
        Where each gets a folder of its own.
    """
    from nbclient import NotebookClient  # half a second, which only this process needs

    whole = nbformat.v4.new_notebook()
    for name, notebook in notebooks.items():
        own = folder / re.sub(r"\W", "_", name)
        own.mkdir(parents=True)
        whole.cells += [nbformat.v4.new_code_cell(f"{FORGET}%cd -q {own}"), *notebook.cells]
    client = NotebookClient(
        whole,
        timeout=300,
        kernel_name="python3",
        record_timing=False,
        coalesce_streams=True,
    )
    client.execute(env={**os.environ, "PYTHONPATH": str(ROOT)})
    for notebook in notebooks.values():
        notebook.metadata.language_info = whole.metadata.language_info
        code = [cell for cell in notebook.cells if cell.cell_type == "code"]
        for count, cell in enumerate(code, 1):
            for part in (cell, *(o for o in cell.outputs if "execution_count" in o)):
                part.execution_count = count
