"""Events that end a run: relations that become true, and zeros of expressions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import formula, items
from fastslow.errors import ArgumentError, quoted
from fastslow.formulas.columns import computed, read, written_formula
from fastslow.formulas.functions import FUNCTIONS
from fastslow.formulas.grammar import (
    CONDITIONS,
    Call,
    Comparison,
    Node,
    Sum,
    nodes,
    parse,
    refused,
    text_of,
)
from fastslow.results.base.outcome import Outcome
from fastslow.results.trajectory.steps.step_polynomials import (
    StepPolynomials,
    interpolated,
    nodes_for,
    values_at,
)
from fastslow.results.trajectory.steps.step_roots import Zero, find_zeros

Array = NDArray[np.float64]

#: Functions with kinks or jumps, by their names in SymPy and in Python.
_KINKED = frozenset(
    ("Abs", "Max", "Min", "sign", "Heaviside", "Piecewise", "floor", "ceiling", "frac", "Mod")
)

#: Linear pieces of a step for an expression with kinks.
_PIECES = 64

#: Relative change of a value by which the rounding error of an expression is estimated.
_CHANGE = 2.0**-20

#: Zeros nearer to an end of a step, as a fraction of it, are at the end if the expression is zero
#: to rounding there.
_AT_END = 1e-6

_EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Stop:
    """An event that ends a run.

    Parameters
    ----------
    name : str
        The relation or the expression as written.
    tree : Node
        h, which is positive where the relation is true.
    names : tuple of (str, str)
        The names in the tree, and those of the columns, of the parameters, and ``t``.
    relation : bool
        True for a relation, whose event is that h reaches zero from below; otherwise every
        zero is an event.
    strict : bool
        True for a relation that is false where h is zero.
    """

    name: str
    tree: Node
    names: tuple[tuple[str, str], ...]
    relation: bool
    strict: bool = False

    @property
    def kinked(self) -> bool:
        """True if h may have kinks or jumps."""
        return any(
            isinstance(n, Call) and FUNCTIONS[n.function].symbolic in _KINKED
            for n in nodes(self.tree)
        )

    def is_event(self, zero: Zero) -> bool:
        """Check whether a zero of h is an event; a touch makes no strict inequality true."""
        if not self.relation:
            return zero.before != 0
        rises = zero.after > 0 or (zero.after == 0 and not zero.long)
        return zero.before < 0 and (rises or not self.strict)

    def happened(self, time: float) -> Outcome:
        """Return the outcome of a run that ends with this event."""
        what = "became true" if self.relation else "reached zero"
        return Outcome("stopped", f"stopped at t = {time:.10g}, where {self.name} {what}.", True)


def stops(name: str, value: Any) -> tuple[Any, ...]:
    """Accept a relation or an expression, or a sequence of them."""
    if isinstance(value, str) or hasattr(value, "free_symbols"):
        value = (value,)
    return tuple(items(formula)(name, value))


def read_stops(
    given: Sequence[Any], columns: Sequence[str], parameters: Mapping[str, float]
) -> tuple[Stop, ...]:
    """Read the events of a run.

    Parameters
    ----------
    given : sequence of str or of SymPy objects
    columns : sequence of str
        States, slow states and slow quantities.
    parameters : mapping

    Raises
    ------
    UnknownNameError
        For an unknown name.
    ArgumentError
        For a condition other than one inequality, or one that nothing changes in time.
    """
    valid = (*columns, *parameters, "t")
    found = []
    for one in given:
        text = written_formula(one)
        relation, strict = isinstance(parse(text, valid), CONDITIONS), False
        tree, names = read(text, valid, "column or parameter", relation)
        if relation:
            if not isinstance(tree, Comparison) or tree.operators[0] not in ("<", "<=", ">", ">="):
                raise refused(text, "expected one inequality such as x >= 2, or x - 2", valid)
            if len(tree.operators) > 1:
                raise refused(text, "expected one inequality; give each as an item of stop=", valid)
            strict = tree.operators[0] in ("<", ">")
            low, high = tree.operands if "<" in tree.operators[0] else tree.operands[::-1]
            tree = Sum((("+", high), ("-", low)))
        if not {own for own in names.values() if own not in parameters or own == "t"}:
            raise refused(text, "nothing in it changes with time", valid)
        found.append(Stop(text, tree, tuple(names.items()), relation, strict))
    return tuple(found)


class StopPlace(NamedTuple):
    """Where an event ends a run.

    Parameters
    ----------
    stop : Stop
    step : int
        Number of the step, or with the offset 0 the number of completed steps.
    offset : float
        Time since the beginning of the step.
    """

    stop: Stop
    step: int
    offset: float


class StopSearch:
    """Search of a growing run for its first event.

    Parameters
    ----------
    stops : tuple of Stop
    columns : sequence of str
    parameters : mapping
    direction : float
        1, or −1 for a run backwards in time, with the negative time in its steps.
    """

    def __init__(
        self,
        stops: tuple[Stop, ...],
        columns: Sequence[str],
        parameters: Mapping[str, float],
        direction: float = 1.0,
    ) -> None:
        self.stops, self.columns, self.direction = stops, tuple(columns), direction
        self.parameters = parameters
        self._done = self._jumps = 0

    def first(
        self, steps: Array, series: Array, end: Array | None, jumps: Array
    ) -> StopPlace | None:
        """Return the first event among the steps and jumps that are new since the last call.

        The last step is left to the next call, until the ``end`` of the run, time and columns,
        is known. Jumps are listed as in a `Record`.
        """
        places = [
            self._among_steps(steps, series, end),
            self._among_jumps(steps, series, end, jumps),
        ]
        found = [place for place in places if place is not None]
        return min(found, key=lambda p: (p.step, p.offset)) if found else None

    def _among_jumps(
        self, steps: Array, series: Array, end: Array | None, jumps: Array
    ) -> StopPlace | None:
        """Return the first event by a jump, of which there may be several at one time.

        Those at the start of a run, and all but the last at one time, are at no end of a step.
        """
        rows = np.searchsorted(steps[:, 0], jumps[self._jumps :, 0])
        rows = rows if end is not None else rows[rows < len(steps)]
        new = jumps[self._jumps : self._jumps + len(rows)]
        self._jumps += len(rows)
        if not len(new):
            return None
        slow = np.vstack([series[:, :, 0], end[None, 1:]] if end is not None else [series[:, :, 0]])
        n = (new.shape[1] - 2) // 2
        both = np.stack([new[:, 2 : 2 + n], new[:, 2 + n :]], axis=2)
        rest = np.repeat(slow[rows, n:, None], 2, axis=2)
        columns = np.concatenate([both, rest], axis=1).transpose(1, 0, 2)
        times = np.repeat(new[:, :1], 2, axis=1)
        found = []
        for stop in self.stops:
            values = np.nan_to_num(self.values(stop, times, columns))
            small = 8.0 * _EPSILON * (np.abs(values).max(axis=1) + self.noise(stop, times, columns))
            before, after = values.T
            passed = (before < -small) & (after > small)
            if not stop.strict:
                passed |= (before < -small) & (after >= -small)
            if not stop.relation:
                passed |= (before > small) & (after <= small)
            found += [StopPlace(stop, int(rows[k]), 0.0) for k in np.flatnonzero(passed)[:1]]
        return min(found, key=lambda p: p.step) if found else None

    def _among_steps(self, steps: Array, series: Array, end: Array | None) -> StopPlace | None:
        known = len(steps) if end is not None else len(steps) - 1
        # the last step again: a zero at its end may belong to either
        begin = max(self._done - 1, 0)
        if known <= begin:
            return None
        self._done = known
        after = end if end is not None else np.concatenate([steps[known, :1], series[known, :, 0]])
        part = _Part(self, steps[begin:known], series[begin:known], after)
        found = [place for stop in self.stops if (place := part.first(stop)) is not None]
        place = min(found, key=lambda p: (p.step, p.offset)) if found else None
        for where, error in part.not_finite:
            if place is None or where < (place.step, place.offset):
                raise error
        return None if place is None else place._replace(step=begin + place.step)

    def values(self, stop: Stop, times: Array | float, columns: Array | Sequence[float]) -> Array:
        """Return h at given times, from columns of shape (n_columns, …)."""
        given = dict(zip(self.columns, columns, strict=True))
        given["t"] = self.direction * times
        own = {name: given[n] if n in given else self.parameters[n] for name, n in stop.names}
        return np.broadcast_to(computed(stop.tree, own), np.shape(times))

    def noise(self, stop: Stop, times: Array, columns: Array) -> Array:
        """Return the scale of the rounding error of h in each row of times."""
        values = self.values(stop, times, columns)
        noise = np.zeros(len(values))
        for _, name in stop.names:
            moved, later = columns, times
            if name in self.columns:
                moved = columns.copy()
                moved[self.columns.index(name)] *= 1.0 + _CHANGE
            elif name == "t":
                later = times * (1.0 + _CHANGE)
            changed = self.values(stop, later, moved) - values
            noise += np.nan_to_num(np.abs(changed).max(axis=1)) / _CHANGE
        return noise


class _Part:
    """Some consecutive steps of a run, and the time and columns after them.

    ``not_finite`` lists step and offset from which an expression is not finite, with the error.
    """

    def __init__(self, search: StopSearch, steps: Array, series: Array, after: Array) -> None:
        self.not_finite: list[tuple[tuple[int, float], ArgumentError]] = []
        self.search, self.series, self.after = search, series, after
        self.start, self.length = steps[:, 0], steps[:, 1]
        self._powers_of: tuple[int, list[list[float]]] = -1, []

    def first(self, stop: Stop) -> StopPlace | None:
        """Return the first event of one kind."""
        count = len(self.start)
        values, noise = self._on_nodes(stop)
        parts = _PIECES if stop.kinked else 1
        if stop.kinked:
            pieces = np.stack([values[:, :-1], np.diff(values, axis=1)], axis=2).reshape(-1, 2)
        else:
            pieces = interpolated(values)
        size = np.abs(pieces).sum(axis=1) + np.repeat(noise, parts)
        zeros = [zero for zero in find_zeros(StepPolynomials(pieces, size)) if stop.is_event(zero)]
        small = 8.0 * _EPSILON * (np.abs(values).max(axis=1) + noise)
        # changes of sign by jumps between two steps, and at the end
        after = np.append(values[1:, 0], self._value_after(stop))
        before = values[:, -1]
        jumped = (before < -small) & (after >= -small)
        if stop.strict:
            # at equality the motion after the jump decides
            ahead = np.array([*map(_first_sign, values[1:], small[1:]), 0.0])
            jumped &= (after > small) | (ahead > 0)
        if not stop.relation:
            jumped |= (before > small) & (after <= small)
        whole = np.flatnonzero(jumped)
        place = float(whole[0] + 1) if len(whole) else np.inf
        step, offset = (int(place), 0.0) if len(whole) else (count + 1, 0.0)
        # an interval of zeros makes a strict inequality true at its end
        first = (lambda z: z.high) if stop.strict else (lambda z: z.low)
        if zeros and min(map(first, zeros)) / parts < place:
            zero = min(zeros, key=first)
            step, offset = self._located(stop, zero, parts, small)
        return StopPlace(stop, step, offset) if step <= count else None

    def _on_nodes(self, stop: Stop) -> tuple[Array, Array]:
        """Return h on the nodes of every step, and the scale of its rounding error."""
        nodes = _even_nodes() if stop.kinked else nodes_for(self.series.shape[2] - 1)
        offsets = self.length[:, None] * nodes
        columns = values_at(self.series, offsets)
        times = self.start[:, None] + offsets
        values = self.search.values(stop, times, columns)
        wrong = ~np.isfinite(values)
        if wrong.any():
            row, node = map(int, np.argwhere(wrong)[0])
            when = self.search.direction * times[row, node]
            text = f"{text_of(stop.tree)} is not finite at t = {when:.10g}"
            error = ArgumentError(f"stop {quoted(stop.name)}: {text}")
            self.not_finite.append(((row, float(offsets[row, node])), error))
            values = values.copy()
            values[row:] = values[row - 1, -1] if row else 1.0
        return values, self.search.noise(stop, times, columns)

    def _value_after(self, stop: Stop) -> float:
        time, columns = self.after[:1], self.after[1:, None]
        return float(self.search.values(stop, time, columns)[0])

    def _value(self, stop: Stop, step: int, offset: float) -> float:
        # single numbers: bisection takes dozens
        columns = [_at(powers, offset) for powers in self._powers(step)]
        return float(self.search.values(stop, self.start[step] + offset, columns))

    def _powers(self, step: int) -> list[list[float]]:
        """Return the coefficients of the columns of a step, the highest first."""
        if self._powers_of[0] != step:
            self._powers_of = step, self.series[step, :, ::-1].tolist()
        return self._powers_of[1]

    def _located(self, stop: Stop, zero: Zero, parts: int, small: Array) -> tuple[int, float]:
        """Return step and offset of an event, to rounding."""
        begun = zero.high if stop.strict else zero.low
        place = (begun if zero.long else zero.middle) / parts
        step = min(int(place), len(self.start) - 1)
        part, length = place - step, float(self.length[step])
        low, high = self._bracket(stop, step, part, zero.before)
        while low < high:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                break
            if self._value(stop, step, middle) * zero.before > 0.0:
                low = middle
            else:
                high = middle
        at_end = abs(self._value(stop, step, length)) <= small[step]
        if length - high <= _AT_END * length and at_end:
            return step + 1, 0.0
        if (
            step > 0
            and high <= _AT_END * length
            and abs(self._value(stop, step, 0.0)) <= small[step]
        ):
            return step, 0.0
        return step, high

    def _bracket(self, stop: Stop, step: int, part: float, before: int) -> tuple[float, float]:
        """Return offsets around a zero with opposite signs, two equal ones for a tangency."""
        length = float(self.length[step])
        width = 1e-12
        while width < 1.0:
            low, high = (length * min(max(part + w, 0.0), 1.0) for w in (-width, width))
            signs = [self._value(stop, step, offset) * before for offset in (low, high)]
            if signs[0] > 0.0 >= signs[1]:
                return low, high
            width *= 8.0
        return length * part, length * part


def _at(powers: list[float], offset: float) -> float:
    """Value of a polynomial, whose coefficients begin with the highest, by Horner's scheme."""
    value = 0.0
    for power in powers:
        value = value * offset + power
    return value


def _first_sign(values: Array, small: float) -> float:
    """Sign of the first value that is not rounding, 0 if there is none."""
    known = values[np.abs(values) > small]
    return float(np.sign(known[0])) if len(known) else 0.0


@cache
def _even_nodes() -> Array:
    return np.linspace(0.0, 1.0, _PIECES + 1)
