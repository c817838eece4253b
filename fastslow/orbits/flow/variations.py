"""Compiled rates of every smooth motion with their derivatives by states, time and parameters.

The derivatives are compiled twice: as Taylor series along the motion, from which the flow
computes its own derivatives, and as values at a point, for the conditions at interfaces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.errors import ModelError, unknown_name
from fastslow.kernels.compiler.machine_code import Address
from fastslow.kernels.compiler.model_code import load_function
from fastslow.kernels.field_code import CompiledField, parameter_array
from fastslow.kernels.fields import field_address
from fastslow.kernels.taylor.many_motions import ManyMotions, shared, source_of
from fastslow.kernels.taylor.recurrences import FUNCTIONS
from fastslow.kernels.taylor.saturation import saturation_arrays
from fastslow.kernels.taylor.series import motion_source
from fastslow.model.derived import cached_by_partition
from fastslow.model.events import refuse_delays
from fastslow.model.known_functions import without_recurrence
from fastslow.model.model import Model
from fastslow.model.motion import Motion, drift
from fastslow.model.recurrences import ListedOperations
from fastslow.model.structure import TIME, real
from fastslow.orbits.flow.jumps import Instants, Jumps, constants_at, instants_between
from fastslow.results.stored.operations import Operations, SeriesOperations
from fastslow.results.trajectory.trajectory import Trajectory

#: Rates of a motion, and its switching functions: those of the interfaces, the walls, the
#: instants, the switches and the conditions of events, then the bounds of sliding or of rest.
Rows = tuple[tuple[sp.Expr, ...], tuple[sp.Expr, ...]]

#: A rate, and its derivatives by the unknowns on which it depends, in the names of series.
RateWithSlopes = tuple[sp.Expr, dict[int, sp.Expr]]

#: Highest Taylor coefficient: for errors of rounding the cheapest order is about -ln(tol)/2 = 18
#: (Jorba and Zou 2005) with a singularity, higher for entire functions, as in linear regions.
ORDER = 24


@dataclass(frozen=True, eq=False)
class Variations:
    """Compiled derivatives of a model's motions by the unknowns u = (states, time, parameters).

    Parameters
    ----------
    states : tuple of str
        States, slow states, and parameters that events assign.
    parameters : tuple of str
        Order of the parameter array.
    chosen : tuple of str
        Parameters by which derivatives are compiled.
    modes : tuple of str
        Names of the motions: regions, then sliding motions, then motions at rest on walls.
    signs : ndarray of int64, shape (n_modes, n_switching)
        Side of each interface, wall, instant and function of a switch or of a condition in every
        mode, 0 for interfaces on which it slides and walls on which it rests.
    continuous : ndarray of bool, shape (n_switching,)
        Whether the rates are continuous across each of them.
    interfaces, walls : int
        Numbers of interfaces and of walls.
    order : int
        Highest Taylor coefficient.
    series : int
        Address of the function that fills the series of the states, then those of the
        derivatives that vary.
    n_rows : int
        Number of rows of the series.
    saturating, saturations : ndarray
        See `fastslow.kernels.taylor.saturation.saturation_arrays`.
    starts : ndarray of int64, shape (n_modes + 1,)
        First entry of every mode.
    entries : ndarray of int64, shape (n_entries, 4)
        Derivatives that are not identically zero: number of the rate, number of the unknown,
        row of the series, and whether the entry is constant along the motion.
    field : CompiledField
        Rates, switching functions, and bounds of sliding and rest, with their derivatives by u.
    resets : CompiledField
        The states after every jump, with their derivatives by u.
    jumps : Jumps
        Resets, motions at rest, and instants.
    codes : tuple of (str, str)
        Period and phase of every clock, as arithmetic of the parameter array.
    rows : tuple of Rows
        The equations of every motion.
    """

    states: tuple[str, ...]
    parameters: tuple[str, ...]
    chosen: tuple[str, ...]
    modes: tuple[str, ...]
    signs: NDArray[np.int64]
    continuous: NDArray[np.bool_]
    interfaces: int
    walls: int
    order: int
    series: int
    n_rows: int
    saturating: NDArray[np.int64]
    saturations: NDArray[np.float64]
    starts: NDArray[np.int64]
    entries: NDArray[np.int64]
    field: CompiledField
    resets: CompiledField
    jumps: Jumps
    codes: tuple[tuple[str, str], ...]
    rows: tuple[Rows, ...]

    @cached_property
    def drifts(self) -> CompiledField:
        """Rates, and the rates of change of the switching functions along each motion."""
        rows = [
            (rates, tuple(drift(h, self.states, rates) for h in functions))
            for rates, functions in self.rows
        ]
        return _field(rows, self.states, self.names, self.chosen)

    def compile_function(self, expression: sp.Expr) -> CompiledField:
        """Compile an expression in the parameters as a function of all unknowns."""
        return _field([((), (expression,))], self.states, self.names, self.chosen)

    @property
    def instants(self) -> Instants:
        """Clocks and tables."""
        return self.jumps.instants

    @property
    def constants(self) -> int:
        """Number of values that are constant between events, the last of the parameters.

        Those of clocks and tables, then the switches.
        """
        return len(self.instants.symbols) + len(self.jumps.switches)

    @property
    def names(self) -> tuple[str, ...]:
        """Order of the parameter array, with the values that are constant between events."""
        constants = (s.name for s in self.instants.symbols)
        return (*self.parameters, *constants, *self.model.switches)

    @cached_property
    def deficiency(self) -> NDArray[np.int64]:
        """Of every mode the number of directions that are lost: one by sliding, two by rest."""
        zero = self.signs == 0
        at_walls = zero[:, self.interfaces : self.interfaces + self.walls].sum(axis=1)
        return np.asarray(zero.sum(axis=1) + at_walls)

    def held_along(self, modes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Interfaces along which a motion in these modes slides all the time."""
        slides = (self.signs[modes, : self.interfaces] == 0).all(axis=0)
        return np.flatnonzero(slides).astype(np.int64)

    @property
    def model(self) -> Model:
        return self.jumps.model

    @property
    def function_names(self) -> tuple[str, ...]:
        """Names of the switching functions, in the order of ``signs``."""
        walls = (wall.name for wall in self.jumps.walls)
        instants = ["instant"] * self.instants.count
        switches = (f"threshold of {name}" for name in self.model.switches)
        triggers = (f"{function} = 0" for function in self.jumps.triggers)
        return (*self.model.interfaces, *walls, *instants, *switches, *triggers)

    @property
    def first_instant(self) -> int:
        """Number of the first switching function of an instant."""
        return self.interfaces + self.walls

    @property
    def first_switch(self) -> int:
        """Number of the first switching function of a switch."""
        return self.first_instant + self.instants.count

    @property
    def first_trigger(self) -> int:
        """Number of the first switching function of the condition of an event."""
        return self.first_switch + len(self.jumps.switches)

    @cached_property
    def jumping(self) -> NDArray[np.bool_]:
        """Whether the saltation matrix differs from the reset's, for all switching functions."""
        found = ~self.continuous
        found[self.first_instant : self.first_switch] = False
        return found

    def constants_at(
        self,
        times: NDArray[np.float64],
        parameters: NDArray[np.float64],
        switches: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Values of clocks and tables in the intervals that contain times, and of switches.

        Parameters
        ----------
        times : ndarray, shape (m,)
        parameters : ndarray
        switches : ndarray, shape (n_switches,) or (m, n_switches), optional
            Needed for a model with switches, see `switches_at`.

        Returns
        -------
        ndarray, shape (m, constants)
        """
        found = constants_at(self.instants, self.codes, times, parameters)
        count = len(self.jumps.switches)
        if not count:
            return found
        assert switches is not None
        return np.hstack([found, np.broadcast_to(switches, (len(times), count))])

    def switches_at(self, run: Trajectory, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of the switches of a run at times between events, shape (m, n_switches)."""
        rows = np.clip(np.searchsorted(run.step_starts, times, side="right") - 1, 0, None)
        assert run.series is not None
        first = self.n + len(self.model.forcing)
        return np.asarray(run.series[rows, first : first + len(self.jumps.switches), 0])

    def instants_between(
        self, since: float, until: float, parameters: NDArray[np.float64]
    ) -> list[tuple[float, int]]:
        """Times of all instants inside an interval, with their switching functions; in order."""
        found = instants_between(self.instants, self.codes, since, until, parameters)
        return [(time, self.first_instant + number) for time, number in found]

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.states)

    @property
    def n_unknowns(self) -> int:
        """Number of states, time and chosen parameters."""
        return self.n + 1 + len(self.chosen)

    @cached_property
    def places(self) -> list[int]:
        """Indices of the chosen parameters in the parameter array."""
        return [self.parameters.index(name) for name in self.chosen]

    def parameter_array(self, model: Model) -> NDArray[np.float64]:
        """Parameter values of a model in the order of `names`, never empty.

        Those of clocks and tables are zero.
        """
        values = np.append(parameter_array(model, self.parameters), np.zeros(self.constants))
        return values if len(values) else np.zeros(1)


