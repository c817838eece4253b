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


def signs_of_name(name: str, count: int) -> Pattern | None:
    """Return the signs in a name, None for another name or number of interfaces."""
    above, joined, below = name.partition("|")
    pairs = zip(above, below if joined else above, strict=False)
    signs = tuple(_SIGNS.get(pair, _OTHER) for pair in pairs)
    whole = len(above) == count and len(below) in (0, count) and bool(joined) == bool(below)
    return signs if whole and _OTHER not in signs else None
