"""A changed parameter: models, runs, diagrams, sweeps, and the explorer's frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count, cycle
from typing import Any

import numpy as np

import fastslow as fs
from fastslow.interactive.pictures import Picture, own_figure
from fastslow.interactive.views import View, view_of
from tests.benchmarks.measuring import Line, against, medians

OVER = (-2.0, 6.0)


def lines() -> Iterator[Line]:
    """Processor time of what follows a change of a parameter of the gear."""
    gear = fs.systems.harmonic_gear()
    numbers = count(1)

    def fresh(name: str) -> fs.Model:
        value = {"A": 41.0, "D": 0.2}[name] * (1.0 + 1e-5 * next(numbers))
        return gear.with_parameters({name: value})

    def diagram(name: str) -> fs.Diagram:
        return fs.continue_equilibria(fresh(name).frozen(), "w", OVER)

    known = gear.frozen()
    timed: dict[str, Callable[[], Any]] = {
        "with_parameters(A=…)": lambda: fresh("A"),
        "with_parameters(D=…), which moves interfaces": lambda: fresh("D"),
        "with_parameters(A=…).frozen()": lambda: fresh("A").frozen(),
        "a diagram, new A": lambda: diagram("A"),
        "a diagram, new D": lambda: diagram("D"),
        "a diagram, the same model again": lambda: fs.continue_equilibria(known, "w", OVER),
        "a short run, new A": lambda: fs.simulate(fresh("A"), [0.5, 0.0], t=(0, 1e-3)),
    }
    for name, value in medians(timed).items():
        yield Line("a changed parameter", f"fastslow, {name}", value, "ms")
    yield from _sweeps(gear)
    yield from _frames(gear)


def _sweeps(gear: fs.Model) -> Iterator[Line]:
    """A sweep beside its runs alone, from the same states."""
    fast = gear.with_parameters(omega=1.0)
    values = np.linspace(1.0, 3.0, 40)
    settle, keep = 60, 16

    def sweep() -> fs.BifurcationSweep:
        return fs.bifurcation_sweep(fast, "C", values, [0, 0], settle=settle, keep=keep, back=False)

    models = [fast.with_parameters(C=value) for value in values]
    begins = np.vstack([[0.0, 0.0], sweep().passes[0].ends[:-1]])

    def bare() -> None:
        for model, begin in zip(models, begins, strict=True):
            fs.simulate(model, begin, periods=settle + keep, dense=False)

    times = medians({"fastslow": sweep, "fastslow, its runs alone": bare})
    share = times["fastslow"] / times["fastslow, its runs alone"]
    for name, value in times.items():
        yield Line(
            "bifurcation_sweep, 40 values", name, value, "ms", None, f"{share:.2f} of the runs"
        )


def _frames(gear: fs.Model) -> Iterator[Line]:
    """A slider of the explorer moved, until the figure is drawn."""
    explorer, resting = (fs.explore(gear, over=OVER, sliders={"D": (0.1, 0.5)}) for _ in "12")
    # up and down within the limits of the axes, which change every few frames on a longer way
    values = cycle([*np.linspace(0.24, 0.26, 41), *np.linspace(0.26, 0.24, 41)[1:-1]])

    def computed() -> View:
        return view_of(gear, explorer.setup, {"D": next(values)}, measured=False)

    kept, views = Picture(own_figure()), cycle([computed() for _ in range(80)])

    def drawn() -> None:
        kept.draw(next(views), moving=True)
        kept.figure.canvas.draw()

    def from_nothing() -> None:
        figure = own_figure()
        Picture(figure).draw(next(views))
        figure.canvas.draw()

    timed: dict[str, Callable[[], Any]] = {
        "fastslow": lambda: explorer.glance({"D": next(values)}),
        "fastslow, computing alone": computed,
        "fastslow, drawing alone": drawn,
        "fastslow, a slider that rests": lambda: resting.set({"D": next(values)}),
        "Matplotlib, the same axes from nothing": from_nothing,
    }
    note = {"Matplotlib, the same axes from nothing": "ratio to drawing alone"}
    times = medians(timed)
    yield from against("a slider of explore moved", "fastslow, drawing alone", times, note)
