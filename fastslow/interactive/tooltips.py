"""Texts of tooltips."""

from __future__ import annotations

from collections.abc import Iterable
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.overlay.transitions import Transition
from fastslow.results.points import Equilibrium, SpecialPoint, linear_words
from fastslow.results.trajectory.events.crossings import Crossing

#: Characters in a line of a sentence.
TOOLTIP_WIDTH = 44


def text_of(point: Any, parameter: str = "") -> str:
    """Describe a point in a few short lines.

    Parameters
    ----------
    point : Equilibrium, SpecialPoint, Crossing, Transition or StatePoint
    parameter : str
        Continuation parameter of the diagram.

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear().frozen()
    >>> print(text_of(fs.equilibria(gear, w=2)[0], "w"))
    w = 2
    x = 0.297894, v = 0
    λ = −0.5 ± 6.44494i
    S1, stable focus
    """
    if isinstance(point, Equilibrium):
        seat = point.region if point.admissible else f"virtual, of {point.region}"
        lines = [
            numbers([parameter], [point[parameter]]),
            numbers(point.states, point.state),
            spectrum(point.eigenvalues),
            f"{seat}, {linear_words(point.stability, point.type)}",
        ]
    elif isinstance(point, SpecialPoint):
        on = f" on {point.interface}" if point.interface else ""
        lines = [
            f"{point.label}, {point.words}{on}",
            numbers([parameter], [point[parameter]]),
            numbers(point.states, point.state),
            spectrum(point.eigenvalues),
            " | ".join(point.regions),
            fill(point.note, TOOLTIP_WIDTH),
        ]
    elif isinstance(point, Crossing):
        way = {1: "upwards", -1: "downwards", 0: "touched"}[point.direction]
        lines = [
            f"{point.interface} {way}",
            numbers(["t"], [point.time]),
            f"{point.from_region} → {point.to_region}",
        ]
    elif isinstance(point, Transition):
        lines = [
            point.type if point.special is None else f"{point.type} at {point.special.label}",
            numbers(["t", parameter], [point.time, point.value]),
            f"{point.from_branch} → {point.to_branch or 'end of run'}",
        ]
    else:
        lines = [
            numbers(["t"], [point.time]),
            numbers(point.states, point.state),
            numbers(point.slow, point.slow.values()),
            point.region,
        ]
    return "\n".join(line for line in lines if line)


def spectrum(eigenvalues: NDArray[np.complex128]) -> str:
    """Format eigenvalues, a complex pair once; empty if none is known.

    Examples
    --------
    >>> spectrum(np.array([-1 + 2j, -1 - 2j, 3]))
    'λ = −1 ± 2i, 3'
    """
    words = []
    for value in np.asarray(eigenvalues, dtype=complex):
        if np.isnan(value):
            continue
        if value.imag == 0:
            words.append(f"{value.real:.6g}")
        elif value.imag > 0:
            words.append(f"{value.real:.6g} ± {value.imag:.6g}i")
    return ("λ = " + ", ".join(words)).replace("-", "−") if words else ""


def numbers(names: Iterable[str], values: Iterable[float]) -> str:
    """Format names with their values to six digits.

    Examples
    --------
    >>> numbers(["x", "v"], [-1.5, 1 / 3])
    'x = −1.5, v = 0.333333'
    """
    pairs = zip(names, values, strict=True)
    return ", ".join(f"{name} = {value:.6g}".replace("-", "−") for name, value in pairs)
