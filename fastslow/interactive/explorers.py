"""Interactive exploration of a model: sliders and a live figure."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from fastslow.arguments import Name, StateLike, formula, instance, interval, mapping, validated
from fastslow.errors import MissingPackageError, unknown_name
from fastslow.interactive.controls import Controls
from fastslow.interactive.pages import write_page
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
    y=formula,
    sliders=mapping,
    figure=instance(Figure),
)
def explore(
    model: Model,
    *,
    parameter: Name | None = None,
    over: Sequence[float] | None = None,
    state: StateLike | None = None,
    t: Sequence[float] | None = None,
    periods: float | None = None,
    integration: Integration = DEFAULT,
    y: Name | None = None,
    sliders: Mapping[Any, Sequence[float]] | None = None,
    figure: Figure | None = None,
) -> Explorer:
    """Vary parameters of a model by sliders, with its diagram, trajectory and overlay.

    A notebook displays the explorer as the last line of a cell (extra ``interactive``);
    `Explorer.export` writes it as a page that needs no Python. Hover shows the nearest point,
    and a click returns it as `Explorer.selected`.

    Parameters
    ----------
    model : Model
    parameter : str or Symbol, optional
        Continuation parameter of the diagram; by default the first slow quantity, or the
        first parameter of a model without slow quantities.
    over : (float, float), optional
        Its range; by default that of the run with a margin, for a parameter from zero to
        twice its value.
    state : sequence of float or mapping, optional
        Initial states, then slow states; by default zeros.
    t, periods
        Length of the run, as in `fastslow.simulate`; by default two periods, and
        t = (0, 100) where there is no period.
    integration : Integration
        Error control of the run.
    y : str or Symbol, optional
        State drawn over time and over the parameter, by default the first.
    sliders : mapping, optional
        Parameter, or state for its initial value, to the range of its slider; by
        default every parameter has one, from zero to twice its value.
    figure : Figure, optional
        Figure to draw into, e.g. ``plt.figure()`` for a separate window.

    Returns
    -------
    Explorer

    Raises
    ------
    UnknownNameError
        For a name that does not occur in the model.
    ArgumentError
        For an invalid range, initial state or time span.

    See Also
    --------
    fastslow.pick, fastslow.simulate, fastslow.plot.overlay

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
        state=state,
        t=t,
        periods=periods,
        integration=integration,
        y=y,
    )
    names = (*model.states, *model.slow_states)
    made = sliders_of(model, dict(zip(names, setup.state, strict=True)), sliders)
    return Explorer(model, setup, made, own_figure() if figure is None else figure)


class Explorer:
    """A model with sliders and a live figure, returned by `fastslow.explore`.

    Attributes
    ----------
    model : Model
        The model as given.
    setup : Setup
        Settings by which views are computed.
    sliders : tuple of Slider
    view : View
        The current view.
    figure : Figure
    pointer : Pointer
        Picking in the figure.
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
        # Jupyter handles some messages of widgets in a second thread
        self._lock = threading.RLock()
        self.view = view_of(model, setup)
        if self.view.diagram is not None:
            self.setup = replace(setup, otherwise=self.view.diagram.over)
        self._draw(moving=False)

    @property
    def selected(self) -> Pick | None:
        """The last clicked point, ``selected.point``, with its description."""
        return self.pointer.selected

    def set(self, values: Mapping[Any, float] | None = None, /, **named: float) -> View:
        """Set values of parameters or initial states, and update the figure.

        Parameters
        ----------
        values : mapping, optional
            Parameter or state to value.
        **named : float
            The same by keyword.

        Returns
        -------
        View

        Raises
        ------
        UnknownNameError
            For a name that is neither a parameter nor a state.
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
        """Set values without computing the overlay, as while a slider moves."""
        return self._shown(values, measured=False)

    @property
    def values(self) -> dict[str, float]:
        """Current values of parameters and initial states."""
        begin = zip(self._states, self.view.setup.state, strict=True)
        return {**self.view.model.parameters, **dict(begin)}

    @property
    def _states(self) -> tuple[str, ...]:
        return (*self.model.states, *self.model.slow_states)

    def call(self) -> str:
        """Return Python source that reproduces the view and the selected point, if any."""
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
        max_frames: int = 500,
        progress: bool = True,
    ) -> Path:
        """Write an HTML page with sliders and picking, which needs no Python or network.

        All combinations of slider values are computed in advance. Picking in the page finds
        rows of branches and runs, not points between them.

        Parameters
        ----------
        path : str or path
            Destination, e.g. ``"gear.html"``.
        sliders : mapping, optional
            Name to a number of equidistant values or to the values themselves; by default
            11 values of the first slider. Other sliders keep their current values.
        title : str
            Heading of the page.
        source : str
            Python source that defines the model, for the calls shown in the page.
        max_frames : int
            Largest number of combinations.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        Path

        Raises
        ------
        UnknownNameError
            For a name without a slider.
        ArgumentError
            For invalid values, or more combinations than ``max_frames``.
        FileError
            If the file cannot be written.
        """
        return write_page(self, Path(path), sliders, title, source, max_frames, progress)

    @property
    def widget(self) -> Any:
        """Return sliders and figure as an ipywidgets box.

        Raises
        ------
        MissingPackageError
            Without the extra ``interactive``.
        """
        if self._widget is None:
            self._widget = Controls(self)
        return self._widget.box

    def _draw(self, *, moving: bool) -> None:
        self.pointer.curves = self._picture.draw(self.view, moving=moving)
        self.pointer.near = None
        self.figure.canvas.draw_idle()
        if self._widget is not None:
            self._widget.sync_sliders()

    def _clicked(self, found: Pick) -> None:
        self._picked_in = self.view
        if self._widget is None:
            print(self.call())
        else:
            self._widget.show_text(found.text)

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        try:
            return self.widget._repr_mimebundle_(**kwargs)
        except MissingPackageError as error:
            return picture(self.figure, f"{self!r}\n{error}")

    def __repr__(self) -> str:
        names = ", ".join(slider.label for slider in self.sliders)
        return f"Explorer of {', '.join(self._states)} with sliders for {names or 'nothing'}"
