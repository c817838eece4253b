"""Choices between few alternatives inside longer computations."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import fastslow as fs
from fastslow.continuation import curves
from fastslow.orbits.derivatives.exponents import _edges
from fastslow.orbits.ends import pseudo_saddles
from fastslow.orbits.flow.equations import NODE
from fastslow.orbits.points import corners, curve_tests, switching
from fastslow.orbits.trace import branch_ends


class Form(SimpleNamespace):
    """Ends and modes of segments."""

    def __len__(self):
        return len(self.ends)


@pytest.mark.parametrize("periods", [2, 3, 7])
def test_blocks_of_exponents_are_whole_periods(periods):
    """Also of two periods."""
    period = 2.5
    edges = _edges((1.0, 4.0 + periods * period), 3.0, period)
    blocks = np.diff(edges[1:]) / period
    assert blocks == pytest.approx(np.round(blocks), abs=1e-12)
    assert blocks.sum() == pytest.approx(periods, abs=1e-12)


def test_null_vectors_are_those_of_the_nearest_row_in_units(monkeypatch):
    """The second unknown has the unit 1e3, in which the third row is nearest."""
    monkeypatch.setattr(curve_tests.normal_forms, "fold_terms", lambda _, vector: vector)
    rows = np.array([[0.0, 0.0, 9.0], [1.0, 40.0, 9.0], [2.0, -200.0, 9.0]])
    curve = SimpleNamespace(
        null=["first", "second", "third"],
        start=SimpleNamespace(width=2),
        rows=rows,
        scale=np.array([1.0, 1e3]),
        at=lambda z: z,
    )
    found = curve_tests.Tests.quadratic(curve, np.array([1.9, 30.0, 0.0]))
    assert found == "third"


@pytest.mark.parametrize(
    ("modes", "passed"), [([2, 0, 2, 0, 2], (2, 0)), ([0, 2, 1, 0, 2], (2, 1, 0)), ([2, 0], None)]
)
def test_a_landing_is_the_second_begin_of_sliding(monkeypatch, modes, passed):
    """From beside a pseudo-saddle, however often the run slides after it has landed."""
    series = np.zeros((len(modes), 1, 3))
    series[:, 0, 0] = np.arange(len(modes)) + 1.0
    run = SimpleNamespace(series=series, steps=np.array([[0.0, 0.1, m, 0.0] for m in modes]))
    saddle = SimpleNamespace(state=np.array([0.5]))
    monkeypatch.setattr(pseudo_saddles, "with_value", lambda shooting, value: value)
    monkeypatch.setattr(pseudo_saddles, "equilibrium_near", lambda *_: saddle)
    problem = SimpleNamespace(run=lambda *_: run)
    curve = SimpleNamespace(problem=SimpleNamespace(at=lambda _: problem))
    last = SimpleNamespace(shooting=None, arrays=SimpleNamespace(period=1.0))
    slow = SimpleNamespace(size=np.array([0.25]), mode=2)
    found = pseudo_saddles._landing(curve, last, slow, 0.0, np.array([1.0]), np.array([0.0]))
    if passed is None:
        assert found is None
    else:
        assert found.modes == passed
        assert found.gap == 4 * (modes.index(2, modes.index(2) + 1) + 0.5)


@pytest.mark.parametrize(
    ("durations", "sign"), [([0.5, 0.2], 1), ([-0.5, -0.2], -1), ([0.5, -0.2], 0), ([0.0, 1.0], 0)]
)
def test_durations_of_new_segments_increase_beyond_a_corner(durations, sign):
    """They are zero at the corner; of different signs, nothing is continued."""
    shooting = SimpleNamespace(form=range(3), variations=SimpleNamespace(n=2))
    corner = SimpleNamespace(new=np.array([1, 2]), shooting=shooting)
    along = np.arange(10.0)
    along[[7, 8]] = durations
    found = corners.onwards(None, corner, along)
    if sign:
        np.testing.assert_array_equal(found, sign * along)
    else:
        assert found is None


@pytest.mark.parametrize("other", [True, False])
def test_sliding_without_a_region_on_the_other_side_has_no_edge_there(other):
    signs = np.array([[1], [0], [-1 if other else 1]])
    form = Form(ends=np.array([0, -1]), modes=np.array([0, 1]))
    variations = SimpleNamespace(signs=signs, interfaces=1, continuous=np.array([False]))
    shooting = SimpleNamespace(variations=variations, form=form)
    found = list(switching._crossings_of_jumps(shooting))
    assert found == ([(0, 0, 2)] if other else [])


@pytest.mark.parametrize("touching", [True, False])
def test_equations_without_the_event_of_a_touch_end_its_segment_at_a_node(touching):
    """The contact is the segment and its function."""

    @dataclass(frozen=True)
    class Equations:
        form: object

    @dataclass(frozen=True)
    class Ends:
        ends: np.ndarray

    shooting = Equations(Ends(np.array([3, 4, 5])))
    start = SimpleNamespace(touching=touching, contact=(1, 2), shooting=shooting)
    found = curve_tests.Start.smooth.fget(start)
    assert found.form.ends.tolist() == ([3, NODE, 5] if touching else [3, 4, 5])


@pytest.mark.parametrize(("growth", "unbounded"), [(1e7, False), (2e8, True)])
def test_a_branch_ends_where_its_orbits_have_grown_by_ten_to_the_eighth(growth, unbounded):
    curve, sizes = SimpleNamespace(name="a"), (3.0, -3.0 * growth)
    rows = [SimpleNamespace(extremes=np.full((2, 3), size), value=0.5) for size in sizes]
    found = branch_ends.unbounded(curve, rows)
    assert (found is not None) == unbounded
    if unbounded:
        assert "10⁸ times those of the first orbit at a = 0.5" in str(found)


def test_an_end_near_the_tolerance_names_it():
    curve, settings = SimpleNamespace(name="p"), fs.Continuation()
    said = []
    for accuracy in (3e-10, 1e-13):
        row = SimpleNamespace(value=0.5, arrays=SimpleNamespace(errors=(0.0, 0.0, accuracy)))
        outcome = branch_ends.ended(curves.SMALL_STEP, curve, row, 3, settings)
        assert outcome.code == "step too small"
        said.append(str(outcome))
    assert "a tolerance of Continuation above 1e-10 leads further" in said[0]
    assert "tolerance" not in said[1]
