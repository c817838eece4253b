"""What the compiled loops are given: a problem, a run of it, and what is kept of the run."""

from __future__ import annotations

from typing import NamedTuple

from fastslow.kernels.records import Flags, IntegerMatrix, Integers, Matrix, Vector


class Problem(NamedTuple):
    """A compiled model, and the errors allowed in its runs.

    Parameters
    ----------
    series, collocation, radau : int
        Addresses of the compiled series, and of the steps by collocation and those of Radau,
        which are 0 where they are not there.
    n_states, n_forcing, n_interfaces, n_modes, order : int
    n_fast : int
        The first states, for which implicit steps are tried; 0 for none.
    max_steps, max_crossings : int
    tol : float
    signs : int64 array, shape (n_modes, n_interfaces)
    continuous : bool array, shape (n_interfaces,)
        Where the rates are.
    rules : float64 array, shape (2, n_states + n_forcing + n_interfaces)
        From `rules_of`: in what sizes errors are measured.
    """

    series: int
    collocation: int
    radau: int
    n_states: int
    n_forcing: int
    n_interfaces: int
    n_modes: int
    order: int
    n_fast: int
    max_steps: int
    max_crossings: int
    tol: float
    signs: IntegerMatrix
    continuous: Flags
    rules: Matrix


class Run(NamedTuple):
    """One run of a problem, at some time.

    Parameters
    ----------
    begin, stop : float
        Of time.
    since : float
        Time from which extremes and hits count.
    parameters : float64 array
    inputs : float64 array, shape (1 + n_states + n_forcing,)
        Time, states and slow quantities, changed as the run goes.
    carried : float64 array, shape (SIZES + n_states + n_forcing + n_interfaces,)
    counted : int64 array, shape (14,)
        What is carried from step to step, at first that of `beginnings`.
        The work up to the next pause is to be set, in steps of the series.
    """

    begin: float
    stop: float
    since: float
    parameters: Vector
    inputs: Vector
    carried: Vector
    counted: Integers


class Record(NamedTuple):
    """What is kept of a run, filled as it goes.

    Steps and crossings are listed, or, where there are extremes, they are summed up.

    Parameters
    ----------
    times : float64 array
        Increasing times of the samples, within the span.
    samples : float64 array, shape (n_rows, n_times)
        The first rows at those times, as far as they are reached.
    steps : float64 array, shape (space, 4)
        Begin, length, mode and kind of every step.
    crossings : float64 array, shape (space, 6 + n_states)
        Time, interface, direction, mode before, mode after, near-tangential and state of
        every crossing.
    store : float64 array
        The coefficients of states and slow quantities, step by step; empty where
        they are not to be kept.
    extremes : float64 array, shape (2, n_states)
        Smallest and largest value of every state; without rows
        where steps and crossings are listed.
    hits : int64 array, shape (n_interfaces, 2)
        Crossings upwards and downwards.
    seen : float64 array, shape (n_modes,)
        When each mode was last left.
    """

    times: Vector
    samples: Matrix
    steps: Matrix
    crossings: Matrix
    store: Vector
    extremes: Matrix
    hits: IntegerMatrix
    seen: Vector
