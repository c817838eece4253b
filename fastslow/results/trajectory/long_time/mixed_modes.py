"""Mixed-mode oscillations: numbers of large and small oscillations, from extrema."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import unknown_name
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.trajectory.long_time.periodicity import INTEGRATION_ERRORS
from fastslow.results.trajectory.steps.dense import DenseOutput
from fastslow.results.trajectory.steps.step_polynomials import StepPolynomials
from fastslow.results.trajectory.steps.step_roots import find_roots

Array = NDArray[np.float64]

#: Least ratio of the smallest large to the largest small amplitude.
AMPLITUDE_GAP = 2.0

#: Digits of exponents.
_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, eq=False, repr=False)
class MixedMode(Result):
    """The pattern of large and small oscillations at the end of a run.

    Parameters
    ----------
    name : str
        The state.
    blocks : tuple of (int, int)
        Numbers L of large and S of small oscillations that follow each other, over one period of
        the pattern; all of them if it does not repeat.
    large, small : (float, float)
        Smallest and largest amplitude of both kinds; NaN without any. The amplitude of an
        oscillation is the smaller one of its rise and its fall.
    since : float
        Time from which extrema were examined.
    outcome : Outcome
        ``"mixed modes"``, ``"one amplitude"``, ``"undecided"`` if small oscillations are below the
        integration error, ``"not periodic"`` or ``"too short"``.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, t = sp.symbols("x t")
    >>> model = fs.Model({x: sp.diff(sp.cos(t) + sp.cos(3 * t), t)})
    >>> fs.simulate(model, [2], t=(0, 60)).mixed_mode().signature
    '1²'
    """

    name: str
    blocks: tuple[tuple[int, int], ...]
    large: tuple[float, float]
    small: tuple[float, float]
    since: float
    outcome: Outcome

    @property
    def signature(self) -> str:
        """L^S of every block, as in ``"1²1³"``."""
        return "".join(f"{large}{str(small).translate(_RAISED)}" for large, small in self.blocks)

    @property
    def gap(self) -> float:
        """Ratio of the smallest large to the largest small amplitude; NaN without either."""
        return self.large[0] / self.small[1]

    def __repr__(self) -> str:
        if not self.blocks:
            return f"MixedMode of {self.name}: {self.outcome}"
        evidence = ""
        if np.isfinite(self.gap):
            evidence = (
                f"; large amplitudes from {self.large[0]:.4g}, small ones from "
                f"{self.small[0]:.4g} to {self.small[1]:.4g}"
            )
        return f"MixedMode of {self.name}: {self.signature}{evidence}. {self.outcome}"


def mixed_mode_of(
    dense: DenseOutput, name: str, window: tuple[float, float], rtol: float
) -> MixedMode:
    """Count large and small oscillations; see `Trajectory.mixed_mode`."""
    if name not in dense.states:
        raise unknown_name("state", name, dense.states)
    since = window[0]
    amplitudes = _amplitudes(dense, dense.states.index(name), window)
    nothing = float("nan"), float("nan")
    if len(amplitudes) < 2:
        outcome = Outcome("too short", f"fewer than two oscillations since t = {since:.6g}.", False)
        return MixedMode(name, (), nothing, nothing, since, outcome)
    ordered = np.sort(amplitudes)[::-1]
    wide = np.flatnonzero(ordered[:-1] >= AMPLITUDE_GAP * ordered[1:])
    if not len(wide):
        outcome = Outcome("one amplitude", "all oscillations are of one size.", True)
        found = float(ordered[-1]), float(ordered[0])
        return MixedMode(name, ((1, 0),), found, nothing, since, outcome)
    count = int(wide[0]) + 1
    large = float(ordered[count - 1]), float(ordered[0])
    small = float(ordered[-1]), float(ordered[count])
    blocks = _blocks(amplitudes >= large[0])
    repeated = _repeated(blocks)
    error = INTEGRATION_ERRORS * rtol * large[1]
    outcome = Outcome("mixed modes", f"repeats after {len(repeated or ())} blocks.", True)
    if small[0] <= error:
        text = (
            f"small oscillations of {small[0]:.2g} are not larger than the integration error, "
            f"{error:.2g}: their number is undecided. Use a smaller rtol of Integration."
        )
        outcome = Outcome("undecided", text, False)
    elif repeated is None:
        text = f"the {len(blocks)} blocks since t = {since:.6g} do not repeat."
        outcome = Outcome("not periodic", text, False)
    return MixedMode(name, repeated or blocks, large, small, since, outcome)


def _amplitudes(dense: DenseOutput, row: int, window: tuple[float, float]) -> Array:
    """Amplitudes of the oscillations in order: the smaller one of the rise and the fall."""
    lengths = dense.steps[:, 1:2]
    order = np.arange(1, dense.series.shape[2])
    rates = dense.series[:, row, 1:] * order * lengths ** (order - 1)
    roots = find_roots(StepPolynomials.of(rates))
    times = dense.steps[roots.step, 0] + roots.part * dense.steps[roots.step, 1]
    kept = (times >= window[0]) & (times <= window[1]) & (roots.direction != 0)
    times, direction = np.clip(times[kept], *dense.span), roots.direction[kept]
    values = dense.columns_at(times)[row]
    top = np.flatnonzero(direction[1:-1] < 0) + 1
    beside = (direction[top - 1] > 0) & (direction[top + 1] > 0)
    top = top[beside]
    return np.minimum(values[top] - values[top - 1], values[top] - values[top + 1])


def _blocks(large: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    """Numbers of large and small oscillations in order, of complete blocks only."""
    runs = [(bool(kind), len(list(group))) for kind, group in groupby(large.tolist())]
    # the first and the last run are cut off by the ends of the time span
    runs = runs[1:-1]
    runs = runs if not runs or runs[0][0] else runs[1:]
    return tuple((one[1], two[1]) for one, two in zip(runs[::2], runs[1::2], strict=False))


def _repeated(blocks: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...] | None:
    """The blocks of one period of the pattern, from the smallest on; None if it does not repeat."""
    for length in range(1, len(blocks) // 2 + 1):
        if blocks[length:] == blocks[:-length]:
            first = blocks[:length]
            return min(first[k:] + first[:k] for k in range(length))
    return None
