"""Three widths of the gap (Fig. 3 of the source): D = 0.1, 0.25, 0.5.

The source states bilateral impacts at 0.1 and 0.25 and unilateral ones at 0.5.
Run here, all three are bilateral: the load falls to −1.2, far enough below zero
for long enough to carry the teeth across each of these gaps.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

import fastslow as fs
from analyses import gap_region, resonances
from analyses.cases import ALLOWED, FASTEST, GAP, WIDTHS, draw, extent, gear, laid_cases, scan
from analyses.claims import LITTLE, Claim, Finding
from analyses.output import Output
from analyses.passages import OMEGA
from fastslow.systems.gears import SCALINGS, gear_scales

FIGURES = ("gap_width_consistent", "gap_width_printed")

#: The torque "T_om" and the mean torque T_m that the source gives, N m.
PEAK, MEAN = 15.0, 10.0


@cache
def scanned(scaling: str) -> dict[float, list[str]]:
    """Regimes of each width over the allowed frequencies and five starts."""
    return {D: scan(scaling, ALLOWED, D=D) for D in WIDTHS}


@cache
def over_widths(scaling: str) -> tuple[list[str], list[str]]:
    """Regimes over widths within the source's range, and far beyond it."""
    model = gear(scaling)
    found = []
    for widths in (np.linspace(0.1, 0.5, 41), np.geomspace(0.5, _largest(scaling), 5)):
        many = fs.simulate_many(model, [0, 0], parameters={"D": widths}, periods=3)
        found.append([str(regime) for regime in many.regime])
    return found[0], found[1]


def widest(scaling: str, omega: float) -> float:
    """The widest gap that the load of figure 3 crosses, by the criterion."""
    p = gear(scaling, D=GAP).parameters
    stiffness = p["A"] + p["D"] ** 2
    return float(fs.slow_load_gap(p["B"], p["C"], omega, stiffness=stiffness, exact=True))


def _largest(scaling: str) -> float:
    return 1.5 * widest(scaling, OMEGA)


def _bilateral(scaling: str) -> Finding:
    found = scanned(scaling)
    both = found[WIDTHS[0]] + found[WIDTHS[1]]
    count = both.count("bilateral")
    peak = [r for D in WIDTHS[:2] for r in scan(scaling, ALLOWED, D=D, T_am=PEAK - MEAN)]
    return Finding(
        scaling,
        "holds" if count == len(both) else "holds only where" if count else "does not hold",
        'Bilateral in {count} of {runs} runs at T_am = 15 N m, as which "T_om = 15" is read. Were '
        "it the peak of the torque, T_am = 5 N m, {peak} of {runs} would be.",
        {"count": count, "runs": len(both), "peak": peak.count("bilateral")},
    )


def _unilateral(scaling: str) -> Finding:
    found = scanned(scaling)[WIDTHS[2]]
    count = sum(regime.startswith("unilateral") for regime in found)
    if count == len(found):
        return Finding(scaling, "holds", "Unilateral in all {runs} runs.", {"runs": len(found)})
    p = gear(scaling).parameters
    at = np.array([FASTEST])
    low, high = (
        10.0 * p["B"] / (p["C"] / 1.5) * (1 + 10 ** gap_region.edge(scaling, D, at)[0])
        for D in WIDTHS[1:]
    )
    numbers = {
        "count": count,
        "runs": len(found),
        "share": gap_region.region(scaling).shares[gap_region.AS_STATED],
        "low": float(low),
        "high": float(high),
        "distance": gap_region.distance(scaling),
    }
    words = (
        "Unilateral in {count} of {runs} runs at T_am = 15 N m. A change from 0.25 to 0.5 alone "
        "does it at ω = 1 rad/s only for T_am between {low:.3f} and {high:.3f} N m (region in the "
        "figure, {share:.0%} of it; its edges are those of the slow-load criterion within "
        "{distance:.2%} of C/B − 1)."
    )
    first, last = resonances.longest(scaling)
    slowest = min(resonances.bands(scaling))[0]
    numbers |= {
        "from": first,
        "to": last,
        "slowest": slowest,
        "times": slowest / FASTEST,
        "step": float(np.diff(resonances.SCANNED[scaling][:2])[0]),
        "contact": float(np.sqrt(p["A"])),
    }
    words += (
        " At 15 N m, as in figure 3, it does so only for loads no longer slow against the "
        "vibration in contact, √A = {contact:.2f}: here and there from ω_o = {slowest:.2f} on, "
        "{times:.0f} times the largest frequency allowed, and at all that were tried, in steps of "
        "{step:.2g}, from {from:.2f} to {to:.2f}."
    )
    return Finding(scaling, "holds only where", words, numbers)


