"""All parameter sets and random examples of the tests of which the test command runs a sample."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest


@dataclass
class Report:
    """What pytest printed, and its status."""

    text: str
    status: int

    @property
    def failures(self) -> list[str]:
        lines = self.text.splitlines()
        return lines[-1:] if self.status not in (0, pytest.ExitCode.NO_TESTS_COLLECTED) else []

    def __str__(self) -> str:
        return self.text


def campaign(folder: str = "tests") -> Report:
    """Run those of a file or folder."""
    command = [sys.executable, "-m", "pytest", "-q", "-m", "sample or hypothesis", folder]
    done = subprocess.run(
        command,
        cwd=Path(__file__).parents[2],
        env={**os.environ, "FASTSLOW_TESTS": "whole"},
        capture_output=True,
        text=True,
    )
    return Report(done.stdout + done.stderr, done.returncode)
