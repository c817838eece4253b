"""How branches and curves of periodic orbits end, beside the endings that all curves have."""

from __future__ import annotations

from fastslow.continuation.endings import Ending

#: Why there is no next point on a curve of orbits.
NEWTON_FAILS = "Newton's method does not converge there"

RETRACED = Ending(
    "retraced",
    "beyond {where} the same orbits were computed again, which are removed: the branch turned back "
    "where rounding decides on its direction, or is a closed curve. What follows there is not "
    "known; begin at an orbit beyond, or give a smaller max_step of Continuation.",
    False,
)

PERIOD_DOUBLING = Ending(
    "period doubling",
    "the orbit repeats after half its period, at {where}: the branch ends on that of the simple "
    "orbits.",
    True,
)

HOPF_POINT = Ending("Hopf point", "the cycles {how}.", True)

CYCLES_SHRINK = Ending("cycles shrink", "the cycles shrink to a point {where}.", False)

BOUNDARY_EQUILIBRIUM = Ending(
    "boundary equilibrium",
    "the cycles shrink to an equilibrium on {interfaces} at {where}.",
    True,
)

NOT_CONFIRMED = Ending(
    "itinerary not confirmed",
    "beyond {where} a free run has another itinerary than the orbit{why}.",
    False,
)

NOT_SOLVED = Ending(
    "limited by rounding",
    "beyond {where} rounding limits Newton's corrections of an orbit to {size:.1g} of its units, "
    "more than the {largest:.2g} up to which it is called solved.",
    False,
)

AT_CONTACT = Ending("end at a contact", "no orbit was found beyond {contact} at {where}.", False)

TWO_FOLD = Ending(
    "two-fold",
    "at {where} the orbit slides past a two-fold on {interface}, at which the rates of sliding are "
    "unbounded: a candidate for the end of the branch, which was not located.",
    False,
)

UNBOUNDED = Ending(
    "amplitude unbounded",
    "the states have grown to 10⁸ times those of the first orbit at {where}: a candidate for a "
    "bifurcation from infinity.",
    False,
)

PERIOD_UNBOUNDED = Ending(
    "period unbounded",
    "the period grows to {period:.4g} at {where}, where the cycle passes a {saddle} within "
    "{distance:.1g} of its range: a candidate for a homoclinic orbit, which was not located.",
    False,
)

HOMOCLINIC_WITH_RESETS = Ending(
    "homoclinic with resets",
    "the period grows as −ln|{name} − {name}*| towards {name}* ≈ {value:.7g}, where the cycle "
    "passes a {saddle} within {distance:.1g} of its range: a candidate for a homoclinic orbit, "
    "which is not solved for in a model with {jumps}.",
    False,
)

SADDLE_NODE_ON_CYCLE = Ending(
    "saddle-node on the cycle",
    "the period grows as |{name} − {name}*|^(−1/2) towards a saddle-node of {equilibria} on the "
    "cycle at {name}* = {value:.10g}.",
    True,
)

BOUNDARY_EQUILIBRIUM_ON_CYCLE = Ending(
    "boundary equilibrium on the cycle",
    "the period grows logarithmically towards {name} = {value:.10g}, where the cycle meets an "
    "equilibrium on {where}: non-smooth, no homoclinic bifurcation.",
    True,
)

HOMOCLINIC = Ending(
    "homoclinic orbit",
    "the period grows as −ln|{name} − {name}*| towards a homoclinic orbit of a saddle at "
    "{name}* = {value:.10g}.",
    True,
)

HOMOCLINIC_TO_PSEUDO_SADDLE = Ending(
    "homoclinic to a pseudo-saddle",
    "the period grows as −ln|{name} − {name}*| towards a homoclinic orbit of a pseudo-saddle at "
    "{name}* = {value:.10g}, on which the cycle lands.",
    True,
)

END_NOT_LOCATED = Ending(
    "end not located",
    "{what} near {where}, where the curve ends; the point was not located.",
    False,
)

RESONANCE = Ending("resonance", "ends at {point} at {where}; {beyond}", True)

CONTACT_OF_ORBIT = Ending("contact of the orbit", RESONANCE.sentence, True)
