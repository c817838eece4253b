"""A model's Taylor series as one compiled function.

The function has a mode for every region, for every sliding motion between two
regions, and for the gradient of every interface. Its source depends on the
equations alone: parameter values arrive as an array.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.compiled.functions import without_recurrence
from fastslow.compiled.model_code import load_function
from fastslow.compiled.recurrences import Recurrences, scalar_code
from fastslow.compiled.series_modes import (
    COLLOCATION,
    DIRECTIONAL,
    RATES,
    SHORT,
    SHORTENED,
)
from fastslow.model.model import Model
from fastslow.model.motions import Motion, drift, motions_of, regions_of
from fastslow.model.structure import TIME, real

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


@dataclass(frozen=True, eq=False)
class CompiledSeries:
    """The compiled series of a model and how its arrays are laid out.

    Called with a mode, ``inputs = (t, states, slow states)`` and the parameter
    array, the function fills rows of ``order + 1`` coefficients: states and
    slow states, slow quantities, interface functions, two bounds for each interface
    that is slid along (see `Motion`), then work space. In a gradient mode ``inputs``
    goes on with the slow quantities, and the output is h, the sum of the
    moduli of its terms, and its gradient by states and slow states. Beyond all
    these the modes follow again with only `SHORT` coefficients; then with one, the
    rates; and then for a direction u: the first coefficients of the states are u when
    it is called, time stands still, and the second ones become J u / 2, with the
    Jacobian J of the rates, exact as the derivatives of a series are.

    Parameters
    ----------
    address : int
        Of the compiled function.
    order : int
        Highest Taylor coefficient.
    parameters : tuple of str
        Order of the parameter array.
    n_states, n_forcing, n_interfaces, n_rows : int
        Numbers of rows: states with slow states, slow quantities, interfaces, and all.
    signs : ndarray of int64, shape (n_modes, n_interfaces)
        Side of each interface in every mode, 0 on interfaces that are slid along.
    modes : tuple of str
        Region names; sliding between A and B is named ``"A|B"``.
    continuous : ndarray of bool, shape (n_interfaces,)
        Whether the rates are continuous across each interface.
    values_only : tuple of str
        Functions without a Taylor recurrence. Where there are any, the compiled function
        fills the values of all rows and the rates of states and interface functions alone,
        and its last coefficient is NaN.
    undecided : tuple of (str, str)
        Intersections of discontinuities along which no sliding is derived, and why.
    """

    address: int
    order: int
    parameters: tuple[str, ...]
    n_states: int
    n_forcing: int
    n_interfaces: int
    n_rows: int
    signs: NDArray[np.int64]
    modes: tuple[str, ...]
    continuous: NDArray[np.bool_]
    values_only: tuple[str, ...] = ()
    undecided: tuple[tuple[str, str], ...] = ()

    @property
    def method(self) -> str:
        """How this model is stepped, in words."""
        if self.values_only:
            names = ", ".join(self.values_only)
            return f"collocation of order {self.order} (no Taylor recurrence for {names})"
        return f"Taylor series of order {self.order}"

    def parameter_array(self, model: Model) -> NDArray[np.float64]:
        """Parameter values in the order that the compiled function expects, never empty."""
        return np.array([model.parameters[name] for name in self.parameters] or [0.0])


@dataclass(frozen=True)
class Equations:
    """Everything that the generated source depends on."""

    states: tuple[sp.Symbol, ...]
    quantities: tuple[sp.Symbol, ...]
    interfaces: tuple[sp.Expr, ...]
    modes: tuple[Motion, ...]
    order: int

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of all parameters in use, sorted."""
        used = set().union(*(h.free_symbols for h in self.interfaces))
        for mode in self.modes:
            used |= set().union(*(e.free_symbols for e in (*mode.rates, *mode.laws)))
        return tuple(sorted(s.name for s in used - self.moving))

    def renamed(self) -> Equations:
        """The same with symbols that are valid in any source: y0, w0, p0, …."""
        groups = {"y": self.states, "w": self.quantities, "p": map(real, self.parameters)}
        new = {s: real(f"{g}{i}") for g, symbols in groups.items() for i, s in enumerate(symbols)}

        def rename(expressions: tuple[sp.Expr, ...]) -> tuple[sp.Expr, ...]:
            return tuple(e.xreplace(new) for e in expressions)

        modes = tuple(
            replace(
                mode, rates=rename(mode.rates), laws=rename(mode.laws), bounds=rename(mode.bounds)
            )
            for mode in self.modes
        )
        return Equations(
            tuple(new[s] for s in self.states),
            tuple(new[s] for s in self.quantities),
            rename(self.interfaces),
            modes,
            self.order,
        )

    @property
    def n_bounds(self) -> int:
        """Number of rows for the bounds of sliding, the same in every mode."""
        return max(2, *(len(mode.bounds) for mode in self.modes), 0)

    @property
    def moving(self) -> set[sp.Symbol]:
        """All symbols that change with time."""
        return {*self.states, *self.quantities, TIME}

    @property
    def without_recurrence(self) -> tuple[str, ...]:
        """Names of functions for which a Taylor series cannot be generated."""
        used = [*self.interfaces]
        for mode in self.modes:
            used += [*mode.rates, *mode.laws, *mode.bounds]
        return tuple(sorted(set().union(*(without_recurrence(e, self.moving) for e in used))))


