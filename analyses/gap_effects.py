"""What else the source says of the width of the gap: complex motion, loss of contact, vibration."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

import fastslow as fs
from analyses.cases import ALLOWED, WIDTHS, gear, laid_cases, starts
from analyses.claims import Claim, Finding
from analyses.passages import PERIODS, Case
from analyses.physical_route import within
from analyses.stiffness import impact
from fastslow.systems.gears import SCALINGS

#: States that differ by less count as the same.
SAME = 1e-9


@cache
def spread(scaling: str) -> tuple[float, float]:
    """How much the state after three periods depends on the period and on the start."""
    from_period, from_start = 0.0, 0.0
    for D in WIDTHS:
        begin = starts(D)
        rows = np.repeat(np.arange(len(begin)), len(ALLOWED))
        omega = np.tile(ALLOWED, len(begin))
        second, third = (
            fs.simulate_many(
                gear(scaling, D=D), begin[rows], parameters={"omega": omega}, periods=periods
            ).final
            for periods in (PERIODS - 1, PERIODS)
        )
        from_period = max(from_period, float(np.abs(third - second).max()))
        grouped = third.reshape(len(begin), len(ALLOWED), -1)
        from_start = max(from_start, float(np.ptp(grouped, axis=0).max()))
    return from_period, from_start


def out_of_contact(case: Case) -> tuple[int, float]:
    """How often in the last period contact is lost for the far side, and how long it is lost.

    The time, in parts of the period, is all that in the gap, that of rebounds included.
    """
    end = case.run.span[1]
    since = end * (1 - 1 / PERIODS)
    met = [c for c in case.run.crossings if c.time > since]
    free = [(c, d) for c, d in pairwise(met) if c.to_region == "S2"]
    across = sum(c.interface != d.interface for c, d in free)
    return across, sum(d.time - c.time for c, d in free) / (end - since)


def _complex(scaling: str) -> Finding:
    period, start = spread(scaling)
    return Finding(
        scaling,
        "does not hold" if max(period, start) < SAME else "holds",
        "All {runs} runs repeat themselves with the load: from one period to the next the state "
        "changes by less than {period:.0e}, and it does not depend on the start by more than "
        "{start:.0e}. There is one motion, of the load's own period, at each width and frequency.",
        {
            "runs": 5 * len(WIDTHS) * len(ALLOWED),
            "period": within(period, SAME),
            "start": within(start, SAME),
        },
    )


def _detached(scaling: str) -> Finding:
    found = [out_of_contact(case) for case in laid_cases("gap_width", scaling)]
    (count, narrow), (_, middle), (_, wide) = found
    holds = all(across == 2 for across, _ in found)
    return Finding(
        scaling,
        "holds only where" if holds else "does not hold",
        "Where the load changes sign, {count} times a period at every width, and nowhere else: at "
        "D = 0.1 the teeth are out of contact for {narrow:.1%} of the time, at 0.25 for "
        "{middle:.1%}, at 0.5 for {wide:.1%}.",
        {"count": count, "narrow": narrow, "middle": middle, "wide": wide},
    )


def _vibrates(scaling: str) -> Finding:
    speeds = [impact(case)[0] for case in laid_cases("gap_width", scaling)]
    return Finding(
        scaling,
        "holds" if speeds == sorted(speeds) else "does not hold",
        "The first impact on the lower side has the speed {narrow:.3f} at D = 0.1, {middle:.3f} "
        "at 0.25 and {wide:.3f} at 0.5, and the vibration after it begins with that speed.",
        dict(zip(("narrow", "middle", "wide"), speeds, strict=True)),
    )


@cache
def claims() -> tuple[Claim, ...]:
    """Sections 2.1 and 3.1 and the conclusions, beside the regimes."""
    figures = tuple(f"gap_width_{scaling}" for scaling in SCALINGS)
    rows = (
        (
            "10b",
            'From D = 0.1 to 0.5 the system has "complex dynamical behaviors".',
            "The state at the end of the second and of the third period, from rest and four other "
            "starts, at ten frequencies ω from 0.1 to 1 rad/s and three widths.",
            _complex,
            figures,
        ),
        (
            "10c",
            'In small gaps "the meshing state of the gear is about to be detached" (conclusions).',
            "The time spent in the gap during the last period, and how often it is crossed.",
            _detached,
            (*figures, "passages"),
        ),
        (
            "10d",
            'If the gap "is too large, it will cause vibration" (section 2.1).',
            "Speed of the first impact on the lower side.",
            _vibrates,
            figures,
        ),
    )
    return tuple(
        Claim(number, sentence, computed, tuple(map(finding, SCALINGS)), shown)
        for number, sentence, computed, finding, shown in rows
    )
