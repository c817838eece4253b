"""One call of every plot function, and the results that they draw."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

import fastslow as fs
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.branch import Branch
from fastslow.results.overlay.delay_scaling import DelayScaling
from fastslow.results.overlay.delays import FoldDelay
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.long_time.sweep import BifurcationSweep, SweepPass

END = Outcome("end of range", "reached the end of the range.", True)


@dataclass(frozen=True)
class Case:
    """How a plot function is called.

    Parameters
    ----------
    args : callable
        From the results by name to the arguments.
    style : dict
        One keyword of style, and ...
    styled : callable
        ... from the drawing the values that show that it was obeyed.
    more : dict
        Further keywords.
    space : dict
        Keywords of a view in space; none if there is no such view.
    axes : int
        How many axes the function draws into.
    """

    args: Callable[[dict[str, Any]], tuple]
    style: dict[str, Any]
    styled: Callable[[Any], list]
    more: Callable[[dict[str, Any]], dict[str, Any]] = lambda r: {}
    space: dict[str, Any] = field(default_factory=dict)
    axes: int = 1


THICK = {"linewidth": 3.0}


def widths(lines):
    return [line.get_linewidth() for line in lines]


CASES = {
    "basins": Case(
        lambda r: (r["basins"], r["attractors"]), THICK, lambda d: widths(d.basins.lines)
    ),
    "clarke_path": Case(
        lambda r: (r["diagram"].boundary_equilibria[0],),
        THICK,
        lambda d: [path.get_linewidth()[0] for path in d.paths],
    ),
    "delay_scaling": Case(
        lambda r: (r["scaling"],), {"markersize": 3.0}, lambda d: [d.measured.get_markersize()]
    ),
    "diagram": Case(lambda r: (r["crowd"],), THICK, lambda d: widths(d.lines), space={"z": "x**2"}),
    "eigenvalue_path": Case(
        lambda r: (r["overlay"],), THICK, lambda d: [path.get_linewidth()[0] for path in d.paths]
    ),
    "freezing": Case(lambda r: (r["freezing"],), THICK, lambda d: widths([d.line])),
    "grid": Case(
        lambda r: (r["grid"],),
        THICK,
        lambda d: [cells.get_linewidth()[0] for cells in d.fills.values()],
    ),
    "multipliers": Case(
        lambda r: (r["orbits"],), THICK, lambda d: [path.get_linewidth()[0] for path in d.paths]
    ),
    "overlay": Case(lambda r: (r["overlay"],), THICK, lambda d: widths(d.lines), space={"z": "v"}),
    "panel": Case(
        lambda r: (r["overlay"],),
        THICK,
        lambda d: widths([*d.overlay.lines, *d.time_series.lines, *d.phase_portrait.lines]),
        axes=3,
    ),
    "parameter_plane": Case(
        lambda r: r["curves"],
        THICK,
        lambda d: widths(d.lines),
        more=lambda r: {"background": r["wedge"]},
        space={"z": "x"},
    ),
    "phase_portrait": Case(
        lambda r: (r["overlay"].run,),
        THICK,
        lambda d: widths(d.lines),
        more=lambda r: {"interface_values": r["overlay"].diagram.interface_values},
        space={"z": "w"},
    ),
    "tipping_map": Case(lambda r: (r["map"],), THICK, lambda d: widths(d.lines)),
    "regime_map": Case(
        lambda r: (r["map"],),
        THICK,
        lambda d: widths(d.lines),
        more=lambda r: {
            "annotate": {"here": (0.3, 0.9)},
            "curves": {"law": (np.linspace(0, 1, 9), np.linspace(0, 1, 9) ** 2)},
        },
    ),
    "response": Case(lambda r: (r["orbits"], "max(x)"), THICK, lambda d: widths(d.lines)),
    "section": Case(
        lambda r: (r["section"], "x", "v"),
        {"marker": "s"},
        lambda d: [line.get_marker() == "s" and 3.0 for line in d.points],
    ),
    "sobol": Case(
        lambda r: (r["sobol"],),
        {"markersize": 3.0},
        lambda d: [line.get_markersize() for line in (d.first, d.total)],
    ),
    "spectrum": Case(lambda r: (r["spectrum"],), THICK, lambda d: widths([d.line])),
    "sweep": Case(
        lambda r: (r["sweep"],),
        {"markeredgewidth": 3.0},
        lambda d: [line.get_markeredgewidth() for line in (d.up, d.down)],
    ),
    "time_series": Case(
        lambda r: (r["overlay"].run,),
        THICK,
        lambda d: widths(d.lines),
        more=lambda r: {
            "phases": r["overlay"].phases,
            "interface_values": r["overlay"].diagram.interface_values,
        },
    ),
}


def crowd(amplitude=1.2, turns=6.0):
    """The equilibria p = x + a sin(b x) of x' = p − x − a sin(b x): a fold at every turn."""
    x = np.linspace(-4, 4, 2001)
    slope = 1 + amplitude * turns * np.cos(turns * x)
    p = x + amplitude * np.sin(turns * x)
    rows = np.flatnonzero(np.diff(np.sign(slope))) + 1
    special = tuple(
        SpecialPoint(
            "LP",
            f"LP{k}",
            ("x",),
            x[[row]],
            {"p": p[row]},
            ("S1",),
            np.zeros(1, dtype=complex),
            np.array([1.0, 0.0]),
            0.0,
            True,
        )
        for k, row in enumerate(rows, start=1)
    )
    tangents = np.column_stack([np.ones_like(x), slope])
    branch = Branch(
        ("x",),
        "p",
        x[:, None],
        p,
        tangents / np.linalg.norm(tangents, axis=1, keepdims=True),
        -slope[:, None].astype(complex),
        np.full(len(x), "S1"),
        special,
        tuple(rows),
        (END, END),
    )
    return fs.Diagram(("x",), "p", (-5.5, 5.5), {}, (branch,), "found", (), ("S1",), {}, "x' = …")


