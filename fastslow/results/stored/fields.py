"""The frozen rates of a stored model over one parameter, for the continuation of branches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fastslow.results.base.immutable import Immutable
from fastslow.results.stored.arithmetic import (
    check_number,
    evaluated,
    expect,
)
from fastslow.results.stored.unit_equations import UnitEquations


@dataclass(frozen=True)
class FieldOperations:
    """Expressions of the rates, the switching functions and their derivatives.

    Parameters
    ----------
    shared : tuple of str
        Common subexpressions ``s0``, ``s1``, … in ``u0``, … (states, then the varying
        parameters) and ``p0``, ….
    outputs : tuple of (int, str)
        Indices of nonzero outputs with their expressions; all others are zero.
    size : int
        Number of outputs.
    """

    shared: tuple[str, ...]
    outputs: tuple[tuple[int, str], ...]
    size: int


@dataclass(frozen=True)
class FieldSides:
    """The two sides of a sliding motion; see `fastslow.diagrams.modes.Sides`."""

    interface: int
    above: int
    below: int
    escaping: bool


@dataclass(frozen=True)
class Derivatives:
    """Nonzero second and third derivatives of the rates by the states.

    Parameters
    ----------
    entries : tuple of tuple of int
        (i, j, k) or (i, j, k, l) with j ≤ k ≤ l.
    shared : tuple of (str, str)
        Common subexpressions by name.
    texts : tuple of str
        The derivatives.
    """

    entries: tuple[tuple[int, ...], ...]
    shared: tuple[tuple[str, str], ...]
    texts: tuple[str, ...]

    def __call__(self, *numbers: Any) -> list[Any]:
        """Evaluate at states, varying parameters and the others, u0, u1 and so on."""
        values = {f"u{k}": number for k, number in enumerate(numbers)}
        for name, text in self.shared:
            values[name] = evaluated(text, values)
        return [evaluated(text, values) for text in self.texts]


@dataclass(frozen=True)
class FieldMode:
    """One region, sliding along an interface, or held against walls.

    Parameters
    ----------
    name : str
    signs : tuple of int
    sides : FieldSides or None
    operations : FieldOperations
    derivatives : Derivatives or None
        None for functions that are available in compiled code only.
    held : tuple of int
        Rows of the walls of a held motion.
    """

    name: str
    signs: tuple[int, ...]
    sides: FieldSides | None
    operations: FieldOperations
    derivatives: Derivatives | None
    held: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class StoredField(Immutable):
    """The frozen rates of every region and sliding motion over a parameter.

    Parameters
    ----------
    parameter : str
        The continuation parameter.
    names : tuple of str
        The parameters ``p0``, ``p1``, … of the operations.
    modes : tuple of FieldMode
    unit_equations : tuple of UnitEquations
        For natural units without and with the scale of the parameter.
    levels : tuple of (str, str, str, float)
        Interfaces at a constant value of one state: name, state, the value as text in the
        parameters and as a number.
    values : mapping
        Parameter values of those numbers.
    path : mapping
        For a model frozen along a path, each slow quantity as text.
    walls : mapping
        The walls of resets, as equations, with the sign of the slope of h for those of `levels`.
    """

    parameter: str
    names: tuple[str, ...]
    modes: tuple[FieldMode, ...]
    unit_equations: tuple[UnitEquations, UnitEquations]
    levels: tuple[tuple[str, str, str, float], ...]
    values: Mapping[str, float]
    path: Mapping[str, str]
    walls: Mapping[str, int] = field(default_factory=dict)

    def interface_values(
        self, values: Mapping[str, float]
    ) -> dict[str, tuple[str, float] | tuple[str, float, int]]:
        """Return (state, value) for each interface at a constant value of one state.

        For a wall with the side beyond it, 1 above and −1 below.
        """
        return {
            name: (*level, self.walls[name]) if self.walls.get(name) else level
            for name, level in self._levels_at(values).items()
        }

    def _levels_at(self, values: Mapping[str, float]) -> dict[str, tuple[str, float]]:
        if values == self.values:
            return {name: (state, value) for name, state, _, value in self.levels}
        numbers = {f"p{k}": np.float64(values[n]) for k, n in enumerate(self.names) if n in values}
        found = {}
        for name, state, text, _ in self.levels:
            with np.errstate(all="ignore"):
                value = float(evaluated(text, numbers))
            if np.isfinite(value):
                found[name] = (state, value)
        return found

    def check(self, states: Sequence[str], interfaces: Sequence[str]) -> None:
        """Validate all operations and ranges.

        Raises
        ------
        UnknownOperationError
        """
        n = len(states)
        unknowns = {f"u{k}" for k in range(n + 1)}
        names = unknowns | {f"p{k}" for k in range(len(self.names))}
        rows = {len(mode.signs) for mode in self.modes}
        m = rows.pop() if len(rows) == 1 else -1
        surfaces = (*interfaces, *self.walls)
        held = max((len(mode.held) for mode in self.modes), default=0)
        sliding = any(mode.sides is not None for mode in self.modes)
        count = len(surfaces) + max(2 * sliding, 2 * held)
        expect(m == count, "as many signs for every mode")
        for mode in self.modes:
            expect(set(mode.signs) <= {-1, 0, 1}, "signs")
            sides = mode.sides
            if sides is not None:
                # its drifts are the last two rows
                inside = 0 <= sides.interface < len(interfaces)
                regions = (sides.above, sides.below)
                expect(inside and all(0 <= k < len(self.modes) for k in regions), "sides")
                expect(all(self.modes[k].sides is None for k in regions), "regions beside")
            known_walls = all(len(interfaces) <= k < len(surfaces) for k in mode.held)
            expect(known_walls and (sides is None or not mode.held), "walls")
            code = mode.operations
            expect(code.size == (n + m) * (n + 2), "a place for every number")
            expect(_distinct_below([k for k, _ in code.outputs], code.size), "places in range")
            known = set(names)
            for k, text in enumerate(code.shared):
                check_number(text, known)
                known.add(f"s{k}")
            for _, text in code.outputs:
                check_number(text, known)
            if mode.derivatives is not None:
                _check_derivatives(mode.derivatives, n, n + 1 + len(self.names))
        for name, state, text, _ in self.levels:
            expect(name in surfaces and state in states, "a state of an interface")
            check_number(text, names - unknowns)
        expect(set(self.walls.values()) <= {-1, 0, 1}, "sides of walls")
        _check_units(self.unit_equations, {*states, self.parameter, *self.names})


def _distinct_below(places: Sequence[int], size: int) -> bool:
    return len(set(places)) == len(places) and all(0 <= k < size for k in places)


def _check_derivatives(given: Derivatives, n: int, count: int) -> None:
    expect(len(given.entries) == len(given.texts), "a text for every derivative")
    for entry in given.entries:
        expect(len(entry) in (3, 4) and all(0 <= k < n for k in entry), "places of derivatives")
    known = {f"u{k}" for k in range(count)}
    for name, text in given.shared:
        check_number(text, known)
        expect(name.isidentifier() and name not in known, "a new name")
        known.add(name)
    for text in given.texts:
        check_number(text, known)


def _check_units(both: Sequence[UnitEquations], names: set[str]) -> None:
    for one in both:
        rows = len(one.matrix)
        expect(names.issuperset((*one.parameters, *one.gone, *one.fixed)), "names of the model")
        expect(one.matrix.shape == (rows, len(one.columns)), "a matrix of units")
        expect(one.right.shape == (rows, 1 + len(one.parameters)), "right-hand sides of units")
        expect(one.matrix.dtype == one.right.dtype == np.dtype(float), "real numbers")
        expect(bool(np.isfinite(one.matrix).all() and np.isfinite(one.right).all()), "numbers")