@cached_by_partition
def variations_of(model: Model, chosen: tuple[str, ...] = (), order: int = ORDER) -> Variations:
    """Compile the derivatives of a model's motions by states, time and some parameters.

    The slow quantities are replaced by their laws, so that a derivative by time or by a parameter
    contains that of the forcing.

    Parameters
    ----------
    model : Model
    chosen : tuple of str, optional
        Parameters for derivatives.
    order : int
        Highest Taylor coefficient.

    Raises
    ------
    ModelError
        For functions without a Taylor recurrence.
    UnknownNameError
        For an unknown parameter.

    Examples
    --------
    >>> x, v, w, t = sp.symbols("x v w t")
    >>> duffing = Model({x: v, v: -x**3 + sp.cos(w*t)}, parameters={w: 2})
    >>> variations = variations_of(duffing, ("w",))
    >>> variations.states, variations.chosen, variations.modes
    (('x', 'v'), ('w',), ('S1',))
    >>> variations.entries[:, :2].tolist()
    [[0, 1], [1, 0], [1, 2], [1, 3]]
    """
    refuse_delays(model.events, "the derivative of the flow (periodic orbits, exponents)")
    names = tuple(sorted({*model.parameters, *model.free} - {*model.assigned}))
    for name in chosen:
        if name in model.assigned:
            raise ModelError(
                f"{name} is assigned by an event and so a state of the motion, with no derivative "
                "by its value at the start of a run; expected a parameter that no event assigns"
            )
        if name not in names:
            raise unknown_name("parameter", name, names)
    jumps = Jumps(model)
    states, modes, instants = jumps.states, jumps.modes, jumps.instants
    rows = tuple(_explicit(motion, jumps) for motion in modes)
    _require_recurrences(rows, states)
    every = (*names, *(s.name for s in instants.symbols), *model.switches)
    field = _field(rows, states, every, chosen)
    resets = CompiledField(Address(0), every, len(states), 0)
    if jumps.rows:
        resets = _field([(row, ()) for row in jumps.rows], states, every, chosen)
    renaming = {real(n): real(f"y{k}") for k, n in enumerate(states)}
    renaming |= {real(n): real(f"p{k}") for k, n in enumerate(every)}
    walls, continuous = len(jumps.walls), [*model.continuous.values()]
    unknowns = (*map(real, states), TIME, *map(real, chosen))
    tapes, starts, entries = [], [0], []
    known: dict[sp.Expr, RateWithSlopes] = {}
    for motion, (rates, _) in zip(modes, rows, strict=True):
        known |= {r: _with_slopes(r, unknowns, renaming) for r in rates if r not in known}
        tape, found = _tape(motion, [known[r] for r in rates], len(states))
        tapes.append(tape)
        entries += found
        starts.append(len(entries))
    operations = Operations((len(states), 0, 0), every, tuple(tapes), (), ())
    many = shared(operations)
    source, n_rows = _source(operations, many, order)
    saturating, limits = saturation_arrays(operations, many.rows if many is not None else ())
    return Variations(
        states=states,
        parameters=names,
        chosen=chosen,
        modes=tuple(motion.name for motion in modes),
        signs=jumps.signs,
        continuous=np.array(
            [*continuous, *[False] * (jumps.signs.shape[1] - len(continuous))], dtype=bool
        ),
        interfaces=len(continuous),
        walls=walls,
        order=order,
        series=load_function(source, "variations"),
        n_rows=n_rows,
        saturating=saturating,
        saturations=limits,
        starts=np.array(starts, dtype=np.int64),
        entries=np.array(entries, dtype=np.int64).reshape(-1, 4),
        field=field,
        resets=resets,
        jumps=jumps,
        codes=instants.codes(names),
        rows=rows,
    )


