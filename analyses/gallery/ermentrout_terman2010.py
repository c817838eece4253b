"""Square-wave bursting of the Morris-Lecar model, read from a file of XPPAUT."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import fastslow as fs
from analyses.claims import Claim, Finding, Quantity
from analyses.gallery import About

#: The file, of our own writing, from the equations of the source.
FILE = Path(__file__).with_suffix(".ode")

ABOUT = About(
    title="Ermentrout, Terman: square-wave bursting, from an .ode file to the overlay",
    why="Many models of bursting cells are published as files of XPPAUT. This one is read from "
    "its file and analysed in one call each. Which bifurcations of the fast subsystem begin and "
    "end a burst, and on which slow quantity do they depend?",
    equations=r"""\begin{align*}
  & C \dot{v} = I - g_{Ca} m_\infty(v) (v - V_{Ca}) - g_K w (v - V_K) - g_L (v - V_L)
    - g_{KCa} \frac{Ca}{Ca + 1} (v - V_K) \\
  & \dot{w} = \phi \cosh\left(\frac{v - V_3}{2 V_4}\right) (w_\infty(v) - w) \\
  & \dot{Ca} = \epsilon \left(-\mu g_{Ca} m_\infty(v) (v - V_{Ca}) - Ca\right) \\
  & m_\infty(v) = \tfrac{1}{2} \left(1 + \tanh\frac{v - V_1}{V_2}\right), \quad
    w_\infty(v) = \tfrac{1}{2} \left(1 + \tanh\frac{v - V_3}{V_4}\right)
\end{align*}""",
    source="G. B. Ermentrout and D. H. Terman, Mathematical Foundations of Neuroscience, "
    "Springer 2010, chapter 5; the model is that of J. Rinzel and G. B. Ermentrout, Analysis of "
    "neural excitability and oscillations, in Methods in Neuronal Modeling, 2nd edition, MIT Press "
    "1998",
    field="neuroscience",
    phenomena=(
        "square-wave bursting",
        "fold",
        "Hopf bifurcation",
        "fold of cycles",
        "homoclinic orbit",
        "model read from a file",
    ),
    slow="The calcium $ca$, with $\\epsilon = 0.001$ per ms: `fs.analyse` proposes it, because it "
    "is 24 times as slow as $v$ along the run. Voltages in mV, times in ms.",
    caption="(a) Voltage, three bursts. (b) The bursts over the frozen model: equilibria, and the "
    "envelope of the cycles from HB1 through LPC1 to the homoclinic orbit HC1. A burst begins at "
    "LP1 and ends near HC1.",
    compared="The axes are those in which the literature explains square-wave bursting. The figure "
    "of the source was not at hand.",
    unsaid=(
        "The values of the parameters are those that a public program quotes from page 115 of the "
        "book; the book itself was not at hand.",
        "The initial states; here $v = -26$, $w = 0.1$, $ca = 0.8$.",
    ),
)


def model() -> fs.Model:
    """Read the model, with calcium as slow state."""
    return fs.read(FILE).model.with_slow(["ca"])


def figure() -> fs.plot.Drawing:
    """Read the file, analyse it, and draw the bursts over time and over the frozen model."""
    found = fs.analyse(fs.read(FILE))
    time, plane = fs.plot.axes("ab", height=84)
    fs.plot.time_series(found.run, "v", ax=time, label=False)
    time.set(xlabel="$t$ (ms)", ylabel="$v$ (mV)")
    drawn = found.plot("v", ax=plane)
    plane.set(xlabel="$ca$", ylabel="$v$ (mV)")
    return drawn


@cache
def claims() -> tuple[Claim, ...]:
    """The points that begin and end a burst, and its type."""
    found = fs.analyse(fs.read(FILE))
    diagram, overlay = found.diagram, found.overlay
    assert diagram is not None
    assert overlay is not None
    (fold,), (hopf,) = diagram.folds, diagram.special("HB")
    (cycles,) = found.cycles
    (homoclinic,) = cycles.special("HC")
    onset = overlay.transitions.select(type="jump")[0]
    end = overlay.transitions.select(type="end of oscillation")[0]
    exact = "mpmath, 30 digits, on the closed equilibrium curve $ca(v)$"
    return (
        Claim(
            "1",
            "A burst begins at the fold of the frozen equilibria and ends at a homoclinic orbit of "
            "the frozen cycle.",
            "The analysis of the file: equilibria and cycles over $ca$, with the bursts.",
            (
                Finding(
                    "either",
                    "holds",
                    "The bursts begin {delay:.4f} behind the fold and end {end:.4f} before the "
                    "homoclinic orbit, measured in $ca$.",
                    {"delay": onset.delay, "end": -end.delay},
                ),
            ),
            quantities=(
                Quantity("fold, $ca$", fold["ca"], "0.5801660281047", exact),
                Quantity("fold, $v$", fold["v"], "-28.8646228353770", exact),
                Quantity(
                    "homoclinic orbit, $ca$",
                    homoclinic["ca"],
                    "1.7846813393",
                    "SciPy, DOP853, manifolds of the saddle at $v = 0$, Brent's method",
                ),
                Quantity(
                    "type",
                    str(overlay.bursting),
                    "fold/homoclinic bursting",
                    "square-wave bursting in the classification of Izhikevich (2000)",
                ),
            ),
        ),
        Claim(
            "2",
            "The cycles emanate from a Hopf point of the upper branch.",
            "The Hopf point of the frozen model.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "It is {kind}: the cycles become stable at a fold of cycles at "
                    "$ca = {lpc:.4f}$.",
                    {"kind": hopf.criticality, "lpc": cycles.special("LPC")[0]["ca"]},
                ),
            ),
            quantities=(
                Quantity("Hopf, $ca$", hopf["ca"], "0.926823147007", exact),
                Quantity("Hopf, $v$", hopf["v"], "4.250684984624", exact),
            ),
        ),
    )
