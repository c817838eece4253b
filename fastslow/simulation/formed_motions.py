"""Motions of a model of very many regions, formed while a run needs them.

The stepping loop pauses where the motion that continues may not be formed. Then the motions next to
the last one are formed, and one is proposed: beginning with these signs, those that the motion
itself contradicts are changed until none is left. The loop compares them as all motions.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import ArgumentError
from fastslow.kernels.taylor.motions_by_signs import MOST_FORMED, SignedSeries
from fastslow.results.stored.operations import WEIGHTS
from fastslow.results.stored.sign_patterns import Pattern
from fastslow.simulation.stepper.event_location import EventSearch
from fastslow.simulation.stepper.motion_selection import NOT_FORMED
from fastslow.simulation.stepper.problems import Problem, Run
from fastslow.simulation.stepper.workspace import (
    INTERFACE,
    MODE,
    NEXT_MODE,
    PROPOSED,
    RESTING,
)

#: Signature of a compiled series.
_SIGNATURE = ctypes.CFUNCTYPE(
    None, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p
)

#: Changes of all contradicted signs at once, after which one is changed at a time.
AT_ONCE = 8

#: Share of the rates, and of a weight, that is left to rounding.
ROUNDING = 1e-11

#: Derivatives of h by which the side of a motion from an interface is judged.
JUDGED = 3


class FormedMotions:
    """The motions of one run.

    Parameters
    ----------
    series : SignedSeries
    signs : sequence of tuple of int
        Of the motions that are formed at once, which rest on no wall.
    """

    def __init__(self, series: SignedSeries, signs: Sequence[Pattern] = ()) -> None:
        self.series, self.numbers = series, dict[Pattern, int]()
        self._tables: list[NDArray[np.float64]] = []
        self._call = _SIGNATURE(series.compiled.address)
        self.first_wall, self.n_signs = series.operations.first_wall, series.operations.n_signs
        for one in signs:
            self.form(series.operations.whole(one))

    @property
    def patterns(self) -> tuple[Pattern, ...]:
        """The signs of all motions formed so far."""
        return tuple(self.numbers)

    def form(self, signs: Pattern) -> int:
        """Form a motion; return its number, -1 for signs that exclude each other."""
        if signs not in self.numbers:
            if len(self.numbers) == MOST_FORMED or not self.series.operations.formed(signs):
                return -1
            self.numbers[signs] = len(self._tables)
            self._tables.append(self.series.table(np.array(signs, dtype=np.int64)))
        return self.numbers[signs]

    def begin(self, run: Run) -> None:
        """Form a motion at the beginning of a run, whose series gives its slow quantities."""
        if self.numbers:
            return
        compiled, operations = self.series.compiled, self.series.operations
        first = compiled.n_states + compiled.n_forcing
        some = np.array([next(iter(rows.values())) for _, rows in operations.choices], dtype=float)
        table = np.zeros(self.series.width)
        table[: len(some)] = some * (compiled.order + 1)
        heights = self._rows(table, run)[first : first + self.first_wall, 0]
        for side in (1, -1):
            signs = np.where(heights == 0.0, side, np.where(heights > 0.0, 1, -1))
            if self.form(operations.whole(tuple(signs.tolist()))) >= 0:
                return
        raise ArgumentError(
            "the initial state is on interfaces beside which no region is found; start slightly "
            "off them"
        )

    def problem(self, problem: Problem) -> Problem:
        """Return a problem with the motions formed so far."""
        count, found = len(self._tables), self.series.saturations
        limits = [number for one in found for number in one[1:]]
        rows = np.array([one.row for one in found], dtype=np.int64)
        # those of switches and inequalities are always −1
        signs = np.full((count, problem.n_interfaces), -1, dtype=np.int64)
        signs[:, : self.n_signs] = np.array(self.patterns).reshape(count, self.n_signs)
        return problem._replace(
            signs=signs,
            saturating=np.tile(rows, (count, 1)),
            saturations=np.tile(np.array(limits, dtype=float), (count, 1)),
        )

    def run(self, run: Run) -> Run:
        """Return a run whose parameters are followed by the tables of the motions."""
        own = run.parameters[: self.series.compiled.n_values]
        return run._replace(parameters=np.concatenate([own, *self._tables]))

    def propose(self, run: Run, search: EventSearch) -> None:
        """Form the motions next to the last one, and propose a motion that continues."""
        counted, first_wall = run.counted, self.first_wall
        on, side = search.on[:first_wall], search.side
        before, event, wall = (int(counted[k]) for k in (MODE, INTERFACE, RESTING))
        if wall >= 0:
            selected = self.patterns[counted[NEXT_MODE]]
            resting = self.form((*selected[:wall], 0, *selected[wall + 1 :]))
            counted[RESTING], counted[PROPOSED] = -1, resting if resting >= 0 else NOT_FORMED
            return
        continuous = self.series.compiled.continuous
        slides = set(self.series.operations.sliding)
        here = np.where(side[:first_wall] > 0, 1, -1)
        if before < 0:
            first = [0 if on[j] and j in slides else int(s) for j, s in enumerate(here)]
        else:
            last = self.patterns[before][:first_wall]
            first = [s if on[j] else int(here[j]) for j, s in enumerate(last)]
        first += side[first_wall : self.n_signs].tolist()
        beside = [first]
        if 0 <= event < first_wall:
            others = (-1, 1) if continuous[event] or event not in slides else (-1, 0, 1)
            beside = [[*first[:event], sign, *first[event + 1 :]] for sign in others]
        for one in beside:
            self.form(tuple(one))
        found = NOT_FORMED
        for one in beside:
            found = self._consistent(one, run, np.flatnonzero(on).tolist())
            if found >= 0:
                break
        counted[PROPOSED] = found

    def _consistent(self, signs: Sequence[int], run: Run, on: Sequence[int]) -> int:
        """Number of a motion whose signs it does not contradict, beginning with some signs."""
        found, given = list(signs), self.series.operations.sliding
        seen = set[Pattern]()
        for attempt in range(AT_ONCE + 3 * len(on)):
            number = self.form(tuple(found))
            if number < 0:
                return NOT_FORMED
            changes = self._contradicted(number, tuple(found), run, on, given)
            if not changes:
                return number
            pattern = tuple(found)
            if attempt >= AT_ONCE or pattern in seen:
                changes = changes[:1]
            seen.add(pattern)
            for j, sign in changes:
                found[j] = sign
        return NOT_FORMED

    def _contradicted(
        self,
        number: int,
        signs: Pattern,
        run: Run,
        on: Sequence[int],
        sliding: Sequence[int],
    ) -> list[tuple[int, int]]:
        """Interfaces at the point whose sign the motion contradicts, with the sign to try next."""
        rows, compiled = self._rows(self._tables[number], run), self.series.compiled
        first = compiled.n_states + compiled.n_forcing
        drift = first + compiled.n_interfaces
        slides = [j for j, sign in enumerate(signs) if sign == 0]
        weights = {node[2]: node[1] for node in self.series.operations.nodes if node[0] == WEIGHTS}
        found = []
        small = ROUNDING * (1.0 + np.abs(rows[: compiled.n_states, 1]).max())
        held = self.series.operations.held_at(signs)
        for j in (j for j in on if j not in held):
            if signs[j] == 0:
                weight = rows[weights[sliding.index(j)]]
                side = 1 if weight[0] > 0.0 else -1
                beyond = side * weight[0] - 1.0
                leaves = beyond > 0.0 if abs(beyond) > ROUNDING else side * weight[1] > 0.0
                if leaves or not np.isfinite(weight[0]):
                    found.append((j, side))
                elif len(slides) == 1 and rows[drift + 2 * slides.index(j), 0] > 0.0:
                    # the motion leaves to both sides
                    found.append((j, 1))
                continue
            slopes = (signs[j] * rows[first + j, 1 : 1 + JUDGED]).tolist()
            slope = next((c for c in slopes if abs(c) > small), 0.0)
            if j in sliding and not slope > 0.0:
                found.append((j, 0))
            elif slope < 0.0:
                found.append((j, -signs[j]))
        return found

    def _rows(self, table: NDArray[np.float64], run: Run) -> NDArray[np.float64]:
        """The Taylor series of the motion of a table at the point of a run."""
        compiled = self.series.compiled
        own = run.parameters[: compiled.n_values]
        # the motion is the only one of a table of its own
        parameters = np.concatenate([own, table])
        rows = np.zeros(compiled.n_rows * (compiled.order + 1))
        self._call(0, run.inputs.ctypes.data, parameters.ctypes.data, rows.ctypes.data)
        return rows.reshape(compiled.n_rows, compiled.order + 1)
