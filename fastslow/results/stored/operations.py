"""Operations from which the code of a model is generated, with a small, fixed vocabulary.

An operation on series identifies its operands by rows. Plain arithmetic is stored as text in
canonical names: ``t`` is time, ``y0`` the first state, ``w0`` the first slow quantity, ``p0``
the first parameter, ``c0`` the first scalar, ``s0`` the first common subexpression and ``r0``
the value of the first row. Operations read from a file are validated before use.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.quotients import LARGEST_ORDER, QUOTIENTS
from fastslow.results.base.equality import content_hash
from fastslow.results.base.immutable import Immutable
from fastslow.results.stored.arithmetic import (
    UnknownOperationError,
    check_literal,
    check_number,
    expect,
)
from fastslow.results.stored.conditions import DEEPEST_CONDITION, postfix_depth

#: Kinds of operations on series. The kind is followed by the output row and the operands.
SCALAR, TIME, SUM, MULTIPLE, PRODUCT = "scalar", "time", "sum", "multiple", "product"
QUOTIENT, ROOT, POWER, LOGARITHM = "quotient", "root", "power", "logarithm"
FUNCTION = "function"

#: A derivative of a quotient with a removable singularity, the name, argument and order of which
#: follow; see `fastslow.quotients`.
REMOVABLE = "removable"

#: Of models with too many regions to form them all: a row that the signs of interfaces choose among
#: several, followed by the number of the choice and these rows; and the weight of a sliding
#: interface, with its number among them, the rows of all a and of the entries of B, see
#: `fastslow.model.piece_operations`.
CHOSEN, WEIGHTS = "chosen", "weights"

#: Between the region and the walls in the name of a motion at rest.
AT_REST = " at rest on "

#: After the regions in the name of an equilibrium at the two-fold of an interface that is crossed
#: at equal normal speeds.
AT_TWO_FOLD = " (two-fold)"

#: Parameters of a clock: number and time of the last instant, period, time of instant 0.
CLOCK_VALUES = 4

#: Parameters of a switch q: q and 1 − q.
SWITCH_VALUES = 2

#: What an interface function depends on: see `Operations.dependence`.
OF_STATES, OF_TIME, OF_LAWS = 0, 1, 2


@dataclass(frozen=True)
class SeriesOperations:
    """Operations that compute the Taylor series of one smooth motion, to any order.

    Parameters
    ----------
    name : str
        Name of the motion: a region, or ``"A|B"`` for sliding between two.
    signs : tuple of int
        Sign of every interface function; 0 for the interfaces of a sliding motion.
    scalars : tuple of str
        Expressions in parameters only, computed once.
    nodes : tuple of tuple
        Operations in order of evaluation.
    rates : tuple of int
        Row of the rate of each state and slow state.
    outputs : tuple of int
        Rows of slow quantities, interface functions and bounds of sliding.
    """

    name: str
    signs: tuple[int, ...]
    scalars: tuple[str, ...]
    nodes: tuple[tuple[Any, ...], ...]
    rates: tuple[int, ...]
    outputs: tuple[int, ...]


@dataclass(frozen=True)
class ValueOperations:
    """Values and rates of one smooth motion with functions that have no Taylor series.

    Parameters
    ----------
    name, signs
        As in `SeriesOperations`.
    laws : tuple of str
        Values of the slow quantities.
    shared : tuple of str
        Common subexpressions.
    rates : tuple of str
        Rates of states and slow states.
    heights : tuple of (str, str)
        Each interface function, and its rate along the motion.
    bounds : tuple of str
        The bounds of sliding.
    """

    name: str
    signs: tuple[int, ...]
    laws: tuple[str, ...]
    shared: tuple[str, ...]
    rates: tuple[str, ...]
    heights: tuple[tuple[str, str], ...]
    bounds: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class PiecewisePolynomial(Immutable):
    """A function of time that is a polynomial between consecutive knots.

    Parameters
    ----------
    knots : ndarray, shape (n,)
        Increasing times.
    coefficients : ndarray, shape (n - 1, k)
        After each knot but the last, in powers of the time since the knot, lowest first.
    periodic : bool
        Whether it repeats after the last knot, and before the first.
    """

    knots: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    periodic: bool = False

    @property
    def n_terms(self) -> int:
        """Number of coefficients of a piece."""
        return int(self.coefficients.shape[1])

    @property
    def length(self) -> float:
        """Time between the first and the last knot."""
        return float(self.knots[-1] - self.knots[0])

    def cycles(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the number of the period at each time, 0 without repetition."""
        if not self.periodic:
            return np.zeros(np.shape(times))
        return np.asarray(np.floor((times - self.knots[0]) / self.length))

    def pieces(self, times: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the index of the piece that begins at or before each time."""
        times = times - self.cycles(times) * self.length
        found = np.searchsorted(self.knots, times, side="right") - 1
        return np.asarray(np.clip(found, 0, len(self.coefficients) - 1), dtype=np.int64)

    def evaluate(self, times: NDArray[np.float64], order: int = 0) -> NDArray[np.float64]:
        """Return the values, or those of a derivative, at some times."""
        rows = self.pieces(times)
        since = times - (self.knots[rows] + self.cycles(times) * self.length)
        total = np.zeros(np.shape(times))
        for k in range(self.n_terms - 1, order - 1, -1):
            factor = math.prod(range(k - order + 1, k + 1))
            total = total * since + factor * self.coefficients[rows, k]
        return total

    def check(self) -> None:
        """Validate the numbers.

        Raises
        ------
        UnknownOperationError
        """
        knots, coefficients = self.knots, self.coefficients
        expect(
            knots.ndim == 1
            and knots.dtype == coefficients.dtype == np.float64
            and coefficients.ndim == 2
            and len(knots) == len(coefficients) + 1 > 1
            and self.n_terms > 0
            and bool(np.isfinite(knots).all() and np.isfinite(coefficients).all())
            and bool((np.diff(knots) > 0).all()),
            "a table with increasing times",
        )


@dataclass(frozen=True)
class EventOperations:
    """One event.

    Parameters
    ----------
    name : str
    program : tuple of int
        Its condition in postfix notation: numbers of triggers, and `AND`, `OR`, `NEGATION`,
        `TRUE` and `FALSE`.
    values : tuple of str
        Values of all states after it.
    delay, priority : str
        The priority is empty if there is none.
    persistent, initially, at_trigger : bool
        Whether it is executed although its condition has become false, whether the condition
        counts as true before a run, and whether the values are those at the trigger.
    kept : tuple of int
        States that are assigned their own values, which may be those of an earlier trigger.
    """

    name: str
    program: tuple[int, ...]
    values: tuple[str, ...]
    delay: str
    priority: str
    persistent: bool
    initially: bool
    at_trigger: bool
    kept: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class Operations(Immutable):
    """All smooth motions of a model as operations, and the gradients of its interfaces.

    Parameters
    ----------
    sizes : tuple of int
        Numbers of states with slow states, of slow quantities with switches, and of interfaces
        with walls and the functions of switches.
    parameters : tuple of str
        Names of ``p0``, ``p1``, …
    motions : tuple of SeriesOperations or ValueOperations
        Regions, then sliding motions; all of one kind.
    gradients : tuple of (tuple of str, tuple of str)
        For every interface the terms of its function, and its derivatives by the states.
    continuous : tuple of bool
        Whether the rates are continuous across each interface.
    values_only : tuple of str
        Functions without a Taylor recurrence.
    undecided : tuple of (str, str)
        Intersections of discontinuities without a sliding motion, with the reason.
    tables : tuple of PiecewisePolynomial
        Tables of slow quantities. Each adds the current piece to the parameters, which are
        then called ``p`` with the next numbers: its index, its knot, and its coefficients.
    resets : tuple of str
        Names of the resets, whose walls follow the interfaces.
    jumps : tuple of tuple of str
        Values of all states after each reset, those at walls first, then those in which each
        motion at rest on walls begins; these are the last motions.
    clocks : tuple of (str, str, int)
        Period and time of instant 0 of every clock, and the number of the jump at its instants,
        -1 for none. After those of the tables, each adds to the parameters the number and
        the time of the last instant, the period, and the time of instant 0. The jump
        ``n + 2 k + v`` beyond the n resets sets switch k to v.
    switches : tuple of str
        Names of the switches, which are the last of the slow quantities. The last of the
        interfaces but the triggers are their functions (1 − q) h₁ + q h₀, of which an upward zero
        changes q. After those of the clocks, each adds q and 1 − q to the parameters.
    triggers : tuple of bool
        For each inequality h > 0 in the conditions of events whether it includes equality. The
        last of the interfaces are (1 − q) h − q h, where q is 1 if the inequality is true; like a
        switch each adds q and 1 − q to the parameters.
    events : tuple of EventOperations
        Their last states are the parameters that they assign.
    """

    sizes: tuple[int, int, int]
    parameters: tuple[str, ...]
    motions: tuple[SeriesOperations | ValueOperations, ...]
    gradients: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...]
    continuous: tuple[bool, ...]
    values_only: tuple[str, ...] = ()
    undecided: tuple[tuple[str, str], ...] = ()
    tables: tuple[PiecewisePolynomial, ...] = ()
    resets: tuple[str, ...] = ()
    jumps: tuple[tuple[str, ...], ...] = ()
    clocks: tuple[tuple[str, str, int], ...] = ()
    switches: tuple[str, ...] = ()
    triggers: tuple[bool, ...] = ()
    events: tuple[EventOperations, ...] = ()

    @cached_property
    def _hash(self) -> int:
        return content_hash((self.sizes, self.parameters, len(self.motions), self.motions[0]))

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def regions(self) -> Mapping[str, tuple[int, ...]]:
        """The signs of the interface functions by region."""
        count = self.sizes[2] - self.n_walls - len(self.switches) - len(self.triggers)
        return {m.name: m.signs[:count] for m in self.motions if 0 not in m.signs}

    @cached_property
    def dependence(self) -> tuple[int, ...]:
        """What the value of every interface function depends on at an instant.

        `OF_TIME` alone, `OF_LAWS` for the slow quantities, which are not the same functions of
        time in all regions, and `OF_STATES` for others.
        """
        found = []
        for terms, _ in self.gradients:
            letters = {name[0] for term in terms for name in re.findall(r"\b[yw]\d+\b", term)}
            found.append(OF_LAWS if "w" in letters else OF_STATES if "y" in letters else OF_TIME)
        return tuple(found)

    @cached_property
    def has_exponentials(self) -> bool:
        """Whether the Taylor series of a motion contains an exponential function."""
        series = (m.nodes for m in self.motions if isinstance(m, SeriesOperations))
        return any(map(contain_exponentials, series))

    @cached_property
    def n_bounds(self) -> int:
        """Number of rows for the bounds of sliding, the same in every motion."""
        return max(2, *(_bounds(motion, self.sizes) for motion in self.motions), 0)

    @property
    def first_free(self) -> int:
        """The first row after those common to all motions."""
        return sum(self.sizes) + self.n_bounds

    @property
    def n_values(self) -> int:
        """Number of parameters with those of tables, clocks, switches and triggers."""
        return self.switch_place + SWITCH_VALUES * (len(self.switches) + len(self.triggers))

    @property
    def switch_place(self) -> int:
        """Place of the first switch among the parameters."""
        pieces = sum(2 + table.n_terms for table in self.tables)
        return len(self.parameters) + pieces + CLOCK_VALUES * len(self.clocks)

    @property
    def n_walls(self) -> int:
        """Number of resets at walls."""
        return len(self.resets) - sum(0 <= jump < len(self.resets) for _, _, jump in self.clocks)

    def check(self) -> None:
        """Validate all operations and ranges.

        Raises
        ------
        UnknownOperationError
        """
        m, q, p = self.sizes
        events = len(self.resets) + 2 * len(self.switches)
        expect(min(m - 1, q - len(self.switches), p) >= 0, "numbers of rows")
        expect(len(self.motions) > 0 and len(self.gradients) == p, "a motion")
        expect(len(self.continuous) == p, "a flag for every interface")
        kind = ValueOperations if self.values_only else SeriesOperations
        moving = {"t", *_numbered("y", m), *_numbered("w", q)}
        for table in self.tables:
            table.check()
        known = {*_numbered("p", self.n_values)}
        done: set[str] = set()
        for motion in self.motions:
            expect(type(motion) is kind and len(motion.signs) == p, "motions of one kind")
            expect(set(motion.signs) <= {-1, 0, 1}, "signs")
            if isinstance(motion, SeriesOperations):
                _check_series(motion, self, known, done)
            else:
                _check_values(motion, self, known, moving)
        for period, phase, number in self.clocks:
            check_number(period, known)
            check_number(phase, known)
            expect(-1 <= number < events, "the jump of a clock")
        last = p - len(self.switches) - len(self.triggers)
        expect(0 <= self.n_walls <= last, "walls among the interfaces")
        rests = sum(0 in motion.signs[last - self.n_walls : last] for motion in self.motions)
        expect(all({*motion.signs[last:]} <= {-1} for motion in self.motions), "signs")
        expect(len(self.jumps) == len(self.resets) + rests, "jumps")
        for jump in self.jumps:
            expect(len(jump) == m, "a value of every state")
            for text in jump:
                check_number(text, known | moving)
        for event in self.events:
            expect(len(event.values) == m, "a value of every state")
            expect(all(0 <= i < m for i in event.kept), "states that events keep")
            depth = postfix_depth(event.program, len(self.triggers))
            expect(0 < depth <= DEEPEST_CONDITION, "a condition")
            for text in (*event.values, event.delay, *filter(None, [event.priority])):
                check_number(text, known | moving)
        for terms, slopes in self.gradients:
            expect(len(terms) > 0 and len(slopes) == m, "a slope by every state")
            for text in (*terms, *slopes):
                check_number(text, known | moving)


def contain_exponentials(nodes: Sequence[tuple[Any, ...]]) -> bool:
    """Check whether some operations on series contain an exponential function."""
    return any(
        (node[0] == FUNCTION and "math.exp(" in node[2]) or node[0] == REMOVABLE for node in nodes
    )


def renamed(
    node: tuple[Any, ...],
    rows: Mapping[int, int],
    names: Sequence[int],
    *,
    without_slopes: bool = False,
) -> tuple[Any, ...]:
    """Kind and operands of an operation with other rows and scalars.

    Parameters
    ----------
    node : tuple
        See `SeriesOperations`.
    rows : mapping
        The row that replaces each one.
    names : sequence of int
        The number that replaces that of each scalar.
    without_slopes : bool
        Whether to leave out the derivatives of a function, which follow from it.

    Examples
    --------
    >>> renamed((PRODUCT, 5, 3, 4), {3: 0, 4: 1}, ()), renamed((MULTIPLE, 5, "c0", 3), {3: 0}, (7,))
    (('product', 0, 1), ('multiple', 'c7', 0))
    """
    kind, _, *operands = node

    def text(code: Any) -> Any:
        code = re.sub(r"\bc(\d+)\b", lambda c: f"c{names[int(c[1])]}", code)
        return re.sub(r"\br(\d+)\b", lambda r: f"r{rows[int(r[1])]}", code)

    if kind == SUM:
        terms, constant = operands
        return kind, tuple((text(f), rows[r]) for f, r in terms), text(constant)
    if kind == FUNCTION:
        value, slots = operands
        if without_slopes:
            return kind, text(value)
        return kind, text(value), tuple((rows[a], rows[s], text(t)) for a, s, t in slots)
    if kind == REMOVABLE:
        name, argument, order = operands
        return kind, name, rows[argument], order
    assert kind in (SCALAR, TIME, MULTIPLE, PRODUCT, QUOTIENT, ROOT, POWER, LOGARITHM)
    return kind, *(text(one) if isinstance(one, str) else rows[one] for one in operands)


def _bounds(motion: SeriesOperations | ValueOperations, sizes: tuple[int, int, int]) -> int:
    if isinstance(motion, ValueOperations):
        return len(motion.bounds)
    return len(motion.outputs) - sizes[1] - sizes[2]


def _numbered(letter: str, count: int) -> Iterator[str]:
    return (f"{letter}{k}" for k in range(count))


def _check_values(
    motion: ValueOperations, whole: Operations, known: set[str], moving: set[str]
) -> None:
    m, q, p = whole.sizes
    counts = (len(motion.laws), len(motion.rates), len(motion.heights))
    expect(counts == (q, m, p), "a text for every row")
    # slow quantities are evaluated before all others
    for text in motion.laws:
        check_number(text, known | moving)
    names = known | moving
    for k, text in enumerate(motion.shared):
        check_number(text, names)
        names = names | {f"s{k}"}
    for text in (*motion.rates, *motion.bounds, *(t for pair in motion.heights for t in pair)):
        check_number(text, names)


def _check_series(
    motion: SeriesOperations, whole: Operations, known: set[str], done: set[str]
) -> None:
    m, q, p = whole.sizes
    last = whole.first_free + len(motion.nodes)
    names = {*known, *_numbered("c", len(motion.scalars))}
    filled = set(range(m))

    def number(text: Any) -> None:
        if not (isinstance(text, str) and text in names):
            check_literal(text)

    def row(given: Any, among: Iterable[int] = filled) -> None:
        expect(type(given) is int and given in among, "a row that is known")

    for text in motion.scalars:
        if text not in done:
            check_number(text, known)
            done.add(text)
    everything = filled | {node[1] for node in motion.nodes}
    for kind, place, *operands in motion.nodes:
        expect(type(place) is int and m <= place < last and place not in filled, "a new row")
        match (kind, *operands):
            case (str(), text) if kind == SCALAR:
                number(text)
            case (str(),) if kind == TIME:
                pass
            case (str(), tuple() as terms, str() as text) if kind == SUM and (terms or text):
                for factor, term in terms:
                    row(term)
                    if factor not in ("+", "-"):
                        number(factor)
                if text:
                    number(text)
            case (str(), text, a) if kind == MULTIPLE:
                number(text)
                row(a)
            case (str(), a, b) if kind == PRODUCT:
                row(a)
                row(b)
            case (str(), a, b) if kind == QUOTIENT:
                (number if isinstance(a, str) else row)(a)
                row(b)
            case (str(), text, a) if kind in (ROOT, POWER):
                number(text)
                row(a)
            case (str(), text, a) if kind == LOGARITHM:
                row(a)
                check_number(text, {*names, f"r{a}"})
            case (str(), text, tuple() as slots) if kind == FUNCTION:
                for a, slope, steady in slots:
                    row(a)
                    row(slope, everything)
                    if steady != "":
                        number(steady)
                check_number(text, {*names, *(f"r{a}" for a, _, _ in slots)})
            case (str(), str(name), a, int(order)) if kind == REMOVABLE:
                expect(name in QUOTIENTS and 0 <= order <= LARGEST_ORDER, "a known quotient")
                row(a)
            case _:
                raise UnknownOperationError(f"expected an operation, received {kind!a}"[:200])
        filled.add(place)
    expect(len(motion.rates) == m and len(motion.outputs) >= q + p, "a row for every result")
    for a in (*motion.rates, *motion.outputs):
        row(a)
