"""Constituents of an overlay: stable branches, phases, transitions, bursting."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.results.base.display import Displayed
from fastslow.results.base.immutable import Immutable
from fastslow.results.base.table import ResultTable, at_values, named_value
from fastslow.results.orbits.special_orbit import SpecialOrbit
from fastslow.results.overlay.delays import Delay
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.queries.state_at import StatePoint

#: Label in place of a stable branch during oscillations.
OSCILLATING = "oscillating"

#: Kinds of transition with a description.
TYPES = {
    "jump": "departure at a smooth or non-smooth fold",
    "Hopf": "delayed departure past a Hopf point",
    "branch point": "delayed departure past a branch point",
    "period doubling": "delayed departure past a period doubling",
    "torus": "delayed departure past a torus bifurcation",
    "crossing": "persistence across a boundary equilibrium, or of an orbit across a contact",
    "gap crossing": "crossing of a gap with a continuum of equilibria",
    "switch": "change of a switch at a threshold that the equilibria have reached",
    "steep": "large lag on a steep part of a stable branch, no bifurcation",
    "rate-induced": "loss of a branch that remains stable but drifts too fast",
    "grazing": "departure at a tangency with an interface, or at a contact of an orbit with one",
    "end of oscillation": "end of the fast oscillation",
    "excursion": "departure from a stable branch that has not ended, and return",
    "loss of tracking": "departure from a stable branch that has not ended, no bifurcation nearby",
    "unclassified": "departure near a special point that does not explain it",
}


#: Columns of a table of transitions: words and numbers.
WORDS = ("type", "from_branch", "to_branch")
NUMBERS = ("delay", "predicted", "duration", "width", "slope", "steepness")

#: Kinds of phase.
PHASES = (
    "quasi-static",
    "oscillating",
    "jump",
    "gap crossing",
    "excursion",
    "transient",
    "outside",
    "sticking",
)


@dataclass(frozen=True)
class StableBranch(Displayed):
    """Stable part of a continued branch within one region (attracting sheet).

    Parameters
    ----------
    label : str
        The region, with a number if it contains several: ``"S1"``, ``"S1.2"``.
    branch : int
        Index of the continued branch in the diagram.
    start, stop : int
        Rows ``start`` to ``stop - 1`` of the branch.
    region : str
        Region of its equilibria; of periodic orbits the itinerary of the first one.
    """

    label: str
    branch: int
    start: int
    stop: int
    region: str


@dataclass(frozen=True, eq=False, repr=False)
class Transition(Immutable):
    """Departure from a stable branch, or end of an oscillating phase.

    Parameters
    ----------
    time, value : float
        Time of the transition and value of the slow quantity then. Between two stable
        branches: where two thirds of the distance from the old to the new one are covered; at
        the passage of a boundary equilibrium: where the interface is crossed; at the onset of
        an oscillation: where the old branch is left; at its end: the last maximum.
    state : ndarray, shape (n,)
        State at that time.
    from_branch, to_branch : str
        Labels of stable branches, or ``"oscillating"``; ``to_branch`` is "" if the run ends
        before it reaches another stable branch.
    special : SpecialPoint, SpecialOrbit or None
        The special point responsible: the end of the old branch that was passed.
    delay : float
        Distance of ``value`` past the special point, away from the old branch, in units of
        the slow quantity; nan without a special point.
    type : str
        ``"jump"``, ``"Hopf"``, ``"branch point"``, ``"period doubling"``, ``"torus"``,
        ``"crossing"``, ``"gap crossing"``, ``"switch"``, ``"steep"``, ``"rate-induced"``,
        ``"grazing"``, ``"end of oscillation"``, ``"excursion"``, ``"loss of tracking"`` or
        ``"unclassified"``.
    leave : StatePoint
        State at which the distance from the old branch exceeds the radius of the overlay;
        in a gap crossing, the crossing of the first interface.
    land : StatePoint or None
        State from which on the distance from the new branch is below the radius; in a gap
        crossing, the first crossing of the second interface; None if the run ends before.
    slope : float
        |dw/dt| of the slow quantity w where it passes the special point (at ``time`` without one).
    steepness : float
        Largest predicted lag behind the old branch, |dX/dw| |dw/dt| / |λ|, in units of each
        state's extent; a branch is followed closely if this is well below 1.
    note : str
        Further evidence.
    turned : bool
        Whether the slow quantity has an extremum past the special point during the jump;
        ``time`` and ``delay`` are then those of the extremum.
    law : Delay, optional
        Predicted delay for a drift at ``slope``: of a jump up to the same state, of a gap
        crossing between the same interfaces.
    """

    time: float
    value: float
    state: NDArray[np.float64]
    from_branch: str
    to_branch: str
    special: SpecialPoint | SpecialOrbit | None
    delay: float
    type: str
    leave: StatePoint
    land: StatePoint | None = None
    slope: float = float("nan")
    steepness: float = float("nan")
    note: str = ""
    law: Delay | None = None
    turned: bool = False

    @property
    def special_equilibrium(self) -> SpecialPoint | None:
        """The special point if it is one of equilibria, None for one of periodic orbits."""
        return self.special if isinstance(self.special, SpecialPoint) else None

    @property
    def predicted(self) -> float:
        """Predicted delay, of a gap crossing the predicted width; nan without a law."""
        return float("nan") if self.law is None else self.law.predicted

    @property
    def duration(self) -> float:
        """Time from leaving to landing; nan without a landing."""
        return float("nan") if self.land is None else self.land.time - self.leave.time

    @property
    def width(self) -> float:
        """Change of the slow quantity from leaving to landing; nan without a landing."""
        return float("nan") if self.land is None else abs(self.land.value - self.leave.value)

    @property
    def description(self) -> str:
        """The transition in one line."""
        name = self.leave.parameter
        head = f"t = {self.time:.6g}, {name} = {self.value:z.6g}: "
        if self.to_branch == self.from_branch and self.type == "excursion":
            parts = [f"excursion from {self.from_branch}"]
        elif self.to_branch == self.from_branch:
            parts = [f"{self.type} on {self.from_branch}"]
        else:
            parts = [f"{self.from_branch} → {self.to_branch or 'end of run'}, {self.type}"]
        if self.special is not None:
            words = self.special.type
            if isinstance(self.special, SpecialPoint):
                words = words or self.special.criticality
            label = self.special.label + (f" ({words})" if words else "")
            parts[0] += f" at {label}, {name} = {self.special[name]:z.6g}"
            if np.isfinite(self.delay):
                turned = f", at the extremum of {name}" if self.turned else ""
                parts.append(f"delay {self.delay:z.3g}{turned}{self._predicted('delay')}")
        elif self.type not in ("steep", "end of oscillation"):
            parts.append("no bifurcation nearby")
        if self.type == "steep":
            parts.append(
                f"no bifurcation: the predicted lag |dX/d{name}| |d{name}/dt| / |λ| reaches "
                f"{self.steepness:.2g} of the state's extent"
            )
        if self.type == "gap crossing" and self.land is not None:
            parts.append(
                f"no bifurcation: duration {self.duration:.4g}{self._predicted('duration')}, "
                f"Δ{name} = {self.width:.4g}{self._predicted('width')}, "
                f"where |d{name}/dt| = {self.slope:.4g}"
            )
        elif self.land is not None and self.land.time > self.time:
            parts.append(f"lands at {name} = {self.land.value:z.6g}, t = {self.land.time:.6g}")
        if self.note and self.type != "end of oscillation":
            parts.append(self.note)
        return head + "; ".join(parts)

    def __repr__(self) -> str:
        return f"Transition({self.description})"

    def _predicted(self, quantity: str) -> str:
        """Return the prediction of a quantity as printed after it."""
        words = "" if self.law is None else self.law.in_words.get(quantity, "")
        return f" (predicted {words})" if words else ""


class Transitions(ResultTable[Transition]):
    """Transitions in order of time, as a table.

    ``transitions[0]`` is a `Transition`, ``transitions["delay"]`` a column,
    ``select("delay > 0.1", type="jump")`` the table of some transitions and ``nearest(w=0.2)``
    a single one.

    Examples
    --------
    >>> Transitions().select(type="jump")
    0 transitions
    """

    _row = "t"
    _places = ("t",)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return t, slow quantity, states, type, branches, special point, delay and duration.

        ``special`` is the label of the special point, ``predicted`` the predicted delay, in a
        gap crossing the predicted width.
        """
        first = self[0].leave if len(self) else None
        names = () if first is None else first.states
        state = np.array([t.state for t in self], dtype=float).reshape(len(self), len(names))
        words = {name: [getattr(t, name) for t in self] for name in WORDS}
        words["special"] = ["" if t.special is None else t.special.label for t in self]
        numbers = {name: [getattr(t, name) for t in self] for name in NUMBERS}
        slow = {} if first is None else {first.parameter: np.array([t.value for t in self])}
        return {
            "t": np.array([t.time for t in self], dtype=float),
            **slow,
            **dict(zip(names, state.T, strict=True)),
            **{name: np.array(values, dtype=str) for name, values in words.items()},
            **{name: np.array(values, dtype=float) for name, values in numbers.items()},
        }

    def _constants(self) -> Mapping[str, float]:
        return self[0].leave.parameters if len(self) else {}

    def _words(self) -> Mapping[str, Collection[str]]:
        return {"type": TYPES}

    def _heading(self) -> str:
        return f"{len(self)} transition{'' if len(self) == 1 else 's'}"

    def at(self, **value: Any) -> Any:
        """Return the transitions during which t or the slow quantity takes a value.

        A transition lasts from leaving the old stable branch to landing on the new one.

        Parameters
        ----------
        **value : float or array_like, shape (m,)
            Time ``t`` or the slow quantity by name, e.g. ``w=0.1``.

        Returns
        -------
        Transitions, or list of m Transitions

        Raises
        ------
        UnknownNameError
            For another name.
        """
        slow = [self[0].leave.parameter] if len(self) else []
        name, given = named_value("transition parameter", ["t", *slow], value)

        def during(number: float) -> Transitions:
            return Transitions(t for t in self if _lasts(t, name, number))

        return at_values(name, given, during)