def _explicit(motion: Motion, jumps: Jumps) -> Rows:
    """Rates and switching functions of a motion as functions of states and time."""
    laws, instants = jumps.laws_of(motion), jumps.instants
    heights = [i.function for i in jumps.model.interfaces.values()]
    heights += [wall.function for wall in jumps.walls]

    def explicit(expressions: Sequence[sp.Expr]) -> tuple[sp.Expr, ...]:
        return tuple(instants.replaced(e, laws) for e in expressions)

    constant = [sp.S.Zero] * len(jumps.model.assigned)
    return (*explicit(motion.rates), *constant), (
        *explicit(heights),
        *instants.heights,
        *explicit(jumps.watched),
        *explicit(jumps.triggers),
        *explicit(motion.bounds),
    )


def _require_recurrences(rows: Sequence[Rows], states: Sequence[str]) -> None:
    moving = {*map(real, states), TIME}
    every = dict.fromkeys(e for rates, _ in rows for e in rates)
    missing = set().union(*(without_recurrence(e, moving) for e in every))
    if missing:
        names = " and ".join(sorted(missing))
        raise ModelError(
            f"derivatives of the flow need Taylor recurrences, and there is none for {names}; "
            "write the model without it, or use simulate(), which falls back on collocation"
        )


def _field(
    rows: Sequence[Rows], states: Sequence[str], names: Sequence[str], chosen: Sequence[str]
) -> CompiledField:
    """Values and derivatives at a point, with the functions of all motions padded by zeros."""
    m = max(len(functions) for _, functions in rows)
    padded = tuple((*rates, *f, *[sp.Integer(0)] * (m - len(f))) for rates, f in rows)
    unknowns = (*map(real, states), TIME, *map(real, chosen))
    rename = {s: sp.Symbol(f"u{k}") for k, s in enumerate(unknowns)}
    rename |= {real(n): sp.Symbol(f"p{k}") for k, n in enumerate(names) if n not in chosen}
    n = len(rows[0][0])
    address = field_address(padded, n, tuple(rename.items()), len(unknowns), len(names))
    return CompiledField(address, tuple(names), n, m, len(unknowns) - n)


