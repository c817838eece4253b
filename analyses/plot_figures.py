"""The figures of the reference: `python -m analyses.plot_figures [docs]`.

Each function draws one with the plot function of its name; the page of the plot function shows the
figure and this code.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import sympy as sp

import fastslow as fs
from analyses.output import Output, copy_figure


def axes() -> fs.plot.Drawing:
    """Three axes of one figure."""
    run = fs.simulate(fs.systems.van_der_pol_relaxation(), [1, 0], t=(0, 600))
    above, left, right = fs.plot.axes("aa;bc", height=90)
    fs.plot.time_series(run, "x", ax=above)
    fs.plot.phase_portrait(run, ax=left)
    return fs.plot.spectrum(run.spectrum("x", since=20), ax=right, peaks=1)


def basins() -> fs.plot.Drawing:
    """Two basins with the equilibria in them."""
    x, v = sp.symbols("x v")
    wells = fs.Model({x: v, v: x - x**3 - v / 5})
    box = {"x": (-2, 2), "v": (-1.5, 1.5)}
    found = fs.attractors(wells, box, 40)
    return fs.plot.basins(fs.basins(wells, box, known=found), found)


def clarke_path() -> fs.plot.Drawing:
    """Eigenvalues between two Jacobians."""
    gear = fs.systems.harmonic_gear()
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    return fs.plot.clarke_path(diagram.boundary_equilibria[0])


def delay_scaling() -> fs.plot.Drawing:
    """Delays behind a fold."""
    cusp = fs.systems.cusp()
    fold = fs.continue_equilibria(cusp.frozen(), "p", over=(-1, 1)).folds[0]
    scaling = fs.delay_scaling(cusp.frozen(), fold, [1e-6, 1e-5, 1e-4, 1e-3], level={"x": 0.5})
    return fs.plot.delay_scaling(scaling)


def diagram() -> fs.plot.Drawing:
    """A diagram with two folds and two boundary equilibria."""
    gear = fs.systems.harmonic_gear(A=-0.6, D=0.25)
    found = fs.continue_equilibria(gear.frozen(), "w", over=(-0.25, 0.25))
    return fs.plot.diagram(found)


def eigenvalue_path() -> fs.plot.Drawing:
    """Two Hopf points, where the eigenvalues cross the imaginary axis."""
    oscillator = fs.systems.van_der_pol()
    (branch,) = fs.continue_equilibria(oscillator.frozen(), "w", over=(-2, 2))
    return fs.plot.eigenvalue_path(branch)


def freezing() -> fs.plot.Drawing:
    """Where the frozen equilibria predict a motion."""
    cusp = fs.systems.cusp(omega=0.002)
    diagram = fs.continue_equilibria(cusp.frozen(), "p", over=(-1.2, 1.2))
    overlay = fs.overlay(diagram, fs.simulate(cusp, [-1.0], periods=1))
    return fs.plot.freezing(overlay.freezing)


def grid() -> fs.plot.Drawing:
    """A quantity over two parameters."""
    stiffness, gap = np.linspace(-1, 1, 21), np.linspace(0.1, 0.9, 17)
    found = fs.sweep(
        lambda A, D: {"threshold": (A + D**2) * D, "folds": bool(A < -(D**2))},
        {"A": stiffness, "D": gap},
    )
    return fs.plot.grid(found, "threshold")


def multipliers() -> fs.plot.Drawing:
    """Multipliers of a branch of forced orbits."""
    x, v, Omega, t = sp.symbols("x v Omega t")
    stop = sp.Piecewise((20 * (x - 1), x > 1), (0, True))
    forced = fs.Model(
        {x: v, v: 0.3 * sp.cos(Omega * t) - 0.1 * v - x - stop}, parameters={Omega: 0.5}
    )
    branch = fs.continue_orbits(fs.find_orbit(forced, [0.4, 0]), "Omega", over=(0.5, 2.5))
    return fs.plot.multipliers(branch)


def overlay() -> fs.plot.Drawing:
    """A slowly forced motion over the equilibria of its frozen model."""
    gear = fs.systems.harmonic_gear(A=-0.6, B=0, C=0.2, D=0.25, omega=0.005)
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-0.25, 0.25))
    run = fs.simulate(gear, [0, 0], periods=2)
    return fs.plot.overlay(fs.overlay(diagram, run))


def panel() -> fs.plot.Drawing:
    """Time series, phase portrait and overlay."""
    gear = fs.systems.harmonic_gear(A=-0.6, B=0, C=0.2, D=0.25, omega=0.005)
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-0.25, 0.25))
    run = fs.simulate(gear, [0, 0], periods=2)
    return fs.plot.panel(fs.overlay(diagram, run))


def parameter_plane() -> fs.plot.Drawing:
    """A curve of folds with its cusp."""
    x, p, q = sp.symbols("x p q")
    cusp = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    fold = fs.continue_equilibria(cusp, "p", over=(-1, 1)).folds[0]
    curve = fs.continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)})
    return fs.plot.parameter_plane(curve)


def phase_portrait() -> fs.plot.Drawing:
    """A motion with its crossings of two interfaces."""
    run = fs.simulate(fs.systems.harmonic_gear(), [0, 0], periods=2)
    return fs.plot.phase_portrait(run)


def regime_map() -> fs.plot.Drawing:
    """Areas of a plane of two parameters."""
    found = fs.refined_map(
        lambda A, D: np.where(A < -(D**2), "two folds", "no fold"), {"A": (-1, 0.5), "D": (0, 1)}
    )
    return fs.plot.regime_map(found)


def response() -> fs.plot.Drawing:
    """The largest displacement of forced orbits."""
    x, v, Omega, t = sp.symbols("x v Omega t")
    stop = sp.Piecewise((20 * (x - 1), x > 1), (0, True))
    forced = fs.Model(
        {x: v, v: 0.3 * sp.cos(Omega * t) - 0.1 * v - x - stop}, parameters={Omega: 0.5}
    )
    branch = fs.continue_orbits(fs.find_orbit(forced, [0.4, 0]), "Omega", over=(0.5, 2.5))
    return fs.plot.response(branch, "max(x)")


def section() -> fs.plot.Drawing:
    """Chaos once a period."""
    buck = fs.systems.buck_converter(V_in=33)
    run = fs.simulate(buck, [12, 0.55], periods=2000)
    return fs.plot.section(run.stroboscopic(since=0.08))


def sobol() -> fs.plot.Drawing:
    """Shares of the variance."""
    found = fs.sobol(
        lambda A, B, D: {"load": (A + B * D**2) * D},
        {"A": (0, 1), "B": (0, 2), "D": (0.5, 1)},
        1024,
    )
    return fs.plot.sobol(found)


def spectrum() -> fs.plot.Drawing:
    """The lines of a relaxation oscillation."""
    run = fs.simulate(fs.systems.van_der_pol_relaxation(), [1, 0], t=(0, 2000))
    return fs.plot.spectrum(run.spectrum("x", since=20), frequencies=(0, 0.1))


def sweep() -> fs.plot.Drawing:
    """A period doubling by simulation."""
    buck = fs.systems.buck_converter()
    found = fs.bifurcation_sweep(
        buck, "V_in", np.linspace(22, 33, 200), [12, 0.55], settle=100, keep=20
    )
    return fs.plot.sweep(found)


def time_series() -> fs.plot.Drawing:
    """A displacement over time."""
    run = fs.simulate(fs.systems.harmonic_gear(), [0, 0], periods=2)
    return fs.plot.time_series(run, "x")


def tipping_map() -> fs.plot.Drawing:
    """Where a shift is tracked, and where it tips."""
    x, shift, r, D, t = sp.symbols("x shift r D t")
    ramp = fs.Model(
        {x: (x + shift) ** 2 - 1},
        forcing={shift: D * (1 + sp.tanh(r * t)) / 2},
        parameters={r: 1, D: 3},
    )
    return fs.plot.tipping_map(fs.tipping_map(ramp, "r", {"r": (0.2, 4), "D": (1, 5)}))


FIGURES: tuple[Callable[[], fs.plot.Drawing], ...] = (
    axes, basins, clarke_path, delay_scaling, diagram, eigenvalue_path, freezing, grid, multipliers,
    overlay, panel, parameter_plane, phase_portrait, regime_map, response, section, sobol, spectrum,
    sweep, time_series, tipping_map,
)  # fmt: skip


def main(arguments: Sequence[str]) -> None:
    """Draw all figures into a folder of documentation."""
    docs = Path(arguments[0]) if arguments else Path(__file__).parents[1] / "docs"
    with TemporaryDirectory() as folder:
        output = Output(Path(folder), formats=("png",))
        for draw in FIGURES:
            name = f"plot_{draw.__name__}"
            output.save(draw().figure, name)
            copy_figure(Path(folder), docs, name)


if __name__ == "__main__":
    main(sys.argv[1:])
