"""Equilibria on an interface whose stability the linearisation of one region does not decide."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fastslow.diagrams.field import CLOSURE, FrozenField
from fastslow.results.branch.branch import Branch
from fastslow.results.points import Equilibrium

Array = NDArray[np.float64]

#: Jacobian matrices with a smaller relative difference are equal.
EQUAL_JACOBIANS = 1e-8

#: On fewer rows the branch passes the interface or is tangent to it.
ROWS_ON_INTERFACE = 3


def one_sided(field: FrozenField, branches: Sequence[Branch]) -> Iterator[str]:
    """Yield a sentence for each part of a branch whose stability one region does not decide.

    The linearisations of both regions determine the stability of an equilibrium on their
    interface; eigenvalues, stability and special points of a branch are those of the region in
    which it was traced.
    """
    for branch in branches:
        for region, name in enumerate(field.regions):
            rows = np.flatnonzero(branch.region == name)
            if len(rows) < ROWS_ON_INTERFACE:
                continue
            points = np.column_stack([branch.state, branch.values])[rows]
            other = _other_side(field, region, points)
            if other is not None:
                yield _sentence(field, branch, region, *other, points)


def one_sided_points(
    field: FrozenField, equilibria: Iterable[Equilibrium], value: float
) -> Iterator[str]:
    """Yield a sentence for each equilibrium whose stability one region does not decide."""
    for one in equilibria:
        # the stability on several interfaces and at two-folds follows from all regions
        if one.continuum or one.region not in field.regions:
            continue
        point = np.append(one.state, value)
        other = _other_side(field, field.regions.index(one.region), point[None])
        if other is not None:
            interface, beyond = other
            place = ", ".join(f"{n} = {x:.6g}" for n, x in zip(one.states, one.state, strict=True))
            yield (
                f"({place}) is on {field.surface(interface)}: its stability and type follow from "
                f"the linearisation of {one.region} alone; that of {field.regions[beyond]} differs."
            )


def _other_side(field: FrozenField, region: int, points: Array) -> tuple[int, int] | None:
    """Return an interface through all points, and the region beyond with another linearisation."""
    mode = field.modes[region]
    if mode.sides is not None or mode.held:
        return None
    for interface in _interfaces_along(field, region, points):
        beyond = field.neighbour(region, interface)
        if beyond is not None and _differ(field, region, beyond, points):
            return interface, beyond
    return None


def _interfaces_along(field: FrozenField, region: int, points: Array) -> list[int]:
    """Return the interfaces, without walls, that contain all points."""
    count = len(field.interfaces)
    _, _, h, slopes = field.evaluate(region, points)
    size = np.einsum("rij,rj->ri", np.abs(slopes), np.maximum(np.abs(points), field.units))
    on = (np.abs(h) <= CLOSURE * size)[:, :count].all(axis=0)
    return [k for k in np.flatnonzero(on).tolist() if not field.is_wall(k)]


def _differ(field: FrozenField, region: int, beyond: int, points: Array) -> bool:
    """Return whether the linearisations of two regions differ in what they decide.

    Of one state the growth rates decide: both regions attract, or both repel.
    """
    first, second = (field.evaluate(k, points)[1][:, :, : field.n] for k in (region, beyond))
    if field.n == 1:
        return bool((np.sign(first) != np.sign(second)).any())
    size = np.abs(first).max(axis=0) + np.abs(second).max(axis=0)
    return bool((np.abs(first - second) > EQUAL_JACOBIANS * size).any())


def _sentence(
    field: FrozenField, branch: Branch, region: int, interface: int, beyond: int, points: Array
) -> str:
    name, other = field.regions[region], field.regions[beyond]
    low, high = points[:, -1].min(), points[:, -1].max()
    labels = [p.label for p in branch.special if name in p.regions and not p.kind.end]
    listed = ", ".join(["stability and type", *labels])
    return (
        f"For {branch.parameter} from {low:.6g} to {high:.6g} equilibria are on "
        f"{field.surface(interface)} at every value, and what is "
        f"given there ({listed}) follows from the linearisation of {name} alone; that of {other} "
        "differs."
    )
