"""Settings of adaptive maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastslow.arguments import instance, positive, refusal, settings, whole
from fastslow.results.base.display import Displayed


def _two_counts(name: str, value: Any) -> tuple[int, int]:
    """Validate two positive integers."""
    if not isinstance(value, Sequence | np.ndarray) or len(value) != 2:
        raise refusal(name, value, "two integers")
    first, second = (whole(1, 2**30)(name, count) for count in value)
    return first, second


@settings(cells=_two_counts, levels=whole(0, 60), guard=whole(0, 10**6), resolution=positive)
@dataclass(frozen=True, kw_only=True)
class Refinement(Displayed):
    """How a map over two parameters is refined at the boundaries of its outcomes.

    Parameters
    ----------
    cells : (int, int)
        Number of cells of the first level along each axis.
    levels : int
        Largest number of times a cell is halved.
    guard : int
        Number of rings of neighbours that are halved with a cell; with 0 only cells
        whose corners differ are halved, and the thin tip of a tongue may be missed.
    resolution : float, optional
        Locate each point of a boundary by bisection along the side of its cell to
        this fraction of the axis.

    Raises
    ------
    ArgumentError
        For an invalid number of cells, levels or rings, or a resolution that is not positive.

    Examples
    --------
    >>> Refinement(cells=(4, 0))
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: cells = 0; expected an integer from 1
    """

    cells: tuple[int, int] = (8, 8)
    levels: int = 6
    guard: int = 1
    resolution: float | None = None


#: What is used where nothing is given.
REFINEMENT = Refinement()

#: The check of ``refinement=``.
refinement_settings = instance(Refinement)
