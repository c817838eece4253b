"""The route of a buck converter to chaos, and its orbits by the stroboscopic map.

Not in the source. The converter is that of Fossas and Olivar (1996); between two switchings it is
linear, so that the map over a period of the sawtooth is composed of matrix exponentials.
"""

from __future__ import annotations

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
from fastslow.plot.branch_lines import stability_runs
from fastslow.plot.layout.style import (
    BLACK,
    FULL,
    GREEN,
    GREY,
    LINES,
    MM,
    MOTION,
    PURPLE,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    dot_look,
    new_figure,
    styled_axes,
)
from fastslow.results.orbits.special_orbit import SpecialOrbit

Floats = NDArray[np.float64]

#: Input voltages, the number at which the converter is simulated, and periods that settle it and
#: that are drawn.
RANGE, SWEPT, SETTLE, KEPT = (22.0, 34.0), 200, 150, 30

#: Periods of orbits, and the distance from their doublings at which the map is solved.
COUNTS, NEAR = (1, 2, 4, 8), 1e-3

#: Input voltage of a chaotic run, its periods, which are few for rounding to have no effect, and
#: those drawn.
CHAOS, EARLY, DRAWN = 33.0, 20, 8

#: Colours of the orbits by the number of periods.
COLOURS = {1: BLACK, 2: VERMILION, 4: GREEN, 8: PURPLE}


@cache
def converter() -> fs.Model:
    """The converter at the lowest input voltage."""
    return fs.systems.buck_converter(V_in=RANGE[0])


@cache
def swept() -> fs.BifurcationSweep:
    """Output voltages at the instants of the sawtooth, over the input voltage, up and down."""
    values = np.linspace(*RANGE, SWEPT)
    return fs.bifurcation_sweep(converter(), "V_in", values, [12, 0.5], settle=SETTLE, keep=KEPT)


def multipliers(source: float, closings: Floats) -> NDArray[np.complex128]:
    """Multipliers of the output that repeats with one switching in each period.

    Its times since the last instant at which the switch closes are solved for, from a guess.
    """
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

    # to rounding, without a warning that it cannot be improved
    shares = fsolve(lambda s: above(p["T"] * s), closings / p["T"], xtol=1e-13, full_output=True)
    times = p["T"] * shares[0]
    normal, matrix = np.array([p["a"], 0.0]), np.eye(2)
    for t, z in zip(times, states(times), strict=True):
        jump = np.outer(drive, normal) / (normal @ A @ expm(A * t) @ z - rise)
        matrix = expm(A * (p["T"] - t)) @ (np.eye(2) + jump) @ expm(A * t) @ matrix
    return np.linalg.eigvals(matrix).astype(complex)


@cache
def branch(count: int) -> fs.OrbitBranch:
    """Orbits of some periods of the sawtooth over the input voltage; each doubles the last."""
    guess = [12.0, 0.5] if count == 1 else doubling(count // 2)
    return fs.continue_orbits(fs.find_orbit(converter(), guess), "V_in", over=RANGE)


def doubling(count: int) -> SpecialOrbit:
    """Where the orbits of some periods double their period."""
    return max(branch(count).special("PD"), key=lambda point: point["V_in"])


def closings(orbit: fs.Orbit) -> Floats:
    """Times since the last instant at which the switch closes."""
    times = [one.time for one in orbit.crossings if one.direction < 0]
    return np.sort(times) % converter().parameters["T"]


def expected(count: int) -> float:
    """The input voltage of a doubling, by matrix exponentials."""
    guess, near = closings(doubling(count).orbit), doubling(count)["V_in"]

    def beyond(source: float) -> float:
        return float(multipliers(source, guess).real.min()) + 1.0

    return float(brentq(beyond, near - NEAR, near + NEAR, xtol=1e-13))


@cache
def chaotic() -> fs.Trajectory:
    """A run of the converter in chaos."""
    model = converter().with_parameters(V_in=CHAOS)
    return fs.simulate(model, [12.0, 0.5], periods=EARLY)


@cache
def claims() -> tuple[Claim, ...]:
    """The doublings."""
    found = {f"doubled{m}": doubling(m)["V_in"] for m in COUNTS}
    gaps = np.diff(list(found.values()))
    apart = max(abs(found[f"doubled{m}"] - expected(m)) for m in COUNTS)
    return (
        Claim(
            "B13",
            "A buck converter becomes chaotic by period doublings of its output.",
            "Orbits of the converter of Fossas and Olivar (1996) of 1, 2, 4 and 8 periods of its "
            "sawtooth over input voltages from 22 to 34 V, each from the doubling of the last, "
            "over simulations up and down; the doublings against the map over a period, composed "
            "of matrix exponentials.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The output of one period doubles its period at {doubled1:.8f} V, those of 2, "
                    "4 and 8 at {doubled2:.8f}, {doubled4:.8f} and {doubled8:.8f} V, by matrix "
                    "exponentials within {apart:.0e}. The distances decrease by the factors "
                    "{first:.2f} and {second:.2f}.",
                    {
                        **found,
                        "apart": within(apart),
                        "first": gaps[0] / gaps[1],
                        "second": gaps[1] / gaps[2],
                    },
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
    period = converter().parameters["T"]
    for count, colour in COLOURS.items():
        phases = period * np.arange(count)
        outputs = np.array([orbit(phases)[0] for orbit in branch(count)])
        for kind, rows in stability_runs(branch(count).stability):
            look = {**LINES[kind], "color": colour, "linewidth": 0.9}
            left.plot(branch(count).values[rows], outputs[rows], **look)
        point = doubling(count)
        left.plot([point["V_in"]] * count, point.orbit(phases)[0], zorder=5, **dot_look("PD"))
        words = f"{count} period" + ("s" if count > 1 else "")
        keys.append(Line2D([], [], color=colour, linewidth=0.9, label=words))
    left.set_xlim(*RANGE)
    left.set_xlabel(r"$V_\mathrm{in}$ (V)")
    left.set_ylabel("$v$ at whole periods (V)")
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
    right.set_xlabel("$t$ (ms)")
    right.set_ylabel("voltage (V)")
    for name, ax in zip("ab", (left, right), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    keys += [
        Line2D([], [], label="PD period doubling", **dot_look("PD")),
        Line2D([], [], marker=".", linestyle="none", color=GREY, label="simulated"),
    ]
    keys += right.get_legend_handles_labels()[0]
    sheet.legend(
        handles=keys, loc="outside lower center", ncols=4, fontsize=SMALL_TEXT, frameon=False
    )
    into.save(sheet, "converter")


if __name__ == "__main__":
    main(Output(Path("figures")))
