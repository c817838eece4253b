"""Canards, and what replaces them at corners: explosions, folded nodes, freezing of the gear.

Not in the source. The smooth oscillators, Koper's model and the one with corners are those of the
gallery; the last panel returns to the gear.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import sympy as sp
from matplotlib.axes import Axes
from numpy.typing import NDArray

import fastslow as fs
from analyses.cases import gear
from analyses.claims import Claim, Finding
from analyses.gallery import desroches_freire_hogan_ponce_thota2013 as corners
from analyses.gallery import koper1995, krupa_szmolyan2001
from analyses.output import Output
from analyses.physical_route import within
from fastslow.plot.layout.style import (
    BLACK,
    BLUE,
    CYCLES,
    FULL,
    GREEN,
    GREY,
    MM,
    SMALL_TEXT,
    TEXT,
    VERMILION,
    new_figure,
    styled_axes,
)
from fastslow.results.overlay.freezing import Freezing
from fastslow.symbolic.folded_points import FoldedPoint

Floats = NDArray[np.float64]

#: Ratio of the rates of both explosions, and those at which the series is tested.
EPSILON, SMALLER = 0.05, (0.02, 0.01)

#: Ranges of the parameters of the explosions, and the heights at which they begin.
FORCES, CURRENTS = (0.985, 1.0), (0.308, 0.32)
LOW, HIGH = {"y": -0.5}, {"w": -0.2}

#: Amplitudes of the forcing, and the range of its frequency.
AMPLITUDES, FREQUENCIES = (1.003, 1.05, 1.5), (0.005, 0.2)

#: Ratio of the rates at which the canards of Koper's model are computed, and those of the runs.
SEPARATED, RUNS = 0.001, (0.1, 0.01, 0.001)

#: Values of a, the inner slopes, and the one from which the rates of both sides are separated.
SMALL, SLOPES, SEPARATING = (1e-2, 1e-3, 1e-4), (0.05, 0.4), 0.2

#: Half-width of the gap, and frequency of the load.
GAP, LOAD = 0.25, 0.1


def series(epsilon: float) -> float:
    """The value of the maximal canard of van der Pol's oscillator (Zvonkin and Shubin 1984)."""
    return 1 - epsilon / 8 - 3 * epsilon**2 / 32 - 173 * epsilon**3 / 1024


@cache
def force(epsilon: float) -> fs.Canard:
    """The maximal canard of van der Pol's oscillator."""
    model = krupa_szmolyan2001.model().with_parameters(epsilon=epsilon)
    return krupa_szmolyan2001.canard_of(model, "a")[0]


@cache
def current() -> fs.Canard:
    """The maximal canard of the FitzHugh-Nagumo model."""
    return krupa_szmolyan2001.canard_of(_neuron(), "I")[0]


def _neuron() -> fs.Model:
    return krupa_szmolyan2001.neuron().with_parameters(epsilon=EPSILON)


def hopf_current() -> float:
    """The current of the Hopf point: (1 − v²)/ε = 0.8 at the equilibrium w = (v + 0.7)/0.8."""
    v = -np.sqrt(1 - 0.8 * EPSILON)
    return float((v + 0.7) / 0.8 - v + v**3 / 3)


@cache
def explosions() -> tuple[fs.OrbitBranch, fs.OrbitBranch]:
    """The cycles of van der Pol's oscillator over its force, and of the neuron over its current."""
    smooth = krupa_szmolyan2001.model().with_parameters(epsilon=EPSILON)
    first = fs.find_orbit(smooth, force(EPSILON), at=LOW)
    other = fs.find_orbit(_neuron(), current(), at=HIGH)
    return (
        fs.continue_orbits(first, "a", over=FORCES),
        fs.continue_orbits(other, "I", over=CURRENTS),
    )


def _forced_node(amplitude: float) -> FoldedPoint:
    """The folded node of forced van der Pol at x = 1 and the frequency 0.01."""
    x, y, t, a, w, epsilon = sp.symbols("x y t a omega epsilon")
    model = fs.Model(
        {x: (y - x**3 / 3 + x) / epsilon},
        slow={y: a * sp.sin(2 * sp.pi * w * t) - x},
        parameters={a: amplitude, w: 0.01, epsilon: 0.01},
    )
    return next(p for p in fs.slow_flow(model).points if p.code == "FN" and p.values["x"] > 0)


@cache
def folded() -> tuple[fs.PointBranch, ...]:
    """The folded nodes of forced van der Pol over the frequency, for each amplitude."""
    return tuple(fs.continue_points(_forced_node(a), "omega", FREQUENCIES) for a in AMPLITUDES)


