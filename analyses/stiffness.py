"""Three torsional stiffnesses (Fig. 4 of the source): k1 = 1000, 3000, 7000 at D = 0.1.

The source states a faster vibration at smaller k1. The natural frequency on the
tooth flank, √(3x² − 2Dx + A − 1/4), falls with k1, and so does the vibration
measured; the opposite holds only under loads far beyond those of the source,
where the cubic part of the stiffness prevails.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from analyses.cases import (
    NARROW,
    STIFFNESSES,
    draw,
    gear,
    laid_cases,
    peak_to_peak,
)
from analyses.claims import LITTLE, Claim, Finding
from analyses.output import Output
from analyses.passages import PERIODS, Case
from analyses.physical_route import within
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    FULL,
    GREEN,
    MM,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)
from fastslow.systems.gears import SCALINGS

Floats = NDArray[np.float64]
FIGURES = ("stiffness_consistent", "stiffness_printed")

#: Cycles of the transient that are timed, and those before them, which still lose contact.
TIMED, SKIPPED = 4, 2


@dataclass(frozen=True)
class Vibration:
    """A vibration in contact, timed on a trajectory.

    Parameters
    ----------
    load : float
        In the middle of the cycles timed.
    frequency : float
        Angular frequency from the extremes of the distance to the frozen equilibrium.
    predicted : float
        √(3x² − 2Dx + A − 1/4) at the equilibrium of that load.
    """

    load: float
    frequency: float
    predicted: float


def flank(load: float, A: float, D: float) -> float:
    """The equilibrium x > D at a load: (x² + A)(x − D) = w."""
    return float(brentq(lambda x: (x * x + A) * (x - D) - load, D, D + 2.0 + load, xtol=1e-14))


def natural(load: float, A: float, D: float) -> float:
    """Angular frequency of a small vibration about that equilibrium."""
    x = flank(load, A, D)
    return float(np.sqrt(3 * x * x - 2 * D * x + A - 0.25))


def timed(case: Case) -> Vibration:
    """Time the vibration after the last impacts on the upper side.

    The extremes of x about the drifting equilibrium are where v is the velocity
    of the equilibrium, w'/(3x² − 2Dx + A).
    """
    run, p = case.run, case.setting.model.parameters
    length = (TIMED + SKIPPED + 1.5) * 2 * np.pi / np.sqrt(p["A"])
    ends = [*(c.time for c in run.crossings[1:]), run.span[1]]
    begin = max(
        c.time
        for c, end in zip(run.crossings, ends, strict=True)
        if c.to_region == "S1" and end > c.time + length
    )
    times = begin + np.linspace(0.0, length, 4000)
    x, v = run(times)
    drift = p["omega"] * p["C"] * np.cos(p["omega"] * times)
    apart = v - drift / (3 * x * x - 2 * p["D"] * x + p["A"])
    rows = np.flatnonzero(apart[:-1] * apart[1:] < 0)
    extremes = times[rows] - apart[rows] * np.diff(times)[rows] / np.diff(apart)[rows]
    first, last = extremes[2 * SKIPPED], extremes[2 * (SKIPPED + TIMED)]
    load = p["B"] + p["C"] * np.sin(p["omega"] * 0.5 * (first + last))
    frequency = 2 * np.pi * TIMED / (last - first)
    return Vibration(float(load), float(frequency), natural(float(load), p["A"], p["D"]))


@cache
def vibrations(scaling: str) -> tuple[Vibration, ...]:
    """Of the three stiffnesses."""
    return tuple(timed(case) for case in laid_cases("stiffness", scaling))


def turning_load(A: float, D: float) -> float:
    """The load above which the natural frequency rises where A falls.

    There d(3x² − 2Dx + A)/dA = 1 − (6x − 2D)(x − D)/(3x² − 2Dx + A) is negative,
    which is A < 3x² − 6Dx + 2D².
    """
    x = D + np.sqrt((A + D * D) / 3.0)
    return float((x * x + A) * (x - D))


def overtaking_load(scaling: str) -> float:
    """The load above which k1 = 1000 vibrates faster than k1 = 7000."""
    soft, _, hard = (gear(scaling, k1=k1, D=NARROW).parameters["A"] for k1 in STIFFNESSES)

    def lead(load: float) -> float:
        return natural(load, soft, NARROW) - natural(load, hard, NARROW)

    low = turning_load(soft, NARROW)
    high = low
    while lead(high) < 0:
        high *= 2
    return float(brentq(lead, low, high, rtol=1e-12))


def torque(scaling: str, load: float) -> float:
    """T_am, N m, at which the largest load is this one, with T_m = 10 N m."""
    p = gear(scaling).parameters
    return float(15.0 * (load - p["B"]) / p["C"])


def impact(case: Case) -> tuple[float, float]:
    """Speed and depth of the first contact with the lower side in the last period."""
    run, p = case.run, case.setting.model.parameters
    since = run.span[1] * (1 - 1 / PERIODS)
    meets = [c for c in run.crossings if c.time > since and c.to_region == "S3"]
    leaves = [c.time for c in run.crossings if c.time > meets[0].time]
    low, _ = run.extremes("x", since=meets[0].time, until=leaves[0])
    return abs(float(meets[0].state[1])), -low - p["D"]


def _faster(scaling: str) -> Finding:
    soft, middle, hard = vibrations(scaling)
    load = overtaking_load(scaling)
    off = max(abs(v.frequency / v.predicted - 1) for v in (soft, middle, hard))
    return Finding(
        scaling,
        "holds conditionally" if soft.frequency < hard.frequency else "holds",
        "Measured in contact: {soft:.2f}, {middle:.2f} and {hard:.2f}, the smaller k1 the slower, "
        "√(3x² − 2Dx + A − 1/4) within {off:.1%}. The softest gear becomes the fastest only above "
        "w = {load:.4g}, which takes T_am = {torque:.0f} N m; the largest load here is {top:.3g}.",
        {
            "soft": soft.frequency,
            "middle": middle.frequency,
            "hard": hard.frequency,
            "off": within(off, 1e-3),
            "load": load,
            "torque": torque(scaling, load),
            "top": sum(gear(scaling).parameters[name] for name in "BC"),
        },
        "no",
    )


@dataclass(frozen=True)
class Sizes:
    """How large the response is, for k1 = 1000, 3000 and 7000.

    Parameters
    ----------
    twist : tuple of float
        x, peak to peak over the last period.
    teeth : tuple of float
        That without the width of the gap, 2D, which cannot depend on k1.
    swing : tuple of float
        First swing of the vibration: how deep the first contact with the lower side goes.
    """

    twist: tuple[float, ...]
    teeth: tuple[float, ...]
    swing: tuple[float, ...]

    @property
    def ratios(self) -> dict[str, float]:
        """Each for k1 = 1000 over that for 7000."""
        return {
            "twist": self.twist[0] / self.twist[2],
            "teeth": self.teeth[0] / self.teeth[2],
            "swing": self.swing[0] / self.swing[2],
        }


@cache
def sizes(scaling: str) -> Sizes:
    """Of the responses of figure 4."""
    cases = laid_cases("stiffness", scaling)
    twist = tuple(peak_to_peak(case) for case in cases)
    teeth = tuple(size - 2 * NARROW for size in twist)
    return Sizes(twist, teeth, tuple(impact(case)[1] for case in cases))


def apart(scaling: str) -> float:
    """RMS distance of the twists of k1 = 1000 and 7000 over the last period.

    In units of the RMS of the twist of k1 = 7000 about its mean.
    """
    soft, _, hard = laid_cases("stiffness", scaling)
    end = hard.run.span[1]
    times = end * (1 - np.arange(4096)[::-1] / 4096 / PERIODS)
    one, other = soft.run(times)[0], hard.run(times)[0]
    return float(np.sqrt(np.mean((one - other) ** 2)) / np.std(other))


def _in_size(scaling: str) -> Finding:
    found = sizes(scaling)
    little = [ratio < LITTLE for ratio in found.ratios.values()]
    return Finding(
        scaling,
        "holds" if all(little) else "holds conditionally" if any(little) else "does not hold",
        "Twist, peak to peak: {soft:.3f}, {middle:.3f} and {hard:.3f}; k1 = 1000 has {twist:.2f} "
        "times that of 7000. Of it 2D = {gap:.1f} is the gap, which cannot depend on k1. Without "
        "it, what the teeth deflect changes {teeth:.1f}-fold, and the first swing of the vibration "
        "{swing:.1f}-fold.",
        {
            **dict(zip(("soft", "middle", "hard"), found.twist, strict=True)),
            "gap": 2 * NARROW,
            **found.ratios,
        },
        "in part",
    )


def _large(scaling: str) -> Finding:
    soft, _, hard = vibrations(scaling)
    numbers = {
        "apart": apart(scaling),
        "teeth": sizes(scaling).ratios["teeth"],
        "frequency": hard.frequency / soft.frequency,
    }
    large = [
        numbers["apart"] > LITTLE - 1,
        numbers["teeth"] > LITTLE,
        numbers["frequency"] > LITTLE,
    ]
    return Finding(
        scaling,
        "holds" if all(large) else "holds conditionally" if any(large) else "does not hold",
        "The twists of k1 = 1000 and 7000 differ by {apart:.2f} of the latter's own RMS; what the "
        "teeth deflect changes {teeth:.1f}-fold, the frequency of the vibration "
        "{frequency:.2f}-fold.",
        numbers,
        "in part",
    )


def _absorbs(scaling: str) -> Finding:
    soft, _, hard = laid_cases("stiffness", scaling)
    yielding, rates = [], []
    for case in (soft, hard):
        p = case.setting.model.parameters
        yielding.append(1 / (p["A"] + p["D"] ** 2))
        (point,) = case.diagram.at(w=p["B"])
        rates.append(float(point.eigenvalues.real.max()))
    less, same = yielding[1] < yielding[0], math.isclose(*rates, rel_tol=1e-9)
    return Finding(
        scaling,
        "holds conditionally" if less and same else "holds" if less else "does not hold",
        "A change of the load twists k1 = 7000 by {twist:.3f} of what it does k1 = 1000; but what "
        "a vibration loses does not depend on k1: it decays as e^({slow:.2f} t) and "
        "e^({fast:.2f} t).",
        {"twist": yielding[1] / yielding[0], "slow": rates[0], "fast": rates[1]},
        "in part",
    )


def _resists(scaling: str) -> Finding:
    soft, _, hard = laid_cases("stiffness", scaling)
    (v_soft, deep_soft), (v_hard, deep_hard) = impact(soft), impact(hard)
    A_soft, A_hard = (c.setting.model.parameters["A"] for c in (soft, hard))
    force_soft = ((deep_soft + NARROW) ** 2 + A_soft) * deep_soft
    force_hard = ((deep_hard + NARROW) ** 2 + A_hard) * deep_hard
    return Finding(
        scaling,
        "holds conditionally" if deep_hard < deep_soft and force_hard > force_soft else "holds",
        "From k1 = 1000 to 7000 the first impact on the lower side is as fast ({slow:.4f} and "
        "{fast:.4f}): gap and load set its speed. The teeth deflect {depth:.2f} times as far, but "
        "their force is {force:.2f} times as large.",
        {
            "slow": v_soft,
            "fast": v_hard,
            "depth": deep_hard / deep_soft,
            "force": force_hard / force_soft,
        },
        "in part",
    )


@cache
def claims() -> tuple[Claim, ...]:
    """Figure 4 and section 3.2."""
    rows = (
        (
            "11",
            'With smaller k1 "the vibration frequency … is faster".',
            "The vibration after the impacts on the upper side, timed on the trajectory, against "
            "the imaginary part of the eigenvalues; the load at which the order turns.",
            _faster,
            (*FIGURES, "contact_frequency"),
        ),
        (
            "12",
            '… and "the corresponding vibration amplitude changes little".',
            "Peak to peak over the last period, with the gap and without, and the depth of the "
            "first contact with the lower side; little is less than by a half.",
            _in_size,
            (*FIGURES, "responses"),
        ),
        (
            "12b",
            'But also: the change of k1 leads to "a large change in the dynamic error response".',
            "RMS distance of the two responses over the last period, by the RMS of one about its "
            "mean; deflection of the teeth; frequency in contact. Large is more than by a half.",
            _large,
            (*FIGURES, "responses"),
        ),
        (
            "13",
            "A larger k1 makes the gear better able to \"resist impact\".",
            "Speed, deflection and force of the first impact on the lower side.",
            _resists,
            FIGURES,
        ),
        (
            "13b",
            'A larger k1 enhances the "ability to absorb external disturbances" (section 3.2; the '
            'abstract and the conclusions say so of a smaller, "appropriate" one).',
            "Twist for a small change of the load, 1/(A + D²) at the corner, and the rate at which "
            "a vibration in contact decays, the real part of its eigenvalues.",
            _absorbs,
            FIGURES,
        ),
    )  # fmt: skip
    return tuple(
        Claim(number, sentence, computed, tuple(map(finding, SCALINGS)), figures)
        for number, sentence, computed, finding, figures in rows
    )


def draw_frequencies(into: Output) -> None:
    """Draw the frequency in contact over the load, with what the runs show."""
    sheet = new_figure(FULL, 66 * MM)
    axes = [styled_axes(ax) for ax in sheet.subplots(1, 2)]
    for ax, letter, scaling in zip(axes, "ab", SCALINGS, strict=True):
        top = 2.0 * overtaking_load(scaling)
        loads = np.geomspace(0.7 * min(v.load for v in vibrations(scaling)), top, 160)
        for k1, measured, colour in zip(
            STIFFNESSES, vibrations(scaling), (BLUE, GREEN, VERMILION), strict=True
        ):
            A = gear(scaling, k1=k1, D=NARROW).parameters["A"]
            curve = np.array([natural(load, A, NARROW) for load in loads])
            ax.plot(loads, curve, color=colour, linewidth=1.3)
            ax.plot(
                measured.load,
                measured.frequency,
                "o",
                markersize=4,
                markerfacecolor="white",
                markeredgecolor=colour,
                zorder=4,
            )
            ax.annotate(
                f"$k_1 = {k1}$",
                (loads[50], curve[50]),
                xytext=(0, 6),
                textcoords="offset points",
                color=colour,
                fontsize=SMALL_TEXT,
            )
        reach = sum(gear(scaling).parameters[name] for name in "BC")
        ax.axvspan(loads[0], reach, color="#EFEFEF", zorder=0)
        ax.axvline(overtaking_load(scaling), color=BLACK, linewidth=0.9, linestyle=(0, (4, 2)))
        ax.annotate(
            "loads of Fig. 4",
            (loads[0], 0.97),
            xycoords=("data", "axes fraction"),
            xytext=(3, 0),
            textcoords="offset points",
            va="top",
            fontsize=SMALL_TEXT,
        )
        ax.set_xscale("log")
        ax.set_xlim(loads[0], loads[-1])
        ax.set_xlabel("load $w$")
        ax.set_ylabel("angular frequency in contact")
        ax.set_title(f"({letter}) {scaling} scaling", loc="left", fontsize=TEXT)
    into.save(sheet, "contact_frequency")


def main(into: Output) -> None:
    """Draw the figures."""
    for scaling in SCALINGS:
        draw("stiffness", scaling, into)
    draw_frequencies(into)
