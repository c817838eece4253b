"""Voltage collapse of a small power system under a growing reactive demand."""

from __future__ import annotations

from functools import cache

import sympy as sp

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

ABOUT = About(
    title="Dobson, Chiang: voltage collapse of a power system",
    why="Power systems have collapsed when the demand grew. At which demand does the equilibrium "
    "of the network disappear, and which oscillations occur before?",
    source="I. Dobson and H.-D. Chiang, Towards a theory of voltage collapse in electric power "
    "systems, Systems & Control Letters 13, 253-262, 1989; H. O. Wang, E. H. Abed and "
    "A. M. A. Hamdan, Bifurcations, chaos, and crises in voltage collapse of a model power "
    "system, IEEE Transactions on Circuits and Systems I 41(4), 294-302, 1994",
    field="power systems",
    phenomena=(
        "Hopf bifurcation",
        "fold",
        "fold of cycles",
        "period doubling",
        "angles as periodic states",
    ),
    slow="The reactive demand $Q_1$ of the load; here it is a parameter.",
    caption="Voltage of the load over its reactive demand: equilibria, and the envelope of the "
    "cycles that connect the two Hopf points. The voltage collapses at LP1.",
    compared="The axes, voltage of the load over its demand, are those of Wang, Abed and Hamdan "
    "and of R. Seydel's collection (bifurcation.de, example 15, Fig. 1), which show all "
    "equilibria and some cycles. Here the envelope of the cycles is drawn; the cascades of "
    "doubled cycles and the chaos are not.",
    unsaid=(
        "The coefficients of the reduced equations, here to five decimals; they reproduce the "
        "three published numbers.",
        "What a demand that grows at a finite rate does: the collapse is then later than the fold.",
    ),
)


def model() -> fs.Model:
    """Angles of generator and load, and the voltage of the load."""
    V, d, dm, w, Q = sp.symbols("V delta delta_m omega Q_1")
    power = 16.66667 * sp.sin(d - dm + 0.08727) * V - 0.16667 * w + 1.88074
    generator, network = sp.cos(d - dm - 0.08727) * V, sp.cos(d - 0.20944) * V
    angle = 496.87181 * V**2 - 166.66667 * generator - 666.66667 * network - 93.33333 * V
    near, far = sp.cos(d - dm - 0.01241) * V, sp.cos(d - 0.13458) * V
    voltage = -78.76384 * V**2 + 26.21722 * near + 104.86887 * far + 14.52288 * V
    return fs.Model(
        {
            dm: w,
            w: power,
            d: angle + 33.33333 * Q + 43.33333,
            V: voltage - 5.22876 * Q - 7.03268,
        },
        parameters={Q: 11.3},
        periodic={d: 2 * sp.pi, dm: 2 * sp.pi},
    )


def figure() -> fs.plot.Drawing:
    """Draw equilibria over the demand, and the cycles from one Hopf point to the other."""
    free, window = model().with_free("Q_1"), {"V": (0.5, 1.5)}
    diagram = fs.continue_equilibria(free, "Q_1", over=(10.5, 11.5), window=window)
    return fs.plot.diagram(diagram, "V", cycles=fs.continue_cycles(diagram), width=130)


@cache
def claims() -> tuple[Claim, ...]:
    """Hopf points and the fold, and the cycles between the Hopf points."""
    free = model().with_free("Q_1")
    diagram = fs.continue_equilibria(free, "Q_1", over=(10.5, 11.5), window={"V": (0.5, 1.5)})
    low, high = sorted(diagram.special("HB"), key=lambda point: point["Q_1"])
    (fold,) = diagram.folds
    (cycles,) = fs.continue_cycles(diagram)
    (turn,), (first, second) = cycles.special("LPC"), cycles.special("PD")
    exact = "mpmath"
    shot = "SciPy, shooting with DOP853, rtol 3e-13"
    return (
        Claim(
            "1",
            "As the demand grows, a subcritical Hopf bifurcation destabilises the operating point, "
            "a supercritical one restores it, and a fold ends it: the voltage collapses.",
            "Equilibria over the demand, with both angles as periodic states.",
            (
                Finding(
                    "either",
                    "holds",
                    "The Hopf points are {low} and {high}.",
                    {"low": low.criticality, "high": high.criticality},
                ),
            ),
            quantities=(
                Quantity("first Hopf point, $Q_1$", low["Q_1"], "10.946056169418", exact, "10.946"),
                Quantity(r"its $\delta_m$", low["delta_m"], "0.31009346310363", exact),
                Quantity(r"its $\delta$", low["delta"], "0.12004840133322", exact),
                Quantity("its $V$", low["V"], "1.0999096249621", exact),
                Quantity(
                    "second Hopf point, $Q_1$", high["Q_1"], "11.406747558842", exact, "11.407"
                ),
                Quantity(r"its $\delta_m$", high["delta_m"], "0.34347598349811", exact),
                Quantity(r"its $\delta$", high["delta"], "0.1361963688254", exact),
                Quantity("its $V$", high["V"], "0.9425553400216", exact),
                Quantity("fold, $Q_1$", fold["Q_1"], "11.411446912580", exact, "11.411"),
                Quantity("its $V$", fold["V"], "0.92496923075456", exact),
            ),
        ),
        Claim(
            "2",
            "One branch of cycles connects the Hopf points; its cycles are stable beside the "
            "second one, and between a fold and a period doubling beside the first one.",
            "The cycles, traced from the first Hopf point.",
            (
                Finding(
                    "either",
                    "holds",
                    "The end of the branch: {end} The cycles are stable in {count} intervals.",
                    {"end": cycles.outcome, "count": len(cycles.stable_intervals())},
                ),
            ),
            quantities=(
                Quantity("fold of cycles, $Q_1$", turn["Q_1"], "10.8176217161", shot),
                Quantity("its period", turn.orbit.period, "1.7749075886", shot),
                Quantity("period doubling, $Q_1$", first["Q_1"], "10.8729097082", shot),
                Quantity("its period", first.orbit.period, "1.8226249001", shot),
                Quantity("second period doubling, $Q_1$", second["Q_1"], "11.3879416367", shot),
                Quantity("its period", second.orbit.period, "2.1233621023", shot),
            ),
        ),
    )
