"""Delayed loss of stability in a slow passage through a branch point."""

from __future__ import annotations

import math

import numpy as np

from fastslow.errors import ArgumentError
from fastslow.model.invariance import invariant_states, jointly_invariant_states
from fastslow.model.model import Model
from fastslow.passage.delays.critical_modes import CriticalMode, critical_mode
from fastslow.passage.delays.entry_exits import MEMORY, entry_exit, places
from fastslow.passage.delays.exchanges import passage_in_words
from fastslow.passage.delays.growth_rates import Sheet
from fastslow.passage.delays.local_field import Site, WrongWay, drift, require_code, site_of
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delays import BranchPointExit
from fastslow.results.points import SpecialPoint

#: Decay beyond which a state that its rate has as a factor falls below 1e-300.
UNDERFLOW = 690.0

#: States that differ by this part of their size along a branch do not move along it.
CONSTANT = 1e-9

#: An eigenvalue of this part of the largest is zero: located branch points have less.
ZERO = 1e-5


def branch_exit(
    diagram: Diagram,
    point: SpecialPoint,
    entry: float,
    rate: float,
    *,
    gain: float = 1.0,
    model: Model | None = None,
) -> BranchPointExit:
    """Where a trajectory leaves an invariant branch behind a branch point.

    The branch that is left must be invariant while the parameter drifts: the states
    that leave it have rates x g and are zero on it, or it does not move with the
    parameter. The distance from it then falls and grows as the exponential of the
    integral of its eigenvalue, and without noise the exit solves

        ∫ λ(p) dp = rate · ln gain    from the entry to the exit

    (De Maesschalck and Schecter 2016). Elsewhere the drift itself pushes
    the trajectory off the branch, and the passage is algebraic.

    Parameters and errors are those of `fastslow.predict_delay`.

    References
    ----------
    P. De Maesschalck and S. Schecter, J. Differential Equations 260, 6697-6715, 2016.
    """
    require_code(point, "BP", "the exit from an invariant branch")
    speed = drift(rate)
    way = 1 if speed > 0 else -1
    mode, reason, memory = invariant_mode(diagram, point, way, model=model, rate=speed)
    floor = "the smallest number, 1e-300," if memory == UNDERFLOW else "rounding"
    found = entry_exit(
        mode,
        entry=entry,
        rate=speed,
        gain=gain,
        memory=memory,
        remembered=f"the exit at the distance of the entry{reason}",
        lost=f"{floor} decides: the distance falls by exp(−{{decay}}), below it and below noise, "
        "and the exit comes at another place than this",
    )
    return BranchPointExit(**found)


def invariant_mode(
    diagram: Diagram,
    point: SpecialPoint,
    way: int,
    *,
    model: Model | None = None,
    alone: bool = True,
    rate: float = math.nan,
) -> tuple[CriticalMode, str, float]:
    """The mode in which an invariant branch loses stability at a branch point.

    Parameters
    ----------
    diagram : Diagram
    point : SpecialPoint
    way : int
        Of the drift, +1 where the parameter rises.
    model : Model, optional
    alone : bool
        Whether nothing else moves in the rates: a branch that does not move with this
        parameter may move with another quantity.
    rate : float
        Of the drift, for what is said where no branch is invariant.

    Returns
    -------
    mode : CriticalMode
    reason : str
        Why the branch is invariant.
    memory : float
        The decay that is remembered.

    Raises
    ------
    ArgumentError
        Where no stable branch ends there in this direction, or it is not invariant.
    """
    require_code(point, "BP", "the exit from an invariant branch")
    name = diagram.parameter
    site = site_of(point, name, model)
    modes = stable_modes(diagram, point, way, model=model)
    invariant = [(mode, *kept) for mode in modes if (kept := _invariance(site, mode.before, alone))]
    if not invariant:
        raise ArgumentError(
            f"the sheet before {point.label} is not invariant while {name} drifts: its states "
            "move along it, and no state that leaves it has a rate of which it is a factor. The "
            "drift itself pushes the trajectory off it: no integral from entry to exit holds, and "
            + passage_in_words(modes[0], site, rate)
        )
    return invariant[0]


def stable_modes(
    diagram: Diagram, point: SpecialPoint, way: int, *, model: Model | None = None
) -> list[CriticalMode]:
    """The critical mode of every branch through a branch point that is stable before it.

    Raises
    ------
    WrongWay
        If there is none.
    """
    modes = []
    for branch, row in places(diagram, point):
        values = branch.eigenvalues[row]
        critical = complex(values[np.argmin(np.abs(values))])
        mode = critical_mode(diagram, point, (branch, row), way, critical, model=model)
        if len(mode.before.rows) > 1 and mode.before.first_growth() <= 0:
            modes.append(mode)
    if not modes:
        raise WrongWay(
            f"rate {'>' if way > 0 else '<'} 0: no sheet before {point.label} is stable in this "
            f"direction; expected rate {'<' if way > 0 else '>'} 0"
        )
    return modes


def _invariance(site: Site, before: Sheet, alone: bool) -> tuple[str, float] | None:
    """Why a sheet is invariant while the parameter drifts, and which decay is remembered.

    None where it is not. States that stay zero by their own rates do so whatever else moves.
    """
    states = before.branch.state[before.rows]
    every = np.concatenate([branch.state for branch in before.diagram.branches])
    size = np.abs(every).max(axis=0)
    names = site.point.states
    jacobian, _ = site.slopes(site.region(str(before.branch.region[before.rows[1]])))
    small = ZERO * np.abs(np.linalg.eigvals(jacobian)).max()
    model = site.field.model
    zero = [n for k, n in enumerate(names) if np.abs(states[:, k]).max() <= CONSTANT * size[k]]
    for together in (*((n,) for n in invariant_states(model)), *jointly_invariant_states(model)):
        if not set(together) <= set(zero):
            continue
        k = [names.index(n) for n in together]
        if np.abs(np.linalg.eigvals(jacobian[np.ix_(k, k)])).min() <= small:
            reason = f"; {together[0]} = 0 stays, as the rate of {together[0]} has it as a factor"
            if len(together) > 1:
                reason = f"; {' = '.join(together)} = 0 stays, by the rates of these states"
            return reason, UNDERFLOW
    if alone and (np.ptp(states, axis=0) <= CONSTANT * size).all():
        return f"; the sheet does not move with {before.diagram.parameter}", MEMORY
    return None
