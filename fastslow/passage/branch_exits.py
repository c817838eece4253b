"""Delayed loss of stability in a slow passage through a branch point."""

from __future__ import annotations

import math

import numpy as np

from fastslow.errors import ArgumentError
from fastslow.model.invariance import factor_states
from fastslow.model.model import Model
from fastslow.passage.hopf_delays import MEMORY, Sheet, places, require_entry
from fastslow.passage.sites import Site, WrongWay, drift, require_code, site_of
from fastslow.results.delays import BranchPointExit
from fastslow.results.diagrams import Diagram
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
    name = diagram.parameter
    here, way = point[name], 1 if speed > 0 else -1
    site = site_of(point, name, model)
    sheets = []
    for branch, row in places(diagram, point):
        values = branch.eigenvalues[row]
        critical = complex(values[np.argmin(np.abs(values))])
        before, behind = (Sheet(diagram, branch, row, w, critical) for w in (-way, way))
        if len(before.rows) > 1 and before.first_growth() <= 0:
            sheets.append((before, behind))
    if not sheets:
        raise WrongWay(
            f"rate = {speed:g}: no sheet before {point.label} is stable in this direction; "
            f"expected rate {'<' if speed > 0 else '>'} 0"
        )
    invariant = [(*pair, kept) for pair in sheets if (kept := _invariance(site, pair[0]))]
    if not invariant:
        raise ArgumentError(
            f"the sheet before {point.label} is not invariant while {name} drifts: its states "
            "move along it, and no state that leaves it has a rate of which it is a factor. The "
            "drift itself pushes the trajectory off it; no integral from entry to exit holds"
        )
    before, behind, (reason, memory) = invariant[0]
    require_entry(before, point, entry)
    decay = -before.integral(entry) / abs(speed)
    exit_at = behind.where(abs(speed) * (decay + math.log(gain)))
    words = f"the exit at the distance of the entry; {reason}"
    if math.isnan(exit_at):
        words = "none: the branch ends or turns before growth has made up for the decay"
    elif decay > memory:
        floor = "the smallest number, 1e-300," if memory == UNDERFLOW else "rounding"
        words = (
            f"{floor} decides: the distance falls by exp(−{decay:.0f}), below it and below noise, "
            "and the exit comes at another place than this"
        )
    elif diagram.corrector is None:
        words += "; eigenvalues interpolated, as the diagram was read from a file"
    return BranchPointExit(
        point=point,
        parameter=name,
        rate=speed,
        delay=abs(exit_at - here),
        validity=words,
        entry=float(entry),
        decay=decay,
        gain=float(gain),
        forgotten=decay > memory,
    )


def _invariance(site: Site, before: Sheet) -> tuple[str, float] | None:
    """Why a sheet is invariant while the parameter drifts, and which decay is remembered.

    None where it is not.
    """
    states = before.branch.state[before.rows]
    every = np.concatenate([branch.state for branch in before.diagram.branches])
    size = np.abs(every).max(axis=0)
    names = site.point.states
    jacobian, _ = site.slopes(site.region(str(before.branch.region[before.rows[1]])))
    small = ZERO * np.abs(np.linalg.eigvals(jacobian)).max()
    for name in factor_states(site.field.model):
        k = names.index(name)
        if np.abs(states[:, k]).max() <= CONSTANT * size[k] and abs(jacobian[k, k]) <= small:
            return f"{name} = 0 stays, as the rate of {name} has it as a factor", UNDERFLOW
    if (np.ptp(states, axis=0) <= CONSTANT * size).all():
        return f"the sheet does not move with {before.diagram.parameter}", MEMORY
    return None
