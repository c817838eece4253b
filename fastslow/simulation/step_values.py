"""Compiled evaluation of the columns of a run from the series of its steps.

The values are those of `fastslow.results.trajectory.steps.dense`, to the last bit.
"""

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
    """Evaluate the series of steps at times.

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


@unfused_kernel
def values_by_steps(series, counts, offsets, values):
    """Evaluate the series of every step at a number of offsets.

    Parameters
    ----------
    series : ndarray, shape (n_steps, columns, order + 1)
    counts : ndarray of int, shape (n_steps,)
    offsets : ndarray, shape (N,)
        Those of the first step, of the second, and so on.
    values : ndarray, shape (columns, N)
        Output.
    """
    steps, columns, width = series.shape
    start = 0
    for s in range(steps):
        stop = start + counts[s]
        for j in range(columns):
            i = start
            # four at once: one alone waits for its own products
            while i + 4 <= stop:
                at, at1, at2, at3 = offsets[i], offsets[i + 1], offsets[i + 2], offsets[i + 3]
                value = value1 = value2 = value3 = series[s, j, width - 1]
                for k in range(width - 2, -1, -1):
                    power = series[s, j, k]
                    value = value * at + power
                    value1 = value1 * at1 + power
                    value2 = value2 * at2 + power
                    value3 = value3 * at3 + power
                values[j, i], values[j, i + 1] = value, value1
                values[j, i + 2], values[j, i + 3] = value2, value3
                i += 4
            while i < stop:
                value = series[s, j, width - 1]
                for k in range(width - 2, -1, -1):
                    value = value * offsets[i] + series[s, j, k]
                values[j, i] = value
                i += 1
        start = stop


@unfused_kernel
def bends_of_steps(series, lengths, bends):
    """Bound the second derivative of every column on every step, times the squared length.

    Parameters
    ----------
    series : ndarray, shape (n_steps, columns, order + 1)
    lengths : ndarray, shape (n_steps,)
    bends : ndarray, shape (columns, n_steps)
        Output.
    """
    steps, columns, width = series.shape
    for s in range(steps):
        length = lengths[s]
        square = length * length
        for j in range(columns):
            bend = 0.0
            for k in range(width - 1, 1, -1):
                bend = bend * length + k * (k - 1) * abs(series[s, j, k])
            bends[j, s] = bend * square
