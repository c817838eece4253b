"""A note on crossings that become ever more frequent, as a motion winds towards an equilibrium."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Number of crossings from which their frequency is judged.
CROSSINGS_JUDGED = 1000

#: Fraction of the longest interval between the first crossings below which the last ones are
#: frequent.
FREQUENT = 1e-2


def note_on_frequent_crossings(
    times: NDArray[np.float64], end: NDArray[np.float64]
) -> tuple[str, ...]:
    """Return a sentence if the crossings before the end of a run become ever more frequent.

    Parameters
    ----------
    times : ndarray, shape (N,)
        Times of the crossings of a run that ended at the largest number of steps or crossings.
    end : ndarray, shape (1 + n,)
        Time and state reached.

    Examples
    --------
    >>> note_on_frequent_crossings(np.sqrt(np.arange(0, 1e6)), np.array([1e3, 0.0]))
    ('the crossings become ever more frequent, first up to 1 and now 0.000513 apart: the motion \
winds towards an equilibrium on an interface, a fused focus near (0), which it reaches in \
infinite time; end the time span, or stop the run, before.',)
    >>> note_on_frequent_crossings(np.arange(0, 1e6), np.array([1e3, 0.0]))
    ()
    """
    if len(times) < CROSSINGS_JUDGED:
        return ()
    # medians, since a turn may contain a long and a short interval
    tenths = [float(np.median(part)) for part in np.array_split(np.diff(times), 10)]
    first, last = float(np.diff(times[: CROSSINGS_JUDGED // 10]).max()), tenths[-1]
    if last > FREQUENT * first or np.any(np.diff(tenths) >= 0):
        return ()
    near = ", ".join(f"{value:.3g}" for value in end[1:])
    return (
        f"the crossings become ever more frequent, first up to {first:.3g} and now {last:.3g} "
        f"apart: the motion winds towards an equilibrium on an interface, a fused focus near "
        f"({near}), which it reaches in infinite time; end the time span, or stop the run, before.",
    )
