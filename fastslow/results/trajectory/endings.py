"""Outcomes of a simulation, from the codes of the stepping loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.outcome import Outcome

#: Growth relative to the initial state from which a run that fails is a blow-up.
_BLOW_UP = 1e6


class _Ending(NamedTuple):
    """What is known where the stepping loop ended, with the parameters of `outcome_of`."""

    mode: int
    end: NDArray[np.float64]
    n_steps: int
    begin: NDArray[np.float64]
    modes: tuple[str, ...]
    limits: tuple[int, int]
    undecided: tuple[tuple[str, str], ...]
    wall: str
    backwards: bool

    @property
    def time(self) -> str:
        return f"t = {self.end[0]:.10g}"

    @property
    def size(self) -> float:
        return float(np.abs(self.end[1:]).max())

    @property
    def grown(self) -> bool:
        """Whether the state grew by many orders of magnitude, so that a failure is a blow-up."""
        most = _BLOW_UP * (1.0 + float(np.abs(self.begin).max()))
        return self.n_steps > 0 and not self.size <= most


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
    """Return the outcome of a run from the code of `fastslow.simulation.stepper.phases`.

    ``begin`` is the initial state, ``end`` the final time and state; ``undecided`` lists
    intersections of interfaces without a sliding motion, with the reason; ``wall`` is the
    relation of the reset beyond whose wall the run ended, or the reset or event which failed;
    ``backwards`` is True for a run backwards in time.
    """
    ending = _Ending(
        mode=mode,
        end=end,
        n_steps=n_steps,
        begin=begin,
        modes=modes,
        limits=limits,
        undecided=undecided,
        wall=wall,
        backwards=backwards,
    )
    return _ENDINGS.get(code, _accumulation)(ending)


def _end_of_time(e: _Ending) -> Outcome:
    return Outcome("end of time", f"reached {e.time}, the end of the time span.", True)


def _too_many_crossings(e: _Ending) -> Outcome:
    return Outcome(
        "too many crossings",
        f"stopped at {e.time} after {e.limits[1]} crossings; raise max_crossings= of Integration.",
        False,
    )


def _out_of_memory(e: _Ending) -> Outcome:
    return Outcome(
        "out of memory",
        f"stopped at {e.time} after {e.n_steps} steps, whose series fill the memory of one run; "
        "continue from run.final_state, raise rtol= of Integration, or keep samples alone by "
        "samples= and dense=False.",
        False,
    )


def _reset_not_finite(e: _Ending) -> Outcome:
    which = f"the {e.wall}" if e.wall else "a reset or an event"
    return Outcome(
        "reset not finite",
        f"at {e.time} {which} gives a value that is not finite (an overflow, a division by zero, "
        "or a function outside its domain) or a delay below zero; the run ends with the state "
        "before it.",
        False,
    )


def _endless_events(e: _Ending) -> Outcome:
    which = f": {e.wall}" if e.wall else ""
    return Outcome(
        "endless events",
        f"at {e.time} events trigger each other without end{which}; the motion beyond is not "
        "defined by the equations alone.",
        False,
    )


def _many_pending(e: _Ending) -> Outcome:
    which = f"the {e.wall}" if e.wall else "an event"
    return Outcome(
        "many pending events",
        f"stopped at {e.time}, where {which} is triggered while too many delayed events are "
        "waiting; expected a delay shorter than about ten times between two triggers.",
        False,
    )


def _blow_up(e: _Ending) -> Outcome:
    return Outcome(
        "blow-up",
        f"the state grew to {e.size:.3g} within {e.n_steps} steps, by {e.time}.",
        False,
    )


def _too_many_steps(e: _Ending) -> Outcome:
    if e.grown:
        return _blow_up(e)
    return Outcome(
        "too many steps",
        f"stopped at {e.time} after {e.limits[0]} steps; raise max_steps= or rtol= of Integration.",
        False,
    )


def _no_step(e: _Ending) -> Outcome:
    if e.grown:
        return _blow_up(e)
    if e.n_steps:
        return Outcome(
            "singular",
            f"the step size vanished at {e.time}, where the rates or their derivatives are not "
            "finite; end the time span before it, stop or reset the states at smaller values, or "
            "write the rates without a singularity there.",
            False,
        )
    return Outcome(
        "not finite at start",
        f"the rates, the switching functions or their derivatives are not finite at the "
        f"initial state, {e.time}; start inside the domain of every function, with parameters at "
        "which all are finite.",
        False,
    )


def _not_unique(e: _Ending) -> Outcome:
    if e.backwards:
        return Outcome(
            "not unique",
            f"at {e.time} the backward motion is not unique: the state slides on an interface from "
            "then on, or touches it where sliding ends, so that several motions lead to it; start "
            "off the interface to choose one.",
            False,
        )
    return Outcome(
        "not unique",
        f"at {e.time} the forward motion is not unique: the vector fields on both sides of an "
        "interface point away from it, so that several solutions exist; start slightly off "
        "the interface to choose one.",
        False,
    )


def _no_continuation(e: _Ending) -> Outcome:
    since = f", after {e.modes[e.mode]}," if e.mode >= 0 else ""
    if e.undecided:
        reasons = "; ".join(f"at {where} {why}" for where, why in e.undecided)
        reached = "the flow reaches" if since else "the initial state is at"
        return Outcome(
            "not decided",
            f"at {e.time}{since} {reached} several discontinuities at once, "
            f"where no sliding motion is defined: {reasons}; write the rates as a sum of terms "
            "with one sign each, smooth one of the signs, or start off the intersection.",
            False,
        )
    return Outcome(
        "no continuation",
        f"at {e.time}{since} there is no admissible continuation: the state is outside every "
        "region, or on several interfaces from which neither a region nor a sliding motion "
        "continues; start slightly off them, or perturb a parameter.",
        False,
    )


def _beyond_a_wall(e: _Ending) -> Outcome:
    which = f"{e.wall} is true" if e.wall else "the relation of a reset is true"
    return Outcome(
        "beyond a wall",
        f"at {e.time} {which}: the start is beyond the wall, or a jump has passed it and its "
        "reset does not return to the other side; expected states on the other side.",
        False,
    )


def _accumulation(e: _Ending) -> Outcome:
    if e.wall:
        return _endless_events(e)
    return Outcome(
        "accumulation",
        f"crossings, resets, events or changes of switches accumulate at {e.time}: infinitely "
        "many within a finite time; the motion beyond is not defined by the equations alone.",
        False,
    )


#: Outcome of each code of the stepping loop; the others are accumulations.
_ENDINGS: Mapping[int, Callable[[_Ending], Outcome]] = MappingProxyType(
    {
        0: _end_of_time,
        1: _too_many_steps,
        2: _too_many_crossings,
        3: _no_step,
        4: _no_step,
        5: _not_unique,
        6: _no_continuation,
        8: _beyond_a_wall,
        10: _reset_not_finite,
        11: _out_of_memory,
        12: _endless_events,
        13: _many_pending,
    }
)
