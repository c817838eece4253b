"""A first fast-slow analysis of a model, as the public calls that it consists of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from fastslow.arguments import Name, StateLike, formula, instance, validated
from fastslow.arguments import shown as shown_value
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import ArgumentError, FastSlowError, unknown_name
from fastslow.model.model import Model
from fastslow.orbits.trace.frozen_branches import continue_cycles
from fastslow.passage.overlay.overlays import overlay
from fastslow.readers.model_files import ModelFile
from fastslow.results.base.display import Summarized
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.overlay.overlay import Overlay
from fastslow.results.trajectory.trajectory import Trajectory
from fastslow.simulation.arguments import start_values
from fastslow.simulation.one import simulate

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fastslow.plot.arguments import Axis
    from fastslow.plot.drawings import Drawing

#: Ratio of two time scales from which they are separated.
SEPARATED = 5.0

#: Fraction of the run that is left out as a transient when time scales are measured.
TRANSIENT = 0.25

#: Extension of the range of the slow quantity in the diagram, as a fraction of it.
BEYOND_RANGE = 1.0


@dataclass(frozen=True, eq=False, repr=False)
class Analysis(Summarized):
    """A first fast-slow analysis, with the calls that compute it.

    Parameters
    ----------
    model : Model
        The model with its slow quantity, also if that was proposed.
    run : Trajectory
    slow : str
        The slow quantity over which the diagram is, empty without one.
    time_scales : dict
        State to its range divided by the largest modulus of its rate, after the transient.
    evidence : tuple of str
        Why this quantity is slow, or why none is.
    calls : tuple of str
        The steps as Python, in which ``model``, or ``file``, is what was analysed.
    outcome : Outcome
    diagram : Diagram, optional
    cycles : tuple of OrbitBranch
    overlay : Overlay, optional
    held : dict
        Further slow quantities to their values in the diagram, the middles of their ranges.
    """

    model: Model
    run: Trajectory
    slow: str
    time_scales: dict[str, float]
    evidence: tuple[str, ...]
    calls: tuple[str, ...]
    outcome: Outcome
    diagram: Diagram | None = None
    cycles: tuple[OrbitBranch, ...] = ()
    overlay: Overlay | None = None
    held: dict[str, float] = field(default_factory=dict)

    def plot(self, y: Axis | None = None, *, ax: Axes | None = None) -> Drawing:
        """Draw the overlay as `fastslow.plot.overlay` does, or the diagram if there is no overlay.

        Parameters
        ----------
        y : str, Symbol, Expr or callable, optional
            Quantity on the vertical axis, by default the first state.
        ax : Axes, optional
            Axes to draw into; new ones otherwise.

        Raises
        ------
        ArgumentError
            Without overlay and diagram.
        """
        if self.overlay is not None:
            from fastslow.plot.passages import overlay as drawn

            return drawn(self.overlay, y, ax=ax)
        if self.diagram is not None:
            from fastslow.plot.branches import diagram as drawn_diagram

            return drawn_diagram(self.diagram, y, ax=ax, cycles=self.cycles)
        raise ArgumentError(f"there is no overlay to draw: {self.outcome}")

    def _groups(self) -> list[list[str]]:
        states = ", ".join((*self.model.states, *self.model.slow_states))
        of = f"with {self.slow} as slow quantity" if self.slow else "without a slow quantity"
        lines = [f"  {sentence}" for sentence in self.evidence]
        if self.overlay is not None and self.overlay.bursting is not None:
            lines.append(f"  {self.overlay.bursting}")
        calls = ["  calls:", *(f"    {call}" for call in self.calls)]
        return [[f"Analysis of {states}, {of}"], lines, [*calls, f"  {self.outcome}"]]


@validated(model=instance(Model, ModelFile), slow=formula)
def analyse(
    model: Model | ModelFile,
    state: StateLike | None = None,
    *,
    t: tuple[float, float] | None = None,
    slow: Name | None = None,
) -> Analysis:
    r"""Analyse a model for the first time: what is slow, the frozen diagram, and the overlay.

    If the model has no slow quantity, the states are compared by their time scales along a run,
    their ranges divided by their largest rates. The slowest one is proposed if a gap of at least
    five separates its time scale from the next; without such a gap, several are proposed if the
    largest gap between the others is that large. With several slow quantities the diagram is over
    the fastest of them, or that of ``slow=``; the others are constant in it, at the middles of
    their ranges in the run. Every step is a public call; they are listed, to go on from there.

    Parameters
    ----------
    model : Model or ModelFile
        A file has its initial state and time.
    state : sequence of float or mapping, optional
        Initial state; that of the file by default.
    t : (float, float), optional
        Start and end of time; those of the file by default.
    slow : str or Symbol, optional
        The slow state, in place of a proposal; of a model with slow quantities, the one over which
        the diagram is.

    Returns
    -------
    Analysis
        Its ``outcome`` says so if no state is slow, the run ends early, or a later step raised an
        error; what was computed before is kept.

    Raises
    ------
    ArgumentError
        Without an initial state or time, or for a time that runs backwards.
    UnknownNameError
        For a slow state that the model does not have, or for one that is no slow quantity of a
        model that has some.
    ModelError
        For rates that depend on time explicitly.

    See Also
    --------
    fastslow.overlay, fastslow.continue_equilibria, fastslow.simulate, fastslow.read

    Examples
    --------
    >>> import fastslow as fs
    >>> file = fs.read_ode("x'=x-x^3/3-z\nz'=eps*x\npar eps=.01\ninit x=2\n@ total=300\ndone")
    >>> found = analyse(file)
    >>> found.slow, str(found.overlay.bursting)
    ('z', 'relaxation oscillation (symmetric fold/fold)')
    >>> print("\n".join(found.calls))  # doctest: +ELLIPSIS
    model = file.model
    run = fs.simulate(model, file.initial, t=(0.0, 300.0))
    model = model.with_slow(['z'])
    run = fs.simulate(model, file.initial, t=(0.0, 300.0))
    diagram = fs.continue_equilibria(model.frozen(), 'z', over=(...))
    overlay = fs.overlay(diagram, run, cycles=[])
    fs.plot.overlay(overlay)
    """
    calls, shown = [], ""
    if isinstance(model, ModelFile):
        shown = "file.initial" if state is None else ""
        state, t = model.initial if state is None else state, t or model.t
        calls, model = ["model = file.model"], model.model
    if state is None or t is None:
        raise ArgumentError("expected an initial state and t=(start, end), which a file would have")
    given = (*model.forcing, *model.slow_states)
    if slow is not None and given and str(slow) not in given:
        raise unknown_name("slow quantity", slow, given)
    begin = start_values(model, state)
    run = simulate(model, begin, t=t)
    if run.backwards:
        raise ArgumentError(f"t = {shown_value(t)}; expected start < end")
    simulated = f"run = fs.simulate(model, {shown or begin}, t={(float(t[0]), float(t[1]))})"
    scales = time_scales_of(run)
    names = given or (() if slow is None else (str(slow),))
    evidence: tuple[str, ...] = (f"{_listed(names)} slow as given.",) if names else ()
    if not names:
        evidence, names = _proposed(scales)
    first = Analysis(
        model, run, "", scales, evidence, calls=(*calls, simulated), outcome=run.outcome
    )
    if not run.outcome:
        return first
    if not names:
        text = f"{evidence[-1]} Name one by slow=."
        return replace(first, outcome=Outcome("no slow state", text, False))
    if not given:
        model = model.with_slow(names)
        made = f"model = model.with_slow({list(names)!r})"
        first = replace(
            first,
            model=model,
            run=simulate(model, begin, t=t),
            calls=(*first.calls, made, simulated),
        )
    return _overlaid(_with_axis(first, names, None if slow is None else str(slow)))


def _with_axis(first: Analysis, names: Sequence[str], wanted: str | None) -> Analysis:
    """The analysis with the quantity over which the diagram is, and the others held."""
    run = first.run
    moving = [name for name in names if np.ptp(run[name]) > 0.0] or list(names)
    scales = time_scales_of(run)
    name = wanted or min(moving, key=lambda n: scales.get(n, np.inf))
    held = {n: 0.5 * float(run[n].min() + run[n].max()) for n in names if n != name}
    if not held:
        return replace(first, slow=name)
    values = ", ".join(f"{n} = {value:.4g}" for n, value in held.items())
    sentence = f"The diagram is over {name}, with {values}, the middle of the range in the run."
    return replace(first, slow=name, held=held, evidence=(*first.evidence, sentence))


def _overlaid(first: Analysis) -> Analysis:
    """The analysis with the diagram over its slow quantity, the cycles and the overlay.

    A step that raises an error ends the analysis, except the cycles, without which it goes on.
    """
    name, run = first.slow, first.run
    low, high = float(run[name].min()), float(run[name].max())
    margin = BEYOND_RANGE * (high - low)
    over = low - margin, high + margin
    try:
        frozen = first.model.frozen()
        held = {n: value for n, value in first.held.items() if n in frozen.free}
        diagram = continue_equilibria(frozen.with_parameters(held), name, over)
    except FastSlowError as error:
        return replace(first, outcome=_not_computed("diagram", error))
    fixed = f".with_parameters({held!r})" if held else ""
    call = f"diagram = fs.continue_equilibria(model.frozen(){fixed}, {name!r}, over={over!r})"
    first = replace(first, diagram=diagram, calls=(*first.calls, call))
    cycles: tuple[OrbitBranch, ...] = ()
    failure: Outcome | None = None
    try:
        cycles = tuple(continue_cycles(diagram))
    except FastSlowError as error:
        failure = _not_computed("branch of cycles", error)
    if cycles:
        call = "cycles = fs.continue_cycles(diagram)"
        first = replace(first, cycles=cycles, calls=(*first.calls, call))
    try:
        found = overlay(diagram, run, cycles=cycles)
    except FastSlowError as error:
        return replace(first, outcome=_not_computed("overlay", error))
    call = f"overlay = fs.overlay(diagram, run, cycles={'cycles' if cycles else '[]'})"
    calls = (*first.calls, call, "fs.plot.overlay(overlay)")
    outcome = found.outcome if failure is None else failure
    return replace(first, calls=calls, outcome=outcome, overlay=found)


def _not_computed(what: str, error: FastSlowError) -> Outcome:
    return Outcome("not computed", f"no {what}: {error}", False)


def _listed(names: Sequence[str]) -> str:
    """Names with the verb: ``x is``; ``x and y are``."""
    if len(names) == 1:
        return f"{names[0]} is"
    return f"{', '.join(names[:-1])} and {names[-1]} are"


def time_scales_of(run: Trajectory) -> dict[str, float]:
    """Return the range of every state that changes, divided by its largest rate.

    The first quarter of the run is left out, if it has at least one step after it.
    """
    assert run.series is not None
    since = run.span[0] + TRANSIENT * (run.span[1] - run.span[0])
    rows = run.step_starts >= since
    if not rows.any():
        rows[:] = True
    found = {}
    for k, name in enumerate(run.states):
        values, rates = run.series[rows, k, 0], np.abs(run.series[rows, k, 1])
        reach = min(float(np.ptp(values)), float(run.periods.get(name, np.inf)))
        if rates.max(initial=0.0) > 0.0 and reach > 0.0:
            found[name] = reach / float(rates.max())
    return found


def _proposed(scales: dict[str, float]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The evidence on the slowest states, and the names of those that a gap separates."""
    order = sorted(scales, key=scales.__getitem__)
    listed = ", ".join(f"{name} {scales[name]:.3g}" for name in order)
    evidence = f"Time scales, range over largest rate after the transient: {listed}."
    if len(order) < 2:
        return (evidence, "Fewer than two states change: no state is slow."), ()
    ratios = [scales[b] / scales[a] for a, b in pairwise(order)]
    place = len(ratios) - 1 if ratios[-1] >= SEPARATED else int(np.argmax(ratios))
    if ratios[place] < SEPARATED:
        slow, fast, ratio = order[-1], order[-2], ratios[-1]
        sentence = (
            f"{slow}, the slowest, is {ratio:.3g} times as slow as {fast}, less than "
            f"{SEPARATED:g}: no state is proposed as slow."
        )
        return (evidence, sentence), ()
    names = tuple(order[place + 1 :])
    sentence = f"{names[0]} is {ratios[place]:.3g} times as slow as {order[place]}: "
    sentence += "proposed as slow." if len(names) == 1 else f"{_listed(names)} proposed as slow."
    return (evidence, sentence), names
