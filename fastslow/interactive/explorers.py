"""Exploring a model: sliders beside a live figure."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from fastslow.arguments import formula, instance, interval, mapping, validated
from fastslow.errors import MissingPackageError, unknown_name
from fastslow.interactive.picking import Pick
from fastslow.interactive.pictures import Picture, own_figure
from fastslow.interactive.pointers import Pointer, picture
from fastslow.interactive.sliders import Slider, sliders_of
from fastslow.interactive.views import Setup, View, at_start, setup_of, view_of
from fastslow.model.model import Model
from fastslow.simulation.settings import DEFAULT, Integration, integration_settings


@validated(
    model=instance(Model),
    parameter=formula,
    over=interval,
    integration=integration_settings,
    state=formula,
    sliders=mapping,
    figure=instance(Figure),
)
def explore(
    model: Model,
    *,
    parameter: object = None,
    over: Sequence[float] | None = None,
    start: Any = None,
    t: Sequence[float] | None = None,
    periods: float | None = None,
    integration: Integration = DEFAULT,
    state: object = None,
    sliders: Mapping[Any, Sequence[float]] | None = None,
    figure: Figure | None = None,
) -> Explorer:
    """Vary a model's parameters by sliders, beside its diagram, trajectory and overlay.

    In a notebook the last line of a cell shows the explorer (extra
    ``interactive``); as a page that needs no Python it is written by
    `Explorer.export`. The pointer shows the point that it is near, and a click
    gives it as `Explorer.selected`.

    Parameters
    ----------
    model : Model
    parameter : str or Symbol, optional
        What the diagram is over; by default the first slow quantity, in a model
        without one the first parameter.
    over : (float, float), optional
        Its range; by default a little more than the run covers, for a parameter
        from zero to twice its value.
    start : sequence of float or mapping, optional
        Initial states, then slow states; by default zeros.
    t, periods
        Length of the run, as in `fastslow.simulate`; by default two periods, and
        t = (0, 100) where there is no period.
    integration : Integration
        Error control of the run.
    state : str or Symbol, optional
        What stands over time and over the parameter, by default the first state.
    sliders : mapping, optional
        Parameter, or state for its initial value, to the range of its slider; by
        default every parameter has one, from zero to twice its value.
    figure : Figure, optional
        Drawn into, e.g. ``plt.figure()`` for a window of its own.

    Returns
    -------
    Explorer

    Raises
    ------
    UnknownNameError
        For a name that is not in the model.
    ArgumentError
        For a range, start or time span that is none.

    Examples
    --------
    >>> import fastslow as fs
    >>> explorer = fs.explore(fs.systems.harmonic_gear(), over=(-2, 6), sliders={"D": (0.1, 0.5)})
    >>> explorer.set(D=0.3).diagram.boundary_equilibria[0]["x"]
    -0.3
    """
    setup = setup_of(
        model,
        parameter=parameter,
        over=over,
        start=start,
        t=t,
        periods=periods,
        integration=integration,
        state=state,
    )
    names = (*model.states, *model.slow_states)
    made = sliders_of(model, dict(zip(names, setup.start, strict=True)), sliders)
    return Explorer(model, setup, made, own_figure() if figure is None else figure)


class Explorer:
    """A model with sliders, drawn live; made by `fastslow.explore`.

    Attributes
    ----------
    model : Model
        As it was given.
    setup : Setup
        How views are computed.
    sliders : tuple of Slider
    view : View
        What is shown.
    figure : Figure
    pointer : Pointer
        Hover and click.
    """

    def __init__(
        self, model: Model, setup: Setup, sliders: tuple[Slider, ...], figure: Figure
    ) -> None:
        self.model = model
        self.setup = setup
        self.sliders = sliders
        self.figure = figure
        self._picture = Picture(figure)
        self.pointer = Pointer(figure, (), self._clicked)
        self._widget: Any = None
        self._picked_in: View | None = None
        # Jupyter handles some messages of widgets in a thread beside that of the cells
        self._lock = threading.RLock()
        self.view = view_of(model, setup)
        if self.view.diagram is not None:
            self.setup = replace(setup, otherwise=self.view.diagram.over)
        self._draw(moving=False)

    @property
    def selected(self) -> Pick | None:
        """What was clicked last: ``selected.point`` is the point itself."""
        return self.pointer.selected

    def set(self, values: Mapping[Any, float] | None = None, /, **named: float) -> View:
        """Show other values of parameters, or of initial states.

        Parameters
        ----------
        values : mapping, optional
            Parameter or state to value.
        **named : float
            The same by name.

        Returns
        -------
        View

        Raises
        ------
        UnknownNameError
            For a name that is neither.
        ModelError
            For a value that is not a finite number.
        """
        return self._shown({**(values or {}), **named})

    def _shown(self, values: Mapping[Any, float], measured: bool = True) -> View:
        with self._lock:
            given = {str(name): value for name, value in values.items()}
            begin = {name: self.values[name] for name in self._states}
            changes = dict(self.view.changes)
            for name, value in given.items():
                if name in begin:
                    begin[name] = value
                elif name in self.model.parameters:
                    changes[name] = value
                else:
                    raise unknown_name("parameter or state", name, [*self.model.parameters, *begin])
            setup = at_start(self.setup, self.model, begin)
            self.view = view_of(self.model, setup, changes, measured=measured)
            self._draw(moving=not measured)
            return self.view

    def glance(self, values: Mapping[Any, float]) -> View:
        """As `set`, without measuring the run against the diagram: for a slider that moves."""
        return self._shown(values, measured=False)

    @property
    def values(self) -> dict[str, float]:
        """Parameters and initial states as they are shown."""
        begin = zip(self._states, self.view.setup.start, strict=True)
        return {**self.view.model.parameters, **dict(begin)}

    @property
    def _states(self) -> tuple[str, ...]:
        return (*self.model.states, *self.model.slow_states)

    def call(self) -> str:
        """Python source that reproduces what is shown, with the point if one was clicked in it."""
        text = self.view.call()
        if self.selected is None or self._picked_in is not self.view:
            return text
        return f"{text}\npoint = {self.selected.call}"

    def export(
        self,
        path: str | os.PathLike[str],
        *,
        sliders: Mapping[Any, Any] | None = None,
        title: str = "",
        source: str = "",
        most: int = 500,
        progress: bool = True,
    ) -> Path:
        """Write a page that shows the same in any browser, without Python or network.

        Every combination of the sliders' values is computed now. Hovering and
        clicking in the page find the rows of branches and runs, not places between.

        Parameters
        ----------
        path : str or path
            Where to, e.g. ``"gear.html"``.
        sliders : mapping, optional
            Name to a number of values evenly over its slider, or to the values
            themselves; by default 11 of the first slider. Others stay where they are.
        title : str
            Stands above.
        source : str
            Python source that makes the model, for the calls that the page shows.
        most : int
            Most combinations that are computed.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        Path

        Raises
        ------
        UnknownNameError
            For a name without slider.
        ArgumentError
            For values that are none, or more combinations than ``most``.
        FileError
            If the file cannot be written.
        """
        from fastslow.interactive.pages import write_page

        return write_page(self, Path(path), sliders, title, source, most, progress)

    @property
    def widget(self) -> Any:
        """Sliders and figure as an ipywidgets box.

        Raises
        ------
        MissingPackageError
            Without the extra ``interactive``.
        """
        if self._widget is None:
            from fastslow.interactive.controls import Controls

            self._widget = Controls(self)
        return self._widget.box

    def _draw(self, *, moving: bool) -> None:
        self.pointer.curves = self._picture.draw(self.view, moving=moving)
        self.pointer.near = None
        self.figure.canvas.draw_idle()
        if self._widget is not None:
            self._widget.follow()

    def _clicked(self, found: Pick) -> None:
        self._picked_in = self.view
        if self._widget is None:
            print(self.call())
        else:
            self._widget.tell(found.text)

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        try:
            return self.widget._repr_mimebundle_(**kwargs)
        except MissingPackageError as error:
            return picture(self.figure, f"{self!r}\n{error}")

    def __repr__(self) -> str:
        names = ", ".join(slider.label for slider in self.sliders)
        return f"Explorer of {', '.join(self._states)} with sliders for {names or 'nothing'}"
