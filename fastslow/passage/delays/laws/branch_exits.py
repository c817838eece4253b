"""Delayed loss of stability in a slow passage through a branch point."""

from __future__ import annotations

import math

import numpy as np

from fastslow.errors import ArgumentError
from fastslow.model.invariance import invariant_states, jointly_invariant_states
from fastslow.model.model import Model
from fastslow.passage.delays.critical_modes import CriticalMode, critical_mode
from fastslow.passage.delays.delay_law import EntryExitLaw, InvariantMode
from fastslow.passage.delays.entry_exits import MEMORY_EXPONENT, UNDERFLOW, entry_exit, places
from fastslow.passage.delays.exchanges import passage_in_words
from fastslow.passage.delays.growth_rates import BranchSide
from fastslow.passage.delays.local_field import (
    LocalField,
    WrongWay,
    drift,
    local_field_at,
    require_law,
)
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delays import BranchPointExit, EntryExit
from fastslow.results.points import SpecialPoint

#: Relative variation along a branch below which a state is constant.
CONSTANT_ALONG = 1e-9

#: Bound of a zero eigenvalue relative to the largest; located branch points have less.
ZERO_EIGENVALUE = 1e-5


def branch_exit(
    diagram: Diagram,
    point: SpecialPoint,
    entry: float,
    rate: float,
    *,
    gain: float = 1.0,
    model: Model | None = None,
) -> BranchPointExit:
    """Exit point of a slow passage along an invariant branch past a branch point.

    The branch must be invariant under the drift: the states transverse to it have rates x g
    and are zero on it, or it does not depend on the parameter. The distance from it then
    varies as the exponential of the integral of its eigenvalue, and without noise the exit
    solves

        ∫ λ(p) dp = rate · ln gain    from the entry to the exit

    (De Maesschalck and Schecter 2016). Otherwise the drift itself drives the trajectory off
    the branch, and the passage is algebraic in the rate.

    Parameters and errors are those of `fastslow.predict_delay`.

    References
    ----------
    P. De Maesschalck and S. Schecter, J. Differential Equations 260, 6697-6715, 2016.
    """
    require_law(point, LAW.name, "the exit from an invariant branch")
    speed = drift(rate)
    way = 1 if speed > 0 else -1
    mode, reason, memory = invariant_mode(diagram, point, way, model=model, rate=speed)
    floor = "the smallest number, 1e-300" if memory == UNDERFLOW else "rounding"
    found = entry_exit(
        mode,
        entry=entry,
        rate=speed,
        gain=gain,
        memory=memory,
        remembered=f"exit at the distance of the entry{reason}",
        lost=f"limited by {floor}: the distance decreases by exp(−{{decay}}), below this limit and "
        "noise, which changes the exit",
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
) -> InvariantMode:
    """Critical mode of an invariant branch at a branch point.

    Parameters
    ----------
    diagram : Diagram
    point : SpecialPoint
    way : int
        Direction of the drift, +1 for an increasing parameter.
    model : Model, optional
    alone : bool
        Whether no other quantity varies in the rates, with which a branch that does not
        depend on this parameter may vary.
    rate : float
        Rate of the drift, for the message if no branch is invariant.

    Returns
    -------
    InvariantMode

    Raises
    ------
    ArgumentError
        If no stable branch ends at the point in this direction, or it is not invariant.
    """
    require_law(point, LAW.name, "the exit from an invariant branch")
    name = diagram.parameter
    local = local_field_at(point, name, model)
    modes = stable_modes(diagram, point, way, model=model)
    invariant = [
        InvariantMode(mode, *kept)
        for mode in modes
        if (kept := _invariance(local, mode.before, alone))
    ]
    if not invariant:
        raise ArgumentError(
            f"the branch before {point.label} is not invariant while {name} drifts: its states "
            "vary along it, and no transverse state is a factor of its own rate. The drift itself "
            "drives the trajectory off the branch; the entry-exit integral does not apply, and "
            + passage_in_words(modes[0], local, rate)
        )
    return invariant[0]


def stable_modes(
    diagram: Diagram, point: SpecialPoint, way: int, *, model: Model | None = None
) -> list[CriticalMode]:
    """Critical modes of the branches through a branch point that are stable before it.

    Raises
    ------
    WrongWay
        If there are none.
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
            f"rate {'>' if way > 0 else '<'} 0: no branch is stable before {point.label} in this "
            f"direction; expected rate {'<' if way > 0 else '>'} 0"
        )
    return modes


def _invariance(local: LocalField, before: BranchSide, alone: bool) -> tuple[str, float] | None:
    """Reason for the invariance of a branch under the drift, and largest decay exponent.

    None if it is not invariant. States that are zero by their own rates are so for any drift.
    """
    states = before.branch.state[before.rows]
    every = np.concatenate([branch.state for branch in before.diagram.branches])
    size = np.abs(every).max(axis=0)
    names = local.point.states
    jacobian, _ = local.slopes(local.region(str(before.branch.region[before.rows[1]])))
    small = ZERO_EIGENVALUE * np.abs(np.linalg.eigvals(jacobian)).max()
    model = local.field.model
    zero = [
        n for k, n in enumerate(names) if np.abs(states[:, k]).max() <= CONSTANT_ALONG * size[k]
    ]
    for together in (
        *((n,) for n in invariant_states(model.partition)),
        *jointly_invariant_states(model.partition),
    ):
        if not set(together) <= set(zero):
            continue
        k = [names.index(n) for n in together]
        if np.abs(np.linalg.eigvals(jacobian[np.ix_(k, k)])).min() <= small:
            reason = f"; {together[0]} = 0 is invariant, as {together[0]} is a factor of its rate"
            if len(together) > 1:
                reason = f"; {' = '.join(together)} = 0 is invariant, by the rates of these states"
            return reason, UNDERFLOW
    if alone and (np.ptp(states, axis=0) <= CONSTANT_ALONG * size).all():
        return f"; the branch does not depend on {before.diagram.parameter}", MEMORY_EXPONENT
    return None


class BranchPointLaw(EntryExitLaw):
    """The exit from an invariant branch past a branch point."""

    name = "branch point"
    result = BranchPointExit

    def exit_of(
        self,
        diagram: Diagram,
        point: SpecialPoint,
        entry: float,
        rate: float,
        *,
        gain: float,
        model: Model | None,
    ) -> EntryExit:
        return branch_exit(diagram, point, entry, rate, gain=gain, model=model)

    def mode(
        self, diagram: Diagram, point: SpecialPoint, way: int, *, alone: bool
    ) -> InvariantMode:
        return invariant_mode(diagram, point, way, alone=alone)


LAW = BranchPointLaw()
