"""How much of a test with many parameter sets or random examples the test command runs.

``python -m tests.campaigns samples`` runs all of it.
"""

import os

#: Whether everything is run.
WHOLE = os.environ.get("FASTSLOW_TESTS") == "whole"


def examples(count):
    """Number of random examples: a tenth, and at least four, in the test command."""
    return count if WHOLE else min(count, max(4, count // 10))


def places(count, kept):
    """Places of a sample, at equal distances.

    >>> places(9, 3), places(2, 5)
    ([1, 4, 7], [0, 1])
    """
    if WHOLE or kept >= count:
        return list(range(count))
    return [int((k + 0.5) * count / kept) for k in range(kept)]


def left_out(items):
    """Items of tests with the mark ``sample`` that the test command does not run."""
    tests = {}
    for item in items:
        mark = item.get_closest_marker("sample")
        if mark is not None:
            name = item.nodeid.partition("[")[0]
            tests.setdefault((name, *mark.args), []).append(item)
    found = set()
    for (_, kept), whole in tests.items():
        chosen = places(len(whole), kept)
        found |= {item for place, item in enumerate(whole) if place not in chosen}
    return found