def meeting() -> float:
    """The amplitude at which the node meets a saddle."""
    (point,) = fs.continue_points(_forced_node(AMPLITUDES[1]), "a", (0.9, 1.2)).special("FSN1")
    return float(point["a"])


def node_ratio(frequency: Floats, amplitude: float) -> Floats:
    """μ from λ² + λ + 4πω(a² − 1)^(1/2) = 0, NaN at a focus."""
    inside = 1 - 16 * np.pi * frequency * np.sqrt(amplitude**2 - 1)
    root = np.sqrt(np.where(inside >= 0, inside, np.nan))
    return np.asarray((1 - root) / (1 + root))


def ratios(curve: fs.PointBranch) -> Floats:
    """μ of the computed eigenvalues, NaN at a focus."""
    sizes = np.sort(np.abs(curve.eigenvalues), axis=1)
    return np.where(curve.codes == "FN", sizes[:, 0] / sizes[:, 1], np.nan)


@cache
def canards() -> fs.Canards:
    """The canards of Koper's folded node."""
    model = koper1995.model().with_parameters(epsilon_1=SEPARATED)
    node = next(p for p in fs.slow_flow(model).points if p.code == "FN")
    return fs.find_canards(model, node)


def small_oscillations() -> list[int]:
    """The numbers of small oscillations of the runs, over one period of each pattern."""
    found = []
    for epsilon in RUNS:
        model = koper1995.model().with_parameters(epsilon_1=epsilon)
        run = fs.simulate(model, [-1, -0.9, -0.8], t=(0, 200 if epsilon == 0.1 else 40))
        found += [small for _, small in run.mixed_mode().blocks]
    return found


def corner_cycle(a: float, s: float = 0.1) -> fs.Orbit:
    """The cycle at the corner on which a run settles."""
    model = corners.model().with_parameters(a=a, s=s)
    return fs.find_orbit(model, fs.simulate(model, [0, 0], t=(0, 20)).final_state)


@cache
def cornered(a: float) -> fs.OrbitBranch:
    """The cycle at the corner over the inner slope."""
    return fs.continue_orbits(corner_cycle(a), "s", over=SLOPES)


def extent(branch: fs.OrbitBranch, name: str) -> Floats:
    """By how much a state changes along each cycle."""
    return np.asarray(branch[f"max({name})"] - branch[f"min({name})"])


@cache
def passage() -> fs.Overlay:
    """The gear under a load that is not very slow, over its equilibria, from the slow manifold."""
    model = gear("consistent", omega=LOAD, D=GAP)
    p = model.parameters
    diagram = fs.continue_equilibria(model.frozen(), "w", over=(-3, 6))
    (start,) = diagram.at(w=p["B"])
    stiff, speed = stiffness(start["x"]), LOAD * p["C"]
    state = [start["x"] - speed / stiff**2, speed / stiff]
    return fs.overlay(diagram, fs.simulate(model, state, periods=1))


def stiffness(x: Floats | float) -> Floats | float:
    """Derivative of (x² + A)(x − D), in contact on the upper side."""
    return 3 * x**2 - 2 * GAP * x + gear("consistent").parameters["A"]


def lag(band: Freezing) -> Floats:
    """x₁ in contact in closed form, −w'/(3x² − 2D|x| + A)²."""
    p = gear("consistent").parameters
    speed = LOAD * p["C"] * np.cos(LOAD * band.t)
    return np.asarray(-speed / stiffness(np.abs(band.equilibrium[:, 0])) ** 2)


@cache
def claims() -> tuple[Claim, ...]:
    """Values of canards, folded points, cycles at corners, and the band of the gear."""
    return _explosions(), _nodes(), _corners(), _freezing()


def _explosions() -> Claim:
    wide, small = ((force(e).value - series(e)) / e**4 for e in SMALLER)
    cycles, spikes = explosions()
    (fold,) = spikes.special("LPC")
    exploded = (extent(cycles, "x") > 2.0) & (extent(cycles, "x") < 3.5)
    beside = cycles.values - force(EPSILON).value
    return Claim(
        "B19",
        "Cycles explode at the value at which the slow manifolds meet.",
        "Maximal canards by two-sided shooting, and branches of cycles, of "
        "ε x' = y − x³/3 + x, y' = a − x, and of ε v' = v − v³/3 − w + I, w' = v + 0.7 − 0.8w.",
        (
            Finding(
                "either",
                "beyond the paper",
                "At ε = 0.05 the manifolds of the first meet at a = {force:.10f}, the series "
                "1 − ε/8 − 3ε²/32 − 173ε³/1024 has {series:.10f}; what it leaves, over ε⁴, is "
                "{wide:.3f} at ε = 0.02 and {small:.3f} at ε = 0.01. Cycles of all extents in x "
                "from 2 to 3.5 are within {near:.0e} of this a; at a = 0.985 it is {most:.3f}. The "
                "manifolds of the second meet at I = {current:.12f}; its cycles fold at "
                "I = {fold:.12f}, and are unstable from there to the Hopf point at {hopf:.10f}.",
                {
                    "force": force(EPSILON).value,
                    "series": series(EPSILON),
                    "wide": wide,
                    "small": small,
                    "near": within(float(np.abs(beside[exploded]).max()), 1e-9),
                    "most": float(extent(cycles, "x").max()),
                    "current": current().value,
                    "fold": fold["I"],
                    "hopf": hopf_current(),
                },
            ),
        ),
        ("canards",),
    )


