"""The dead zone of the gear (Fig. 1 of the source): what the teeth transmit over the twist."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import sympy as sp
from numpy.typing import NDArray

import fastslow as fs
from analyses.claims import Claim, Finding
from analyses.output import Output
from fastslow.plot.layout.bands import draw_bands
from fastslow.plot.layout.style import BRANCH, LINES, axes_for
from fastslow.plot.layout.typesetting import typeset

GAP = 0.25


def transmitted(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """The dead-zone function f(x), read off the gear's own equations.

    The equation is v' = w − v − (x² + A) f(x), so that f is what is left of v'
    at w = v = 0, divided by −(x² + A).
    """
    gear = fs.systems.harmonic_gear(D=GAP)
    at = {"w": 0, "v": 0, **gear.parameters}
    values = np.empty_like(x)
    where = regions_of(x)
    for name in gear.regions:
        inside = where == name
        rate = (
            gear.regions[name].rates["v"].subs({sp.Symbol(k, real=True): v for k, v in at.items()})
        )
        values[inside] = sp.lambdify(sp.Symbol("x", real=True), rate)(x[inside])
    return -values / (x**2 + gear.parameters["A"])


def regions_of(x: NDArray[np.float64]) -> NDArray[np.str_]:
    """The region of each twist; the interfaces count to the gap."""
    return np.where(x > GAP, "S1", np.where(x < -GAP, "S3", "S2"))


def draw() -> fs.plot.Drawing:
    """The dead zone, one column wide."""
    x = np.linspace(-1, 1, 401)
    ax = axes_for(None)
    ax.plot(x, transmitted(x), color=BRANCH, **LINES["stable"])
    ax.set_xlim(-1, 1)
    ax.set_xticks([-1, -GAP, 0, GAP, 1], ["−1", "$-D$", "0", "$D$", "1"])
    ax.set_xlabel(typeset("x"))
    ax.set_ylabel("$f(x)$")
    values = {"x - D": ("x", GAP), "x + D": ("x", -GAP)}
    draw_bands(ax, "x", values, x, regions_of(x), vertical=True)
    return fs.plot.Drawing(ax)


@cache
def claims() -> tuple[Claim, ...]:
    """Figure 1 and equation (1)."""
    left, middle, right = transmitted(np.array([-1.0, 0.0, 1.0]))
    odd = left == -right and middle == 0.0
    return (
        Claim(
            "1",
            "Figure 1 and (1): the teeth transmit θ − φ, 0 in the gap, θ + φ.",
            "f(x), read off the equations of the gear at D = 0.25.",
            (
                Finding(
                    "either",
                    "holds" if odd else "does not hold",
                    "f(−1) = {left:.2f}, f(0) = {middle:.0f}, f(1) = {right:.2f}, once the third "
                    'condition is read as θ < −φ; as printed, "θ < φ", f would have two values '
                    "up to 2φ apart on the gap.",
                    {"left": float(left), "middle": abs(float(middle)), "right": float(right)},
                ),
            ),
            ("dead_zone",),
        ),
        Claim(
            "1b",
            'The "two interfaces" divide the system "into three subregions S1, S2 and S3".',
            "Interfaces and regions, read off the equations.",
            (_regions(),),
            ("dead_zone",),
        ),
    )


def _regions() -> Finding:
    gear = fs.systems.harmonic_gear(D=GAP)
    counts = {"interfaces": len(gear.interfaces), "regions": len(gear.regions)}
    return Finding(
        "either",
        "holds" if counts == {"interfaces": 2, "regions": 3} else "does not hold",
        "{interfaces} interfaces, x = D and x = −D, and {regions} regions: S1 is x > D, S2 the "
        "gap, S3 x < −D.",
        counts,
    )


def main(into: Output) -> dict[str, float]:
    """Draw the dead zone and return f at −1, 0 and 1."""
    drawing = draw()
    into.save(drawing.figure, "dead_zone")
    at = np.array([-1.0, 0.0, 1.0])
    return {f"f({x:g})": float(f) for x, f in zip(at, transmitted(at), strict=True)}


if __name__ == "__main__":
    print(main(Output(Path("figures"))))
