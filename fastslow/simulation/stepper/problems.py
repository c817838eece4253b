"""Arguments of the compiled loops: a problem, a run of it, and the record of the run."""

from __future__ import annotations

from typing import NamedTuple

from fastslow.kernels.compiler.records import Flags, IntegerMatrix, Integers, Matrix, Vector


class Problem(NamedTuple):
    """A compiled model with its error control.

    Parameters
    ----------
    series, collocation, radau : int
        Addresses of the compiled series, of collocation and of Radau steps, 0 if not loaded.
    n_states, n_forcing, n_interfaces, n_modes, order : int
        Of a model whose motions are formed during a run, the largest number of modes.
    first_wall, first_switch, first_trigger : int
        Numbers of interfaces before the walls, before the functions of switches, and before those
        of the inequalities in the conditions of events.
    n_resets, n_rests : int
        Numbers of resets, which are the first of the jumps, and of the jumps that follow, by which
        the last modes begin, those at rest on walls; of a model whose motions are formed during a
        run one for each wall.
    switch_place : int
        Place of the first switch among the parameters.
    n_fast : int
        Number of leading (fast) states for which implicit steps are tried, 0 for none.
    max_steps, max_crossings : int
    forming : int
        Whether the motions are formed during a run: ``signs`` are those of the ones so far.
    tol : float
    signs : int64 array, shape (n_modes, n_interfaces)
    saturating : int64 array, shape (n_modes, k)
    saturations : float64 array, shape (n_modes, 4 k)
        Arguments of functions that saturate, see `saturation_arrays`.
    continuous : bool array, shape (n_interfaces,)
        Whether the rates are continuous across each interface.
    of_time, of_laws : bool array, shape (n_interfaces,)
        Whether each is a function of time alone, and whether it depends on slow quantities that
        are not the same functions of time in all regions.
    rests : bool array, shape (n_interfaces,)
        Whether each is a wall on which a motion may rest.
    rules : float64 array, shape (2, n_states + n_forcing + n_interfaces)
        Error scale rules, from `rules_of`.
    instants : int64 array, shape (n_tables + n_clocks, 5)
    knots : float64 array, shape (n_pieces, 1 + n_terms)
        Tables of slow quantities and clocks, from `instants_of`.
    events : int64 array, shape (n_events, 4 + width)
        From `events_of`.
    effects : int64 array, shape (n_events, n_states + n_triggers)
        Whether each event assigns a state, and whether an inequality depends on what it assigns.
    closed : bool array, shape (n_triggers,)
        Whether each inequality includes equality.
    """

    series: int
    collocation: int
    radau: int
    n_states: int
    n_forcing: int
    n_interfaces: int
    n_modes: int
    order: int
    first_wall: int
    first_switch: int
    first_trigger: int
    n_resets: int
    n_rests: int
    switch_place: int
    n_fast: int
    max_steps: int
    max_crossings: int
    forming: int
    tol: float
    signs: IntegerMatrix
    saturating: IntegerMatrix
    saturations: Matrix
    continuous: Flags
    of_time: Flags
    of_laws: Flags
    rests: Flags
    rules: Matrix
    instants: IntegerMatrix
    knots: Matrix
    events: IntegerMatrix
    effects: IntegerMatrix
    closed: Flags


class Run(NamedTuple):
    """One run of a problem at an instant.

    Parameters
    ----------
    begin, stop : float
        Of time.
    since : float
        Time from which extremes and hits count.
    parameters : float64 array
        With the current pieces of tables, and the states of clocks and switches, which are
        updated in place.
    inputs : float64 array, shape (1 + n_states + n_forcing,)
        Time, states and slow quantities, updated in place.
    carried : float64 array, shape (SIZES + 2 n_states + n_forcing + n_interfaces + 2 + events,)
    counted : int64 array, shape (INTEGERS,)
        State carried from step to step, initially from `beginnings`. The caller sets the
        work until the next pause, in series steps.
    """

    begin: float
    stop: float
    since: float
    parameters: Vector
    inputs: Vector
    carried: Vector
    counted: Integers


class Record(NamedTuple):
    """Output of a run.

    Steps and crossings are listed or, with extremes given, accumulated.

    Parameters
    ----------
    times : float64 array
        Increasing times of the samples, within the span.
    samples : float64 array, shape (n_rows, n_times)
        The first rows at those times, up to the time reached.
    steps : float64 array, shape (space, 4)
        Begin, length, mode and kind of every step.
    crossings : float64 array, shape (space, 6 + n_states)
        Time, interface, direction, mode before, mode after, near-tangential and state of
        every crossing.
    resets : float64 array, shape (space, 2 + 2 n_states)
        Time, reset, and states before and after. Events follow the resets in number, and the
        number n + 2 k + v beyond all n of these is the change of switch k to v.
    store : float64 array
        Coefficients of states and slow quantities, step by step; empty if they are not stored.
    extremes : float64 array, shape (2, n_states)
        Smallest and largest value of every state; no rows if steps and crossings are listed.
    hits : int64 array, shape (n_interfaces + n_kicks + n_events, 2)
        Crossings upwards and downwards; resets are counted in the first column, those at
        instants of time after all interfaces, and events last.
    seen : float64 array, shape (n_modes,)
        Time at which each mode was last left.
    """

    times: Vector
    samples: Matrix
    steps: Matrix
    crossings: Matrix
    resets: Matrix
    store: Vector
    extremes: Matrix
    hits: IntegerMatrix
    seen: Vector
