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
from analyses.cases import FASTEST, GAP, WIDTHS, draw, extent, gear, laid_cases, regimes_of, scan
from analyses.claims import LITTLE, Claim, Finding
from analyses.output import Output
from analyses.passages import OMEGA
from fastslow.systems.gears import SCALINGS, gear_scales

FIGURES = ("gap_width_consistent", "gap_width_printed")

#: A middle off x = 0 by less than this part of the size counts as symmetric.
SYMMETRIC = 0.01

#: The torque "T_om" and the mean torque T_m that the source gives, N m.
PEAK, MEAN = 15.0, 10.0


@cache
def scanned(scaling: str) -> dict[float, list[str]]:
    """Regimes of each width over the allowed frequencies and five starts."""
    return {D: regimes_of(scan(scaling, D=D)) for D in WIDTHS}


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
    return float(fs.systems.slow_load_gap(p["B"], p["C"], omega, stiffness=stiffness, exact=True))


def _largest(scaling: str) -> float:
    return 1.5 * widest(scaling, OMEGA)


def _bilateral(scaling: str) -> Finding:
    found = scanned(scaling)
    both = found[WIDTHS[0]] + found[WIDTHS[1]]
    count = both.count("bilateral")
    other = [r for D in WIDTHS[:2] for r in regimes_of(scan(scaling, D=D, T_am=PEAK - MEAN))]
    peak = other.count("bilateral")
    held = (count == len(both), peak == len(other))
    return Finding(
        scaling,
        "holds" if all(held) else "holds conditionally" if count or peak else "does not hold",
        'It depends on how "T_om = 15" is read. As T_am = 15 N m, the reading of all other rows, '
        "{count} of {runs} runs are bilateral; as the peak of the torque, T_am = 5 N m, {peak} "
        "of {runs}.",
        {"count": count, "runs": len(both), "peak": peak},
        "in part",
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
        "area": gap_region.region(scaling).shares[gap_region.AS_STATED],
        "low": float(low),
        "high": float(high),
        "distance": gap_region.distance(scaling),
    }
    words = (
        "Unilateral in {count} of {runs} runs at T_am = 15 N m. A change from 0.25 to 0.5 alone "
        "does it at ω = 1 rad/s only for T_am between {low:.3f} and {high:.3f} N m (region in the "
        "figure, {area:.0%} of it; its edges are those of the slow-load criterion within "
        "{distance:.2%} of C/B − 1)."
    )
    numbers |= {
        "step": resonances.STEPS[scaling],
        "contact": float(np.sqrt(p["A"])),
        "periods": resonances.LONGEST // 2,
        "top": float(resonances.SCANNED[scaling][-1]),
    }
    words += (
        " At 15 N m, as in figure 3, faster loads than allowed were tried from rest and from "
        "(D, 0), up to ω_o = {top:.0f} in steps of {step:.2g}, until the motion repeats or its "
        "Lyapunov exponent decides, over up to {periods} periods; the vibration in contact has "
        "√A = {contact:.2f}. "
    )
    if not resonances.bands(scaling):
        words += "It is as stated at none of them: most motions are chaotic."
        return Finding(scaling, "holds conditionally", words, numbers, "no")
    first, last = resonances.longest(scaling)
    corner = resonances.longest(scaling, "corner")
    exponent, share = resonances.chaos()
    disordered = resonances.chaotic_below_one()
    numbers |= {
        "from": first,
        "to": last,
        "times": first / FASTEST,
        "other": corner[0],
        "end": corner[1],
        "slowest": disordered[0],
        "next": next(w for w in disordered if w > disordered[0] + 0.1),
        "frequency": resonances.CHAOTIC,
        # of chaos, to the digits that any rounding gives
        "exponent": round(exponent, 1),
        "share": round(share, 1),
    }
    words += (
        "It is as stated from {from:.2f} on, {times:.0f} times the largest frequency allowed, up "
        "to {to:.2f} from rest, but from {other:.2f} to {end:.2f} from (D, 0): other motions "
        "coexist there. Below, most motions at D = 0.5 are bilateral or chaotic, the latter at "
        "ω_o = {frequency} with a largest Lyapunov exponent of {exponent:.1f} per period, "
        "both sides met in {share:.1f} of the periods. Were 0 < ω < 1 meant of ω_o, D = 0.5 would "
        "be unilateral nowhere, but bilateral, or chaotic as near {slowest:.2f} and from "
        "{next:.2f} to 1."
    )
    return Finding(scaling, "holds conditionally", words, numbers, "no")


def _asymmetric(scaling: str) -> Finding:
    ratios = []
    for case in laid_cases("gap_width", scaling):
        low, high = extent(case)
        ratios.append((high + low) / (high - low))
    narrow, _, wide = ratios
    return Finding(
        scaling,
        "holds" if abs(wide) > SYMMETRIC else "does not hold",
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
        "holds conditionally"
        if once and slow > WIDTHS[2]
        else "holds"
        if once
        else "does not hold",
        "One transition from bilateral to unilateral, but at D = {slow:.1f} (ω_o = 0.01) or "
        "{fast:.1f} (1 rad/s), where the gap is ±{degrees:.0f}° wide; D = 0.5 is far below.",
        {
            "slow": slow,
            "fast": fast,
            "degrees": float(np.degrees(fast * angle)),
        },
        "no",
    )


def _in_kind(scaling: str) -> Finding:
    kinds = over_widths(scaling)[0]
    return Finding(
        scaling,
        "holds" if len(set(kinds)) == 1 else "holds conditionally",
        "{same} of {widths} widths from 0.1 to 0.5 are bilateral: the claim holds better than the "
        "figure that the source draws it from.",
        {"same": kinds.count("bilateral"), "widths": len(kinds)},
        "in part",
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
            "The middle of the orbit, (max + min)/(max − min) of x over the last period; below "
            f"{SYMMETRIC} it counts as symmetric.",
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
