"""Which samples of a run count to a band of equilibria and its edge: places made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from fastslow.passage.overlay.sticking import along_edges, with_sticking
from fastslow.results.overlay.transitions import Phase

#: One band −1 ≤ x ≤ 1 at every value of the parameter.
BAND = SimpleNamespace(
    name="band A",
    edge="edge of A",
    region="S1|S2",
    bounds=lambda slow: (np.full((len(slow), 1), -1.0), np.full((len(slow), 1), 1.0)),
)
DIAGRAM = SimpleNamespace(states=("x",), bands=[BAND])


class Run(dict):
    """Columns and times of a run."""

    @property
    def t(self):
        return self["t"]


def run_of(x):
    return Run(t=0.5 * np.arange(len(x)), x=np.array(x, dtype=float))


def test_a_run_that_has_left_a_band_slips_along_its_edge():
    """Up to a distance of 0.3 extents of 2, as long as it has not gone farther in between."""
    run = run_of([3, 0.5, 1, 1.2, 1.5, 1.7, 1.1, 3, 1.2])
    band = np.array([-1, 0, 0, -1, -1, -1, -1, -1, -1])
    slow = np.zeros(len(band))
    found, distance = along_edges(DIAGRAM, run, slow, band, np.array([2.0]), 0.3)
    assert found.tolist() == [-1, 0, 0, 0, 0, -1, -1, -1, -1]
    np.testing.assert_allclose(distance[1:5], [0, 0, 0.1, 0.25], atol=1e-15)
    assert np.isnan(np.delete(distance, [1, 2, 3, 4])).all()
    assert band.tolist().count(0) == 2


def test_without_a_rest_there_is_no_edge():
    run = run_of([1.1, 1.2])
    found, distance = along_edges(
        DIAGRAM, run, np.zeros(2), np.array([-1, -1]), np.array([1.0]), 0.3
    )
    assert found.tolist() == [-1, -1]
    assert np.isnan(distance).all()


@pytest.mark.parametrize("kind", ["quasi-static", "oscillating"])
def test_phases_are_cut_where_the_run_sticks_and_slips(kind):
    """At rest from 1 to 2.5, slipping to 3.5, at rest again from 5 to the end at 5.5."""
    run = run_of(np.zeros(12))
    rests = np.full(12, -1)
    rests[2:5] = rests[10:] = 0
    band = rests.copy()
    band[5:7] = 0
    phases = (Phase(0.0, 2.0, kind, ("S1",)), Phase(2.0, 5.5, kind, ("S2",)))
    found = with_sticking(phases, DIAGRAM, run, rests, band)
    assert [(p.start, p.end, p.type, p.stable_branches) for p in found] == [
        (0.0, 1.0, kind, ("S1",)),
        (1.0, 2.5, "sticking", ("band A",)),
        (2.5, 3.5, "quasi-static", ("edge of A",)),
        (3.5, 5.0, kind, ("S2",)),
        (5.0, 5.5, "sticking", ("band A",)),
    ]
    plain = with_sticking(phases, DIAGRAM, run, np.full(12, -1), np.full(12, -1))
    assert plain == phases
