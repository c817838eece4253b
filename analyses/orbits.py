"""Periodic orbits over the frequency of the load: a gear pair, and the gear under a fast load.

Not in the source, whose load is slow. The gear pair is that of Kahraman and Singh (1990); its
contact-loss grazing is in closed form, because the motion in contact is linear.
"""

from __future__ import annotations

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
    FULL,
    GREEN,
    MM,
    PURPLE,
    SMALL,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)

Floats = NDArray[np.float64]

#: Frequencies of the gear pair, and of the gear.
PAIR, FAST = (0.4, 1.6), (0.3, 12.0)

#: Damping, mean and amplitude of the torque of the gear pair.
DAMPING, MEAN, AMPLITUDE = 0.05, 0.1, 0.05

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

#: Colours of the branches by the number of periods.
COLOURS = {1: BLACK, 2: VERMILION, 3: GREEN, 4: PURPLE}


@cache
def pair() -> fs.OrbitBranch:
    """Orbits of the gear pair over the frequency, from the motion in contact."""
    model = fs.systems.gear_pair(zeta=DAMPING, Fm=MEAN, Fa=AMPLITUDE, Omega=PAIR[0])
    orbit = fs.find_orbit(model, [1.0 + MEAN, 0.0])
    return fs.continue_orbits(orbit, "Omega", over=PAIR)


def grazing_frequencies() -> Floats:
    """Frequencies at which the linear motion in contact touches the gap.

    Roots of Fa Ω² = Fm sqrt((1 − Ω²)² + 4 ζ² Ω²), a quadratic equation in Ω².
    """
    ratio = (AMPLITUDE / MEAN) ** 2
    squares = np.roots([1.0 - ratio, 4.0 * DAMPING**2 - 2.0, 1.0])
    return np.sort(np.sqrt(squares))


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
    model = fast_gear()
    simple = _branch(fs.find_orbit(model, [0.4, 0.0]), FAST)
    branches = [simple]
    ends: list[float] = []
    for point in simple.special("PD"):
        if np.abs(np.array([*ends, np.inf]) - point["omega"]).min() > ON:
            branches.append(_branch(fs.find_orbit(model, point), FAST))
            ends += [branches[-1].special[k]["omega"] for k in (0, -1)]
    for value, count, state in repeating():
        if not any(_is_on(branch, value, state) for branch in branches):
            here = model.with_parameters(omega=value)
            orbit = fs.find_orbit(here, state.tolist(), multiple=count)
            branches.append(_branch(orbit, ((1 - NEAR) * value, (1 + NEAR) * value)))
    return tuple(branches)


def _branch(orbit: fs.Orbit, over: tuple[float, float]) -> fs.OrbitBranch:
    return fs.continue_orbits(orbit, "omega", over=over, continuation=STEPS)


def _is_on(branch: fs.OrbitBranch, value: float, state: Floats) -> bool:
    """Check whether a settled motion is a stable orbit of a branch, at some period of the load."""
    if not branch.range[0] <= value <= branch.range[1]:
        return False
    phases = 2 * np.pi / value * np.arange(branch.multiple or 1)
    return any(
        np.abs(orbit(phases) - state[:, None]).max(axis=0).min() <= ON
        for orbit in branch.at(omega=value, stable=True)
    )


@cache
def claims() -> tuple[Claim, ...]:
    """Folds and grazing of the gear pair; coexisting motions of the gear."""
    folds, touches = (pair().special(code)["Omega"] for code in ("LPC", "GR"))
    apart = float(np.abs(np.sort(touches) - grazing_frequencies()).max())
    simple = fast()[0]
    bends = simple.special("LPC")["omega"]
    bends = bends[bends > SLOW]
    motions = repeating()
    on = [any(_is_on(branch, value, state) for branch in fast()) for value, _, state in motions]
    touch, doubled = _doubling(simple)
    return (
        Claim(
            "B5",
            "Loss of contact bends the response of a gear pair to lower frequencies.",
            "Orbits of x'' + 2ζx' + g(x) = Fm + Fa Ω² sin(Ωt), ζ = 0.05, Fm = 0.1, Fa = 0.05, over "
            "0.4 ≤ Ω ≤ 1.6; the frequencies of grazing against their closed form.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "Contact is lost above Ω = {low:.10f} and regained at {high:.10f}, the closed "
                    "form within {apart:.0e}. Between the folds at Ω = {left:.10f} and "
                    "{right:.10f} two stable motions coexist.",
                    {
                        "low": touches.min(),
                        "high": touches.max(),
                        "apart": within(apart),
                        "left": folds.min(),
                        "right": folds.max(),
                    },
                ),
            ),
            ("orbits",),
        ),
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
    """Draw both responses."""
    sheet = new_figure(FULL, 80 * MM)
    axes = sheet.subplots(1, 2, width_ratios=[1, 2])
    left, right = (styled_axes(ax) for ax in axes)
    fs.plot.response(pair(), "max(x)", ax=left)
    left.set_title("(a)", loc="left", fontsize=TEXT)
    omega, states = settled()
    many = fs.simulate_many(fast_gear(), states, parameters={"omega": omega}, periods=COMMON)
    (dots,) = right.plot(
        omega, many.maximum[:, 0], ".", color=BLUE, markersize=2.5, zorder=1.5, label="simulated"
    )
    handles = [dots]
    for branch in fast():
        colour = COLOURS[branch.multiple or 1]
        drawn = fs.plot.response(
            branch, "max(x)", ax=right, label=False, linewidth=0.9, color=colour
        )
        for markers in drawn.markers:
            markers.remove()
    for count, colour in COLOURS.items():
        words = f"{count} period" + ("s" if count > 1 else "")
        handles.append(Line2D([], [], color=colour, linewidth=0.9, label=words))
    right.set_xscale("log")
    ticks = (0.3, 0.5, 1, 2, 3, 5, 10)
    right.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    right.xaxis.set_minor_formatter(NullFormatter())
    right.legend(handles=handles, fontsize=SMALL, frameon=False, loc="upper left")
    right.set_title("(b)", loc="left", fontsize=TEXT)
    into.save(sheet, "orbits")


if __name__ == "__main__":
    main(Output(Path("figures")))
