"""The maps of many runs take most of the time of all analyses: here they are coarse."""

from dataclasses import replace

import pytest

import fastslow as fs
from analyses import case_maps, resonances

from .drawn import CHAOTIC


@pytest.fixture(scope="session", autouse=True)
def coarse_maps():
    """``python -m tests.campaigns figures`` computes them as they are published."""
    usual = case_maps.refinement

    def refinement(plane, scaling):
        if plane.name in CHAOTIC and scaling == "printed":
            return fs.Refinement(cells=(5, 4), levels=0, resolution=5e-2)
        return replace(usual(plane, scaling), levels=1, resolution=1e-2)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(case_maps, "refinement", refinement)
        patch.setattr(
            resonances, "REFINEMENT", fs.Refinement(cells=(6, 4), levels=0, resolution=1e-2)
        )
        sample = {**resonances.SCANNED, "printed": resonances.SCANNED["printed"][::10]}
        patch.setattr(resonances, "SCANNED", sample)
        yield
