"""mypy finds nothing; as a test it runs beside the others."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

#: mypy without garbage collection, which takes a quarter of its time; it would enable it again.
MYPY = """
import gc
gc.disable()
gc.enable = lambda: None
from mypy.__main__ import console_entry
console_entry()
"""


def test_types():
    done = subprocess.run(
        [sys.executable, "-c", MYPY, f"--cache-dir={os.devnull}"],
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
