"""The cases of the source's figures 3 to 5 under both scalings, side by side."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import fastslow as fs
from analyses.output import Output
from analyses.passages import OMEGA, PERIODS, Case, Setting, laid
from fastslow.plot.layout.style import FULL, MM, SMALL_TEXT, TEXT, new_figure, styled_axes
from fastslow.systems.gears import Scaling, gear_scales

#: Gap of figure 5; the source leaves it out.
GAP = 0.25

#: What figures 3, 4 and 5 vary: half-width of the gap; stiffness, N m/rad; torque, N m.
WIDTHS = (0.1, 0.25, 0.5)
STIFFNESSES = (1000, 3000, 7000)
TORQUES = (10, 50, 100)

#: The regime that the source states for a case.
STATED = {
    ("gap_width", 0.1): "bilateral",
    ("gap_width", 0.25): "bilateral",
    ("gap_width", 0.5): "unilateral",
    ("load_amplitude", 10): "bilateral",
    ("load_amplitude", 50): "unilateral",
    ("load_amplitude", 100): "unilateral",
}

#: The gap of figure 4.
NARROW = 0.1

#: Upper limit of the load's frequency in the source, 1 rad/s, in dimensionless units.
FASTEST = gear_scales().time

#: Frequencies that the source allows, from 0.1 rad/s on.
ALLOWED = FASTEST * np.geomspace(0.1, 1.0, 10)


@cache
def gear(scaling: str, omega: float = OMEGA, **values: float) -> fs.Model:
    """The dimensionless gear from physical values, with a dimensionless load frequency."""
    chosen: Scaling = "printed" if scaling == "printed" else "consistent"
    width = {"D": values.pop("D")} if "D" in values else {}
    physical = fs.systems.harmonic_gear_from_physical(chosen, **values)
    return physical.with_parameters(omega=omega, **width)


def settings(figure: str, scaling: str) -> list[Setting]:
    """The three settings of a figure: ``"gap_width"``, ``"stiffness"`` or ``"load_amplitude"``."""
    if figure == "gap_width":
        given = [(D, f"$D = {D}$", {"D": D}) for D in WIDTHS]
    elif figure == "stiffness":
        given = [
            (k1, rf"$k_1 = {k1}\,\mathrm{{N\,m/rad}}$", {"k1": k1, "D": NARROW})
            for k1 in STIFFNESSES
        ]
    else:
        given = [
            (T, rf"$T_\mathrm{{am}} = {T}\,\mathrm{{N\,m}}$", {"T_am": T, "D": GAP})
            for T in TORQUES
        ]
    return [
        Setting(
            f"{figure}_{value}_{scaling}",
            title,
            gear(scaling, **values),
            STATED.get((figure, value), ""),
        )
        for value, title, values in given
    ]


@cache
def laid_cases(figure: str, scaling: str) -> tuple[Case, ...]:
    """The three cases of a figure, each run over three slow periods from rest."""
    return tuple(laid(setting) for setting in settings(figure, scaling))


def extent(case: Case, name: str = "x") -> tuple[float, float]:
    """Lowest and highest value of a column over the last period."""
    end = case.run.span[1]
    return case.run.extremes(name, since=end * (1 - 1 / PERIODS))


def peak_to_peak(case: Case, name: str = "x") -> float:
    """Of a column over the last period."""
    low, high = extent(case, name)
    return high - low


def draw(figure: str, scaling: str, into: Output) -> None:
    """Draw three cases: time series, phase portraits and overlays, one column each."""
    sheet = new_figure(FULL, 154 * MM)
    # the places are known; finding them anew for every panel would take most of the time
    sheet.set_layout_engine("none")
    edges = {"left": 0.095, "right": 0.98, "bottom": 0.155, "top": 0.89}
    ratios = {"height_ratios": [1.0, 1.15, 1.3], "wspace": 0.24, "hspace": 0.42}
    grid = sheet.subplots(3, 3, gridspec_kw={**edges, **ratios})
    overlays = []
    for column, case in enumerate(laid_cases(figure, scaling)):
        axes = [styled_axes(ax) for ax in grid[:, column]]
        values = case.diagram.interface_values
        axes[0].set_title(f"{case.setting.title}\n{case.run.regime}", fontsize=TEXT)
        look: dict[str, Any] = {"crossings": False, "interface_values": values, "legend": False}
        fs.plot.time_series(case.run, "x", ax=axes[0], **look)
        fs.plot.phase_portrait(case.run, ax=axes[1], **look)
        overlay = fs.plot.overlay(case.overlay, ax=axes[2], legend=False)
        assert isinstance(overlay, fs.plot.OverlayDrawing)
        overlays.append(overlay)
        for number, ax in enumerate(axes):
            ax.yaxis.labelpad = 1.0
            if column:
                ax.set_ylabel("")
            ax.set_title(f"({'abcdefghi'[3 * number + column]})", loc="left", fontsize=TEXT)
    # the case with most kinds of marks explains them for all
    sheet.legend(
        handles=max((o.handles for o in overlays), key=len),
        loc="lower center",
        ncols=4,
        fontsize=SMALL_TEXT,
        frameon=False,
    )
    sheet.suptitle(
        rf"{scaling} scaling, $\omega_\mathrm{{o}} = {OMEGA:g}$, {PERIODS} periods from rest",
        fontsize=TEXT,
    )
    into.save(sheet, f"{figure}_{scaling}")


def starts(D: float) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Five starts (x, v): at rest, on either flank, moving up or down."""
    return np.array([[0, 0], [D + 0.5, 0], [-D - 0.5, 0], [0, 1], [0, -1]], dtype=float)


@cache
def scan(scaling: str, periods: int = PERIODS, **values: float) -> fs.Ensemble:
    """Runs over the allowed frequencies of the load and five starts."""
    model = gear(scaling, **values)
    begin = starts(model.parameters["D"])
    rows = np.repeat(np.arange(len(begin)), len(ALLOWED))
    return fs.simulate_many(
        model, begin[rows], parameters={"omega": np.tile(ALLOWED, len(begin))}, periods=periods
    )


def regimes_of(many: fs.Ensemble) -> list[str]:
    """Regimes of all runs."""
    return [str(regime) for regime in many.regime]
