"""The route of a buck converter to chaos, and its orbits by the stroboscopic map.

Not in the source. The converter is that of Fossas and Olivar (1996); between two switchings it is
linear, so that the map over a period of the sawtooth is composed of matrix exponentials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import within
from fastslow.plot.layout.style import (
    BLACK,
    FULL,
    GREEN,
    GREY,
    MM,
    MOTION,
    SMALL,
    TEXT,
    VERMILION,
    dot_look,
    new_figure,
    styled_axes,
)

Floats = NDArray[np.float64]

#: Input voltages, the number at which the converter is simulated, and periods that settle it and
#: that are drawn.
RANGE, SWEPT, SETTLE, KEPT = (22.0, 34.0), 200, 150, 30

#: Where orbits of 1, 2 and 4 periods are followed from, and up to where.
FROM, UP_TO = {1: 22.0, 2: 25.5, 4: 31.5}, 34.0

#: Steps of the input voltage.
STEP = 0.2

#: Difference of closing times below which they are equal, s.
SAME = 1e-8

#: Input voltage of a chaotic run, its periods, which are few for rounding to have no effect, and
#: those drawn.
CHAOS, EARLY, DRAWN = 33.0, 20, 8

#: Colours of the orbits by the number of periods.
COLOURS = {1: BLACK, 2: VERMILION, 4: GREEN}


@cache
def converter() -> fs.Model:
    """The converter at the lowest input voltage."""
    return fs.systems.buck_converter(V_in=RANGE[0])


@cache
def swept() -> fs.BifurcationSweep:
    """Output voltages at the instants of the sawtooth, over the input voltage, up and down."""
    values = np.linspace(*RANGE, SWEPT)
    return fs.bifurcation_sweep(converter(), "V_in", values, [12, 0.5], settle=SETTLE, keep=KEPT)


@dataclass(frozen=True)
class Cycle:
    """An output that repeats after some periods of the sawtooth, with one switching in each.

    Parameters
    ----------
    source : float
        Input voltage.
    closings : ndarray, shape (m,)
        Times since the last instant at which the switch closes.
    states : ndarray, shape (m, 2)
        States at the instants.
    multipliers : ndarray, shape (2,)
    """

    source: float
    closings: Floats
    states: Floats
    multipliers: NDArray[np.complex128]


def cycle(source: float, closings: Sequence[float] | Floats) -> Cycle:
    """The output that repeats, from a guess of its switching times, by matrix exponentials."""
    p = converter().parameters
    A = np.array([[-1 / (p["R"] * p["C"]), 1 / p["C"]], [-1 / p["L"], 0]])
    drive = np.array([0, source / p["L"]])
    whole, rise = expm(A * p["T"]), (p["V_U"] - p["V_L"]) / p["T"]

    def states(times: Floats) -> Floats:
        forced = [np.linalg.solve(A, (expm(A * (p["T"] - t)) - np.eye(2)) @ drive) for t in times]
        last = np.zeros(2)
        for one in forced:
            last = whole @ last + one
        found = [np.linalg.solve(np.eye(2) - np.linalg.matrix_power(whole, len(times)), last)]
        for one in forced[:-1]:
            found.append(whole @ found[-1] + one)
        return np.array(found)

    def above(times: Floats) -> Floats:
        ends = [expm(A * t) @ z for t, z in zip(times, states(times), strict=True)]
        return p["a"] * (np.array(ends)[:, 0] - p["V_ref"]) - p["V_L"] - rise * times

    scale = p["T"]
    guess = np.asarray(closings) / scale
    times = scale * fsolve(lambda s: above(scale * s), guess, xtol=1e-13, full_output=True)[0]
    if np.abs(above(times)).max() > 1e-9 or not np.all((times > 0) & (times < p["T"])):
        raise ValueError(f"no output with one switching in each period at {source} V")
    normal, matrix = np.array([p["a"], 0.0]), np.eye(2)
    for t, z in zip(times, states(times), strict=True):
        jump = np.outer(drive, normal) / (normal @ A @ expm(A * t) @ z - rise)
        matrix = expm(A * (p["T"] - t)) @ (np.eye(2) + jump) @ expm(A * t) @ matrix
    return Cycle(source, times, states(times), np.linalg.eigvals(matrix).astype(complex))


@cache
def first(count: int) -> fs.Orbit:
    """The orbit of some periods that a simulation settles on."""
    model = converter().with_parameters(V_in=FROM[count])
    run = fs.simulate(model, [12.0, 0.5], periods=SETTLE)
    return fs.find_orbit(model, run(run.t[-1]).tolist(), multiple=count)


def closings(orbit: fs.Orbit) -> Floats:
    """Times since the last instant at which the switch closes."""
    period = converter().parameters["T"]
    times = [one.time for one in orbit.crossings if one.direction < 0]
    return np.sort(times) % period


@cache
def branch(count: int) -> tuple[Cycle, ...]:
    """Outputs of some periods over the input voltage."""
    sides = []
    for step in (-STEP, STEP):
        found = [cycle(FROM[count], closings(first(count)))]
        while RANGE[0] <= found[-1].source + step <= UP_TO:
            try:
                ahead = cycle(found[-1].source + step, found[-1].closings)
            except ValueError:
                break
            # at the doubling at which the branch begins the halves become equal
            if (
                count > 1
                and np.abs(ahead.closings - np.roll(ahead.closings, count // 2)).max() < SAME
            ):
                break
            found.append(ahead)
        sides.append(found)
    return (*sides[0][:0:-1], *sides[1])


@cache
def doubling(count: int) -> Cycle:
    """The output of some periods that doubles its period."""
    cycles = branch(count)
    row = next(k for k, one in enumerate(cycles) if one.multipliers.real.min() < -1.0)
    guess = cycles[row].closings

    def beyond(source: float) -> float:
        return float(cycle(source, guess).multipliers.real.min()) + 1.0

    return cycle(brentq(beyond, cycles[row - 1].source, cycles[row].source, xtol=1e-13), guess)


@cache
def chaotic() -> fs.Trajectory:
    """A run of the converter in chaos."""
    model = converter().with_parameters(V_in=CHAOS)
    return fs.simulate(model, [12.0, 0.5], periods=EARLY)


@cache
def claims() -> tuple[Claim, ...]:
    """The doublings, and the multipliers of orbits."""
    apart = max(
        float(
            np.abs(np.sort_complex(first(m).multipliers) - np.sort_complex(one.multipliers)).max()
        )
        for m in FROM
        for one in [cycle(FROM[m], closings(first(m)))]
    )
    points = {f"doubled{m}": doubling(m).source for m in FROM}
    return (
        Claim(
            "B13",
            "A buck converter becomes chaotic by period doublings of its output.",
            "The converter of Fossas and Olivar (1996) over input voltages from 22 to 34 V, by "
            "simulation up and down; its outputs of 1, 2 and 4 periods of the sawtooth by matrix "
            "exponentials, and their multipliers beside those of fs.find_orbit.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The output of one period doubles its period at {doubled1:.6f} V, that of two "
                    "at {doubled2:.6f} V and that of four at {doubled4:.6f} V. The multipliers of "
                    "orbits of 1, 2 and 4 periods are those of the matrix exponentials within "
                    "{apart:.0e}.",
                    {**points, "apart": within(apart)},
                ),
            ),
            ("converter",),
        ),
    )


def main(into: Output) -> None:
    """Draw the outputs over the input voltage, and a switching pattern in chaos."""
    sheet = new_figure(FULL, 80 * MM)
    left, right = (styled_axes(ax) for ax in sheet.subplots(1, 2, width_ratios=[3, 2]))
    for one in swept().passes:
        left.plot(one.swept, one.x, ".", color=GREY, markersize=1.0, zorder=1)
    keys: list[Artist] = []
    for count, colour in COLOURS.items():
        cycles = branch(count)
        over = [one.source for one in cycles]
        stable = np.array([np.abs(one.multipliers).max() < 1.0 for one in cycles])
        for k in range(count):
            heights = np.array([one.states[k, 0] for one in cycles])
            for rows, look in ((stable, "-"), (~stable, "--")):
                left.plot(over, np.where(rows, heights, np.nan), look, color=colour, linewidth=0.9)
        point = doubling(count)
        left.plot(point.source * np.ones(count), point.states[:, 0], zorder=5, **dot_look("PD"))
        words = f"{count} period" + ("s" if count > 1 else "")
        keys.append(Line2D([], [], color=colour, linewidth=0.9, label=words))
    left.set_xlim(*RANGE)
    left.set_xlabel(r"$V_\mathrm{in}$ in V")
    left.set_ylabel("$v$ in V at whole periods")
    p = converter().parameters
    since = chaotic().span[1] - DRAWN * p["T"]
    t = np.linspace(0.0, DRAWN * p["T"], 1200)
    v = chaotic()(np.minimum(since + t, chaotic().span[1]))[0]
    right.plot(
        1e3 * t, p["a"] * (v - p["V_ref"]), color=MOTION, linewidth=0.8, label="control voltage"
    )
    for k in range(DRAWN):
        ends = 1e3 * p["T"] * np.array([k, k + 1])
        right.plot(
            ends, [p["V_L"], p["V_U"]], color=GREY, linewidth=0.9, label="" if k else "sawtooth"
        )
        right.plot([ends[1]] * 2, [p["V_L"], p["V_U"]], ":", color=GREY, linewidth=0.6)
    right.set_xlabel("$t$ in ms")
    right.set_ylabel("V")
    for name, ax in zip("ab", (left, right), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    keys += [
        Line2D([], [], label="PD period doubling", **dot_look("PD")),
        Line2D([], [], marker=".", linestyle="none", color=GREY, label="simulated"),
    ]
    keys += right.get_legend_handles_labels()[0]
    sheet.legend(handles=keys, loc="outside lower center", ncols=4, fontsize=SMALL, frameon=False)
    into.save(sheet, "converter")


if __name__ == "__main__":
    main(Output(Path("figures")))
