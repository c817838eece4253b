"""Where a series of values turns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastslow.passage.overlay.spikes import extrema_of, refined

steps = st.lists(st.floats(-10, 10), min_size=3, max_size=60)


@given(steps, st.floats(0.1, 5))
def test_turns_alternate_and_are_prominent(values, least):
    turns = extrema_of(np.array(values), least)
    assert np.all(np.diff(turns.upper.astype(int)) != 0)
    assert np.all(np.diff(turns.rows) > 0)
    heights = np.array(values)[turns.rows]
    assert np.all(np.abs(np.diff(heights)) >= least)


@given(steps, st.floats(0.1, 5))
def test_maxima_become_minima_upside_down(values, least):
    one, other = extrema_of(np.array(values), least), extrema_of(-np.array(values), least)
    assert one.rows.tolist() == other.rows.tolist()
    assert one.upper.tolist() == (~other.upper).tolist()


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0], [3.0] * 9, np.arange(9.0).tolist()])
def test_what_does_not_turn(values):
    assert len(extrema_of(np.array(values), 0.5).rows) == 0


def test_a_wave_turns_twice_a_period():
    t = np.linspace(0, 10 * np.pi, 3001)
    turns = extrema_of(np.sin(t), 0.2)
    assert len(turns.rows) == 10
    expected = np.pi * (np.arange(10) + 0.5)
    assert refined(t, np.sin(t), turns.rows) == pytest.approx(expected, abs=1e-6)


def test_ripples_are_no_turns():
    t = np.linspace(0, 2 * np.pi, 2001)
    assert len(extrema_of(np.sin(t) + 0.02 * np.sin(60 * t), 0.2).rows) == 2
