"""An explorer in a notebook: sliders of ipywidgets beside a figure of ipympl."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from html import escape
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.figure import Figure

from fastslow.errors import FastSlowError
from fastslow.interactive.sliders import Slider
from fastslow.results.base.table import extra

if TYPE_CHECKING:
    from fastslow.interactive.explorers import Explorer

#: Steps of a slider over its range.
STEPS = 100

#: A slider rests that has not moved for this long, in seconds.
REST = 0.4


def live_canvas(figure: Figure) -> Any:
    """A canvas of ipympl for a figure, in place of the one that it has."""
    kept = matplotlib.get_backend()
    backend = extra("ipympl.backend_nbagg", "interactive")
    if matplotlib.get_backend() != kept:
        # its import makes it the backend of pyplot
        matplotlib.use(kept)
    canvas = backend.Canvas(figure)
    # shows itself as part of the canvas
    backend.FigureManager(canvas, 0)
    canvas.header_visible = False
    return canvas


def step_of(slider: Slider) -> float:
    """About a hundredth of a slider, such that its value lies on a step.

    Examples
    --------
    >>> round(step_of(Slider("D", 0.1, 0.5, 0.25)), 12), step_of(Slider("x", 0.0, 2.0, 0.0))
    (0.003947368421, 0.02)
    """
    step = (slider.high - slider.low) / STEPS
    below = slider.value - slider.low
    return below / max(round(below / step), 1) if below > 0 else step


def brief(value: float, step: float) -> float:
    """A value with no more decimals than its slider resolves.

    Examples
    --------
    >>> brief(0.38815789473684215, 0.004), brief(1203.7, 20.0)
    (0.3882, 1204.0)
    """
    return round(value, max(1 - math.floor(math.log10(step)), 0))


class Controls:
    """Sliders, figure, and what was clicked, of an explorer.

    Parameters
    ----------
    explorer : Explorer

    Attributes
    ----------
    box : ipywidgets.VBox
        All of it.
    sliders : dict
        Name to ipywidgets.FloatSlider.
    """

    def __init__(self, explorer: Explorer) -> None:
        widgets = extra("ipywidgets", "interactive")
        self._explorer = explorer
        self._following = False
        self._later: asyncio.TimerHandle | None = None
        self.canvas = live_canvas(explorer.figure)
        shown = explorer.values
        self.sliders = {
            slider.name: widgets.FloatSlider(
                value=shown[slider.name],
                min=slider.low,
                max=slider.high,
                step=step_of(slider),
                description=slider.label,
                readout_format=".4g",
                continuous_update=True,
                layout=widgets.Layout(width="22em"),
            )
            for slider in explorer.sliders
        }
        for slider in self.sliders.values():
            slider.observe(self._moved, names="value")
        self.words = widgets.HTML()
        self.tell()
        rows = widgets.Box(
            tuple(self.sliders.values()), layout=widgets.Layout(flex_flow="row wrap")
        )
        self.box = widgets.VBox((rows, self.canvas, self.words))

    def tell(self, text: str = "") -> None:
        """Show what was clicked, or what went wrong, and the call that reproduces the view."""
        above = f"<pre>{escape(text)}</pre>" if text else ""
        self.words.value = f"{above}<pre>{escape(self._explorer.call())}</pre>"

    def follow(self) -> None:
        """Put the sliders where the explorer is."""
        self._following = True
        try:
            for name, slider in self.sliders.items():
                value = self._explorer.values[name]
                # one that is being dragged is left to the hand that drags it
                if abs(slider.value - value) > 0.5 * slider.step:
                    slider.value = value
        finally:
            self._following = False
        self.tell()

    def _moved(self, change: Any) -> None:
        if self._following:
            return
        (name,) = (name for name, slider in self.sliders.items() if slider is change.owner)
        if abs(change.new - self._explorer.values[name]) < 0.5 * change.owner.step:
            # the browser's own rounding
            return
        value = {name: brief(change.new, change.owner.step)}
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            self._show(self._explorer.set, value)
            return
        # while the slider moves without the measurement, which follows when it rests
        if self._later is not None:
            self._later.cancel()
        self._show(self._explorer.glance, value)
        self._later = loop.call_later(REST, self._show, self._explorer.set, {})

    def _show(self, how: Callable[[Mapping[str, float]], object], values: dict[str, float]) -> None:
        try:
            how(values)
        except FastSlowError as error:
            self.tell(str(error))
