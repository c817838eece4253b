"""What else the source says of the width of the gap: complex motion, loss of contact, vibration."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from analyses.cases import ALLOWED, WIDTHS, laid_cases, peak_to_peak, scan
from analyses.claims import Claim, Finding
from analyses.passages import PERIODS, Case
from analyses.physical_route import within
from analyses.stiffness import flank, impact
from fastslow.systems.gears import SCALINGS, gear_scales

#: States that differ by less count as the same.
SAME = 1e-9


@cache
def spread(scaling: str) -> tuple[float, float]:
    """How much the state after three periods depends on the period and on the start."""
    from_period, from_start = 0.0, 0.0
    for D in WIDTHS:
        second, third = (scan(scaling, periods, D=D).final for periods in (PERIODS - 1, PERIODS))
        from_period = max(from_period, float(np.abs(third - second).max()))
        grouped = third.reshape(-1, len(ALLOWED), third.shape[1])
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
        "holds conditionally" if holds else "does not hold",
        "Where the load changes sign, {count} times a period at every width, and nowhere else: at "
        "D = 0.1 the teeth are out of contact for {narrow:.1%} of the time, at 0.25 for "
        "{middle:.1%}, at 0.5 for {wide:.1%}.",
        {"count": count, "narrow": narrow, "middle": middle, "wide": wide},
        "in part",
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


def without_gap(case: Case) -> float:
    """The twist, peak to peak, of the same gear with D = 0, by its equilibria."""
    p = case.setting.model.parameters
    return flank(p["C"] + p["B"], p["A"], 0.0) + flank(p["C"] - p["B"], p["A"], 0.0)


def overtones(case: Case) -> float:
    """RMS of all overtones of the twist over the last period, by that of its fundamental."""
    end = case.run.span[1]
    times = end * (1 - np.arange(4096)[::-1] / 4096 / PERIODS)
    size = np.abs(np.fft.rfft(case.run(times)[0]))
    return float(np.sqrt(np.sum(size[2:] ** 2)) / size[1])


def overtones_without_gap(case: Case) -> float:
    """The same of the equilibria of the gear with D = 0 under the same load."""
    p = case.setting.model.parameters
    load = p["B"] + p["C"] * np.sin(2 * np.pi * np.arange(1024) / 1024)
    x = np.array([np.sign(w) * flank(abs(w), p["A"], 0.0) for w in load])
    size = np.abs(np.fft.rfft(x))
    return float(np.sqrt(np.sum(size[2:] ** 2)) / size[1])


def _accuracy(scaling: str) -> Finding:
    cases = laid_cases("gap_width", scaling)
    angle = 1e3 * gear_scales("printed" if scaling == "printed" else "consistent").angle
    errors = [angle * peak_to_peak(case) for case in cases]
    free = angle * without_gap(cases[0])
    grows = [free, *errors] == sorted([free, *errors])
    return Finding(
        scaling,
        "holds" if grows else "does not hold",
        "The transmission error θ, peak to peak, is {narrow:.3g} mrad at D = 0.1, {middle:.3g} at "
        "0.25 and {wide:.3g} at 0.5; without a gap it is {free:.3g}. From there it grows by 2D "
        "and at most {more:.1%} more, for what the teeth overshoot.",
        {
            **dict(zip(("narrow", "middle", "wide"), errors, strict=True)),
            "free": free,
            "more": max(
                (error - free) / (2 * D * angle) - 1
                for error, D in zip(errors, WIDTHS, strict=True)
            ),
        },
    )


def _obvious(scaling: str) -> Finding:
    cases = laid_cases("gap_width", scaling)
    since = [case.run.span[1] * (1 - 1 / PERIODS) for case in cases]
    counts = [
        sum(c.time > begin for c in case.run.crossings)
        for case, begin in zip(cases, since, strict=True)
    ]
    shares = [overtones(case) for case in cases]
    obvious = min(counts) > 0 and min(shares) > 10 * overtones_without_gap(cases[0])
    return Finding(
        scaling,
        "holds" if obvious else "does not hold",
        "Non-smooth: interfaces are crossed {few}, {some} and {many} times a period at the three "
        "widths. Nonlinear: the overtones of the twist have {narrow:.0%}, {middle:.0%} and "
        "{wide:.0%} of its fundamental, without a gap {free:.1e}. Both follow from the gap alone "
        "and are no complex behaviour: see 10b.",
        {
            **dict(zip(("few", "some", "many"), counts, strict=True)),
            **dict(zip(("narrow", "middle", "wide"), shares, strict=True)),
            "free": overtones_without_gap(cases[0]),
        },
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
        (
            "10e",
            'The clearance "reduces the … transmission accuracy" (abstract).',
            "The transmission error θ = θ_o − θ_i/N, peak to peak over the last period, in mrad; "
            "that of a gear without clearance from its equilibria.",
            _accuracy,
            (*figures, "responses"),
        ),
        (
            "10f",
            'From D = 0.1 to 0.5 there are "obvious non-smooth characteristics and nonlinear '
            'characteristics".',
            "Crossings of interfaces and overtones of the twist in the last period; the overtones "
            "of a gear without clearance from its equilibria.",
            _obvious,
            figures,
        ),
    )
    return tuple(
        Claim(number, sentence, computed, tuple(map(finding, SCALINGS)), shown)
        for number, sentence, computed, finding, shown in rows
    )
