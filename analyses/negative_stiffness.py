"""A gear with A < −D², where the equilibrium curve folds and the trajectory jumps.

Not a case of the source, whose stiffness is positive: there the curve has no
fold. Folds are at x = ±(D + √(D² − 3A))/3; for A = −0.6, D = 0.25 their load is
∓0.0894402097712473. They begin at the corners, where A = −D². A load that swings
beyond both folds makes relaxation oscillations.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import gear
from analyses.claims import Claim, Finding
from analyses.output import Output
from analyses.passages import OMEGA, Case, Setting, draw, laid
from analyses.physical_route import within
from fastslow.plot.layout.style import FULL, MM, SMALL_TEXT, TEXT, new_figure, styled_axes
from fastslow.systems.gears import SCALINGS

Floats = NDArray[np.float64]

STIFFNESS, GAP, SWING = -0.6, 0.25, 0.4

#: The plane in which relaxation oscillations are looked for.
OVER = {"A": (-1.0, -0.2), "C": (0.005, 0.45)}


def settings() -> list[Setting]:
    """One case: the load swings across both folds."""
    gear = fs.systems.harmonic_gear(A=STIFFNESS, B=0.0, C=SWING, D=GAP, omega=OMEGA)
    title = f"$A = {STIFFNESS}$, $D = {GAP}$, $B = 0$, $C = {SWING}$"
    return [Setting("negative_stiffness", title, gear)]


@cache
def case() -> Case:
    """The case: its run and the overlay on its diagram."""
    (setting,) = settings()
    return laid(setting)


@cache
def fold_curves() -> tuple[fs.PointBranch, ...]:
    """The folds over load and stiffness, up to where they meet the interfaces."""
    over = {"w": (-0.3, 0.3), "A": (-1.0, 0.1)}
    return tuple(
        fs.continue_points(fold, ("w", "A"), over=over, virtual=False)
        for fold in case().diagram.folds
    )


def fold_load(A: Floats) -> Floats:
    """The load at the fold x < −D, (x² + A)(x + D) at x = −(D + √(D² − 3A))/3."""
    x = (GAP + np.sqrt(GAP**2 - 3 * A)) / 3
    return np.asarray(-(x * x + A) * (x - GAP))


@cache
def relaxation() -> fs.RefinedMap:
    """Where a load without a mean carries the gear from side to side."""
    model = case().setting.model
    return fs.regime_map(
        model,
        OVER,
        [1.0, 0.0],
        refinement=fs.Refinement(cells=(8, 8), levels=2, resolution=5e-4),
        periods=3,
    )


def onset_at(A: float) -> float:
    """Amplitude at which oscillations begin at one stiffness, in loads of the fold."""
    model = case().setting.model.with_parameters(A=A)
    fold = float(fold_load(np.array([A]))[0])
    low, high = 1.0, 1.1
    # each round divides the interval by nine
    for _ in range(4):
        factors = np.linspace(low, high, 10)
        many = fs.simulate_many(model, [1.5, 0.0], parameters={"C": factors * fold}, periods=3)
        first = int(np.argmax(many.regime == "bilateral"))
        assert first > 0, "the interval holds the onset"
        low, high = factors[first - 1], factors[first]
    return float(high)


def onset() -> tuple[float, float]:
    """Amplitude at which oscillations begin, in loads of the fold: least and most."""
    lines = relaxation().boundary("bilateral", "meshed upper")
    points = np.concatenate([line.points for line in lines])
    far = points[points[:, 0] < STIFFNESS]
    ratios = far[:, 1] / fold_load(far[:, 0])
    return float(ratios.min()), float(ratios.max())


@cache
def claims() -> tuple[Claim, ...]:
    """Where the S-shape and the relaxation oscillations of this genre begin."""
    meets = [point for curve in fold_curves() for point in curve.special("BF")]
    apart = max(
        float(np.abs(np.abs(curve["w"]) - fold_load(curve["A"])).max()) for curve in fold_curves()
    )
    least, most = onset()
    jumps = [t for t in case().overlay.transitions if t.type == "jump"]
    stiff = [-(GAP**2) / gear(scaling).parameters["A"] * 3000.0 for scaling in SCALINGS]
    return (
        Claim(
            "B4",
            "Folds and relaxation oscillations need negative stiffness: A < −D².",
            "The fold continued over load and A, against its closed form; the regime over A and "
            "the amplitude of a load without a mean, −1 ≤ A ≤ −0.2, ω_o = 0.01, D = 0.25.",
            (
                Finding(
                    "either",
                    "beyond the paper",
                    "The fold meets the corner at A = {meet:.6f} = −D², which is k1 = {soft:.3g} "
                    "(consistent) or {hard:.2g} N m/rad (printed) at D = 0.25; the cases have "
                    "1000 or more. It is the closed form within {apart:.0e}. For −1 ≤ A < −0.6, "
                    "the range scanned, the gear jumps from side to side when the load swings "
                    "{least:.2f} to {most:.2f} times as far as the fold; at A = −1.5 {beyond:.3f} "
                    "times. In the case drawn it jumps {jumps:.0f} times in three periods.",
                    {
                        "meet": meets[0]["A"],
                        "soft": stiff[0],
                        "hard": stiff[1],
                        "apart": within(apart),
                        "least": least,
                        "most": most,
                        "beyond": onset_at(-1.5),
                        "jumps": len(jumps),
                    },
                ),
            ),
            ("negative_stiffness", "relaxation"),
        ),
    )


def draw_plane(into: Output) -> None:
    """Draw the folds over load and stiffness, and where relaxation oscillations begin."""
    sheet = new_figure(FULL, 72 * MM)
    left, right = (styled_axes(ax) for ax in sheet.subplots(1, 2))
    fs.plot.parameter_plane(*fold_curves(), ax=left, legend=False)
    left.annotate(
        "three equilibria", (0.5, 0.3), xycoords="axes fraction", fontsize=SMALL_TEXT, ha="center"
    )
    left.annotate("fold", (0.24, 0.42), xycoords="axes fraction", fontsize=SMALL_TEXT, ha="right")
    left.annotate("fold", (0.76, 0.42), xycoords="axes fraction", fontsize=SMALL_TEXT)
    left.set_title("(a)", loc="left", fontsize=TEXT)
    A = np.linspace(*OVER["A"], 200)
    curves = {"load of the fold": (A, fold_load(A))}
    marks = {"case drawn": (STIFFNESS, SWING)}
    fs.plot.regime_map(relaxation(), ax=right, curves=curves, annotate=marks, legend=False)
    right.annotate(
        "load of the fold",
        (A[70], float(fold_load(A[70:71])[0])),
        xytext=(24, 26),
        textcoords="offset points",
        arrowprops={"arrowstyle": "-", "linewidth": 0.6},
        fontsize=SMALL_TEXT,
    )
    right.set_title("(b)", loc="left", fontsize=TEXT)
    into.save(sheet, "relaxation")


def main(into: Output) -> None:
    """Draw the figures."""
    drawing = draw(case())
    into.save(drawing.figure, "negative_stiffness", 300)
    draw_plane(into)


if __name__ == "__main__":
    main(Output(Path("figures")))
