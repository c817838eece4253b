"""Equilibria and diagrams of all switch states as one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from fastslow.model.model import Model
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.branch.equilibrium_sets import Equilibria
from fastslow.results.points import SpecialPoints


def joined_equilibria(parts: Sequence[Equilibria]) -> Equilibria:
    """Return the equilibria of all switch states as one list."""
    known = all(part.completeness == "complete" for part in parts)
    return Equilibria(
        [one for part in parts for one in part],
        "complete" if known else "found",
        [one for part in parts for one in part.sets],
        [note for part in parts for note in part.notes],
    )


def joined_diagram(model: Model, parts: Sequence[Diagram]) -> Diagram:
    """Return the diagrams of all switch states as one, with unique labels of special points."""
    first = parts[0]
    failed = [part.outcome for part in parts if not part.outcome]
    windows = [part.window for part in parts if part.window is not None]
    window = None
    if windows:
        lower, upper = (
            tuple(zip(*ends, strict=True))
            for ends in zip(*((w.lower, w.upper) for w in windows), strict=True)
        )
        window = replace(windows[0], lower=tuple(map(min, lower)), upper=tuple(map(max, upper)))
    return replace(
        first,
        parameters=dict(first.parameters),
        branches=tuple(_relabelled(parts)),
        completeness="complete" if all(p.completeness == "complete" for p in parts) else "found",
        interfaces=tuple(dict.fromkeys(name for part in parts for name in part.interfaces)),
        regions=tuple(dict.fromkeys(name for part in parts for name in part.regions)),
        interface_values=_merged([part.interface_values for part in parts]),
        equations=model.equations,
        corrector=None,
        outcome=failed[0] if failed else first.outcome,
        window=window,
        bands=tuple(band for part in parts for band in part.bands),
        model=model,
    )


def _merged(mappings: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {name: value for one in mappings for name, value in one.items()}


def _relabelled(parts: Sequence[Diagram]) -> Iterator[Branch]:
    """Yield the branches of all diagrams; labels LP1, LP2, … continue from one to the next."""
    counts: dict[str, int] = {}
    for part in parts:
        labels: dict[str, str] = {}
        for branch in part.branches:
            points = []
            for point in branch.special:
                if point.label not in labels:
                    counts[point.stem] = counts.get(point.stem, 0) + 1
                    labels[point.label] = f"{point.stem}{counts[point.stem]}"
                points.append(replace(point, label=labels[point.label]))
            yield replace(branch, special=SpecialPoints(points))
