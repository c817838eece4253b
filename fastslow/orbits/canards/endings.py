"""How singular orbits end."""

from __future__ import annotations

from fastslow.continuation.endings import Ending

CLOSED = Ending("closed", "closes after {jumps}, with slow time {time}.", True)

THROUGH_NODE = Ending(
    "through a folded node",
    "{closes} It passes a folded node through its funnel: mixed modes where the rates are well "
    "separated.",
    True,
)

ON_CANARD = Ending(
    "on the strong canard",
    "the return lands on the strong canard of the folded node at {where}.",
    True,
)

NOT_ON_CANARD = Ending(
    "not on the canard",
    "the distance from the strong canard does not change its sign for {name} from {low} to {high}, "
    "where it is {reach}.",
    False,
)

PASSED_CANARD = Ending(
    "not on the canard",
    "the distance from the strong canard changes its sign at {where} without becoming zero: it is "
    "not known on one side, or the return jumps there.",
    False,
)

NOT_CLOSED = Ending("not closed", "the orbit has not closed after {count} pieces.", False)

#: Why a slow piece or a jump does not go on, by its code.
DEAD_ENDS = {
    ending.code: ending
    for ending in (
        Ending("equilibrium", "the slow flow ends in an equilibrium at {where}.", False),
        Ending(
            "canard point",
            "the slow flow ends in a canard point at {where}, where the slow rate vanishes on the "
            "fold.",
            False,
        ),
        Ending(
            "folded saddle",
            "the slow flow meets a folded saddle at {where}, where it is not determined.",
            False,
        ),
        Ending(
            "folded focus",
            "the slow flow meets a folded focus at {where}, where it is not determined.",
            False,
        ),
        Ending(
            "Hopf point",
            "the sheet loses its stability at a Hopf point of the fast rates at {where}, not at a "
            "fold; the passage is delayed, which this orbit does not describe.",
            False,
        ),
        Ending("unbounded", "the slow flow leaves every bound at {where}.", False),
        Ending(
            "not ended",
            "the slow flow has not left the sheet at {where} in the time that is followed.",
            False,
        ),
        Ending(
            "no landing",
            "the fast flow from {where} does not settle on a sheet: it may oscillate.",
            False,
        ),
        Ending("unbounded jump", "the fast flow leaves every bound near {where}.", False),
        Ending(
            "degenerate fold",
            "the fold at {where} is not quadratic: the jump from it is not determined.",
            False,
        ),
    )
}
