"""Tables and clocks as arrays of the stepping loop, and their parameters at the start of a run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.results.stored.operations import PiecewisePolynomial


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
    instants = np.zeros((len(tables), 5), dtype=np.int64)
    knots = np.zeros((sum(len(table.coefficients) for table in tables), 1 + width))
    place, row = n_parameters, 0
    for k, table in enumerate(tables):
        last = row + len(table.coefficients)
        instants[k] = place, 1 + table.n_terms, row, last - 1, -1
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
