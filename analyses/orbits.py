"""Periodic orbits and largest Lyapunov exponents of the gear over the frequency of a fast load.

Not in the source, whose load is slow.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import within
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    DARK,
    FULL,
    GREEN,
    GREY,
    MM,
    PURPLE,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)

Floats = NDArray[np.float64]

#: Frequencies of the load.
FAST = (0.3, 12.0)

#: Frequencies at which the motion of the gear is simulated, down and up.
SWEPT = 160

#: Periods of the load that a settled motion repeats after, at most.
MOST = 4

#: Periods of the load over which the largest twist is measured.
COMMON = 12

#: Difference of states below which a motion repeats, and below which it is that of an orbit: near
#: a period doubling it settles slowly.
SAME, ON = 1e-6, 1e-3

#: Range of a branch that no period doubling connects with the others, as a fraction of its
#: frequency.
NEAR = 0.05

#: Frequency above which the orbits of one period have a single pair of folds.
SLOW = 4.0

#: Steps along the branches of the gear.
STEPS = fs.Continuation(max_step=0.05)

#: Every how many of the other settled motions exponents are computed, over how many periods, and
#: how many are left out before.
EVERY, LONG, LEFT_OUT = 2, 400, 20

#: To what the sum of the exponents agrees with the divergence.
DIVERGENCE = 1e-9

#: Colours of the branches by the number of periods.
COLOURS = {1: BLACK, 2: VERMILION, 3: GREEN, 4: PURPLE}


@cache
def fast_gear() -> fs.Model:
    """The gear of the source with its values under the consistent scaling, and D = 0.25."""
    return fs.systems.harmonic_gear(A=41.67, B=2.372, C=3.546, D=0.25, omega=FAST[1])


@cache
def settled() -> tuple[Floats, Floats]:
    """Frequencies, and the states of the gear that a sweep down and up has settled on."""
    values = np.geomspace(FAST[1], FAST[0], SWEPT)
    found = fs.bifurcation_sweep(fast_gear(), "omega", values, [0.4, 0.0], settle=200, keep=1)
    return (
        np.concatenate([one.values for one in found.passes]),
        np.concatenate([one.ends for one in found.passes]),
    )


@cache
def repeating() -> tuple[tuple[float, int, Floats], ...]:
    """Settled motions that repeat after few periods of the load: frequency, periods, state.

    A motion that both passes have settled on is counted once.
    """
    omega, states = settled()
    periods = np.zeros(len(omega), dtype=int)
    for count in range(MOST, 0, -1):
        later = fs.simulate_many(
            fast_gear(), states, parameters={"omega": omega}, periods=count
        ).final
        periods[np.abs(later - states).max(axis=1) <= SAME] = count
    found: list[tuple[float, int, Floats]] = []
    for value, count, state in zip(omega, periods, states, strict=True):
        known = any(
            value == other and np.abs(state - start).max() <= SAME for other, _, start in found
        )
        if count and not known:
            found.append((float(value), int(count), state))
    return tuple(found)


@cache
def fast() -> tuple[fs.OrbitBranch, ...]:
    """Branches of orbits of the gear that contain all settled motions of few periods.

    The branch of the orbits of one period; those of two periods, from its doublings; and others
    from the settled motions that are on none of them.
    """
    return _traced()[0]


@cache
def _traced() -> tuple[tuple[fs.OrbitBranch, ...], tuple[fs.Orbit | None, ...]]:
    """The branches, and the stable orbit on which each repeating motion is, if it is on one."""
    model = fast_gear()
    simple = _branch(fs.find_orbit(model, [0.4, 0.0]), FAST)
    branches = [simple]
    ends: list[float] = []
    for point in simple.special("PD"):
        if np.abs(np.array([*ends, np.inf]) - point["omega"]).min() > ON:
            branches.append(_branch(fs.find_orbit(model, point), FAST))
            ends += [branches[-1].special[k]["omega"] for k in (0, -1)]
    found: list[fs.Orbit | None] = []
    for value, count, state in repeating():
        each = (_orbit(branch, value, state) for branch in branches)
        orbit = next((one for one in each if one is not None), None)
        if orbit is None:
            here = model.with_parameters(omega=value)
            start = fs.find_orbit(here, state.tolist(), multiple=count)
            branches.append(_branch(start, ((1 - NEAR) * value, (1 + NEAR) * value)))
            orbit = _orbit(branches[-1], value, state)
        found.append(orbit)
    return tuple(branches), tuple(found)


def _branch(orbit: fs.Orbit, over: tuple[float, float]) -> fs.OrbitBranch:
    return fs.continue_orbits(orbit, "omega", over=over, continuation=STEPS)


def _orbit(branch: fs.OrbitBranch, value: float, state: Floats) -> fs.Orbit | None:
    """The stable orbit of a branch that a settled motion is, at some period of the load."""
    if not branch.range[0] <= value <= branch.range[1]:
        return None
    phases = 2 * np.pi / value * np.arange(branch.multiple or 1)
    for orbit in branch.at(omega=value, stable=True):
        if np.abs(orbit(phases) - state[:, None]).max(axis=0).min() <= ON:
            return orbit
    return None


def on_orbits() -> tuple[fs.Orbit | None, ...]:
    """The stable orbit on which each repeating motion is, if it is on one."""
    return _traced()[1]


@dataclass(frozen=True, eq=False)
class Separation:
    """Lyapunov exponents of a settled motion, per period of the load.

    Parameters
    ----------
    omega : float
    exponents : ndarray, shape (2,)
        The largest first. Their sum is the divergence, −1, times the period.
    kind : {"on an orbit", "chaotic", "others"}
    """

    omega: float
    exponents: Floats
    kind: str


@cache
def separations() -> tuple[Separation, ...]:
    """Exponents of settled motions: from the multipliers of their orbits, else by integration."""
    found = [
        Separation(orbit.parameters["omega"], orbit.log_multipliers / orbit.multiple, "on an orbit")
        for orbit in on_orbits()
        if orbit is not None and orbit.multiple
    ]
    known: dict[float, list[Floats]] = {}
    for value, _, state in repeating():
        known.setdefault(value, []).append(state)
    omega, states = settled()
    for value, state in zip(omega[::EVERY], states[::EVERY], strict=True):
        if any(np.abs(state - other).max() <= SAME for other in known.get(float(value), [])):
            continue
        spectrum = fs.lyapunov(
            fast_gear().with_parameters(omega=value), state, periods=LONG, settle=LEFT_OUT
        )
        kind = "chaotic" if spectrum.chaotic else "others"
        found.append(Separation(float(value), spectrum.per_period, kind))
    return tuple(found)


@cache
def claims() -> tuple[Claim, ...]:
    """Coexisting motions of the gear, and chaos."""
    simple = fast()[0]
    bends = simple.special("LPC")["omega"]
    bends = bends[bends > SLOW]
    motions = repeating()
    on = [orbit is not None for orbit in on_orbits()]
    touch, doubled = _doubling(simple)
    return (
        Claim(
            "B6",
            "Under a fast load motions of the gear coexist, and double their periods.",
            "Orbits of the gear with A = 41.67, B = 2.372, C = 3.546, D = 0.25 over "
            "0.3 ≤ ω_o ≤ 12, beside a sweep of simulations down and up.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "{on:.0f} of {all:.0f} settled motions that repeat after up to four periods "
                    "are on stable orbits of {branches:.0f} branches. {doubling:.0f} branches of "
                    "two periods connect two period doublings of the motion of one period. Between "
                    "its folds at ω_o = {left:.6f} and {right:.6f} two stable motions of one "
                    "period coexist. It doubles its period at {doubled:.9f}, {gap:.1e} below its "
                    "grazing at {touch:.9f}.",
                    {
                        "on": sum(on),
                        "all": len(motions),
                        "branches": len(fast()),
                        "doubling": sum(_connects(branch) for branch in fast()),
                        "left": bends.min(),
                        "right": bends.max(),
                        "doubled": doubled,
                        "gap": touch - doubled,
                        "touch": touch,
                    },
                ),
            ),
            ("orbits",),
        ),
        _chaos(),
    )


def _chaos() -> Claim:
    found = separations()
    rest = [one for one in found if one.kind != "on an orbit"]
    wild = [one for one in rest if one.kind == "chaotic"]
    most = max(wild, key=lambda one: one.exponents[0])
    balance = max(abs(one.exponents.sum() + 2 * np.pi / one.omega) for one in found)
    calm = max(one.exponents[0] for one in found if one.kind == "on an orbit")
    return Claim(
        "B6b",
        "Between its resonances the gear under a fast load is chaotic.",
        "Lyapunov exponents of the settled motions of B6: those on stable orbits from their "
        "multipliers, every second other one by QR decomposition with saltation matrices over "
        f"{LONG} periods; the sum of both beside −2π/ω_o.",
        (
            Finding(
                "either",
                "beyond the paper",
                "{chaotic:.0f} of the {rest:.0f} motions on no orbit of up to four periods are "
                "chaotic, with ω_o from {low:.2f} to {high:.2f}; the largest exponent is "
                "{exponent:.1f} per period. On orbits it is {calm:.4f} at most. The sum is "
                "−2π/ω_o within {balance:.0e}.",
                {
                    "chaotic": len(wild),
                    "rest": len(rest),
                    "low": min(one.omega for one in wild),
                    "high": max(one.omega for one in wild),
                    # of chaos, to the digits that any rounding gives
                    "exponent": round(float(most.exponents[0]), 1),
                    "calm": float(calm),
                    "balance": within(float(balance), DIVERGENCE),
                },
            ),
        ),
        ("orbits",),
    )


def _connects(branch: fs.OrbitBranch) -> bool:
    """Check whether a branch ends at period doublings on both sides."""
    return {outcome.code for outcome in branch.outcomes} == {"period doubling"}


def _doubling(branch: fs.OrbitBranch) -> tuple[float, float]:
    """A grazing of a branch with the period doubling nearest to it."""
    touches, doublings = (branch.special(code)["omega"] for code in ("GR", "PD"))
    touches, doublings = touches[touches > SLOW], doublings[doublings > SLOW]
    away = np.abs(touches[:, None] - doublings)
    row, column = np.unravel_index(np.argmin(away), away.shape)
    return float(touches[row]), float(doublings[column])


def main(into: Output) -> None:
    """Draw the response, and the exponents below."""
    sheet = new_figure(FULL, 118 * MM)
    upper, lower = (
        styled_axes(ax) for ax in sheet.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    )
    omega, states = settled()
    many = fs.simulate_many(fast_gear(), states, parameters={"omega": omega}, periods=COMMON)
    handles = []
    rows = np.arange(len(omega)).reshape(2, -1)
    for row, marker, colour, word in zip(
        rows, ("v", "^"), (BLUE, GREY), ("downwards", "upwards"), strict=True
    ):
        handles += upper.plot(
            omega[row],
            many.maximum[row, 0],
            marker,
            color=colour,
            markersize=2.5,
            markeredgewidth=0,
            zorder=1.5,
            label=f"simulated, {word}",
        )
    for branch in fast():
        colour = COLOURS[branch.multiple or 1]
        drawn = fs.plot.response(
            branch, "max(x)", ax=upper, label=False, linewidth=0.9, color=colour
        )
        for markers in drawn.markers:
            markers.remove()
    for count, colour in COLOURS.items():
        words = f"{count} period" + ("s" if count > 1 else "")
        handles.append(Line2D([], [], color=colour, linewidth=0.9, label=words))
    upper.set_xlabel("")
    lower.axhline(0.0, color=GREY, linewidth=0.8)
    for kind, colour in (("on an orbit", BLUE), ("chaotic", VERMILION), ("others", DARK)):
        chosen = [one for one in separations() if one.kind == kind]
        lower.plot(
            [one.omega for one in chosen],
            [one.exponents[0] for one in chosen],
            ".",
            color=colour,
            markersize=3.0,
            label=kind,
        )
    lower.set_ylabel("largest exponent\nper period")
    lower.set_xlabel(r"$\omega_\mathrm{o}$")
    lower.set_xscale("log")
    lower.set_xlim(0.97 * FAST[0], 1.03 * FAST[1])
    ticks = (0.3, 0.5, 1, 2, 3, 5, 10)
    lower.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    lower.xaxis.set_minor_formatter(NullFormatter())
    for letter, ax in zip("ab", (upper, lower), strict=True):
        ax.set_title(f"({letter})", loc="left", fontsize=TEXT)
    sheet.legend(
        handles=[*handles, *lower.get_legend_handles_labels()[0]],
        loc="outside lower center",
        ncols=5,
        fontsize=SMALL_TEXT,
        frameon=False,
    )
    into.save(sheet, "orbits")


if __name__ == "__main__":
    main(Output(Path("figures")))
