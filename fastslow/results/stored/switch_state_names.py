"""Names of regions in a state of the switches, and of the thresholds of switches."""

from __future__ import annotations

import re
from collections.abc import Mapping

#: Sign in the names of thresholds.
CHANGES = " → "


def in_state(region: str, state: Mapping[str, int]) -> str:
    """Return the name of a region in a state of the switches.

    Examples
    --------
    >>> in_state("S1", {"q": 0}), in_state("S1 at rest on x = 1", {"q": 1})
    ('S1 (q = 0)', 'S1 (q = 1) at rest on x = 1')
    """
    if not state:
        return region
    words = ", ".join(f"{name} = {value}" for name, value in state.items())
    name, space, rest = region.partition(" ")
    return f"{name} ({words}){space}{rest}"


def state_of(region: str) -> dict[str, int]:
    """Return the state of the switches in the name of a region.

    Examples
    --------
    >>> state_of("S1 (q = 0, s = 1) at rest on x = 1"), state_of("S1|S2 (escaping)")
    ({'q': 0, 's': 1}, {})
    """
    found = re.search(r" \(([^()]* = [01])\)", region)
    if found is None:
        return {}
    pairs = (part.split(" = ") for part in found[1].split(", "))
    return {name: int(value) for name, value in pairs}


def threshold(relation: str, switch: str, value: int) -> str:
    """Return the name of a threshold at which a switch changes to a value.

    Examples
    --------
    >>> threshold("x > 1", "q", 1)
    'x > 1 (q → 1)'
    """
    return f"{relation} ({switch}{CHANGES}{value})"


def without_state(region: str) -> str:
    """Return the name of a region without the state of the switches.

    Examples
    --------
    >>> without_state("S1 (q = 0, s = 1)|S2 (q = 0, s = 1) (escaping)")
    'S1|S2 (escaping)'
    """
    return re.sub(r" \([^()]* = [01]\)", "", region)
