"""Picking in figures: hover shows the nearest point, a click returns it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backend_bases import Event, FigureCanvasBase, MouseEvent
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from fastslow.arguments import function, validated
from fastslow.errors import MissingPackageError
from fastslow.interactive.picking import Pick, PickCurve, curves_of, nearest_pick
from fastslow.plot.drawings import Drawing
from fastslow.plot.layout.style import BLACK, GREY, SMALL_TEXT, rendered
from fastslow.plot.layout.typesetting import paragraph
from fastslow.results.base.extras import extra
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.overlay import Overlay
from fastslow.results.trajectory.trajectory import Trajectory


@validated(on_click=function)
def pick(
    drawing: Drawing,
    result: Diagram | Trajectory | Overlay,
    *,
    on_click: Callable[[Pick], Any] | None = None,
) -> Pointer:
    """Describe drawn points on hover, and return them on a click.

    Works with the interactive backends of Matplotlib, in axes of ``plt.figure()``; other
    figures become interactive in a notebook if the pointer is the last line of a cell (extra
    ``interactive``). Equilibria between the rows of a branch are computed if the diagram has
    its model.

    Parameters
    ----------
    drawing : DiagramDrawing, MotionDrawing, OverlayDrawing or PanelDrawing
        Drawing returned by `fastslow.plot`.
    result : Diagram, Trajectory or Overlay
        The result in the drawing.
    on_click : callable, optional
        Called with the Pick of each click, which is also `Pointer.selected`.

    Returns
    -------
    Pointer
        Keep a reference; picking ends with the object.

    Raises
    ------
    ArgumentError
        For any other drawing, or if the result is not the one drawn.

    See Also
    --------
    fastslow.explore, fastslow.plot.diagram

    Examples
    --------
    >>> import fastslow as fs
    >>> from matplotlib.backend_bases import MouseEvent
    >>> gear = fs.systems.harmonic_gear(A=-0.6).frozen()
    >>> diagram = fs.continue_equilibria(gear, "w", over=(-0.5, 0.5))
    >>> drawing = fs.plot.diagram(diagram)
    >>> pointer = fs.pick(drawing, diagram)
    >>> place = drawing.ax.transData.transform((diagram.folds[0]["w"], diagram.folds[0]["x"]))
    >>> click = MouseEvent("button_press_event", drawing.figure.canvas, *place, button=1)
    >>> drawing.figure.canvas.callbacks.process(click.name, click)
    >>> pointer.selected.point.label
    'LP1'
    """
    curves = curves_of(drawing, result)
    return Pointer(drawing.figure, curves, on_click)


class Pointer:
    """Hover and click on a figure.

    Parameters
    ----------
    figure : Figure
    curves : sequence of PickCurve
        Curves that can be picked; may be replaced when the figure is redrawn.
    on_click : callable, optional
        Called with each pick.

    Attributes
    ----------
    selected : Pick or None
        The point clicked last.
    near : Pick or None
        The point near the pointer.
    """

    def __init__(
        self,
        figure: Figure,
        curves: Sequence[PickCurve] = (),
        on_click: Callable[[Pick], Any] | None = None,
    ) -> None:
        self.figure = figure
        self.curves = tuple(curves)
        self.selected: Pick | None = None
        self.near: Pick | None = None
        self._on_click = on_click
        self._live: Any = None
        self._box: Annotation | None = None
        self._beneath: Any = None
        self._connected = [
            figure.canvas.mpl_connect("motion_notify_event", self._moved),
            figure.canvas.mpl_connect("button_press_event", self._clicked),
            figure.canvas.mpl_connect("draw_event", self._drawn),
        ]

    def release(self) -> None:
        """Disconnect from the figure."""
        for number in self._connected:
            self.figure.canvas.mpl_disconnect(number)
        self._connected = []
        self._hide()

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if self._live is None:
            try:
                self._live = live_canvas(self.figure)
            except MissingPackageError as error:
                return picture(self.figure, f"{self!r}\n{error}")
        return self._live._repr_mimebundle_(**kwargs)

    def _moved(self, event: Event) -> None:
        found = self._found(event)
        if found is None:
            if self.near is not None:
                self._hide()
                self._show()
        elif self.near is None or found.text != self.near.text:
            self._hide()
            self._box = tooltip_for(found)
            self._show()
        self.near = found

    def _clicked(self, event: Event) -> None:
        assert isinstance(event, MouseEvent)
        toolbar: Any = self.figure.canvas.toolbar
        found = self._found(event)
        # a drag for zoom or pan is not a click on a point
        if found is None or event.button != 1 or (toolbar is not None and toolbar.mode):
            return
        self.selected = found
        if self._on_click is not None:
            self._on_click(found)

    def _found(self, event: Event) -> Pick | None:
        assert isinstance(event, MouseEvent)
        ax = event.inaxes
        return nearest_pick(self.curves, ax, event.x, event.y) if isinstance(ax, Axes) else None

    def _hide(self) -> None:
        if self._box is not None and self._box.axes is not None:
            self._box.remove()
        self._box = None

    def _drawn(self, _: Event) -> None:
        """Store the canvas without the tooltip, so that the next tooltip needs no full redraw."""
        canvas: Any = self.figure.canvas
        self._beneath = canvas.copy_from_bbox(self.figure.bbox) if _blits(canvas) else None
        if self._box is not None and self._box.axes is not None:
            self.figure.draw_artist(self._box)

    def _show(self) -> None:
        canvas: Any = self.figure.canvas
        if self._beneath is None:
            canvas.draw_idle()
            return
        canvas.restore_region(self._beneath)
        if self._box is not None:
            self.figure.draw_artist(self._box)
        canvas.blit(self.figure.bbox)


def picture(figure: Figure, text: str) -> dict[str, Any]:
    """Return a static representation of a figure, for frontends without widgets."""
    return {"text/plain": text, "image/png": rendered(figure, "png", figure.dpi)}


def _blits(canvas: FigureCanvasBase) -> bool:
    return bool(canvas.supports_blit)


def tooltip_for(found: Pick) -> Annotation:
    """Create a tooltip next to a point and inside the figure."""
    ax = found.ax
    frame = ax.get_window_extent()
    x, y = ax.transData.transform((found.x, found.y))
    right = x < 0.5 * (frame.x0 + frame.x1)
    upper = y < 0.5 * (frame.y0 + frame.y1)
    return ax.annotate(
        paragraph(found.text),
        (found.x, found.y),
        xytext=(10 if right else -10, 10 if upper else -10),
        textcoords="offset points",
        ha="left" if right else "right",
        va="bottom" if upper else "top",
        fontsize=SMALL_TEXT + 1,
        color=BLACK,
        bbox={"boxstyle": "round,pad=0.4", "facecolor": "white", "edgecolor": GREY, "alpha": 0.95},
        arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.8},
        zorder=20,
        animated=True,
        annotation_clip=False,
    )


def live_canvas(figure: Figure) -> Any:
    """Replace the canvas of a figure by one of ipympl and return it."""
    kept = matplotlib.get_backend()
    backend = extra("ipympl.backend_nbagg", "interactive")
    if matplotlib.get_backend() != kept:
        # its import sets the backend of pyplot
        matplotlib.use(kept)
    canvas = backend.Canvas(figure)
    # the manager attaches itself to the canvas
    backend.FigureManager(canvas, 0)
    canvas.header_visible = False
    return canvas
