"""How branches of equilibria and their curves end, beside the endings that all curves have."""

from __future__ import annotations

from fastslow.continuation.endings import Ending

TOO_MANY_FOLDS = Ending(
    "too many folds",
    "the branch has folded {count} times up to {where}, and is not traced beyond, where the folds "
    "may go on without end; give a window.",
    False,
)

INTERFACES_MEET = Ending(
    "interfaces meet",
    "the interfaces {interfaces} meet at the equilibrium {where}; the continuation of the branch "
    "is not unique.",
    False,
)

SECOND_INTERFACE = Ending(
    INTERFACES_MEET.code,
    "another interface of region {region} is reached at {where}; beyond it other regions are "
    "adjacent.",
    True,
)

NO_REGION_BEYOND = Ending(
    "no region beyond", "there is no region beyond {interface} at {where}.", False
)

NOT_HELD = Ending(
    NO_REGION_BEYOND.code,
    "the motion held against {interface} at {where} is not derived.",
    False,
)

DISCONTINUOUS_SLIDING = Ending(
    "discontinuous interface",
    "the sliding vector field is discontinuous across {interface} at {where}, where two "
    "discontinuities intersect; sliding along their intersection is not unique.",
    False,
)

NO_SLIDING = Ending(
    "two-fold",
    "both fields are tangent to {interface} at the boundary equilibrium {where}; there is no "
    "sliding motion near it.",
    True,
)

TWO_FOLD = Ending(
    NO_SLIDING.code,
    "both fields are tangent to {interface} = 0 at {where}; the branch of pseudo-equilibria of "
    "{region} ends at this two-fold.",
    True,
)

SINGULAR_AT_INTERFACE = Ending(
    "singular at interface",
    "the equilibria of region {region} are singular or tangent to {interface} at {where}; a small "
    "change of another parameter makes them regular.",
    False,
)

SWITCH = Ending("switch", "at {where} the branch reaches the threshold {interface}.", True)

RESET = Ending(
    "reset", "at {where} the branch reaches {interface}, where the state is reset.", True
)

EDGE_OF_DOMAIN = Ending(
    "edge of domain",
    "traced to {where}; no equilibrium was found at the end of the range, where the rates may not "
    "be defined.",
    False,
)

ADMISSIBLE = Ending(
    "becomes admissible",
    "the virtual branch reaches the interface and is admissible beyond it.",
    True,
)

LEFT_REGION = Ending("left the region", "the points leave region {region} at {where}.", True)

TWO_FOLD_LEFT_REGION = Ending(LEFT_REGION.code, "the two-fold is at {where}; {why}.", True)
