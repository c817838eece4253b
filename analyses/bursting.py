"""Bursts of a neuron over the cycles of its frozen model, which end at a homoclinic orbit.

Not in the source. The neuron is that of Hindmarsh and Rose (1984); its bursting is fold/homoclinic
(Izhikevich 2000). The homoclinic orbit is computed a second time from the gap between the manifolds
of the saddle, with SciPy.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.physical_route import within
from fastslow.plot.layout.style import (
    BLACK,
    CYCLES,
    FULL,
    MM,
    SMALL_TEXT,
    TEXT,
    new_figure,
    styled_axes,
)
from fastslow.plot.passages import OverlayDrawing

Floats = NDArray[np.float64]

#: Ratio of the time scales, length of the run, and the range of the slow state.
RATE, LENGTH, RANGE = 0.001, 1400.0, (-12.0, 4.0)

#: Distance from the saddle at which the manifolds are compared.
NEAR = 1e-6


@cache
def diagram() -> fs.Diagram:
    """Equilibria of the frozen neuron."""
    return fs.continue_equilibria(fs.systems.hindmarsh_rose(r=RATE).frozen(), "z", over=RANGE)


@cache
def spiking() -> fs.OrbitBranch:
    """The cycles on which the neuron spikes, from HB1."""
    return fs.continue_cycles(diagram())[0]


@cache
def burst() -> fs.Overlay:
    """Several bursts over the diagram and its cycles."""
    run = fs.simulate(fs.systems.hindmarsh_rose(r=RATE), [-1.5, -10.0, 1.9], t=(0.0, LENGTH))
    return fs.overlay(diagram(), run, cycles=spiking())


def gap(z: float) -> float:
    """Distance, across the stable manifold, at which the unstable one returns to the saddle."""

    def rates(_: float, s: Floats) -> list[float]:
        return [s[1] - s[0] ** 3 + 3 * s[0] ** 2 - z + 2, 1 - 5 * s[0] ** 2 - s[1]]

    x = float(np.sort(np.roots([1, 2, 0, z - 3]).real)[1])
    rest = np.array([x, 1 - 5 * x**2])
    values, vectors = np.linalg.eig([[-3 * x**2 + 6 * x, 1], [-10 * x, -1]])
    stable, unstable = np.linalg.inv(vectors)[np.argsort(values)]
    way = vectors[:, np.argmax(values)]

    def back(_: float, s: Floats) -> float:
        return abs(float(stable @ (s - rest))) - NEAR

    back.terminal, back.direction = True, -1  # type: ignore[attr-defined]
    start = rest + NEAR * way * np.sign(way[0])
    run = solve_ivp(rates, (0, 400), start, "DOP853", events=back, rtol=1e-13, atol=1e-15)
    return float(unstable @ (run.y_events[0][0] - rest))


@cache
def checked() -> float:
    """The homoclinic orbit's value of z, from the gap."""
    return float(brentq(gap, 2.0855, 2.0857, xtol=1e-14))


@cache
def growth() -> tuple[float, float]:
    """Growth of the period with −ln(z* − z) along the last cycles, and 1/λ of the saddle."""
    point = spiking()["HC1"]
    x = point.saddle[0]
    rate = float(np.linalg.eigvals([[-3 * x**2 + 6 * x, 1], [-10 * x, -1]]).max())
    away, period = point["z"] - spiking().values[-3:-1], spiking().period[-3:-1]
    return float(-np.diff(period)[0] / np.diff(np.log(away))[0]), 1.0 / rate


@cache
def claims() -> tuple[Claim, ...]:
    """The end of the cycles, and the ends of the bursts beside it."""
    point = spiking()["HC1"]
    ends = burst().transitions.select(type="end of oscillation")
    slope, expected = growth()
    return (
        Claim(
            "B9",
            "The spiking of a bursting neuron ends at a homoclinic orbit of its frozen cycles.",
            "Cycles of the Hindmarsh-Rose model from its Hopf point at z = −9.59 to the homoclinic "
            "orbit of a saddle, beside the gap between the manifolds of the saddle by SciPy; a run "
            "with r = 0.001 over them.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The cycles end at z = {value:.12f}, the gap vanishes there within "
                    "{apart:.0e}; "
                    "the saddle quantity is {quantity:.6f}, so that they are stable. Near it their "
                    "period grows by {slope:.3f} where the distance decreases by the factor e, "
                    "in the limit by 1/λ = {expected:.3f} of the saddle. The last spikes of "
                    "{count:.0f} bursts have their maxima at most {past:.4f} from there.",
                    {
                        "value": point["z"],
                        "apart": within(abs(point["z"] - checked())),
                        "quantity": point.saddle_quantity,
                        "slope": slope,
                        "expected": expected,
                        "count": len(ends),
                        "past": max(abs(end.delay) for end in ends),
                    },
                ),
            ),
            ("bursting",),
        ),
    )


def main(into: Output) -> None:
    """Draw the bursts over the envelope of the cycles, and the growth of the period."""
    sheet = new_figure(FULL, 88 * MM)
    left, right = (styled_axes(ax) for ax in sheet.subplots(1, 2))
    drawn = fs.plot.overlay(burst(), ax=left, legend=False)
    assert isinstance(drawn, OverlayDrawing)
    left.set_xlim(1.6, 2.4)
    left.set_ylim(-2.0, 2.2)
    point, cycles = spiking()["HC1"], spiking()
    away = point["z"] - cycles.values[:-1]
    right.semilogx(away, cycles.period[:-1], color=CYCLES, linewidth=1.5, label="cycles")
    near = np.array([away.min(), 0.2])
    line = cycles.period[-2] - growth()[1] * np.log(near / away[-1])
    right.semilogx(near, line, "--", color=BLACK, linewidth=0.9, label=r"slope $1/\lambda$")
    right.set_xlabel(r"$z^* - z$", fontsize=TEXT)
    right.set_ylabel("period", fontsize=TEXT)
    right.legend(fontsize=SMALL_TEXT, frameon=False)
    for name, ax in zip("ab", (left, right), strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    shown = [one for one in drawn.handles if one.get_label() != "HB Hopf"]
    sheet.legend(
        handles=shown, loc="outside lower center", ncols=5, fontsize=SMALL_TEXT, frameon=False
    )
    into.save(sheet, "bursting")


if __name__ == "__main__":
    main(Output(Path("figures")))
