"""A sample of the campaign of damaged files."""

from pathlib import Path

import numpy as np
import pytest

import fastslow as fs
from fastslow.results.trajectory.spectrum import Spectrum
from tests.campaigns import files

pytestmark = pytest.mark.slow

DATA = Path(__file__).parent / "data"


def test_damaged_files_are_refused_or_identical():
    diagram = fs.read_auto(DATA / "b.fhn")
    amplitude = np.linspace(0.0, 1.0, 50)
    kept = {
        "diagram": diagram,
        "points": diagram.special,
        "spectrum": Spectrum("x", "hann", (0.0, 1.0), amplitude, amplitude),
    }
    report = files.campaign(60, 1, kept)
    assert not report.failures, str(report)
    assert sum(counts.total() for counts in report.outcomes.values()) == 240
    assert report.outcomes["nc"]["refused"] >= 50
    assert report.outcomes["AUTO"]["read"] >= 20
    assert report.largest < 100 * 2**20
