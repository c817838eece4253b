"""The pages are built: their code runs, their links resolve, and nothing is warned of."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]


def test_the_pages_are_built_without_a_warning(tmp_path):
    strict = ["-W", "--keep-going", "-n", "-q"]
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", *strict, ROOT / "docs", tmp_path],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    assert (tmp_path / "tutorial.html").is_file()
