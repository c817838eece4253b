"""Slow flows and canards beside the computations of which they consist.

The bounds are 3 times `derive`, 25 times the trajectory of one side, and 1.5 times `simulate_many`
of the starts; the notes state how many times as long each takes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import sympy as sp

import fastslow as fs
from fastslow.orbits.canards.folded_sections import FoldedSection
from fastslow.orbits.canards.funnels import CURVE_RTOL, FUNNEL_STARTS, funnel_curves
from tests.benchmarks.measuring import Line, medians

x, y, z, a, k, lam, eps = sp.symbols("x y z a k lambda epsilon")


def lines() -> Iterator[Line]:
    """The slow flow, a maximal canard, and the canards at a folded node."""
    koper = fs.Model(
        {x: (k * y - x**3 + 3 * x - lam) / eps},
        slow={y: x - 2 * y + z, z: y - z},
        parameters={k: -10, lam: 7, eps: 0.01},
    )
    oscillator = fs.Model(
        {x: (y - x**3 / 3 + x) / eps}, slow={y: a - x}, parameters={a: 1, eps: 0.01}
    )
    for name, model in (("Koper", koper), ("van der Pol", oscillator)):
        yield from _compared(
            f"the slow flow of the model of {name}",
            ("slow_flow", lambda model=model: _symbolic(fs.slow_flow, model)),
            (
                "derive of the frozen model",
                lambda model=model: _symbolic(fs.derive, model.frozen()),
            ),
        )
    (point,) = fs.slow_flow(oscillator).points
    canard = fs.find_canard(oscillator, point, "a")
    at = oscillator.with_parameters(a=canard.value)
    start = [canard.attracting[n][0] for n in ("x", "y")]
    settings = fs.Integration(rtol=1e-13)

    def side() -> fs.Trajectory:
        limit = 4.0 * np.ptp(canard.attracting.t)
        given = {"stop": canard.section, "dense": False, "integration": settings}
        return fs.simulate(at, start, t=(0, limit), **given)

    yield from _compared(
        f"a maximal canard, {canard.evaluations} pairs of trajectories",
        ("find_canard", lambda: fs.find_canard(oscillator, point, "a")),
        ("trajectory of one side", side),
    )
    node = next(p for p in fs.slow_flow(koper).points if p.code == "FN")
    section, lengths, *_ = funnel_curves(FoldedSection(koper, node))
    sides = section.attracting, -section.attracting

    def starts() -> list[np.ndarray]:
        return [section.curve(one, lengths, CURVE_RTOL) for one in sides]

    yield from _compared(
        f"the canards at a folded node, {2 * FUNNEL_STARTS} starts",
        ("find_canards", lambda: fs.find_canards(koper, node)),
        (
            "simulate_many of the starts",
            starts,
        ),
    )


def _symbolic(function: Callable[[fs.Model], Any], model: fs.Model) -> Any:
    sp.core.cache.clear_cache()
    return function(model)


def _compared(
    work: str, one: tuple[str, Callable[[], Any]], other: tuple[str, Callable[[], Any]]
) -> list[Line]:
    times = medians({f"fastslow, {one[0]}": one[1], f"fastslow, {other[0]}": other[1]}, repeats=5)
    first, second = times.items()
    return [
        Line(
            work, first[0], first[1], "ms", note=f"{first[1] / second[1]:.3g} times the next line"
        ),
        Line(work, second[0], second[1], "ms"),
    ]
