"""What the controls and the page of an explorer use of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from matplotlib.figure import Figure

from fastslow.interactive.sliders import Slider
from fastslow.interactive.views import Setup, View
from fastslow.model.model import Model


class Explored(Protocol):
    """A model with sliders, and the view at their values."""

    model: Model
    setup: Setup
    sliders: tuple[Slider, ...]
    figure: Figure
    view: View

    @property
    def values(self) -> dict[str, float]:
        """Current values of parameters and initial states."""

    def set(self, values: Mapping[Any, float], /) -> View:
        """Set values of parameters or initial states, and update the figure."""

    def glance(self, values: Mapping[Any, float]) -> View:
        """Set values without computing the overlay."""

    def call(self) -> str:
        """Return Python source that reproduces the view."""
