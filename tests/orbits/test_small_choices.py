"""Choices between few alternatives inside longer computations."""

from types import SimpleNamespace

import numpy as np
import pytest

from fastslow.orbits.derivatives.exponents import _edges
from fastslow.orbits.points import codimension_two


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
    monkeypatch.setattr(codimension_two.normal_forms, "fold_terms", lambda _, vector: vector)
    rows = np.array([[0.0, 0.0, 9.0], [1.0, 40.0, 9.0], [2.0, -200.0, 9.0]])
    curve = SimpleNamespace(
        null=["first", "second", "third"],
        start=SimpleNamespace(width=2),
        rows=rows,
        scale=np.array([1.0, 1e3]),
        at=lambda z: z,
    )
    found = codimension_two.Tests._quadratic(curve, np.array([1.9, 30.0, 0.0]))
    assert found == "third"