def _asymmetric(scaling: str) -> Finding:
    ratios = []
    for case in laid_cases("gap_width", scaling):
        low, high = extent(case)
        ratios.append((high + low) / (high - low))
    narrow, _, wide = ratios
    return Finding(
        scaling,
        "holds" if abs(wide) > 0.01 else "does not hold",
        "Its middle is off x = 0 by {wide:.4f} of its size, because B > 0; but at D = 0.1 by more, "
        "{narrow:.4f}. Asymmetry does not tell unilateral from bilateral impacts.",
        {"wide": wide, "narrow": narrow},
    )


def _stays(scaling: str) -> Finding:
    wide = over_widths(scaling)[1]
    changes = sum(a != b for a, b in pairwise(wide))
    slow, fast = widest(scaling, OMEGA), widest(scaling, FASTEST)
    angle = gear_scales("printed" if scaling == "printed" else "consistent").angle
    once = changes == 1 and wide[-1].startswith("unilateral")
    return Finding(
        scaling,
        "holds only where" if once and slow > WIDTHS[2] else "holds" if once else "does not hold",
        "From bilateral to unilateral once and never back, but at D = {slow:.1f} (ω_o = 0.01) or "
        "{fast:.1f} (1 rad/s), where the gap is ±{degrees:.0f}° wide; D = 0.5 is far below.",
        {
            "slow": slow,
            "fast": fast,
            "degrees": float(np.degrees(fast * angle)),
        },
    )


def _in_kind(scaling: str) -> Finding:
    kinds = over_widths(scaling)[0]
    return Finding(
        scaling,
        "holds" if len(set(kinds)) == 1 else "holds only where",
        "{same} of {widths} widths from 0.1 to 0.5 are bilateral: the claim holds better than the "
        "figure that the source draws it from.",
        {"same": kinds.count("bilateral"), "widths": len(kinds)},
    )


def _in_size(scaling: str) -> Finding:
    cases = laid_cases("gap_width", scaling)
    sizes = [high - low for low, high in map(extent, cases)]
    bent = [size - 2 * D for size, D in zip(sizes, WIDTHS, strict=True)]
    twist, teeth = sizes[2] / sizes[0], bent[2] / bent[0]
    little = max(twist, 1 / twist) < LITTLE
    return Finding(
        scaling,
        "holds" if little else "does not hold",
        "From D = 0.1 to 0.5 the twist, peak to peak, grows from {first:.3f} to {last:.3f}, "
        "{twist:.2f}-fold; what the teeth deflect, without the gap, {teeth:.2f}-fold.",
        {"first": sizes[0], "last": sizes[2], "twist": twist, "teeth": teeth},
    )


@cache
def claims() -> tuple[Claim, ...]:
    """Figure 3 and section 3.1."""
    runs = (
        "Regimes from rest and four other starts, at ten frequencies ω from 0.1 to 1 rad/s, "
        "three periods each."
    )
    rows = (
        ("5", 'At D = 0.1 and 0.25 there is "bilateral impact".', runs, _bilateral, FIGURES),
        (
            "6",
            'At D = 0.5 the teeth "are transformed into a state of unilateral impact".',
            runs + " Where it holds: a refined map over ω_o and C/B, three runs at each point; "
            "and frequencies far beyond those that the source allows.",
            _unilateral,
            (
                "gap_region",
                "regimes_width",
                "regimes_frequency",
                "map_width_load",
                "map_frequency_width",
                "resonances",
            ),
        ),
        (
            "7",
            'At D = 0.5 "the corresponding phase diagram is asymmetric".',
            "The middle of the orbit, (max + min)/(max − min) of x over the last period.",
            _asymmetric,
            FIGURES,
        ),
        (
            "8",
            'With larger gaps the teeth "will always be in the form of unilateral impact".',
            "Five widths from 0.5 up to 1.5 times the widest gap that the load crosses, by the "
            "criterion for that gap.",
            _stays,
            ("map_width_load", "map_frequency_width"),
        ),
        (
            "9",
            'Within a range, D changes the response "in quantity", not in kind.',
            "The regime at 41 widths from 0.1 to 0.5, ω_o = 0.01.",
            _in_kind,
            ("map_width_load",),
        ),
        (
            "10",
            'With D "the magnitude of the corresponding response change will not be too large".',
            "Peak to peak over the last period; little is less than by a half.",
            _in_size,
            (*FIGURES, "responses"),
        ),
    )
    return tuple(
        Claim(number, sentence, computed, tuple(map(finding, SCALINGS)), figures)
        for number, sentence, computed, finding, figures in rows
    )


def main(into: Output) -> None:
    """Draw the figures."""
    for scaling in SCALINGS:
        draw("gap_width", scaling, into)
    gap_region.draw(into)
