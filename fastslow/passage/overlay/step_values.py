"""Compiled evaluation of the columns of a run from the Taylor series of its steps."""

from __future__ import annotations

from fastslow.kernels.compiler.decorators import unfused_kernel


@unfused_kernel
def step_of(starts, time):
    """Index of the last step that begins at or before a time, else 0."""
    low, high = 0, starts.shape[0]
    while low < high:
        middle = (low + high) // 2
        if starts[middle] <= time:
            low = middle + 1
        else:
            high = middle
    return max(low - 1, 0)


@unfused_kernel
def values_in_steps(series, starts, begin, end, times, values):
    """Evaluate the series of steps at times, identical to `results.trajectory.steps.dense`.

    Parameters
    ----------
    series : ndarray, shape (n_steps, columns, order + 1)
    starts : ndarray, shape (n_steps,)
    begin, end : float
        Time span of the run.
    times : ndarray, shape (N,)
    values : ndarray, shape (columns, N)
        Output.

    Returns
    -------
    int
        Number of times outside the run.
    """
    count, columns, width = series.shape
    row = outside = 0
    for i in range(times.shape[0]):
        time = times[i]
        if not begin <= time <= end:
            outside += 1
        # usually the step of the previous time
        after = row + 1
        if time < starts[row] or (after < count and starts[after] <= time):
            row = step_of(starts, time)
        offset = time - starts[row]
        for j in range(columns):
            value = series[row, j, width - 1]
            for k in range(width - 2, -1, -1):
                value = value * offset + series[row, j, k]
            values[j, i] = value
    return outside
