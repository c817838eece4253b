"""What an overlay finds along a trajectory: sheets, phases, transitions, the kind of bursting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import word
from fastslow.results.base.immutable import Immutable, ImmutableSequence
from fastslow.results.overlay.delays import Delay, GapTransit
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.state_at import StatePoint

#: Stands for a sheet where the fast motion follows none.
OSCILLATING = "oscillating"

#: Every kind of transition, and what happens there.
KINDS = {
    "jump": "leaves at a fold, smooth or not",
    "Hopf": "leaves at a Hopf point",
    "branch point": "leaves at a branch point",
    "crossing": "goes on across a boundary equilibrium",
    "gap crossing": "crosses a gap, over a continuum of equilibria",
    "steep": "falls behind a steep slope without bifurcation",
    "rate-induced": "loses a sheet that stays stable, as it drifts too fast to be followed",
    "grazing": "leaves where it touches an interface",
    "end of oscillation": "the fast oscillation ends",
    "excursion": "leaves a sheet that has not ended and comes back",
    "loss of tracking": "leaves a sheet that has not ended, without a bifurcation nearby",
    "unclassified": "leaves near a special point that does not explain it",
}


#: Every kind of phase.
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
class StableSheet:
    """A stable run of a branch, in one region, that a trajectory can follow.

    Parameters
    ----------
    label : str
        The region, numbered where a region has several: ``"S1"``, ``"S1.2"``.
    branch : int
        Number of the branch in the diagram.
    start, stop : int
        Rows ``start`` to ``stop - 1`` of the branch.
    region : str
        The region of its equilibria.
    """

    label: str
    branch: int
    start: int
    stop: int
    region: str


@dataclass(frozen=True, eq=False)
class Transition(Immutable):
    """A leaving of the followed sheet, or the end of an oscillating phase, up to the next sheet.

    Parameters
    ----------
    time, value : float
        When it happened, and the slow quantity then: between two sheets where two
        thirds of the way from the old one to the new one are done; at the passage of
        a boundary equilibrium where the interface is crossed; at the start of an oscillation
        where the old sheet is left; at its end the last maximum.
    state : ndarray, shape (n,)
        The state at that time.
    from_sheet, to_sheet : str
        Labels of the sheets, or ``"oscillating"``; to_sheet is "" where the run ends before
        it comes to another sheet.
    special : SpecialPoint or None
        The special point responsible: the end of the old sheet that was passed.
    delay : float
        How far past the special point, away from the old sheet, the slow
        quantity is at ``value``, in its own units; nan without a special point.
    kind : str
        ``"jump"``, ``"Hopf"``, ``"branch point"``, ``"crossing"``, ``"gap crossing"``, ``"steep"``,
        ``"rate-induced"``, ``"grazing"``, ``"end of oscillation"``, ``"excursion"``,
        ``"loss of tracking"`` or ``"unclassified"``.
    leave : StatePoint
        Where the old sheet is farther away than the radius of the overlay; across a gap
        the crossing of its first interface.
    land : StatePoint or None
        Where the new sheet is nearer than that for good; across a gap the first crossing of
        its other interface; None where the run ends before.
    slope : float
        |dw/dt| of the slow quantity w where it passes the special point (at ``time`` without one).
    steepness : float
        Largest predicted lag of the motion behind the old sheet, |dX/dw| |dw/dt| / |λ|,
        in units of each state's extent: well below 1 a sheet is followed.
    note : str
        Further evidence in words.
    turned : bool
        Whether the slow quantity turns round past the special point during the jump;
        ``time`` and ``delay`` are then those of its extreme.
    law : Delay, optional
        What the law of delay predicts for a drift at ``slope``: for a jump at the same
        state as here, for a transit between the same interfaces.
    """

    time: float
    value: float
    state: NDArray[np.float64]
    from_sheet: str
    to_sheet: str
    special: SpecialPoint | None
    delay: float
    kind: str
    leave: StatePoint
    land: StatePoint | None = None
    slope: float = float("nan")
    steepness: float = float("nan")
    note: str = ""
    law: Delay | None = None
    turned: bool = False

    @property
    def predicted(self) -> float:
        """The delay that the law predicts, of a transit its width; nan without a law."""
        if self.law is None:
            return float("nan")
        return self.law.transit if isinstance(self.law, GapTransit) else self.law.delay

    @property
    def duration(self) -> float:
        """Time from leaving to landing; nan without a landing."""
        return float("nan") if self.land is None else self.land.time - self.leave.time

    @property
    def width(self) -> float:
        """Change of the slow quantity from leaving to landing; nan without a landing."""
        return float("nan") if self.land is None else abs(self.land.value - self.leave.value)

    def describe(self, name: str) -> str:
        """In one line, with the slow quantity's name."""
        change = f"t = {self.time:.6g}, {name} = {self.value:.6g}: "
        if self.to_sheet == self.from_sheet and self.kind == "excursion":
            parts = [f"excursion from {self.from_sheet}"]
        elif self.to_sheet == self.from_sheet:
            parts = [f"{self.from_sheet} left and reached again, {self.kind}"]
        else:
            parts = [f"{self.from_sheet} → {self.to_sheet or 'end of run'}, {self.kind}"]
        if self.special is not None:
            words = self.special.subtype or self.special.criticality
            label = self.special.label + (f" ({words})" if words else "")
            parts[0] += f" at {label}, {name} = {self.special[name]:.6g}"
            if np.isfinite(self.delay):
                turned = f", where {name} turns round" if self.turned else ""
                law = ""
                if self.law is not None and self._compared():
                    law = f" (predicted {self.predicted:.3g}{self.law.bound})"
                parts.append(f"delay {self.delay:.3g}{turned}{law}")
        elif self.kind not in ("steep", "end of oscillation"):
            parts.append("no bifurcation nearby")
        if self.kind == "steep":
            parts.append(
                f"no bifurcation: the predicted lag |dX/d{name}| |d{name}/dt| / |λ| grows to "
                f"{self.steepness:.2g} of the state's extent"
            )
        if self.kind == "gap crossing" and self.land is not None:
            time = width = ""
            if isinstance(self.law, GapTransit):
                time = f" (predicted {self.law.transit_time:.4g})"
                width = f" (predicted {self.law.transit:.4g}; slow limit {self.law.asymptotic:.4g})"
            parts.append(
                f"no bifurcation: duration {self.duration:.4g}{time}, "
                f"Δ{name} = {self.width:.4g}{width}, where |d{name}/dt| = {self.slope:.4g}"
            )
        elif self.land is not None and self.land.time > self.time:
            parts.append(f"lands at {name} = {self.land.value:.6g}, t = {self.land.time:.6g}")
        if self.note and self.kind != "end of oscillation":
            parts.append(self.note)
        return change + "; ".join(parts)

    def _compared(self) -> bool:
        """Whether the law speaks of the delay."""
        return bool(np.isfinite(self.predicted)) and not isinstance(self.law, GapTransit)


