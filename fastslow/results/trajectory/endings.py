"""Outcomes of a simulation, from the codes of the stepping loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome

#: Growth relative to the initial state from which a run that fails is a blow-up.
_BLOW_UP = 1e6


def outcome_of(
    code: int,
    mode: int,
    end: NDArray[np.float64],
    n_steps: int,
    begin: NDArray[np.float64],
    modes: tuple[str, ...],
    limits: tuple[int, int],
    undecided: tuple[tuple[str, str], ...] = (),
    wall: str = "",
    *,
    backwards: bool = False,
) -> Outcome:
    """Return the outcome of a run from the code of `fastslow.simulation.stepper.driver`.

    ``begin`` is the initial state, ``end`` the final time and state; ``undecided`` lists
    intersections of interfaces without a sliding motion, with the reason; ``wall`` is the
    relation of the reset beyond whose wall the run ended, or which failed; ``backwards`` is True
    for a run backwards in time.
    """
    time = f"t = {end[0]:.10g}"
    if code == 0:
        return Outcome("end of time", f"reached {time}, the end of the time span.", True)
    if code == 2:
        return Outcome(
            "too many crossings",
            f"stopped at {time} after {limits[1]} crossings; raise max_crossings= of Integration.",
            False,
        )
    if code == 11:
        return Outcome(
            "out of memory",
            f"stopped at {time} after {n_steps} steps, whose series fill the memory of one run; "
            "continue from run.final_state, raise rtol= of Integration, or keep samples alone by "
            "samples= and dense=False.",
            False,
        )
    if code == 10:
        which = f"the reset at {wall}" if wall else "a reset"
        return Outcome(
            "reset not finite",
            f"at {time} {which} gives a value that is not finite (an overflow, a division by zero, "
            "or a function outside its domain); the run ends with the state before it.",
            False,
        )
    size = float(np.abs(end[1:]).max())
    most = _BLOW_UP * (1.0 + float(np.abs(begin).max()))
    if code in (1, 3, 4) and n_steps and not size <= most:
        return Outcome(
            "blow-up",
            f"the state grew to {size:.3g} within {n_steps} steps, by {time}.",
            False,
        )
    if code == 1:
        return Outcome(
            "too many steps",
            f"stopped at {time} after {limits[0]} steps; raise max_steps= or rtol= of Integration.",
            False,
        )
    if code in (3, 4) and n_steps:
        return Outcome(
            "singular",
            f"the step size vanished at {time}, where the rates or their derivatives are not "
            "finite; end the time span before it, stop or reset the states at smaller values, or "
            "write the rates without a singularity there.",
            False,
        )
    if code in (3, 4):
        return Outcome(
            "not finite at start",
            f"the rates, the switching functions or their derivatives are not finite at the "
            f"initial state, {time}; start inside the domain of every function, with parameters at "
            "which all are finite.",
            False,
        )
    if code == 5 and backwards:
        return Outcome(
            "not unique",
            f"at {time} the backward motion is not unique: the state slides on an interface from "
            "then on, or touches it where sliding ends, so that several motions lead to it; start "
            "off the interface to choose one.",
            False,
        )
    if code == 5:
        return Outcome(
            "not unique",
            f"at {time} the forward motion is not unique: the vector fields on both sides of an "
            "interface point away from it, so that several solutions exist; start slightly off "
            "the interface to choose one.",
            False,
        )
    since = f", after {modes[mode]}," if mode >= 0 else ""
    if code == 6 and undecided:
        reasons = "; ".join(f"at {where} {why}" for where, why in undecided)
        reached = "the flow reaches" if since else "the initial state is at"
        return Outcome(
            "not decided",
            f"at {time}{since} {reached} several discontinuities at once, "
            f"where no sliding motion is defined: {reasons}; write the rates as a sum of terms "
            "with one sign each, smooth one of the signs, or start off the intersection.",
            False,
        )
    if code == 6:
        return Outcome(
            "no continuation",
            f"at {time}{since} there is no admissible continuation: the state is outside every "
            "region, or on several interfaces from which neither a region nor a sliding motion "
            "continues; start slightly off them, or perturb a parameter.",
            False,
        )
    if code == 8:
        which = f"{wall} is true" if wall else "the relation of a reset is true"
        return Outcome(
            "beyond a wall",
            f"at {time} {which}: the start is beyond the wall, or a jump has passed it and its "
            "reset does not return to the other side; expected states on the other side.",
            False,
        )
    return Outcome(
        "accumulation",
        f"crossings, resets or changes of switches accumulate at {time}: infinitely many within a "
        "finite time; the motion beyond is not defined by the equations alone.",
        False,
    )