def scaling():
    """Delays past a fold at seven rates, two parts in a hundred off the law."""
    eps = np.logspace(-2, -5, 7)
    point = SpecialPoint(
        "LP",
        "LP1",
        ("x",),
        np.zeros(1),
        {"p": 0.0},
        ("S1",),
        np.zeros(1, dtype=complex),
        np.array([1.0, 0.0]),
        0.0,
        True,
    )
    delay = 2.04 * eps ** (2 / 3)
    laws = tuple(
        FoldDelay(
            point=point,
            parameter="p",
            validity="by hand",
            rate=e,
            delay=2 * e ** (2 / 3) + e,
            quadratic=1.0,
            slope=1.0,
            cubic=0.0,
            mixed=0.0,
            coefficients=(2.0, 0.0, 1.0),
        )
        for e in eps
    )
    return DelayScaling(
        point,
        "p",
        1,
        "x = 1",
        eps,
        delay,
        laws,
        0.0,
        ("eps^(2/3)", "eps"),
        np.array([2.04, 0.0]),
        np.array([2.0, 1.0]),
        0.667,
        0.001,
        np.full(6, 2 / 3),
        2 / 3,
        (END,) * 7,
    )


def swept():
    """The logistic map beyond its first period doublings, up and down."""
    values = np.linspace(2.8, 3.7, 181)
    passes = []
    for direction in (1, -1):
        found, x = [], 0.5
        for value in values[::direction]:
            for _ in range(300):
                x = value * x * (1 - x)
            kept = []
            for _ in range(16):
                x = value * x * (1 - x)
                kept.append(x)
            found.append(kept)
        passes.append(
            SweepPass(
                direction,
                values[::direction],
                np.full(len(values), 16),
                np.repeat(values[::direction], 16),
                np.ravel(found),
                np.zeros((len(values), 1)),
                (END,) * len(values),
            )
        )
    return BifurcationSweep("r", "x", "stroboscopic", "…", tuple(passes))


def cusp():
    """Both folds of x' = p + q x − x³, which meet in a cusp, and where there are three roots."""
    x, p, q = sp.symbols("x p q")
    model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    folds = fs.continue_equilibria(model, "p", over=(-1, 1)).folds
    over = {"p": (-1, 1), "q": (-0.5, 1.5)}
    curves = tuple(fs.continue_points(fold, ("p", "q"), over=over) for fold in folds)

    def number(p, q):
        return np.where(4 * q**3 > 27 * p**2, "three equilibria", "one equilibrium")

    return curves, fs.refined_map(number, over, refinement=fs.Refinement(levels=4))


def three_areas():
    def label(x, y):
        return np.where(
            y > 0.5 + 0.3 * np.sin(4 * x), "bilateral", np.where(x > 0.6, "new", "free")
        )

    return fs.refined_map(
        label, {"x": (0, 1), "y": (0, 1)}, refinement=fs.Refinement(levels=4, resolution=1e-6)
    )


def incomplete():
    """A grid of three labels, with points that failed and points that are missing."""

    def label(a, b):
        if a + b > 1.8:
            raise ValueError("too large")
        return "low" if b < a**2 else "middle" if b < 0.8 else "high"

    grid = fs.sweep(label, {"a": np.linspace(0, 1, 21), "b": np.linspace(0, 1, 16)})
    done = grid.done.copy()
    done[:24] = False
    return replace(grid, done=done)


def results_by_name(diagram, overlay):
    """Every result that is drawn; ``diagram`` with boundary equilibria, ``overlay`` over folds."""
    curves, wedge = cusp()
    inner, plane = focus_and_cycle()
    return {
        "diagram": diagram,
        "overlay": overlay,
        "freezing": overlay.freezing,
        "crowd": crowd(),
        "scaling": scaling(),
        "curves": curves,
        "wedge": wedge,
        "map": three_areas(),
        "grid": incomplete(),
        "sobol": fs.sobol(lambda a, b: {"y": a + b * a}, {"a": (0, 1), "b": (0, 2)}, 64),
        "section": overlay.run.section("x"),
        "spectrum": overlay.run.spectrum("x"),
        "sweep": swept(),
        "orbits": folded_orbits(),
        "attractors": inner,
        "basins": plane,
    }


@cache
def focus_and_cycle():
    """A stable focus inside an unstable and a stable circle: attractors and basins."""
    x, v = sp.symbols("x v")
    R = x**2 + v**2
    growth = R - R**2 - sp.Rational(1, 10)
    model = fs.Model({x: -v + x * growth, v: x + v * growth})
    box = {"x": (-1.5, 1.5), "v": (-1.5, 1.5)}
    found = fs.attractors(model, box, 40, 3)
    refinement = fs.Refinement(cells=(8, 8), levels=2)
    return found, fs.basins(model, box, known=found, refinement=refinement)


def folded_orbits():
    """A branch of orbits with a grazing and a fold."""
    x, v, t = sp.symbols("x v t")
    W = sp.Symbol("W")
    force = sp.Piecewise((x - 1, x > 1), (x + 1, x < -1), (0, True))
    rate = 0.1 + 0.05 * W**2 * sp.sin(W * t) - 0.1 * v - force
    orbit = fs.find_orbit(fs.Model({x: v, v: rate}, parameters={W: 0.8}), [1.1, 0.0])
    return fs.continue_orbits(orbit, "W", over=(0.79, 0.84))
