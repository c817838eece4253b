"""Instants known in advance, at which a step ends exactly: the knots of tables."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.decorators import kernel
from fastslow.results.stored.operations import PiecewisePolynomial
from fastslow.simulation.stepper.polynomials import ZERO

#: Columns of `Problem.instants`, one row for each table: the first of its parameters (index
#: of the piece, its knot, its coefficients), their number without the index, and the rows of
#: `Problem.knots` of its first and its last piece.
PLACE, LENGTH, FIRST, LAST = range(4)


def instants_of(
    tables: tuple[PiecewisePolynomial, ...], n_parameters: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the rows of `Problem.instants` and of `Problem.knots` for some tables.

    Parameters
    ----------
    tables : tuple of PiecewisePolynomial
    n_parameters : int
        Number of parameters before those of the tables.
    """
    width = max((table.n_terms for table in tables), default=0)
    instants = np.zeros((len(tables), 4), dtype=np.int64)
    knots = np.zeros((sum(len(table.coefficients) for table in tables), 1 + width))
    place, row = n_parameters, 0
    for k, table in enumerate(tables):
        last = row + len(table.coefficients)
        instants[k] = place, 1 + table.n_terms, row, last - 1
        knots[row:last, 0] = table.knots[:-1]
        knots[row:last, 1 : 1 + table.n_terms] = table.coefficients
        place, row = place + 2 + table.n_terms, last
    return instants, knots


def fill_pieces(
    tables: tuple[PiecewisePolynomial, ...],
    n_parameters: int,
    values: NDArray[np.float64],
    times: NDArray[np.float64],
) -> None:
    """Fill the parameters of the pieces in which several runs begin.

    Parameters
    ----------
    tables : tuple of PiecewisePolynomial
    n_parameters : int
        Number of parameters before those of the tables.
    values : ndarray, shape (m, n_values)
        Filled in.
    times : ndarray, shape (m,)
    """
    place = n_parameters
    for table in tables:
        rows, last = table.pieces(times), place + 2 + table.n_terms
        values[:, place], values[:, place + 1] = rows, table.knots[rows]
        values[:, place + 2 : last] = table.coefficients[rows]
        place = last


@kernel
def next_instant(problem, parameters):
    """Time of the next instant, infinite after the last."""
    instants, knots = problem.instants, problem.knots
    soonest = np.inf
    for k in range(instants.shape[0]):
        row = instants[k, FIRST] + np.int64(parameters[instants[k, PLACE]]) + 1
        if row <= instants[k, LAST]:
            soonest = min(soonest, knots[row, 0])
    return soonest


@kernel
def pass_instant(problem, parameters, t):
    """Move every table with a knot at this time to its next piece."""
    instants, knots = problem.instants, problem.knots
    for k in range(instants.shape[0]):
        place = instants[k, PLACE]
        row = instants[k, FIRST] + np.int64(parameters[place]) + 1
        if row <= instants[k, LAST] and knots[row, 0] <= t:
            parameters[place] += 1.0
            for j in range(ZERO, instants[k, LENGTH]):
                parameters[place + 1 + j] = knots[row, j]