class Transitions(ImmutableSequence, tuple[Transition, ...]):
    """Transitions in time; called with a kind, those of that kind.

    Examples
    --------
    >>> Transitions()("jump")
    ()
    """

    def __call__(self, kind: str) -> Transitions:
        """Those of one kind; UnknownNameError for a kind that there is not."""
        word("kind of transition", KINDS)("kind", kind)
        return Transitions(t for t in self if t.kind == kind)


@dataclass(frozen=True)
class Phase:
    """A stretch of time of one kind of motion.

    Parameters
    ----------
    start, end : float
    kind : str
        ``"quasi-static"`` (follows a sheet), ``"oscillating"`` (two oscillations or more away from
        the sheets), ``"jump"`` (from one sheet to the next), ``"gap crossing"`` (the same across a
        gap), ``"excursion"`` (from a sheet and back to it), ``"transient"`` (at the start or
        the end of the run, near no sheet), ``"outside"`` (the diagram does not go so far) or
        ``"sticking"`` (rests in a band of equilibria).
    sheets : tuple of str
        Labels of the sheets followed, in order; for an oscillation that settles on a sheet,
        that one.
    oscillations : int
        Maxima of the observed state.
    attractor : str
        Of an oscillating phase ``"cycle"``, or ``"equilibrium"`` where the oscillation decays
        on to a stable sheet that was there all the time; else "".
    intervals : tuple of float
        Times between successive maxima.
    sizes : tuple of float
        Of an oscillating phase, the rise of the observed state to each maximum, in its own
        units.
    """

    start: float
    end: float
    kind: str
    sheets: tuple[str, ...] = ()
    oscillations: int = 0
    attractor: str = ""
    intervals: tuple[float, ...] = ()
    sizes: tuple[float, ...] = ()

    @property
    def duration(self) -> float:
        return self.end - self.start


@dataclass(frozen=True)
class Bursting:
    """What a rhythm of quasi-static and oscillating phases (or of jumps) is called, and why.

    Parameters
    ----------
    name : str
        Such as ``"fold/Hopf bursting"``: the bifurcation that starts the oscillation before the
        stroke, that which ends it after (Izhikevich 2000).
    evidence : tuple of str
        Sentences that the name rests on.
    """

    name: str
    evidence: tuple[str, ...]

    def __str__(self) -> str:
        return self.name