def _nodes() -> Claim:
    apart = [
        np.nanmax(np.abs(ratios(c) - node_ratio(c["omega"], a)))
        for c, a in zip(folded(), AMPLITUDES, strict=True)
    ]
    counts = small_oscillations()
    return Claim(
        "B20",
        "The ratio μ of a folded node bounds the number of small oscillations from above.",
        "Folded points of ε x' = y − x³/3 + x, y' = a sin 2πωt − x, over ω for three a, beside "
        "λ² + λ − 4πωa cos 2πωt = 0 with a sin 2πωt = 1; canards and runs of Koper's model.",
        (
            Finding(
                "either",
                "beyond the paper",
                "The nodes of forced van der Pol have the μ of the closed form within {apart:.0e}, "
                "and meet saddles at a = {meet:.10f} (FSN1). Koper's node at λ = 7 has "
                "μ = {ratio:.10f}, so that there are up to 7 small oscillations and 8 canards; "
                "{canards} are found at ε = 0.001. Runs at ε = 0.1, 0.01 and 0.001 have {fewest} "
                "to {most} small oscillations after a large one.",
                {
                    "apart": within(float(max(apart)), 1e-12),
                    "meet": meeting(),
                    "ratio": canards().ratio,
                    "canards": len(canards()),
                    "fewest": min(counts),
                    "most": max(counts),
                },
            ),
        ),
        ("canards",),
    )


def _corners() -> Claim:
    touched = [cornered(a).special("GR")[0]["s"] for a in SMALL]
    sizes = [_extent_at(a, 0.1) for a in SMALL]
    whole = [_extent_at(a, 0.3) for a in SMALL]
    return Claim(
        "B21",
        "At a corner the full cycle appears at once, or the cycle grows in proportion.",
        "Cycles over the inner slope s of an oscillator with corners at x = 0 and 1, "
        "ε x' = y + F(x), y' = a − x, ε = 0.01, F with the slopes −1, s and −1.",
        (
            Finding(
                "either",
                "beyond the paper",
                "For s = 0.1 the extent of the cycle is {one:.9f} at a = 0.001, and "
                "{ratio:.9f} of that at a = 0.01; for s = 0.3 it is {full:.4f}, and {same:.4f} of "
                "that at a = 0.01. The cycle reaches the other corner from s = {first:.6f} at "
                "a = 0.01, from {second:.6f} at 0.001 and from {third:.6f} at 0.0001, on the way "
                "to 2√ε = 0.2, from which the rates of both sides are separated.",
                {
                    "one": sizes[1],
                    "ratio": sizes[1] / sizes[0],
                    "full": whole[1],
                    "same": whole[1] / whole[0],
                    "first": touched[0],
                    "second": touched[1],
                    "third": touched[2],
                },
            ),
        ),
        ("canards",),
    )


def _extent_at(a: float, s: float) -> float:
    orbit = corner_cycle(a, s)
    return float(orbit["max(x)"] - orbit["min(x)"])


def _freezing() -> Claim:
    band = passage().freezing
    exact = lag(band)[band.known]
    ends = passage().diagram.special("BE")
    separated = passage().run.crossings[0].time
    settled = band.known & (band.t > 10) & (band.t < separated)
    rest = band.state - band.equilibrium - band.lag - band.second
    error = np.abs(rest[settled, 0]) / np.abs(band.second[settled, 0]).max()
    return Claim(
        "B22",
        "In contact the gear follows its frozen equilibria within the band of second order.",
        "Boundary equilibria of the frozen gear, and the band x* + x₁ ± |x₂| of `overlay.freezing` "
        "along one period of the load at ω_o = 0.1, T_am = 15 N m and D = 0.25.",
        (
            Finding(
                "either",
                "beyond the paper",
                "The corners, at w = {load:.0f} and x = ±{place:.2f}, are the ends of the gap, in "
                "which no equilibrium is isolated and there is no band. In contact the lag is "
                "−w'/(3x² − 2D|x| + A)² within {apart:.0e}, and |x₂| at most {ratio:.2%} of the "
                "largest |x₁| nearby. From t = 10 up to the first separation the gear is as near "
                "to x* + x₁ + x₂ as {error:.1%} of |x₂|.",
                {
                    "load": float(max(abs(one["w"]) for one in ends)),
                    "place": float(max(abs(one["x"]) for one in ends)),
                    "apart": within(float(np.abs(band.lag[band.known, 0] - exact).max()), 1e-12),
                    "ratio": float(np.nanmax(band.ratio)),
                    "error": float(error.max()),
                },
            ),
        ),
        ("canards",),
    )


