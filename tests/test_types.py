"""mypy finds nothing, nor in the code of pages and notebooks."""

import os
import re
import subprocess
import sys

import pytest

from tests.docs.kernels import ROOT, sources

pytestmark = pytest.mark.slow

#: mypy without garbage collection, which takes a quarter of its time; it would enable it again.
MYPY = """
import gc
gc.disable()
gc.enable = lambda: None
from mypy.__main__ import console_entry
console_entry()
"""

#: The code of a page names one variable after another as it likes, and knows what it found.
OF_A_PAGE = (
    "# mypy: allow-redefinition, allow-untyped-defs, allow-incomplete-defs, no-strict-optional\n"
    '# mypy: disable-error-code="union-attr, arg-type"\n'
)


def checked(files):
    """What mypy says of files."""
    return subprocess.run(
        [sys.executable, "-c", MYPY, f"--cache-dir={os.devnull}", *files],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )


def test_types(tmp_path):
    pages = []
    for name, code in sources():
        pages.append(tmp_path / f"page_{re.sub(r'[^a-z0-9]', '_', name)}.py")
        pages[-1].write_text(OF_A_PAGE + code, "utf-8")
    wrong = tmp_path / "wrong.py"
    call = "fs.simulate(fs.systems.cusp(), [0], t=(0, 1), perods=2)"
    wrong.write_text(f"{OF_A_PAGE}import fastslow as fs\n{call}.ends\n", "utf-8")
    done = checked(["fastslow", "analyses", *pages, wrong])
    found = [line for line in done.stdout.splitlines() if "error:" in line]
    # only what is wrong on purpose
    assert len(found) == 2, done.stdout + done.stderr
    assert 'Unexpected keyword argument "perods" for "simulate"' in found[0]
    assert '"Trajectory" has no attribute "ends"' in found[1]