def _lasts(transition: Transition, name: str, value: float) -> bool:
    """Return True if a column takes a value between leaving and landing."""
    ends = [transition.leave, *([] if transition.land is None else [transition.land])]
    if name == "t":
        last = ends[-1].time if transition.land is not None else np.inf
        return bool(min(transition.time, ends[0].time) <= value <= max(transition.time, last))
    values = [transition.value, *(end.value for end in ends)]
    return min(values) <= value <= max(values)


@dataclass(frozen=True)
class Phase(Displayed):
    """Time interval with one kind of motion.

    Parameters
    ----------
    start, end : float
    type : str
        ``"quasi-static"`` (follows a stable branch), ``"oscillating"`` (at least two oscillations
        away from the stable branches), ``"jump"`` (from one stable branch to the next),
        ``"gap crossing"`` (a jump across a gap), ``"excursion"`` (from a stable branch and back),
        ``"transient"`` (at the start or the end of the run, near no stable branch),
        ``"outside"`` (beyond the range of the diagram) or ``"sticking"`` (at rest in a band of
        equilibria).
    stable_branches : tuple of str
        Labels of the stable branches followed, in order; of an oscillation that decays onto a
        stable branch, the label of that one.
    oscillations : int
        Number of maxima of the observed state.
    attractor : str
        Of an oscillating phase ``"cycle"``, or ``"equilibrium"`` if the oscillation decays onto
        a stable branch that exists throughout; else "".
    intervals : tuple of float
        Times between successive maxima.
    sizes : tuple of float
        Of an oscillating phase, the rise of the observed state to each maximum, in its own
        units.
    """

    start: float
    end: float
    type: str
    stable_branches: tuple[str, ...] = ()
    oscillations: int = 0
    attractor: str = ""
    intervals: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()

    @property
    def duration(self) -> float:
        return self.end - self.start


