"""Extremes of the columns of a trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fastslow.errors import unknown_name
from fastslow.results.trajectory.section import window_of

if TYPE_CHECKING:
    from fastslow.results.trajectory.trajectory import Trajectory


def extremes_of(
    run: Trajectory, name: object, since: float | None, until: float | None = None
) -> tuple[float, float]:
    """Return minimum and maximum of a column; see `Trajectory.extremes`."""
    if str(name) not in run.columns:
        raise unknown_name("column", name, run.columns)
    row = run.columns.index(str(name))
    begin, end = window_of(run, since, until)
    ends = run.dense_columns([begin, end])[row]
    assert run.series is not None
    used = np.flatnonzero((run.steps[:, 0] + run.steps[:, 1] > begin) & (run.steps[:, 0] < end))
    length = run.steps[used, 1]
    scaled = run.series[used, row] * length[:, None] ** np.arange(run.series.shape[2])
    after = np.maximum(begin - run.steps[used, 0], 0.0) / length
    before = np.minimum((end - run.steps[used, 0]) / length, 1.0)
    inside = scaled[after == 0, 0]
    low, high = float(np.append(ends, inside).min()), float(np.append(ends, inside).max())
    reach = np.abs(scaled[:, 1:]).sum(axis=1)
    for i in np.flatnonzero((scaled[:, 0] + reach > high) | (scaled[:, 0] - reach < low)):
        roots = np.polynomial.polynomial.polyroots(np.polynomial.polynomial.polyder(scaled[i]))
        critical = roots.real[np.abs(roots.imag) < 1e-6]
        critical = critical[(critical >= after[i]) & (critical <= before[i])]
        values = np.polynomial.polynomial.polyval(critical, scaled[i])
        low, high = float(np.append(values, low).min()), float(np.append(values, high).max())
    return low, high
