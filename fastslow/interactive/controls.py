"""An explorer in a notebook: sliders of ipywidgets beside a figure of ipympl."""

from __future__ import annotations

from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

from fastslow.errors import FastSlowError, MissingPackageError

if TYPE_CHECKING:
    from fastslow.interactive.explorers import Explorer

#: Steps of a slider over its range.
STEPS = 100


def package(name: str) -> Any:
    """A package of the extra ``interactive``, imported late.

    Raises
    ------
    MissingPackageError
        When it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise MissingPackageError(
            f"this needs {name}, of the extra 'interactive': pip install 'fastslow[interactive]'"
        ) from None


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
        widgets = package("ipywidgets")
        backend = package("ipympl.backend_nbagg")
        self._explorer = explorer
        self.canvas = backend.Canvas(explorer.figure)
        # shows itself as part of the canvas
        self.manager = backend.FigureManager(self.canvas, 0)
        self.canvas.header_visible = False
        shown = {**explorer.view.model.parameters}
        states = (*explorer.model.states, *explorer.model.slow_states)
        shown |= dict(zip(states, explorer.view.setup.start, strict=True))
        self.sliders = {
            slider.name: widgets.FloatSlider(
                value=shown[slider.name],
                min=slider.low,
                max=slider.high,
                step=(slider.high - slider.low) / STEPS,
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
        self.tell(explorer.call())
        rows = widgets.Box(
            tuple(self.sliders.values()), layout=widgets.Layout(flex_flow="row wrap")
        )
        self.box = widgets.VBox((rows, self.canvas, self.words))

    def tell(self, call: str, text: str = "") -> None:
        """Show the call that reproduces the view, and what was clicked."""
        above = f"<pre>{escape(text)}</pre>" if text else ""
        self.words.value = f"{above}<pre>{escape(call)}</pre>"

    def _moved(self, _: Any) -> None:
        values = {name: slider.value for name, slider in self.sliders.items()}
        shown = self._explorer.view
        states = (*shown.model.states, *shown.model.slow_states)
        now = {**shown.model.parameters, **dict(zip(states, shown.setup.start, strict=True))}
        moved = {name: value for name, value in values.items() if value != now[name]}
        try:
            self._explorer.set(moved)
        except FastSlowError as error:
            self.tell("", str(error))