class Phases(ResultTable[Phase]):
    """Phases of a run in order of time, as a table.

    ``phases[0]`` is a `Phase`, ``phases["duration"]`` a column,
    ``select("duration > 10", type="jump")`` the table of some phases and ``at(t=3.0)`` that of
    the phases at a time.

    Examples
    --------
    >>> phases = Phases([Phase(0, 8, "quasi-static", ("S1",)), Phase(8, 9, "jump")])
    >>> phases["duration"]
    array([8., 1.])
    >>> phases.at(t=8.5)[0].type
    'jump'
    """

    _row = "phase"

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return start, end, duration, type, stable branches, oscillations and attractor."""
        branches = [", ".join(phase.stable_branches) for phase in self]
        return {
            **{
                name: np.array([getattr(phase, name) for phase in self], dtype=float)
                for name in ("start", "end", "duration")
            },
            "type": np.array([phase.type for phase in self], dtype=str),
            "stable_branches": np.array(branches, dtype=str),
            "oscillations": np.array([phase.oscillations for phase in self], dtype=np.int64),
            "attractor": np.array([phase.attractor for phase in self], dtype=str),
        }

    def _words(self) -> Mapping[str, Collection[str]]:
        return {"type": PHASES}

    def _heading(self) -> str:
        return f"{len(self)} phase{'' if len(self) == 1 else 's'}"

    def at(self, **value: Any) -> Any:
        """Return the phases at a time; at the time between two phases both.

        Parameters
        ----------
        **value : float or array_like, shape (m,)
            The time ``t``.

        Returns
        -------
        Phases, or list of m Phases
        """
        name, given = named_value("phase parameter", ["t"], value)
        return at_values(name, given, lambda t: Phases(p for p in self if p.start <= t <= p.end))


def clipped(phases: Phases, begin: float, end: float) -> Phases:
    """Restrict phases to a time interval; counts remain those of the whole phase."""
    return Phases(
        replace(phase, start=max(phase.start, begin), end=min(phase.end, end))
        for phase in phases
        if min(phase.end, end) > max(phase.start, begin)
    )


@dataclass(frozen=True)
class Bursting(Displayed):
    """Classification of recurrent quasi-static and oscillating phases, or of jumps.

    Parameters
    ----------
    name : str
        E.g. ``"fold/Hopf bursting"``: the bifurcation at the onset of the oscillation, then the
        one at its end (Izhikevich 2000).
    evidence : tuple of str
        Statements that support the classification.
    """

    name: str
    evidence: tuple[str, ...]

    def __str__(self) -> str:
        return self.name
