"""A first fast-slow analysis of a model, as the public calls that it consists of."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from fastslow.arguments import Name, StateLike, formula, instance, validated
from fastslow.arguments import shown as shown_value
from fastslow.diagrams.trace.tracing import continue_equilibria
from fastslow.errors import ArgumentError
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
        The slow quantity, empty without one.
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

    def plot(self) -> Drawing:
        """Draw the overlay, as `fastslow.plot.overlay` does.

        Raises
        ------
        ArgumentError
            Without an overlay.
        """
        from fastslow.plot.passages import overlay as drawn

        if self.overlay is None:
            raise ArgumentError(f"there is no overlay to draw: {self.outcome}")
        return drawn(self.overlay)

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
    five separates its time scale from the next. Every step is a public call; they are listed, to
    go on from there.

    Parameters
    ----------
    model : Model or ModelFile
        A file has its initial state and time.
    state : sequence of float or mapping, optional
        Initial state; that of the file by default.
    t : (float, float), optional
        Start and end of time; those of the file by default.
    slow : str or Symbol, optional
        The slow state, in place of a proposal.

    Returns
    -------
    Analysis
        Its ``outcome`` says so if no state is slow or the run ends early; what was computed is
        kept.

    Raises
    ------
    ArgumentError
        Without an initial state or time, or for a model with several slow quantities.
    UnknownNameError
        For a slow state that the model does not have.
    ModelError
        For rates that depend on time explicitly.

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
    given = [*model.forcing, *model.slow_states]
    if len(given) + (slow is not None) > 1:
        names = ", ".join([*given, *([str(slow)] if slow is not None else [])])
        raise ArgumentError(
            f"several slow quantities, {names}; expected one, as a diagram is over one of them"
        )
    begin = start_values(model, state)
    run = simulate(model, begin, t=t)
    if run.backwards:
        raise ArgumentError(f"t = {shown_value(t)}; expected start < end")
    simulated = f"run = fs.simulate(model, {shown or begin}, t={(float(t[0]), float(t[1]))})"
    scales, name = time_scales_of(run), str(slow or (given or [""])[0])
    evidence: tuple[str, ...] = (f"{name} is slow as given.",)
    if not name:
        evidence, name = _proposed(scales)
    first = Analysis(
        model, run, "", scales, evidence, calls=(*calls, simulated), outcome=run.outcome
    )
    if not run.outcome:
        return first
    if not name:
        text = f"{evidence[-1]} Name one by slow=."
        return replace(first, outcome=Outcome("no slow state", text, False))
    if not given:
        model = model.with_slow([name])
        made = f"model = model.with_slow([{name!r}])"
        first = replace(
            first,
            model=model,
            run=simulate(model, begin, t=t),
            calls=(*first.calls, made, simulated),
        )
    return _overlaid(replace(first, slow=name))


def _overlaid(first: Analysis) -> Analysis:
    """The analysis with the diagram over its slow quantity, the cycles and the overlay."""
    name, run, frozen = first.slow, first.run, first.model.frozen()
    low, high = float(run[name].min()), float(run[name].max())
    margin = BEYOND_RANGE * (high - low)
    over = low - margin, high + margin
    diagram = continue_equilibria(frozen, name, over)
    calls = [f"diagram = fs.continue_equilibria(model.frozen(), {name!r}, over={over!r})"]
    cycles: tuple[OrbitBranch, ...] = ()
    if any(point.kind.starts_cycles for point in diagram.special):
        cycles = tuple(continue_cycles(diagram))
        calls.append("cycles = fs.continue_cycles(diagram)")
    found = overlay(diagram, run, cycles=cycles)
    calls.append(f"overlay = fs.overlay(diagram, run, cycles={'cycles' if cycles else '[]'})")
    return replace(
        first,
        calls=(*first.calls, *calls, "fs.plot.overlay(overlay)"),
        outcome=found.outcome,
        diagram=diagram,
        cycles=cycles,
        overlay=found,
    )


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


def _proposed(scales: dict[str, float]) -> tuple[tuple[str, ...], str]:
    """The evidence on the slowest state, and its name if it is separated from the others."""
    order = sorted(scales, key=scales.__getitem__)
    listed = ", ".join(f"{name} {scales[name]:.3g}" for name in order)
    evidence = [f"Time scales, range over largest rate after the transient: {listed}."]
    if len(order) < 2:
        return (*evidence, "Fewer than two states change: no state is slow."), ""
    fast, slow = order[-2:]
    ratio = scales[slow] / scales[fast]
    if ratio < SEPARATED:
        evidence.append(
            f"{slow}, the slowest, is {ratio:.3g} times as slow as {fast}, less than "
            f"{SEPARATED:g}: no state is proposed as slow."
        )
        return tuple(evidence), ""
    evidence.append(f"{slow} is {ratio:.3g} times as slow as {fast}: proposed as slow.")
    return tuple(evidence), slow
