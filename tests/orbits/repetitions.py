"""Rows of branches of orbits that repeat earlier ones, found by their tables alone."""

import numpy as np

#: Successive rows on the line through earlier rows, distance from it as a fraction of the shorter
#: of both steps, and cosine of their angle.
ROWS, NEAR, ALONG = 6, 0.02, 0.98

#: Fractions of a step of a run.
SAMPLES = np.linspace(0.0, 1.0, 9)


def repetitions(branch):
    """Numbers of the rows with which `ROWS` rows on the line through earlier rows end."""
    places = _places(branch)
    steps = np.diff(places, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    found, count = [], 0
    for k in range(4, len(places)):
        chords, sizes = steps[: k - 3], lengths[: k - 3]
        gaps = places[k] - places[: k - 3]
        with np.errstate(all="ignore"):
            share = np.clip((gaps * chords).sum(axis=1) / sizes**2, 0, 1)
            off = np.linalg.norm(gaps - share[:, None] * chords, axis=1)
            along = np.abs(chords @ steps[k - 1]) / (sizes * lengths[k - 1])
            here = (off <= NEAR * np.minimum(sizes, lengths[k - 1])) & (along >= ALONG)
        count = count + 1 if here.any() else 0
        if count >= ROWS:
            found.append(k)
    return found


def _places(branch):
    """Parameter, period and extremes of the states of all rows, in units of their ranges."""
    n = len(branch.states)
    lengths = SAMPLES * branch.steps[:, 1, None]
    states = np.zeros((len(lengths), n, len(SAMPLES)))
    for power in reversed(range(branch.series.shape[2])):
        states = states * lengths[:, None] + branch.series[:, :n, power, None]
    first = np.append(0, np.cumsum(branch.counts[:-1, 0]))
    low = np.minimum.reduceat(states.min(axis=2), first)
    high = np.maximum.reduceat(states.max(axis=2), first)
    columns = np.column_stack([branch.values, branch.period, low, high])
    columns = columns[np.isfinite(columns).all(axis=1)]
    reach = np.ptp(columns, axis=0)
    return columns / np.where(reach > 0, reach, 1.0)
