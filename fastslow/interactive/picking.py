"""Picking: the point of a drawing nearest to a screen position, with its description."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from fastslow.arguments import class_of
from fastslow.errors import ArgumentError
from fastslow.interactive.tooltips import text_of
from fastslow.plot.branches import DiagramDrawing
from fastslow.plot.layout.marks import at_states
from fastslow.plot.layout.style import root
from fastslow.plot.motions import MotionDrawing
from fastslow.plot.panels import PanelDrawing
from fastslow.plot.passages import OverlayDrawing
from fastslow.plot.quantities import (
    Quantity,
    along_branch,
    along_overlay,
    along_run,
    at_crossings,
    at_points,
    at_times,
)
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.overlay import Overlay, require_equilibria
from fastslow.results.points import Equilibrium
from fastslow.results.trajectory.queries.state_at import StatePoint
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Largest distance of a picked point, in points (1/72 inch).
PICK_DISTANCE = 12.0

#: Advantage of a marker over a line, in points.
LEAD = 5.0


@dataclass(frozen=True, eq=False)
class Pick:
    """A picked point of a drawing.

    Parameters
    ----------
    point : Equilibrium, SpecialPoint, Crossing, Transition or StatePoint
    ax : Axes
    x, y : float
        Position in data coordinates.
    distance : float
        Distance from the pointer, in points (1/72 inch).
    text : str
        Description, one property per line.
    call : str
        Python source that returns it, given results named diagram, run and overlay.
    """

    point: Any
    ax: Axes
    x: float
    y: float
    distance: float
    text: str
    call: str


@dataclass(frozen=True, eq=False)
class PickCurve:
    """Points or a line in axes that can be picked.

    Parameters
    ----------
    ax : Axes
    xy : ndarray, shape (N, 2)
        In data coordinates.
    joined : bool
        Whether a line joins the points; markers otherwise.
    found : callable
        (row, fraction of the following step) -> (point, source text).
    parameter : str
        What the horizontal axis of a diagram shows.
    """

    ax: Axes
    xy: Array
    joined: bool
    found: Callable[[int, float], tuple[Any, str]]
    parameter: str = ""


def curves_of(drawing: Any, result: Diagram | Trajectory | Overlay) -> tuple[PickCurve, ...]:
    """Return the curves and markers of a drawing that can be picked.

    Parameters
    ----------
    drawing : DiagramDrawing, MotionDrawing, OverlayDrawing or PanelDrawing
        Drawing returned by `fastslow.plot`.
    result : Diagram, Trajectory or Overlay
        The result in the drawing.

    Raises
    ------
    ArgumentError
        For any other drawing, or if the result is not the one drawn.
    """
    if isinstance(result, Overlay):
        require_equilibria(result, "pick")
    if isinstance(drawing, PanelDrawing) and isinstance(result, Overlay):
        parts = (drawing.time_series, drawing.phase_portrait)
        motions = [curve for part in parts for curve in curves_of(part, result.run)]
        return (*motions, *curves_of(drawing.overlay, result))
    if isinstance(drawing, OverlayDrawing) and isinstance(result, Overlay):
        below = _diagram_curves(drawing.diagram, result.diagram)
        return (*below, *_overlay_curves(drawing, result))
    if isinstance(drawing, DiagramDrawing) and isinstance(result, Diagram):
        return tuple(_diagram_curves(drawing, result))
    if isinstance(drawing, MotionDrawing) and isinstance(result, Trajectory) and not drawing.z:
        return tuple(_motion_curves(drawing, result))
    raise ArgumentError(
        f"cannot pick in {class_of(drawing)} of {class_of(result)}; expected the "
        "drawing of a diagram, a trajectory or an overlay in the plane, and the result drawn"
    )


def nearest_pick(curves: Iterable[PickCurve], ax: Axes, x: float, y: float) -> Pick | None:
    """Return the drawn point nearest to a screen position.

    Parameters
    ----------
    curves : iterable of PickCurve
    ax : Axes
        Axes that contain the position.
    x, y : float
        Position in pixels, as in a Matplotlib event.

    Returns
    -------
    Pick or None
        None if nothing is drawn nearby.
    """
    place = np.array([x, y])
    points = 72.0 / root(ax).dpi
    best: tuple[float, float, PickCurve, int, float] | None = None
    for curve in curves:
        if curve.ax is not ax or not len(curve.xy):
            continue
        distance, row, part = _nearest(ax.transData.transform(curve.xy), place, curve.joined)
        distance *= points
        rank = distance if curve.joined else distance - LEAD
        if distance <= PICK_DISTANCE and (best is None or rank < best[0]):
            best = rank, distance, curve, row, part
    if best is None:
        return None
    _, distance, curve, row, part = best
    point, call = curve.found(row, part)
    at = curve.xy[row] if part == 0 else (1 - part) * curve.xy[row] + part * curve.xy[row + 1]
    return Pick(
        point, ax, float(at[0]), float(at[1]), distance, text_of(point, curve.parameter), call
    )


def _nearest(pixels: Array, place: Array, joined: bool) -> tuple[float, int, float]:
    """Return distance, row and fraction of the following step of the nearest point."""
    with np.errstate(invalid="ignore", over="ignore"):
        if not joined or len(pixels) == 1:
            away = np.nan_to_num(np.hypot(*(pixels - place).T), nan=np.inf)
            row = int(np.argmin(away))
            return float(away[row]), row, 0.0
        step = np.diff(pixels, axis=0)
        square = (step**2).sum(axis=1)
        part = ((place - pixels[:-1]) * step).sum(axis=1) / np.where(square > 0, square, 1.0)
        part = np.clip(np.nan_to_num(part), 0.0, 1.0)
        away = np.hypot(*(pixels[:-1] + part[:, None] * step - place).T)
    away = np.nan_to_num(away, nan=np.inf)
    row = int(np.argmin(away))
    if part[row] == 1.0:
        return float(away[row]), row + 1, 0.0
    return float(away[row]), row, float(part[row])


def _diagram_curves(drawing: DiagramDrawing, diagram: Diagram) -> Iterable[PickCurve]:
    virtual = any(line.get_label() == "virtual" for line in drawing.lines)
    for branch in diagram.branches:
        if branch.admissible or virtual:
            yield PickCurve(
                drawing.ax,
                np.column_stack(along_branch(diagram, branch, *drawing.shown)),
                True,
                _on_branch(diagram, branch),
                diagram.parameter,
            )
    special = list(diagram.special)
    marked = {str(line.get_label()).split()[0] for line in drawing.markers}
    numbers = [
        k
        for k, point in enumerate(special)
        if point.stem in marked and (point.admissible or virtual)
    ]
    yield PickCurve(
        drawing.ax,
        np.column_stack(at_points([special[k] for k in numbers], *drawing.shown)),
        False,
        lambda row, _: (special[numbers[row]], f"diagram.special[{numbers[row]}]"),
        diagram.parameter,
    )


def _on_branch(diagram: Diagram, branch: Branch) -> Callable[[int, float], tuple[Any, str]]:
    """Return the equilibrium at a position along a branch, corrected if the model is known."""

    def found(row: int, part: float) -> tuple[Equilibrium, str]:
        table = branch.points
        place = table[row] if part == 0 else (1 - part) * table[row] + part * table[row + 1]
        values = dict(zip(branch.point_names, place.tolist(), strict=True))
        words = ", ".join(f"{name}={value!r}" for name, value in values.items())
        return diagram.nearest(**values), f"diagram.nearest({words})"

    return found


def run_curve(ax: Axes, run: Trajectory, *shown: Quantity) -> PickCurve:
    """Return the curve of a run over time or in the plane of two quantities."""
    return PickCurve(ax, np.column_stack(along_run(run, *shown)), True, _on_run(run))


def _motion_curves(drawing: MotionDrawing, run: Trajectory) -> Iterable[PickCurve]:
    yield run_curve(drawing.ax, run, *drawing.shown)
    if drawing.crossings is not None:
        at = at_crossings(run, *drawing.shown)
        yield _at_crossings(drawing.ax, np.column_stack(at), run)


def _overlay_curves(drawing: OverlayDrawing, overlay: Overlay) -> Iterable[PickCurve]:
    shown, run = drawing.shown, overlay.run
    yield PickCurve(drawing.ax, np.column_stack(along_overlay(overlay, *shown)), True, _on_run(run))
    if drawing.crossings is not None:
        times = np.array([c.time for c in run.crossings])
        state = np.array([c.state for c in run.crossings])
        at = at_times(overlay, times, run.states, state, *shown)
        yield _at_crossings(drawing.ax, np.column_stack(at), run)
    if overlay.transitions:
        yield PickCurve(
            drawing.ax,
            np.column_stack(at_states(overlay, shown, overlay.transitions)),
            False,
            lambda row, _: (overlay.transitions[row], f"overlay.transitions[{row}]"),
            overlay.parameter,
        )


def _at_crossings(ax: Axes, at: Array, run: Trajectory) -> PickCurve:
    return PickCurve(ax, at, False, lambda row, _: (run.crossings[row], f"run.crossings[{row}]"))


def _on_run(run: Trajectory) -> Callable[[int, float], tuple[Any, str]]:
    """Return the state at a position along a trajectory, by dense output if available."""

    def found(row: int, part: float) -> tuple[StatePoint, str]:
        times = run.t
        time = float(times[row] if part == 0 else (1 - part) * times[row] + part * times[row + 1])
        return run.at(t=time)[0], f"run.at(t={time!r})[0]"

    return found
