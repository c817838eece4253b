"""Three amplitudes of the load (Fig. 5 of the source): T_am = 10, 50, 100 N m.

The source states bilateral impacts at 10 and unilateral ones at 50 and 100.
The load is w = B + C sin(ω t) with C/B = 0.0996 T_am/(N m): at 10 it never
changes sign, and the teeth stay in mesh; at 50 and 100 it does, and impacts are
bilateral.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import (
    FASTEST,
    GAP,
    TORQUES,
    draw,
    extent,
    gear,
    laid_cases,
    peak_to_peak,
    regimes_of,
    scan,
)
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.passages import PERIODS, Case
from analyses.physical_route import within
from analyses.stiffness import impact, timed
from fastslow.systems.gears import SCALINGS, gear_scales
from fastslow.systems.geartrain import harmonic_gear_two_inertias

Floats = NDArray[np.float64]

FIGURES = ("load_amplitude_consistent", "load_amplitude_printed")

#: Mean torques tried, N m; the source's text leaves open which of T_m, T_am and "T_om" it gives.
MEANS = np.geomspace(0.5, 200.0, 40)


@cache
def scanned(scaling: str) -> dict[int, list[str]]:
    """Regimes of each amplitude over the allowed frequencies and five starts."""
    return {T: regimes_of(scan(scaling, T_am=T, D=GAP)) for T in TORQUES}


def at_means(scaling: str, T_am: Floats, means: Floats) -> list[str]:
    """Regimes at amplitudes and mean torques, at 1 rad/s from the upper end of the gap."""
    model = gear(scaling, D=GAP, omega=FASTEST)
    p = model.parameters
    given = {"B": p["B"] * means / 10.0, "C": p["C"] * T_am / 15.0}
    many = fs.simulate_many(model, [GAP, 0.0], parameters=given, periods=2)
    return [str(regime) for regime in many.regime]


@cache
def over_means(scaling: str) -> list[tuple[str, ...]]:
    """Regimes of the three amplitudes at every mean torque tried."""
    found = at_means(
        scaling, np.tile(np.array(TORQUES, dtype=float), len(MEANS)), np.repeat(MEANS, len(TORQUES))
    )
    rows = np.reshape(found, (len(MEANS), len(TORQUES))).tolist()
    return [tuple(row) for row in rows]


@cache
def thresholds(scaling: str) -> tuple[tuple[float, float], ...]:
    """The mean torques up to which each amplitude has bilateral impacts, and any, by bisection.

    Between the mean torques tried each amplitude goes from bilateral impacts to unilateral ones
    and on to none, once.
    """
    amplitudes = np.array(TORQUES, dtype=float)
    found = []
    for kinds in (("bilateral",), ("bilateral", "unilateral upper")):
        inside = np.array([[regime in kinds for regime in row] for row in over_means(scaling)])
        assert (np.diff(inside.astype(int), axis=0).clip(0) == 0).all()
        last = inside.sum(axis=0) - 1
        low, high = MEANS[last], MEANS[last + 1]
        for _ in range(24):
            middle = 0.5 * (low + high)
            within = np.array([r in kinds for r in at_means(scaling, amplitudes, middle)])
            low, high = np.where(within, middle, low), np.where(within, high, middle)
        found.append(low)
    return tuple((float(a), float(b)) for a, b in zip(*found, strict=True))


def ratio(T_am: float) -> float:
    """C/B at T_m = 10 N m, the same in both scalings."""
    p = gear("consistent", T_am=T_am).parameters
    return float(p["C"] / p["B"])


def _light(scaling: str) -> Finding:
    found = scanned(scaling)[TORQUES[0]]
    p = gear(scaling, T_am=TORQUES[0]).parameters
    count = found.count("bilateral")
    light, *heavy = (first for first, _ in thresholds(scaling))
    return Finding(
        scaling,
        "holds" if count == len(found) else "holds conditionally" if light > 0 else "does not hold",
        "Bilateral in {count} of {runs} runs: C/B = {ratio:.4f}, the load never falls below "
        "{lowest:.4f}, and the teeth stay in mesh. Bilateral at 1 rad/s only for mean torques up "
        "to T_m = {light:.3f} N m, and there at 50 and 100 N m too, which are so up to "
        "{middle:.3f} and {heavy:.3f} N m.",
        {
            "count": count,
            "runs": len(found),
            "ratio": ratio(TORQUES[0]),
            "lowest": p["B"] - p["C"],
            "light": light,
            "middle": heavy[0],
            "heavy": heavy[1],
        },
        "no",
    )


def _heavy(scaling: str) -> Finding:
    found = scanned(scaling)
    runs = found[TORQUES[1]] + found[TORQUES[2]]
    count = sum(regime.startswith("unilateral") for regime in runs)
    _, middle, heavy = thresholds(scaling)
    both = middle[1] > heavy[0]
    return Finding(
        scaling,
        "holds" if count == len(runs) else "holds conditionally" if both else "does not hold",
        "Bilateral in {count} of {runs} runs, unilateral in {unilateral}; C/B = {light:.2f} and "
        "{heavy:.2f}. At 1 rad/s impacts are unilateral at 50 N m for mean torques T_m from "
        "{first:.3f} to {second:.3f} N m and at 100 N m from {third:.3f} to {fourth:.3f} N m, so "
        "never at both; beyond, the teeth stay in mesh without impacts, both of them from "
        "{fourth:.3f} N m on, where 10 N m does too.",
        {
            "count": runs.count("bilateral"),
            "runs": len(runs),
            "unilateral": count,
            "light": ratio(TORQUES[1]),
            "heavy": ratio(TORQUES[2]),
            **dict(zip(("first", "second"), middle, strict=True)),
            **dict(zip(("third", "fourth"), heavy, strict=True)),
        },
        "no",
    )


def _high(scaling: str) -> Finding:
    _, middle, heavy = laid_cases("load_amplitude", scaling)
    low, high = timed(middle), timed(heavy)
    slow, fast = impact(middle)[0], impact(heavy)[0]
    return Finding(
        scaling,
        "holds" if high.frequency > 10 * FASTEST else "does not hold",
        "After each impact the teeth vibrate at {high:.2f}, {times:.0f} times ω_o and, within "
        "{off:.1%}, the natural frequency; not new: at 50 N m it is {low:.2f}, begun by "
        "impacts of speed {slow:.3f} instead of {fast:.3f}.",
        {
            "high": high.frequency,
            "times": high.frequency / heavy.setting.model.parameters["omega"],
            "off": within(abs(high.frequency / high.predicted - 1), 1e-2),
            "low": low.frequency,
            "slow": slow,
            "fast": fast,
        },
    )


def _grows(scaling: str) -> Finding:
    cases = laid_cases("load_amplitude", scaling)
    sizes = [peak_to_peak(case) for case in cases]
    return Finding(
        scaling,
        "holds" if sizes == sorted(sizes) else "does not hold",
        "Twist, peak to peak: {light:.4f}, {middle:.3f} and {heavy:.3f}, of which the gap is 0.5 "
        "in the last two.",
        {"light": sizes[0], "middle": sizes[1], "heavy": sizes[2]},
    )


def output_speed(case: Case, scaling: str) -> tuple[float, float]:
    """Parts of the twist and of the load itself in the output speed, peak to peak, rad/s.

    θ_o' = [T_am (1 − cos ω t)/ω + N² J_i θ']/(J_o + N² J_i): the second term and the first.
    """
    scales = gear_scales("printed" if scaling == "printed" else "consistent")
    p = harmonic_gear_two_inertias().parameters
    motor = p["N"] ** 2 * p["J_i"]
    total = p["J_o"] + motor
    low, high = extent(case, "v")
    given = case.setting.model.parameters
    torque = 10.0 * given["C"] / given["B"] * p["J_o"] / gear_scales().inertia
    speed = given["omega"] / scales.time
    return (
        (high - low) * scales.angle / scales.time * motor / total,
        2 * torque / (speed * total),
    )


def _speed(scaling: str) -> Finding:
    cases = laid_cases("load_amplitude", scaling)
    found = [output_speed(case, scaling) for case in cases]
    speeds = [twist for twist, _ in found]
    return Finding(
        scaling,
        "holds" if speeds == sorted(speeds) else "does not hold",
        "What the twist adds to the output speed, peak to peak: {light:.2g}, {middle:.2f} and "
        "{heavy:.2f} rad/s, {jump:.0f}-fold once there are impacts. The load itself makes "
        "that speed swing slowly by {slow:.1f}, {slower:.1f} and {slowest:.1f} rad/s.",
        {
            **dict(zip(("light", "middle", "heavy"), speeds, strict=True)),
            "jump": speeds[1] / speeds[0],
            **dict(zip(("slow", "slower", "slowest"), (s for _, s in found), strict=True)),
        },
    )


def impacts(case: Case) -> int:
    """How often in the last period the teeth meet, rebounds included."""
    since = case.run.span[1] * (1 - 1 / PERIODS)
    return sum(c.time > since and c.to_region != "S2" for c in case.run.crossings)


def _multiple(scaling: str) -> Finding:
    cases = laid_cases("load_amplitude", scaling)
    counts = [impacts(case) for case in cases]
    lowest = [c.setting.model.parameters["B"] - c.setting.model.parameters["C"] for c in cases]
    needs = all((count > 0) == (load < 0) for count, load in zip(counts, lowest, strict=True))
    return Finding(
        scaling,
        "holds conditionally" if needs and counts[2] <= counts[1] else "holds",
        "Impacts in a period: {light}, {middle} and {heavy}, where the load falls to "
        "{high:.3g}, {low:.3g} and {lower:.3g}. A load that becomes negative is needed for any; "
        "one twice as large makes them faster, but not more.",
        {
            **dict(zip(("light", "middle", "heavy"), counts, strict=True)),
            **dict(zip(("high", "low", "lower"), lowest, strict=True)),
        },
        "in part",
    )


@cache
def claims() -> tuple[Claim, ...]:
    """Figure 5 and section 3.3."""
    runs = (
        "Regimes from rest and four other starts, at ten frequencies ω from 0.1 to 1 rad/s; the "
        "mean torques T_m at which they change at 1 rad/s, by bisection between 40 from 0.5 to "
        "200 N m."
    )
    rows = (
        (
            "14",
            'At T_am = 10 N m, "light load", there is "bilateral impact".',
            runs,
            _light,
            (*FIGURES, "map_stiffness_torque"),
        ),
        (
            "15",
            'At 50 and 100 N m, "heavy load", the teeth are "always in a meshing state", impacts '
            "unilateral.",
            runs,
            _heavy,
            (*FIGURES, "map_width_load"),
        ),
        (
            "16",
            'At 100 N m "a high-frequency vibration response appears".',
            "The vibration after the impacts on the upper side, timed on the trajectory.",
            _high,
            FIGURES,
        ),
        (
            "17",
            'With T_am "the response amplitude … also increases".',
            "Peak to peak over the last period.",
            _grows,
            (*FIGURES, "responses"),
        ),
        (
            "18",
            'With it "there will be speed fluctuations at the output".',
            "The parts of the twist and of the load in the output speed, from the two inertias.",
            _speed,
            FIGURES,
        ),
        (
            "18b",
            'A "larger load moment" (conclusions: "a large negative load torque") "leads to '
            'multiple vibration responses".',
            "Impacts in the last period, rebounds included, and the lowest load.",
            _multiple,
            FIGURES,
        ),
    )
    return tuple(
        Claim(number, sentence, computed, tuple(map(finding, SCALINGS)), figures)
        for number, sentence, computed, finding, figures in rows
    )


def main(into: Output) -> None:
    """Draw the figures."""
    for scaling in SCALINGS:
        draw("load_amplitude", scaling, into)