_compiled: dict[Equations, CompiledSeries] = {}


def compile_series(model: Model, order: int) -> CompiledSeries:
    """Compile the Taylor series of a model, or find it compiled already.

    A model with a function that has no recurrence is compiled to values and rates.

    Parameters
    ----------
    model : Model
    order : int
        Highest coefficient, lowered to `COLLOCATION` where no Taylor series exists.

    Raises
    ------
    ModelError
        If a function in the equations cannot be compiled.
    """
    equations = equations_of(model, order)
    if equations not in _compiled:
        motions = motions_of(model)
        whole = replace(equations, modes=(*motions.regions, *motions.sliding))
        if whole.without_recurrence:
            whole = replace(whole, order=min(order, COLLOCATION))
        _compiled[equations] = _compile(
            whole, np.array(list(model.continuous.values()), dtype=bool), motions.undecided
        )
    return _compiled[equations]


def equations_of(model: Model, order: int) -> Equations:
    """What the generated source of a model depends on, its regions alone as modes."""
    names = (*model.states, *model.slow_states)
    return Equations(
        tuple(map(real, names)),
        tuple(map(real, model.forcing)),
        tuple(i.function for i in model.interfaces.values()),
        regions_of(model),
        order,
    )


def _compile(
    equations: Equations,
    continuous: NDArray[np.bool_],
    undecided: tuple[tuple[str, str], ...],
) -> CompiledSeries:
    parameters = equations.parameters
    source, n_rows = _source(equations.renamed(), len(parameters))
    m, q, p = (len(g) for g in (equations.states, equations.quantities, equations.interfaces))
    signs = np.array([mode.signs for mode in equations.modes], dtype=np.int64)
    return CompiledSeries(
        load_function(source, "series"),
        equations.order,
        parameters,
        m,
        q,
        p,
        n_rows,
        signs.reshape(len(equations.modes), p),
        tuple(mode.name for mode in equations.modes),
        continuous,
        equations.without_recurrence,
        undecided,
    )


def _source(equations: Equations, n_parameters: int) -> tuple[str, int]:
    """Source of the generated module, and the number of rows it fills."""
    lines = [f"    p{i} = parameters[{i}]" for i in range(n_parameters)]
    n_rows = 0
    bodies: list[list[str]] = []
    alone = bool(equations.without_recurrence)
    for mode in equations.modes:
        body, rows = (
            _values_source(equations, mode)
            if alone
            else mode_source(equations, mode, clock="clock")
        )
        bodies.append(body)
        n_rows = max(n_rows, rows)
    bodies += [_gradient_source(equations, h) for h in equations.interfaces]
    for number, body in enumerate(bodies):
        lines.append(f"    {'if' if number == 0 else 'elif'} mode == {number}:")
        lines += [f"        {line}" for line in body]
    text = "\n".join(lines) + "\n"
    what = "Values and rates" if alone else f"Taylor coefficients of order {equations.order}"
    header = _HEADER.format(
        what=what,
        order=equations.order,
        modes=len(equations.modes),
        states=len(equations.states),
        short=min(SHORT, equations.order),
        second=min(2, equations.order),
        number=SHORTENED * len(bodies),
        rates=RATES * len(bodies),
        directional=DIRECTIONAL * len(bodies),
    )
    return header + text, n_rows


