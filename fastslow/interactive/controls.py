"""Notebook controls of an explorer: ipywidgets sliders and an ipympl figure."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping
from html import escape
from typing import Any

from fastslow.errors import FastSlowError
from fastslow.interactive.explored import Explored
from fastslow.interactive.pointers import live_canvas
from fastslow.interactive.sliders import Slider
from fastslow.results.base.extras import extra

#: Steps of a slider over its range.
SLIDER_STEPS = 100

#: Time after the last movement of a slider until the overlay is computed, in seconds.
DEBOUNCE = 0.4


def step_of(slider: Slider) -> float:
    """Step of a slider, about a hundredth of its range, that includes its value.

    Examples
    --------
    >>> round(step_of(Slider("D", 0.1, 0.5, 0.25)), 12), step_of(Slider("x", 0.0, 2.0, 0.0))
    (0.003947368421, 0.02)
    """
    step = (slider.high - slider.low) / SLIDER_STEPS
    below = slider.value - slider.low
    return below / max(round(below / step), 1) if below > 0 else step


def brief(value: float, step: float) -> float:
    """Round a value to the resolution of its slider.

    Examples
    --------
    >>> brief(0.38815789473684215, 0.004), brief(1203.7, 20.0)
    (0.3882, 1204.0)
    """
    return round(value, max(1 - math.floor(math.log10(step)), 0))


class Controls:
    """Sliders, figure and selected point of an explorer.

    Parameters
    ----------
    explorer : Explored

    Attributes
    ----------
    box : ipywidgets.VBox
        Box with all widgets.
    sliders : dict
        Name to ipywidgets.FloatSlider.
    """

    def __init__(self, explorer: Explored) -> None:
        widgets = extra("ipywidgets", "interactive")
        self._explorer = explorer
        self._syncing = False
        self._pending: asyncio.TimerHandle | None = None
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
        self.show_text()
        rows = widgets.Box(
            tuple(self.sliders.values()), layout=widgets.Layout(flex_flow="row wrap")
        )
        self.box = widgets.VBox((rows, self.canvas, self.words))

    def show_text(self, text: str = "") -> None:
        """Show the selected point or an error, and the call that reproduces the view."""
        above = f"<pre>{escape(text)}</pre>" if text else ""
        self.words.value = f"{above}<pre>{escape(self._explorer.call())}</pre>"

    def sync_sliders(self) -> None:
        """Set the sliders to the values of the explorer."""
        self._syncing = True
        try:
            for name, slider in self.sliders.items():
                value = self._explorer.values[name]
                # not the slider that is being dragged
                if abs(slider.value - value) > 0.5 * slider.step:
                    slider.value = value
        finally:
            self._syncing = False
        self.show_text()

    def _moved(self, change: Any) -> None:
        if self._syncing:
            return
        (name,) = (name for name, slider in self.sliders.items() if slider is change.owner)
        if abs(change.new - self._explorer.values[name]) < 0.5 * change.owner.step:
            # rounded by the browser
            return
        value = {name: brief(change.new, change.owner.step)}
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            self._show(self._explorer.set, value)
            return
        # without the overlay while the slider moves
        if self._pending is not None:
            self._pending.cancel()
        self._show(self._explorer.glance, value)
        self._pending = loop.call_later(DEBOUNCE, self._show, self._explorer.set, {})

    def _show(self, how: Callable[[Mapping[str, float]], object], values: dict[str, float]) -> None:
        try:
            how(values)
        except FastSlowError as error:
            self.show_text(str(error))