def _with_slopes(
    rate: sp.Expr, unknowns: Sequence[sp.Symbol], renaming: dict[sp.Symbol, sp.Symbol]
) -> RateWithSlopes:
    """A rate, and its derivatives that are not identically zero by their unknowns."""
    inside = rate.free_symbols
    slopes = {
        c: slope.xreplace(renaming)
        for c, u in enumerate(unknowns)
        if u in inside and (slope := rate.diff(u)) != 0
    }
    return rate.xreplace(renaming), slopes


def _tape(
    motion: Motion, rates: Sequence[RateWithSlopes], n: int
) -> tuple[SeriesOperations, list[tuple[int, int, int, int]]]:
    """Operations on series of one motion, and the entries of its derivatives."""
    slopes = {(i, c): e for i, (_, own) in enumerate(rates) for c, e in own.items()}
    symbols = {real(f"y{k}"): k for k in range(n)}
    place = {e: row for row, e in enumerate(dict.fromkeys(slopes.values()), start=n)}
    reserved = {e: row for e, row in place.items() if e not in symbols}
    work = ListedOperations(symbols, TIME, reserved, n + max(2, len(place)))
    held = tuple(work.row(rate) for rate, _ in rates)
    outputs = tuple(work.row(e) for e in place)
    tape = SeriesOperations(
        motion.name, motion.signs, tuple(work.scalars), tuple(work.nodes), held, outputs
    )
    entries = [(i, c, place[e], int(work.is_scalar(e))) for (i, c), e in slopes.items()]
    return tape, entries


def _source(operations: Operations, many: ManyMotions | None, order: int) -> tuple[str, int]:
    """Source of the generated function, and its number of rows."""
    lines = [
        f'"""Taylor coefficients of order {order} with derivatives of the rates."""\n\n',
        f"{FUNCTIONS}\n\n",
        "def variations(mode, inputs, parameters, W):",
        f"    n = {order}",
        *(f"    p{i} = parameters[{i}]" for i in range(len(operations.parameters))),
    ]
    if many is not None:
        tables, body, n_rows = source_of(operations, many, order)
        lines = [*tables, *lines, "    clock = 1.0", *(f"    {line}" for line in body)]
        return "\n".join(lines) + "\n", n_rows
    n_rows = 0
    for number, motion in enumerate(operations.motions):
        assert isinstance(motion, SeriesOperations)
        body, rows = motion_source(operations, motion, order, called=True)
        n_rows = max(n_rows, rows)
        lines.append(f"    {'if' if number == 0 else 'elif'} mode == {number}:")
        lines += [f"        {line}" for line in body]
    return "\n".join(lines) + "\n", n_rows
