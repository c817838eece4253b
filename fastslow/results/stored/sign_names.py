"""Names of regions and sliding motions by the signs of the interface functions.

Examples
--------
>>> name_of_signs((1, -1, 1)), name_of_signs((1, 0, -1))
('+-+', '++-|+--')
>>> signs_of_name("++-|+--", 3), signs_of_name("S1", 3) is None
((1, 0, -1), True)
"""

from __future__ import annotations

from collections.abc import Sequence

from fastslow.results.stored.operations import AT_REST
from fastslow.results.stored.sign_patterns import Pattern

#: The sign of an interface by its letters in both regions of a name, and that of other letters.
_SIGNS, _OTHER = {("+", "+"): 1, ("-", "-"): -1, ("+", "-"): 0}, 2


def name_of_signs(signs: Sequence[int]) -> str:
    """Return the name of a region, or of sliding where some signs are zero.

    As of all sliding motions, it joins the names of the regions in which these are all positive,
    and all negative.
    """
    above = "".join("-" if s < 0 else "+" for s in signs)
    below = "".join("+" if s > 0 else "-" for s in signs)
    return above if above == below else f"{above}|{below}"


def name_at_rest(signs: Sequence[int], walls: Sequence[str]) -> str:
    """Return the name of a motion whose signs are followed by those of walls, 0 at rest.

    Examples
    --------
    >>> name_at_rest((1, -1, 0), ["x = 1"])
    '+- at rest on x = 1'
    """
    count = len(signs) - len(walls)
    at = [wall for wall, sign in zip(walls, signs[count:], strict=True) if sign == 0]
    return name_of_signs(signs[:count]) + (AT_REST + " and ".join(at) if at else "")


def signs_at_rest(name: str, count: int, walls: Sequence[str]) -> Pattern | None:
    """Return the signs in a name, followed by those of walls where it rests on any.

    Examples
    --------
    >>> signs_at_rest("+- at rest on x = 1", 2, ["x = 1", "y = 1"]), signs_at_rest("+-", 2, [])
    ((1, -1, 0, -1), (1, -1))
    """
    motion, rests, at = name.partition(AT_REST)
    signs, named = signs_of_name(motion, count), at.split(" and ") if rests else []
    if signs is None or not {*named} <= {*walls}:
        return None
    return (*signs, *(-(wall not in named) for wall in walls)) if named else signs


def signs_of_name(name: str, count: int) -> Pattern | None:
    """Return the signs in a name, None for another name or number of interfaces."""
    above, joined, below = name.partition("|")
    pairs = zip(above, below if joined else above, strict=False)
    signs = tuple(_SIGNS.get(pair, _OTHER) for pair in pairs)
    whole = len(above) == count and len(below) in (0, count) and bool(joined) == bool(below)
    return signs if whole and _OTHER not in signs else None
