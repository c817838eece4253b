"""Chains of conditions in the generated source of models with many motions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

#: Branches of one chain. A chain is translated by recursion, with three calls for each branch.
LONGEST_CHAIN = 64


def chosen(branches: Iterable[tuple[str, Sequence[str]]]) -> list[str]:
    r"""Return the lines that execute the first body whose test is true.

    More branches than `LONGEST_CHAIN` are divided into chains, each of which is preceded by its
    tests.

    Parameters
    ----------
    branches : iterable of (str, sequence of str)
        Tests and bodies.

    Examples
    --------
    >>> print(*chosen([("mode == 0", ["x = 1.0"]), ("mode == 1", ["x = 2.0"])]), sep="\n")
        if mode == 0:
            x = 1.0
        elif mode == 1:
            x = 2.0
    """
    left = [*branches]
    if len(left) > LONGEST_CHAIN:
        groups = [left[k : k + LONGEST_CHAIN] for k in range(0, len(left), LONGEST_CHAIN)]
        left = [(" or ".join(f"({test})" for test, _ in group), chosen(group)) for group in groups]
    lines = []
    for count, (test, body) in enumerate(left):
        lines.append(f"    {'elif' if count else 'if'} {test}:")
        lines += [f"        {line}" for line in body]
    return lines
