"""Contact regimes of a gap: classification of periods and of whole motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.angles import apart, periods_of
from fastslow.results.base.display import Summarized
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.result import Result
from fastslow.results.stored.operations import AT_REST
from fastslow.results.trajectory.events.crossings import Segment
from fastslow.results.trajectory.long_time.lyapunov_exponents import LyapunovExponents
from fastslow.results.trajectory.steps.dense import DenseOutput

Floats = NDArray[np.float64]
Bits = NDArray[np.int64]

#: Regimes by the visited sides of a gap: lower, inside, upper as bits 1, 2, 4.
REGIMES = (
    "",
    "meshed lower",
    "free",
    "unilateral lower",
    "meshed upper",
    "bilateral",
    "unilateral upper",
    "bilateral",
)

#: Labels of motions without a regime.
NOT_SETTLED, CHAOTIC = "not settled", "chaotic"

#: Labels of the runs of an ensemble, by number.
RUN_LABELS = (*REGIMES, NOT_SETTLED)

#: Label of parameters at which the gap is empty.
NO_GAP = "no gap"

#: Prefix of the names of several coexisting regimes.
COEXISTING = "coexisting: "

#: Difference, in units of their range, below which states repeat.
REPEATING = 1e-6

#: Largest number of periods after which a repeat is detected.
LARGEST_MULTIPLE = 16


@dataclass(frozen=True, eq=False, repr=False)
class Regimes(Result):
    """The contact regime of a motion, and of each of its periods.

    Parameters
    ----------
    label : str
        The regime of the motion: the sides in contact in all periods or, if the motion
        repeats after several periods, in these together; ``"chaotic"`` for a positive
        Lyapunov exponent; else ``"not settled"``.
    types : tuple of str
        The regime of each period, in order of time: ``"bilateral"``, ``"unilateral
        upper"``, ``"unilateral lower"``, ``"meshed upper"``, ``"meshed lower"`` or
        ``"free"``.
    period : float
        Length of each period.
    span : tuple of float
        Start of the first and end of the last period.
    multiple : int or None
        Number of periods after which the states repeat, None if they do not.
    change : float
        Largest change of a state over that number of periods (else over one), in units
        of its range; NaN without states.
    outcome : Outcome
        ``"settled"``, ``"not settled"`` or ``"chaotic"``.
    exponents : LyapunovExponents or None
        Computed by `fastslow.classify_regime` if the states do not repeat.

    Examples
    --------
    >>> import fastslow as fs
    >>> run = fs.simulate(fs.systems.harmonic_gear(D=0.5, omega=1.3), [0, 0], periods=60)
    >>> regimes = run.regimes()
    >>> regimes.label, len(regimes.types), sorted(regimes.fractions)
    ('not settled', 30, ['bilateral', 'unilateral upper'])
    """

    label: str
    types: tuple[str, ...]
    period: float
    span: tuple[float, float]
    multiple: int | None
    change: float
    outcome: Outcome
    exponents: LyapunovExponents | None = None

    @property
    def fractions(self) -> dict[str, float]:
        """The fraction of periods of each kind, most frequent first."""
        return fractions_of(self.types)

    @property
    def settled(self) -> bool:
        """True if the states repeat."""
        return self.multiple is not None

    def __repr__(self) -> str:
        return f"Regimes: {self.words}. {self.outcome}"

    @property
    def words(self) -> str:
        """The label and the fractions of the periods as text."""
        return in_words(self.label, self.types)


def fractions_of(kinds: Sequence[str]) -> dict[str, float]:
    """Return the fraction of each kind, most frequent first."""
    names, counts = np.unique(np.array(kinds), return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return {str(names[k]): float(counts[k] / len(kinds)) for k in order}


def in_words(label: str, kinds: Sequence[str]) -> str:
    """Return a label as text, with the fractions of the periods if they differ.

    Examples
    --------
    >>> in_words("bilateral", ["bilateral"] * 3)
    'bilateral in each of the last 3 periods'
    >>> in_words("not settled", ["free", "bilateral", "free"])
    'not settled: free in 66.7 %, bilateral in 33.3 % of the last 3 periods'
    """
    count = len(kinds)
    last = "the last period" if count == 1 else f"the last {count} periods"
    shares = fractions_of(kinds)
    if list(shares) == [label]:
        return f"{label} in {'each of ' if count > 1 else ''}{last}"
    listed = ", ".join(
        f"{kind} in {share:.1%}".replace("%", " %") for kind, share in shares.items()
    )
    return f"{label}: {listed} of {last}"


def gap_regions(model: Any, gap: str | None = None) -> tuple[str, str, str] | None:
    """Return the regions below, inside and above a gap, None without a gap.

    Parameters
    ----------
    model : Model or StoredModel
    gap : str, optional
        The region inside; by default the middle one of three regions separated by two
        interfaces that differ by a constant, if contact accelerates, or moves a body that is
        free inside.

    Raises
    ------
    UnknownNameError
        If the named region does not exist.
    ArgumentError
        If the named region is not between two others.
    """
    sides: Mapping[str, Sequence[int]] = model.operations.regions
    if gap is not None and str(gap) not in sides:
        raise unknown_name("region", gap, sides)
    if gap is None and not (len(sides) == 3 and model.traits.parallel):
        return None
    for inside in sides if gap is None else (str(gap),):
        below: list[str] = []
        above: list[str] = []
        for name, signs in sides.items():
            differ = [j for j, s in enumerate(signs) if s != sides[inside][j]]
            if len(differ) == 1:
                j = differ[0]
                rising = signs[j] * model.traits.rising[j] > 0
                (above if rising else below).append(name)
        if len(below) == len(above) == 1:
            return below[0], inside, above[0]
    if gap is None:
        return None
    raise ArgumentError(f"gap = {gap!r}; expected a region with one region below and one above it")


def bits_of(modes: Sequence[str], gap: tuple[str, str, str]) -> Bits:
    """Return the sides of each mode as bits; sliding along an edge is contact with its side."""
    lower, inside, upper = gap
    bits = np.zeros(len(modes), dtype=np.int64)
    for column, mode in enumerate(modes):
        region, _, _ = mode.partition(AT_REST)
        sides = region.split("|")
        bits[column] = (lower in sides) + 2 * (region == inside) + 4 * (upper in sides)
    return bits


def periods_at_the_end(length: Floats, period: Floats) -> NDArray[np.int64]:
    """Return the number of periods in the second half of a run, at least one.

    Examples
    --------
    >>> periods_at_the_end(np.array([1.0, 6.0, 60.0]), np.array([2.0, 2.0, np.nan]))
    array([1, 1, 1])
    """
    with np.errstate(invalid="ignore"):
        count = np.where(np.isfinite(period), length / period + 1e-9, 0.0)
    return np.maximum(1, count.astype(np.int64) // 2)


def repeats(
    states: Floats, scale: Floats, turns: Floats, allowed: float
) -> tuple[NDArray[np.int64], Floats]:
    """Detect after how many periods states repeat, and by how much they change.

    Parameters
    ----------
    states : ndarray, shape (m, k + 1, n)
        States of m runs at the ends of successive periods.
    scale : ndarray, shape (m, n)
        Ranges of the states.
    turns : ndarray, shape (n,)
        The periods of the states, 0 for states without one.
    allowed : float
        Largest change, in units of the scale.

    Returns
    -------
    multiples : ndarray of int, shape (m,)
        Number of periods, 0 if the states do not repeat.
    changes : ndarray, shape (m,)
        Largest change over that number of periods, else over one.
    """
    m, count, n = states.shape
    multiples, changes = np.zeros(m, dtype=np.int64), np.full(m, np.nan)
    for multiple in range(1, max(1, min(LARGEST_MULTIPLE, (count - 1) // 2)) + 1):
        if multiple >= count:
            break
        moved = apart(
            states[:, multiple:].reshape(-1, n).T,
            states[:, :-multiple].reshape(-1, n).T,
            turns[:, None],
        )
        distance = np.abs(moved.T.reshape(m, -1, n)).max(axis=1) / scale
        change = distance.max(axis=1)
        if multiple == 1:
            changes = change
        with np.errstate(invalid="ignore"):
            new = (multiples == 0) & (change <= allowed)
        multiples[new] = multiple
        changes = np.where(new, change, changes)
    return multiples, changes


def labels_of(touched: Bits, multiples: NDArray[np.int64]) -> list[str]:
    """Return the regime of each run as text; the arguments are those of `numbers_of`.

    Examples
    --------
    >>> labels_of(np.array([[7, 5], [6, 3], [6, 7]]), np.array([0, 0, 2]))
    ['bilateral', 'not settled', 'bilateral']
    """
    return [RUN_LABELS[number] for number in numbers_of(touched, multiples).tolist()]


def numbers_of(
    touched: NDArray[np.integer[Any]], multiples: NDArray[np.integer[Any]]
) -> NDArray[np.uint8]:
    """Return the regime of each run from the sides in contact in successive periods.

    It is the number of a label in `RUN_LABELS`, the first of equal ones.

    Parameters
    ----------
    touched : ndarray of int, shape (m, k)
    multiples : ndarray of int, shape (m,)

    Examples
    --------
    >>> numbers_of(np.array([[7, 5], [6, 3], [6, 7]]), np.array([0, 0, 2])).tolist()
    [5, 8, 5]
    """
    # bilateral with and without time inside the gap
    names = np.where(touched == 7, 5, touched)
    same = (names == names[:, :1]).all(axis=1)
    found = names[:, 0].astype(np.uint8)
    for row in np.flatnonzero(~same).tolist():
        last = touched[row, touched.shape[1] - multiples[row] :]
        found[row] = np.bitwise_or.reduce(last) if len(last) else RUN_LABELS.index(NOT_SETTLED)
    found[found == 7] = 5
    return found


def edges_of_periods(window: tuple[float, float], period: float, late: bool) -> Floats:
    """Return the ends of the whole periods before the end of a time interval.

    At least one; with ``late`` those of the second half of the interval.
    """
    first, last = window
    count = (
        int(periods_at_the_end(np.array(last - first), np.array(period)))
        if late
        else max(1, int((last - first) / period + 1e-9))
    )
    return last - period * np.arange(count, -1, -1.0)


def touched_in(segments: Sequence[Segment], sides: Mapping[str, int], edges: Floats) -> Bits:
    """Return the sides of a gap in contact during each period, from those of every mode."""
    begins = np.array([s.start for s in segments])
    ends = np.array([s.end for s in segments])
    bits = np.array([sides[s.region] for s in segments], dtype=np.int64)
    touched = np.zeros(len(edges) - 1, dtype=np.int64)
    for k in range(len(touched)):
        inside = (ends > edges[k]) & (begins < edges[k + 1])
        touched[k] = np.bitwise_or.reduce(bits[inside], initial=0)
    return touched


def regimes_of(
    touched: Bits,
    edges: Floats,
    period: float,
    *,
    span: tuple[float, float],
    dense: DenseOutput | None,
    allowed: float,
    early: str,
) -> Regimes:
    """Classify a run by the sides in contact in its periods; see `Trajectory.regimes`.

    Without dense output it is unknown whether the states repeat. Repeating states change by
    less than ``allowed``, in units of their ranges; ``early`` is a sentence of the outcome.
    """
    multiple, change = 0, float("nan")
    if dense is not None and len(dense.steps) and edges[0] >= span[0] - 1e-9 * period:
        ranges = np.ptp(dense.nodes, axis=0)
        scale = np.where(ranges > 0, ranges, 1.0)
        turns = periods_of(dense.states, dense.periods)
        states = dense(np.clip(edges, *span)).T
        (multiple,), (change,) = repeats(states[None], scale[None], turns, allowed)
    (label,) = labels_of(touched[None], np.array([multiple]))
    return Regimes(
        label,
        tuple(REGIMES[bits] for bits in touched),
        period,
        (max(float(edges[0]), span[0]), float(edges[-1])),
        int(multiple) or None,
        float(change),
        ending_of(int(multiple), float(change), len(touched), early),
    )


def ending_of(multiple: int, change: float, count: int, early: str = "") -> Outcome:
    """Return the outcome that states whether the last periods repeat."""
    if multiple:
        each = "1 period" if multiple == 1 else f"{multiple} periods"
        text = f"The states repeat after {each}, to {change:.2g} of their ranges." + early
        return Outcome("settled", text, True)
    periods = "the last period" if count == 1 else f"the last {count} periods"
    if np.isnan(change):
        text = f"It is unknown whether the states repeat over {periods}." + early
        return Outcome("not settled", text, False)
    text = (
        f"Over {periods} the states do not repeat: in one they change by {change:.2g} of their "
        "ranges. classify_regime() distinguishes chaos from a transient." + early
    )
    return Outcome("not settled", text, False)


def coexisting(labels: Sequence[str]) -> str:
    """Return the label of the motions at one set of parameters, which may coexist.

    Examples
    --------
    >>> coexisting(["chaotic", "bilateral", "chaotic"]), coexisting(["free", "free"])
    ('coexisting: bilateral + chaotic', 'free')
    """
    names = sorted(set(labels))
    return names[0] if len(names) == 1 else COEXISTING + " + ".join(names)


@dataclass(frozen=True, eq=False, repr=False)
class RegimeSet(Summarized, Result):
    """The limit motions of runs from several initial states, at one set of parameters.

    Parameters
    ----------
    motions : tuple of Regimes
        The distinct motions, in the order of detection.
    initial : ndarray, shape (m, n)
        The initial states.
    index : ndarray of int, shape (m,)
        Index of the motion reached from each initial state.
    parameters : mapping
    equations : str
        The model as text.
    """

    motions: tuple[Regimes, ...]
    initial: Floats
    index: NDArray[np.int64]
    parameters: Mapping[str, float]
    equations: str = ""

    @property
    def label(self) -> str:
        """The regime, or ``"coexisting: "`` with the regimes of all motions."""
        return coexisting([motion.label for motion in self.motions])

    @property
    def fractions(self) -> dict[str, float]:
        """The fraction of periods of each kind, over all initial states."""
        return fractions_of([kind for k in self.index for kind in self.motions[k].types])

    def _groups(self) -> list[list[str]]:
        lines = []
        for k, motion in enumerate(self.motions):
            count = int(np.count_nonzero(self.index == k))
            lines.append(f"  {count} of {len(self.initial)}: {motion.words}. {motion.outcome}")
        return [[f"RegimeSet from {len(self.initial)} initial states: {self.label}"], lines]
