"""Relative derivatives of the gear with respect to every physical parameter of the source.

They are computed for the widest gap that the load crosses, the time in the gap, and the
transmission error, peak to peak, at the values of figure 3 with the gap given,
φ = 1.75e-2 rad, and ω = 1 rad/s. The time is differentiated along a run and the transmission
error along its periodic orbit, both with respect to the parameters of (5); the rest follows from
the equivalent inertia and damping. Units fix some sums of them, which is tested.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import SPEED, within
from fastslow.plot.layout.style import (
    BLUE,
    FULL,
    GREY,
    MM,
    ORANGE,
    SMALL_TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)
from fastslow.systems.gears import gear_scales

#: The physical parameters of the source, and their values.
VALUES: Mapping[str, float] = {
    "J_i": 6.8e-4,
    "J_o": 2.4e-2,
    "N": 100.0,
    "xi": 0.05,
    "K_HD": 7200.0,
    "k1": 3000.0,
    "k2": 21000.0,
    "phi": 1.75e-2,
    "T_m": 10.0,
    "T_am": 15.0,
    "omega": SPEED,
}

LABELS = {
    "J_i": r"$J_\mathrm{i}$",
    "J_o": r"$J_\mathrm{o}$",
    "N": "$N$",
    "xi": r"$\xi$",
    "K_HD": r"$K_\mathrm{HD}$",
    "k1": "$k_1$",
    "k2": "$k_2$",
    "phi": r"$\varphi$",
    "T_m": r"$T_\mathrm{m}$",
    "T_am": r"$T_\mathrm{am}$",
    "omega": r"$\omega$",
}

#: Exponents of the units of energy and of time, and of the angle, in each parameter and quantity.
UNITS = {
    "energy": {"J_i": 1, "J_o": 1, "K_HD": 1, "k1": 1, "k2": 1, "T_m": 1, "T_am": 1},
    "time": {"J_i": 2, "J_o": 2, "omega": -1, "time in the gap": 1},
    "angle": {"k2": -2, "phi": 1, "T_m": 1, "T_am": 1, "widest gap": 1, "transmission error": 1},
}

#: Relative step of differences of the criterion.
STEP = 1e-3

#: Below this the criterion's differences are rounding.
ROUNDING = 1e-8

QUANTITIES = ("widest gap", "time in the gap", "transmission error")


def widest(values: Mapping[str, float]) -> float:
    """Half of the widest gap that the load crosses, rad, by the criterion in physical units."""
    scales = gear_scales(
        J_i=values["J_i"],
        J_o=values["J_o"],
        N=values["N"],
        xi=values["xi"],
        K_HD=values["K_HD"],
    )
    return float(
        fs.systems.slow_load_gap(
            values["T_m"] / scales.inertia,
            values["T_am"] / values["J_o"],
            values["omega"],
            damping=scales.damping / scales.inertia,
            stiffness=(values["k1"] + values["k2"] * values["phi"] ** 2) / scales.inertia,
            exact=True,
        )
    )


def _difference(name: str) -> float:
    """Relative derivative of the widest gap by a parameter, of fourth order in the step."""
    logs = [
        np.log(widest({**VALUES, name: VALUES[name] * np.exp(k * STEP)})) for k in (-2, -1, 1, 2)
    ]
    return float((logs[0] - 8 * logs[1] + 8 * logs[2] - logs[3]) / (12 * STEP))


def by_source(by: Mapping[str, float]) -> dict[str, float]:
    """Relative derivatives with respect to the parameters of the source, from those of (5).

    J_eq = N² J_i J_o/(N² J_i + J_o) and C_eq = 2 ξ √(J_eq K_HD).
    """
    moved = VALUES["N"] ** 2 * VALUES["J_i"]
    share = VALUES["J_o"] / (moved + VALUES["J_o"])
    inertia = by["J_eq"] + by["C_eq"] / 2
    own = {name: by[name] for name in ("k1", "k2", "phi", "T_m", "T_am", "omega")}
    return {
        "J_i": share * inertia,
        "J_o": (1 - share) * inertia + by["J_o"],
        "N": 2 * share * inertia,
        "xi": by["C_eq"],
        "K_HD": by["C_eq"] / 2,
        **own,
    }


@cache
def orbit() -> fs.Orbit:
    """The periodic motion under the load."""
    model = fs.systems.harmonic_gear_twist(**VALUES)
    run = fs.simulate(model, [0.0, 0.0], periods=1)
    return fs.find_orbit(model, run(run.span[1]).tolist())


def first_crossing(run: fs.Trajectory) -> int:
    """Index of the crossing at which the gap is entered from above and crossed as a whole."""
    met = [(c.to_region, d.to_region) for c, d in pairwise(run.crossings)]
    return met.index(("S2", "S3"))


@cache
def relative() -> dict[str, dict[str, float]]:
    """Relative derivatives d ln(quantity)/d ln(parameter), by quantity and parameter."""
    motion = orbit()
    model = fs.systems.harmonic_gear_twist(**VALUES)
    p = model.parameters
    size = motion["max(theta)"] - motion["min(theta)"]
    error = {}
    for name in p:
        slope = motion.gradient(name)
        error[name] = p[name] * (slope["max(theta)"] - slope["min(theta)"]) / size
    run = fs.simulate(model, motion(0.0).tolist(), periods=1)
    k = first_crossing(run)
    times = run.sensitivity(list(p)).crossing_times
    length = run.crossings[k + 1].time - run.crossings[k].time
    across = {name: p[name] * (times[k + 1, j] - times[k, j]) / length for j, name in enumerate(p)}
    return {
        "widest gap": {name: _difference(name) for name in VALUES},
        "time in the gap": by_source(across),
        "transmission error": by_source(error),
    }


def imbalance() -> float:
    """Largest violation of what the units of energy, time and angle fix."""
    found = []
    for powers in UNITS.values():
        for quantity, slopes in relative().items():
            total = sum(power * slopes.get(name, 0.0) for name, power in powers.items())
            found.append(total - powers.get(quantity, 0))
    return float(np.abs(found).max())


@cache
def claims() -> tuple[Claim, ...]:
    """What matters for the gap and what for the transmission error."""
    gap, time, error = (relative()[name] for name in QUANTITIES)
    return (
        Claim(
            "B14",
            "The clearance sets the transmission error, the damping what the load can cross.",
            "Relative derivatives of the widest gap that the load crosses, of the time in the gap "
            "and of the transmission error, peak to peak, by all 11 physical parameters at the "
            "values of Fig. 3, φ = 1.75e-2 rad and ω = 1 rad/s.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "One per cent more clearance means {phi:.2f}% more transmission error and "
                    "{phi_time:.2f}% more time in the gap; one per cent more k1 means {k1:.2f}% "
                    "and {k1_time:.3f}%. ξ, and K_HD with half its weight, act by C_eq: one "
                    "per cent of ξ changes the widest gap by {xi_gap:.2f}%, the time by "
                    "{xi_time:.2f}% and the transmission error by {xi:.3f}%. The widest gap "
                    "changes most with T_m, by {mean:.2f}%, and with T_am, by {swing:.2f}%; k2 "
                    "changes the transmission error by {k2:.1e}%. What units of energy, time and "
                    "angle fix is met within {balance:.0e}.",
                    {
                        "phi": error["phi"],
                        "phi_time": time["phi"],
                        "k1": error["k1"],
                        "k1_time": time["k1"],
                        "xi_gap": gap["xi"],
                        "xi_time": time["xi"],
                        "xi": error["xi"],
                        "mean": gap["T_m"],
                        "swing": gap["T_am"],
                        "k2": error["k2"],
                        "balance": within(imbalance(), ROUNDING),
                    },
                ),
            ),
            ("sensitivities",),
        ),
    )


def main(into: Output) -> None:
    """Draw the derivatives, one panel for each quantity."""
    sheet = new_figure(FULL, 72 * MM)
    axes = sheet.subplots(1, 3, sharey=True)
    rows = np.arange(len(VALUES))[::-1]
    words = ("widest gap crossed", "time in the gap", "transmission error")
    for ax, letter, name, title, colour in zip(
        axes, "abc", QUANTITIES, words, (BLUE, ORANGE, VERMILION), strict=True
    ):
        styled_axes(ax)
        slopes = np.array([relative()[name][parameter] for parameter in VALUES])
        ax.axvline(0.0, color=GREY, linewidth=0.8)
        ax.barh(rows, slopes, height=0.62, color=colour, zorder=2)
        room = 0.5 * np.ptp(slopes)
        ax.set_xlim(min(slopes.min(), 0.0) - room, max(slopes.max(), 0.0) + room)
        for row, slope in zip(rows, slopes, strict=True):
            ax.annotate(
                f"{slope:.2f}".replace("-", "−") if abs(slope) >= 0.005 else "0.00",
                (slope, row),
                xytext=(3 if slope >= 0 else -3, 0),
                textcoords="offset points",
                ha="left" if slope >= 0 else "right",
                va="center",
                fontsize=SMALL_TEXT,
            )
        ax.set_title(f"({letter}) {title}", loc="left", fontsize=SMALL_TEXT)
        ax.set_xlabel("% per %")
    axes[0].set_yticks(rows, [LABELS[name] for name in VALUES])
    into.save(sheet, "sensitivities")


if __name__ == "__main__":
    main(Output(Path("figures")))