def main(into: Output) -> None:
    """Draw two explosions, folded nodes, canards, cycles at a corner, and the band of the gear."""
    sheet = new_figure(FULL, 120 * MM)
    grid = [styled_axes(ax) for row in sheet.subplots(2, 3) for ax in row]
    force_axes, current_axes, ratio_axes, canard_axes, corner_axes, gear_axes = grid
    cycles, spikes = explosions()
    _draw_explosion(force_axes, cycles, "x", force(EPSILON).value, 1.0)
    _draw_explosion(current_axes, spikes, "v", current().value, hopf_current())
    _draw_nodes(ratio_axes)
    _draw_canards(canard_axes)
    _draw_corners(corner_axes)
    fs.plot.freezing(passage().freezing, "x", ax=gear_axes, legend=False, linewidth=0.5)
    gear_axes.plot(0.0, 0.0, "s", color=BLACK, markersize=3.5, zorder=5)
    for name, ax in zip("abcdef", grid, strict=True):
        ax.set_title(f"({name})", loc="left", fontsize=TEXT)
    into.save(sheet, "canards")


def _draw_explosion(
    ax: Axes, branch: fs.OrbitBranch, state: str, canard: float, hopf: float
) -> None:
    """Extent of the cycles, the value of the canard, and the Hopf point."""
    fs.plot.response(branch, f"max({state}) - min({state})", ax=ax, label=False, color=CYCLES)
    ax.axvline(canard, color=GREY, linewidth=0.8, zorder=1)
    ax.plot(hopf, 0.0, "s", color=BLACK, markersize=3.5, zorder=5)
    ax.locator_params(axis="x", nbins=4)
    ax.set_ylabel(f"extent in ${state}$")


def _draw_nodes(ax: Axes) -> None:
    """μ over the frequency, as computed and in closed form."""
    omega = np.linspace(*FREQUENCIES, 400)
    for curve, a, (color, marker) in zip(
        folded(), AMPLITUDES, ((BLUE, "o"), (VERMILION, "^"), (GREEN, "s")), strict=True
    ):
        ax.plot(omega, node_ratio(omega, a), color=BLACK, linewidth=0.8)
        (dots,) = ax.plot(curve["omega"], ratios(curve), marker, color=color, label=f"{a:g}")
        dots.set(markerfacecolor="none", markersize=4, markevery=3)
    ax.legend(title="$a$", fontsize=SMALL_TEXT, title_fontsize=SMALL_TEXT, loc="upper right")
    ax.set(xlabel=r"$\omega$", ylabel=r"$\mu$")


def _draw_canards(ax: Axes) -> None:
    """Both slow manifolds on the section, with their intersections."""
    for sheet, color, style, name in (
        (canards().attracting, BLUE, "-", "attracting"),
        (canards().repelling, VERMILION, "--", "repelling"),
    ):
        ax.plot(1e2 * sheet[:, 0], 1e4 * sheet[:, 1], style, color=color, linewidth=1.0, label=name)
    places = np.array([one.state for one in canards()]) - [-1.0, -0.9, -0.8]
    ax.plot(1e2 * places[:, 0], 1e4 * places[:, 1], "o", color=BLACK, markersize=3, zorder=5)
    ax.legend(fontsize=SMALL_TEXT, loc="upper center")
    ax.set(xlabel="$10^2 (x + 1)$", ylabel="$10^4 (y + 0.9)$")


def _draw_corners(ax: Axes) -> None:
    """Extent of the cycles over the inner slope."""
    for a, color, style in zip(SMALL, (BLUE, VERMILION, GREEN), ("-", "--", "-."), strict=True):
        branch = cornered(a)
        size = extent(branch, "x")
        ax.semilogy(branch.values, size, style, color=color, linewidth=1.2, label=f"{a:g}")
    ax.axvline(SEPARATING, color=GREY, linewidth=0.8, zorder=1)
    ax.legend(title="$a$", fontsize=SMALL_TEXT, title_fontsize=SMALL_TEXT, loc="lower right")
    ax.set(xlabel="$s$", ylabel="extent in $x$")


if __name__ == "__main__":
    main(Output(Path("figures")))