def mode_source(equations: Equations, mode: Motion, *, clock: str = "1.0") -> tuple[list[str], int]:
    """Source lines that fill the series of one mode, and the number of its rows.

    Where ``clock`` is the name of the rate of time, the first coefficients of the
    states are kept as they are while it is 0.
    """
    m, q, p = (len(g) for g in (equations.states, equations.quantities, equations.interfaces))
    targets = [*mode.laws, *equations.interfaces, *mode.bounds]
    symbols = {s: i for i, s in enumerate(equations.states)}
    outputs = dict(enumerate(targets, start=m))
    reserved: dict[sp.Expr, int] = {}
    for row, expression in outputs.items():
        if expression not in symbols:
            reserved.setdefault(expression, row)
    free = m + q + p + equations.n_bounds
    work = Recurrences(equations.order, symbols, TIME, reserved, free, clock)
    for symbol, law in zip(equations.quantities, mode.laws, strict=True):
        work.name(symbol, work.row(law))
    rates = [work.row(rate) for rate in mode.rates]
    held = {row: work.row(expression) for row, expression in outputs.items()}
    copies = {row: source for row, source in held.items() if row != source}
    body = ["t = inputs[0]"]
    body += [f"{work.at(i, '0')} = inputs[{i + 1}]" for i in range(m)]
    body += [f"{name} = {code}" for code, name in work.scalars.items()]
    body += work.values()
    first = [f"{work.at(i, '1')} = {work.at(r, '0')}" for i, r in enumerate(rates)]
    body += first if clock == "1.0" else [f"if {clock} != 0.0:", *(f"    {s}" for s in first)]
    body += ["for k in range(1, n):", "    q = 1.0 / k"]
    body += ["    " + line for line in work.general()]
    body += ["    r = 1.0 / (k + 1)"]
    body += [f"    {work.at(i, 'k + 1')} = {work.at(r)} * r" for i, r in enumerate(rates)]
    last = work.general(tuple(held.values()))
    body += ["k = n", "q = 1.0 / k", *last] if last else []
    if copies:
        body += ["for k in range(n + 1):"]
        body += [f"    {work.at(row)} = {work.at(source)}" for row, source in copies.items()]
    return body, work.next


def _values_source(equations: Equations, mode: Motion) -> tuple[list[str], int]:
    """What a mode fills without recurrences: values, and rates of states and interfaces."""
    columns, m, q = equations.order + 1, len(equations.states), len(equations.quantities)
    names = [s.name for s in equations.states]
    laws = dict(zip((s.name for s in equations.quantities), mode.laws, strict=True))
    outputs = {i * columns + 1: rate for i, rate in enumerate(mode.rates)}
    for row, h in enumerate(equations.interfaces, start=m + q):
        outputs[row * columns] = h
        outputs[row * columns + 1] = drift(h, names, mode.rates, laws)
    n_rows = m + q + len(equations.interfaces)
    outputs |= {(n_rows + k) * columns: drift for k, drift in enumerate(mode.bounds)}
    shared, results = sp.cse(
        list(outputs.values()), symbols=sp.numbered_symbols("s", real=True), list=True
    )
    body = ["t = inputs[0]"]
    for i in range(m):
        body += [f"y{i} = inputs[{i + 1}]", f"W[{i * columns}] = y{i}"]
    for k, law in enumerate(mode.laws):
        body += [f"w{k} = {scalar_code(law)}", f"W[{(m + k) * columns}] = w{k}"]
    body += [f"{symbol} = {scalar_code(value)}" for symbol, value in shared]
    body += [
        f"W[{place}] = {scalar_code(value)}" for place, value in zip(outputs, results, strict=True)
    ]
    # what no recurrence gives
    return [*body, f"W[{equations.order}] = math.nan"], n_rows + equations.n_bounds


def _gradient_source(equations: Equations, function: sp.Expr) -> list[str]:
    m = len(equations.states)
    symbols = (TIME, *equations.states, *equations.quantities)
    body = [f"{s.name} = inputs[{i}]" for i, s in enumerate(symbols) if s in function.free_symbols]
    terms = [scalar_code(term) for term in sp.Add.make_args(function)]
    body.append("W[0] = " + " + ".join(f"({term})" for term in terms))
    body.append("W[1] = " + " + ".join(f"abs({term})" for term in terms))
    slopes = [scalar_code(function.diff(s)) for s in equations.states]
    return body + [f"W[{2 + i}] = {slopes[i]}" for i in range(m)]
