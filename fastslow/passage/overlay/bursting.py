"""Classification of bursting and relaxation oscillations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fastslow.passage.overlay.cycle_ends import CycleEnd
from fastslow.results.overlay.transitions import Bursting, Phase, Transition
from fastslow.results.points import SpecialPoint

#: Kinds of transition in a relaxation oscillation.
DEPARTURES = ("jump", "gap crossing", "switch", "grazing", "Hopf")

#: Smallest number of bursts to classify.
TWICE = 2

#: Onset or end without an identified bifurcation.
UNKNOWN = "unclassified"


@dataclass(frozen=True, eq=False)
class Burst:
    """Complete oscillating phase with its onset and end."""

    phase: Phase
    start: Transition
    end: CycleEnd | None


def bursting_of(bursts: Sequence[Burst], transitions: Sequence[Transition]) -> Bursting | None:
    """Classify bursting by the bifurcations at the onset and the end of oscillating phases.

    The onset is the special point at which the stable branch is left, the end that of the
    cycle; a burst without one of them is unclassified.

    Bursts on a cycle are named as by E. M. Izhikevich, International Journal of
    Bifurcation and Chaos 10(6), 1171-1266, 2000: onset/end. If the oscillation decays onto
    the next stable branch (point-point bursting), the two departures give the name, and
    without oscillations the run is a relaxation oscillation.

    Parameters
    ----------
    bursts : sequence of Burst
        In order of time.
    transitions : sequence of Transition
        All transitions of the run.

    Returns
    -------
    Bursting or None
        None without a recurrent pattern: fewer than two oscillating phases on a cycle between
        stable branches, and no two branches that are left in turn.
    """
    cycles = [b for b in bursts if b.end is not None]
    if cycles:
        return _on_cycles(cycles) if len(cycles) >= TWICE else None
    between = [t for t in transitions if t.type in DEPARTURES]
    between = [t for t in between if t.from_branch != t.to_branch and t.to_branch]
    if len({t.from_branch for t in between}) < 2:
        return None
    leavings = list(dict.fromkeys(_start(t) for t in between[-2:]))
    pair = "/".join(leavings * 2 if len(leavings) == 1 else leavings)
    counts = [b.phase.oscillations for b in bursts]
    specials = [t.special_equilibrium for t in between[-2:]]
    mirrored = _mirrored(specials[0], specials[1])
    symmetric = "symmetric " if mirrored else ""
    evidence = [f"{_at(t)}, from {t.from_branch} to {t.to_branch}" for t in between[-2:]]
    gaps = all(t.type == "gap crossing" for t in between)
    if mirrored and not gaps:
        evidence.append("both points have the same eigenvalues and normal form: a symmetric pair")
    if gaps:
        evidence.append("the equilibria change steeply at the gap, without a bifurcation")
        name = "fast-slow oscillation across the gap, without bifurcation"
        if counts:
            evidence.append(_settling(counts))
        return Bursting(name, tuple(evidence))
    if counts:
        evidence.append(_settling(counts))
        return Bursting(f"{symmetric}{pair} bursting (point-point)", tuple(evidence))
    evidence.append("no oscillation of the fast states between the stable branches")
    return Bursting(f"relaxation oscillation ({symmetric}{pair})", tuple(evidence))


def _settling(counts: Sequence[int]) -> str:
    low, high = min(counts), max(counts)
    count = low if low == high else f"{low} to {high}"
    return f"{count} oscillations decaying onto a stable branch"


def _on_cycles(bursts: Sequence[Burst]) -> Bursting:
    # the first burst may still depend on the initial state
    steady = bursts[1:] if len(bursts) > 1 else bursts
    names: list[str] = []
    evidence: list[str] = []
    for b in steady:
        assert b.end is not None
        name = _named(_start(b.start), b.end.name)
        if name not in names:
            names.append(name)
            evidence.append(f"onset: {_at(b.start)}")
            end = "" if b.end.special is None else f"at {b.end.special.label}, "
            evidence.append(f"end: {end}{b.end.evidence}")
    counts = [b.phase.oscillations for b in steady]
    low, high = min(counts), max(counts)
    evidence.append(f"{low if low == high else f'{low} to {high}'} oscillations in a burst")
    specials = list({id(b.start.special): b.start.special_equilibrium for b in steady}.values())
    symmetric = len(names) == 1 and len(specials) == 2 and _mirrored(*specials)
    name = ("symmetric " if symmetric else "") + " + ".join(names)
    return Bursting(name, tuple(evidence))


def _named(start: str, end: str) -> str:
    """Class of a burst; unclassified if one of the two bifurcations is not known."""
    if UNKNOWN not in (start, end):
        return f"{start}/{end} bursting"
    known = [f"onset: {start}"] * (start != UNKNOWN) + [f"end: {end}"] * (end != UNKNOWN)
    return f"unclassified bursting ({', '.join(known) or 'onset and end not known'})"


def _start(t: Transition) -> str:
    """Name of a departure in a class of bursting."""
    point = t.special_equilibrium
    if t.type == "gap crossing":
        return "gap crossing"
    if point is None:
        return "grazing" if t.type == "grazing" else UNKNOWN
    if point.kind.bursting:
        return ("sub" if point.criticality == "subcritical" else "") + point.kind.bursting
    return UNKNOWN if t.type == UNKNOWN else point.type or "boundary equilibrium"


def _at(t: Transition) -> str:
    if t.special is None:
        return f"{t.type} at {t.value:.4g}"
    words = f"departure at {t.special.label}"
    return words + (f" with delay {t.delay:.3g}" if np.isfinite(t.delay) else "")


def _mirrored(one: SpecialPoint | None, other: SpecialPoint | None) -> bool:
    """Whether two points have the same eigenvalues and normal form, as under a symmetry."""
    if one is None or other is None or one.code != other.code or one.label == other.label:
        return False
    first, second = np.sort_complex(one.eigenvalues), np.sort_complex(other.eigenvalues)
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        return False
    numbers = [
        (abs(q.coefficient or 0.0), q.lyapunov or 0.0, q.frequency or 0.0) for q in (one, other)
    ]
    apart = max(np.abs(first - second).max(), *np.abs(np.subtract(numbers[0], numbers[1])))
    size = max(np.abs(first).max(), *np.abs(numbers[0]))
    return bool(apart <= 1e-6 * size)
