"""Taylor series of a model as one compiled function.

The function has a mode for every region, for every sliding motion between two
regions, and for the gradient of every interface. Its source depends on the
equations alone; parameter values are passed as an array.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.compiler.chains import chosen
from fastslow.kernels.compiler.machine_code import Address
from fastslow.kernels.compiler.model_code import load_function
from fastslow.kernels.taylor.many_motions import ManyMotions, shared, source_of
from fastslow.kernels.taylor.modes import (
    COLLOCATION,
    DIRECTIONAL,
    RATES,
    SHORT_ORDER,
    SHORTENED,
)
from fastslow.kernels.taylor.recurrences import Recurrences
from fastslow.kernels.taylor.saturation import saturation_arrays
from fastslow.results.stored.operations import (
    OF_LAWS,
    OF_TIME,
    EventOperations,
    Operations,
    PiecewisePolynomial,
    SeriesOperations,
    ValueOperations,
)

_HEADER = '''"""{what} for {modes} modes of {states} states."""


def series(mode, inputs, parameters, W):
    n = {order}
    clock = 1.0
    if mode >= {number}:
        if mode >= {directional}:
            mode -= {directional}
            n = {second}
            clock = 0.0
        elif mode >= {rates}:
            mode -= {rates}
            n = 1
        else:
            mode -= {number}
            n = {short}
'''


#: Number of compiled series kept in memory.
SERIES_KEPT = 256


class HasOperations(Protocol):
    """A model or a stored model."""

    @property
    def operations(self) -> Operations: ...

    @property
    def parameters(self) -> Mapping[str, float]: ...


@dataclass(frozen=True, eq=False)
class CompiledSeries:
    """The compiled series of a model and the layout of its arrays.

    Called with a mode, ``inputs = (t, states, slow states)`` and the parameter
    array, the function fills rows of ``order + 1`` coefficients: states and
    slow states, slow quantities, switching functions, two bounds for each sliding
    interface (see `Motion`), then work space. In a gradient mode ``inputs``
    also contains the slow quantities, and the output is h, the sum of the
    moduli of its terms, and its gradient by states and slow states. In mode −1 − k the
    output is the k-th of the jumps, a value for every state. The modes from 0 are
    followed by the same with only `SHORT_ORDER` coefficients; with one, the rates; and
    with directional derivatives: the first coefficients of the states are a direction u
    on entry, time is fixed, and the second ones become J u / 2 with the exact Jacobian J
    of the rates.

    Parameters
    ----------
    address : Address
        Of the compiled function.
    order : int
        Highest Taylor coefficient.
    parameters : tuple of str
        Order of the parameter array.
    n_states, n_forcing, n_interfaces, n_rows : int
        Numbers of rows: states with slow states, slow quantities, interfaces, and all.
    signs : ndarray of int64, shape (n_modes, n_interfaces)
        Side of each interface in every mode, 0 for sliding interfaces.
    saturating, saturations : ndarray
        Rows of the arguments of functions that saturate, and their limits, see
        `saturation_arrays`.
    modes : tuple of str
        Region names; sliding between A and B is named ``"A|B"``.
    continuous : ndarray of bool, shape (n_interfaces,)
        Whether the rates are continuous across each interface.
    of_time, of_laws : ndarray of bool, shape (n_interfaces,)
        Whether each interface is a function of time alone, and whether it depends on slow
        quantities that are not the same functions of time in all regions (see `Operations`).
    values_only : tuple of str
        Functions without a Taylor recurrence. If there are any, the compiled function fills
        only the values of all rows and the rates of states and switching functions, and its
        last coefficient is NaN.
    undecided : tuple of (str, str)
        Intersections of switching manifolds without derived sliding, with the reason.
    tables : tuple of PiecewisePolynomial
        Tables of slow quantities, whose current pieces follow the parameters in the array.
    resets : tuple of str
        Names of the resets, those at walls first. The first of the jumps are theirs.
    n_walls : int
        Number of walls, the last of the interfaces before the functions of switches.
    n_rests : int
        Number of motions at rest on walls, the last of the modes. The last of the jumps give the
        states in which they begin.
    clocks : tuple of (str, str, int)
        See `Operations`.
    switches : tuple of str
        Names of the switches, the last of the slow quantities; see `Operations`.
    switch_place : int
        Place of the first switch among the parameters.
    n_values : int
        Number of parameters with those of tables, clocks, switches and triggers.
    triggers : tuple of bool
        The inequalities of events, whose functions are the last of the interfaces; see
        `Operations`. Their values follow those of the switches.
    events : tuple of EventOperations
        Values, delay and priority of each are given after the jumps, in modes below theirs.
    effects : ndarray of bool, shape (n_events, n_states + n_triggers)
        The states that each event assigns, and the triggers that depend on these.
    """

    address: Address
    order: int
    parameters: tuple[str, ...]
    n_states: int
    n_forcing: int
    n_interfaces: int
    n_rows: int
    signs: NDArray[np.int64]
    saturating: NDArray[np.int64]
    saturations: NDArray[np.float64]
    modes: tuple[str, ...]
    continuous: NDArray[np.bool_]
    of_time: NDArray[np.bool_]
    of_laws: NDArray[np.bool_]
    values_only: tuple[str, ...] = ()
    undecided: tuple[tuple[str, str], ...] = ()
    tables: tuple[PiecewisePolynomial, ...] = ()
    resets: tuple[str, ...] = ()
    n_walls: int = 0
    n_rests: int = 0
    clocks: tuple[tuple[str, str, int], ...] = ()
    switches: tuple[str, ...] = ()
    switch_place: int = 0
    n_values: int = 0
    triggers: tuple[bool, ...] = ()
    events: tuple[EventOperations, ...] = ()
    effects: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))

    @property
    def method(self) -> str:
        """Description of the stepping method."""
        if self.values_only:
            names = ", ".join(self.values_only)
            return f"collocation of order {self.order} (no Taylor recurrence for {names})"
        return f"Taylor series of order {self.order}"

    def parameter_array(self, model: HasOperations) -> NDArray[np.float64]:
        """Parameter values in the order that the compiled function expects, never empty.

        They are followed by zeros for the current pieces of tables, clocks and switches.
        """
        values = [model.parameters[name] for name in self.parameters]
        values += [0.0] * (self.n_values - len(values))
        return np.array(values or [0.0])


def compile_series(model: HasOperations, order: int) -> CompiledSeries:
    """Compile the Taylor series of a model, or return the compiled one.

    A model with a function without recurrence is compiled to values and rates.

    Parameters
    ----------
    model : Model or StoredModel
    order : int
        Highest coefficient, at most `COLLOCATION` without a Taylor series.

    Raises
    ------
    ModelError
        If a function in the equations cannot be compiled.
    """
    operations = model.operations
    return _compiled(operations, min(order, COLLOCATION) if operations.values_only else order)


@lru_cache(maxsize=SERIES_KEPT)
def _compiled(operations: Operations, order: int) -> CompiledSeries:
    many = shared(operations)
    source, n_rows = _source(operations, many, order)
    saturating, limits = saturation_arrays(operations, many.rows if many is not None else ())
    found = described(operations, load_function(source, "series"), order, n_rows)
    return replace(found, saturating=saturating, saturations=limits)


def described(operations: Operations, address: Address, order: int, n_rows: int) -> CompiledSeries:
    """Return a compiled function with the layout of its arrays, without saturations."""
    m, q, p = operations.sizes
    count = len(operations.motions)
    signs = np.array([motion.signs for motion in operations.motions], dtype=np.int64)
    dependence = np.array(operations.dependence, dtype=np.int64)
    return CompiledSeries(
        address=address,
        order=order,
        parameters=operations.parameters,
        n_states=m,
        n_forcing=q,
        n_interfaces=p,
        n_rows=n_rows,
        signs=signs.reshape(count, p),
        saturating=np.zeros((count, 0), dtype=np.int64),
        saturations=np.zeros((count, 0)),
        modes=tuple(motion.name for motion in operations.motions),
        continuous=np.array(operations.continuous, dtype=bool),
        of_time=dependence == OF_TIME,
        of_laws=dependence == OF_LAWS,
        values_only=operations.values_only,
        undecided=operations.undecided,
        tables=operations.tables,
        resets=operations.resets,
        n_walls=operations.n_walls,
        n_rests=len(operations.jumps) - len(operations.resets),
        clocks=operations.clocks,
        switches=operations.switches,
        switch_place=operations.switch_place,
        n_values=operations.n_values,
        triggers=operations.triggers,
        events=operations.events,
        effects=_effects(operations),
    )


def _effects(operations: Operations) -> NDArray[np.bool_]:
    """Return the states that every event assigns, and the triggers that depend on these."""
    n, count = operations.sizes[0], len(operations.triggers)
    assigned = [
        [v != f"y{i}" or i in e.kept for i, v in enumerate(e.values)] for e in operations.events
    ]
    gradients = operations.gradients[len(operations.gradients) - count :]
    depends = [[s not in ("0", "0.0") for s in slopes] for _, slopes in gradients]
    states = np.array(assigned, dtype=bool).reshape(len(assigned), n)
    return np.hstack([states, states @ np.array(depends, dtype=bool).reshape(count, n).T])


def _source(operations: Operations, many: ManyMotions | None, order: int) -> tuple[str, int]:
    """Source of the generated module, and its number of rows."""
    count = len(operations.motions)
    n_rows, tables = 0, list[str]()
    branches: list[tuple[str, list[str]]] = []
    if many is not None:
        tables, body, n_rows = source_of(operations, many, order)
        branches = [(f"(mode >= 0) and (mode < {count})", body)]
    else:
        for number, motion in enumerate(operations.motions):
            if isinstance(motion, SeriesOperations):
                body, rows = motion_source(operations, motion, order, clock="clock")
            else:
                body, rows = _values_source(operations, motion, order)
            branches.append((f"mode == {number}", body))
            n_rows = max(n_rows, rows)
    before = "".join(f"{table}\n" for table in tables)
    return before + source_of_modes(operations, branches, count, order), n_rows


def source_of_modes(
    operations: Operations, branches: list[tuple[str, list[str]]], count: int, order: int
) -> str:
    """Source of the function with these branches for ``count`` motions, and those that follow."""
    lines = [f"    p{i} = parameters[{i}]" for i in range(operations.n_values)]
    gradients = operations.sizes[2]
    branches = list(branches)
    for number in range(gradients):
        branches.append((f"mode == {count + number}", _gradient_source(operations, number)))
    # negative, so that they have no short form
    jumps = [*operations.jumps]
    jumps += [(*e.values, e.delay, e.priority or "0.0") for e in operations.events]
    for number, values in enumerate(jumps):
        branches.append((f"mode == {-1 - number}", _jump_source(operations, values)))
    lines += chosen(branches)
    text = "\n".join(lines) + "\n"
    alone = operations.values_only
    what = "Values and rates" if alone else f"Taylor coefficients of order {order}"
    header = _HEADER.format(
        what=what,
        order=order,
        modes=count,
        states=operations.sizes[0],
        short=min(SHORT_ORDER, order),
        second=min(2, order),
        number=SHORTENED * (count + gradients),
        rates=RATES * (count + gradients),
        directional=DIRECTIONAL * (count + gradients),
    )
    return header + text


def motion_source(
    operations: Operations,
    motion: SeriesOperations,
    order: int,
    *,
    clock: str = "1.0",
    called: bool = False,
) -> tuple[list[str], int]:
    """Source lines that fill the series of one motion, and its number of rows.

    If ``clock`` names the rate of time, the first coefficients of the states are not
    changed while it is 0. If ``called``, the lines call the functions of
    `fastslow.kernels.taylor.recurrences.FUNCTIONS`.
    """
    m = operations.sizes[0]
    work = Recurrences(motion.nodes, order, clock, called)
    copies = {row: held for row, held in enumerate(motion.outputs, start=m) if row != held}
    body = ["t = inputs[0]"]
    body += [f"{work.at(i, '0')} = inputs[{i + 1}]" for i in range(m)]
    body += [f"c{k} = {code}" for k, code in enumerate(motion.scalars)]
    body += work.values()
    first = [f"{work.at(i, '1')} = {work.at(r, '0')}" for i, r in enumerate(motion.rates)]
    body += first if clock == "1.0" else [f"if {clock} != 0.0:", *(f"    {s}" for s in first)]
    # the last coefficients of the states need those of the rates below
    always, below = work.general(motion.outputs)
    below += ["r = 1.0 / (k + 1)"]
    below += [f"{work.at(i, 'k + 1')} = {work.at(r)} * r" for i, r in enumerate(motion.rates)]
    body += ["for k in range(1, n + 1):", "    q = 1.0 / k"]
    body += [f"    {line}" for line in always]
    body += ["    if k < n:", *(f"        {line}" for line in below)]
    if copies:
        body += ["for k in range(n + 1):"]
        body += [f"    {work.at(row)} = {work.at(held)}" for row, held in copies.items()]
    return body, max(operations.first_free, work.n_rows)


def _values_source(
    operations: Operations, motion: ValueOperations, order: int
) -> tuple[list[str], int]:
    """Source lines without recurrences: values, and rates of states and switching functions."""
    columns, (m, q, p) = order + 1, operations.sizes
    body = ["t = inputs[0]"]
    for i in range(m):
        body += [f"y{i} = inputs[{i + 1}]", f"W[{i * columns}] = y{i}"]
    for k, law in enumerate(motion.laws):
        body += [f"w{k} = {law}", f"W[{(m + k) * columns}] = w{k}"]
    body += [f"s{k} = {code}" for k, code in enumerate(motion.shared)]
    body += [f"W[{i * columns + 1}] = {rate}" for i, rate in enumerate(motion.rates)]
    for row, (height, rate) in enumerate(motion.heights, start=m + q):
        body += [f"W[{row * columns}] = {height}", f"W[{row * columns + 1}] = {rate}"]
    first = m + q + p
    body += [f"W[{k * columns}] = {bound}" for k, bound in enumerate(motion.bounds, start=first)]
    # marks the missing recurrence
    return [*body, f"W[{order}] = math.nan"], operations.first_free


def _gradient_source(operations: Operations, number: int) -> list[str]:
    terms, slopes = operations.gradients[number]
    body = _moving_source(operations, terms)
    body.append("W[0] = " + " + ".join(f"({term})" for term in terms))
    body.append("W[1] = " + " + ".join(f"abs({term})" for term in terms))
    return body + [f"W[{2 + i}] = {slope}" for i, slope in enumerate(slopes)]


def _jump_source(operations: Operations, values: tuple[str, ...]) -> list[str]:
    body = _moving_source(operations, values)
    return body + [f"W[{i}] = {value}" for i, value in enumerate(values)]


def _moving_source(operations: Operations, texts: tuple[str, ...]) -> list[str]:
    """Source lines that name time, states and slow quantities in some expressions."""
    m, q, _ = operations.sizes
    symbols = ("t", *(f"y{i}" for i in range(m)), *(f"w{k}" for k in range(q)))
    used = set(re.findall(r"\b[tyw]\d*\b", " ".join(texts)))
    return [f"{s} = inputs[{i}]" for i, s in enumerate(symbols) if s in used]
