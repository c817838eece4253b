"""Certificates: all curves of equilibria in a window, proved in interval arithmetic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import finite, flag, validated
from fastslow.errors import ArgumentError
from fastslow.results.base.framed import Framed
from fastslow.results.base.result import Result
from fastslow.results.base.table import inside, named_value
from fastslow.results.branch.diagram import Diagram
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import SpecialPoint, SpecialPoints

#: Codes of the points that certificates list completely.
LISTED = tuple(code for code, one in POINT_TYPES.items() if one.certified)

Array = NDArray[np.float64]
Whole = NDArray[np.int64]


#: Ends of curves whose number of equilibria is not known.
NOT_CONTINUED, NOT_SEPARATED = "not continued", "not separated"


@dataclass(frozen=True, eq=False, repr=False)
class ProvedCurve(Framed, Result):
    """A curve of equilibria that is proved to exist, as consecutive arcs.

    On each arc the curve is the graph of a smooth function of one unknown, and there is no other
    equilibrium in the box of the arc.

    Parameters
    ----------
    states : tuple of str
    parameter : str
    region : str
        The region whose rates vanish, ``"S1|S2"`` for pseudo-equilibria.
    low, high : ndarray, shape (m, n + 1)
        Boxes of the arcs, in the states and the parameter.
    free : ndarray of str, shape (m,)
        The unknown that determines the others on each arc; ``"weight"`` is the weight of the
        two fields of a pseudo-equilibrium.
    node_low, node_high : ndarray, shape (m + 1, n + 1)
        Bounds of the points at which the arcs begin, and of the end of the last.
    direction : ndarray of int, shape (m,)
        1 where the parameter increases along the arc, −1 where it decreases, 0 where this is not
        decided: within 1e-9 of a fold, or on a vertical segment.
    decided : ndarray of bool, shape (m,)
        Whether the arc is in the window and on one side of every interface; else it contains a
        boundary equilibrium or the edge of the window, and is shorter than 1e-9 of the window
        unless the curve runs along the interface or the edge.
    admissible : bool
        False for virtual equilibria.
    closed : bool
    ends : tuple of str
        Both ends: ``"edge"`` of the window or the region, ``"boxes left"`` where nothing is
        proved, ``"not continued"`` for no known reason, or ``"not separated"`` from another
        curve, which may be the same.
    unstable : ndarray of int, shape (m,)
        Number of eigenvalues with positive real part on each arc, in an escaping region with the
        infinite one; −1 where it is not decided: within 1e-9 of a fold or a Hopf point, and of
        virtual equilibria. Empty in files of earlier versions.
    neutral : int
        Number of further eigenvalues that are zero all along the curve.
    """

    states: tuple[str, ...]
    parameter: str
    region: str
    low: Array
    high: Array
    free: NDArray[np.str_]
    node_low: Array
    node_high: Array
    direction: Whole
    decided: NDArray[np.bool_]
    admissible: bool = True
    closed: bool = False
    ends: tuple[str, str] = ("edge", "edge")
    unstable: Whole = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    neutral: int = 0

    @property
    def stability(self) -> NDArray[np.str_]:
        """``"stable"``, ``"unstable"`` or ``"undecided"`` for each arc, shape (m,)."""
        unstable = self.unstable if len(self.unstable) else np.full(len(self.free), -1)
        lowest = "undecided" if self.neutral else "stable"
        return np.where(unstable > 0, "unstable", np.where(unstable == 0, lowest, "undecided"))

    def stable_intervals(self) -> NDArray[np.float64]:
        """Return intervals of the parameter over which the curve is proved stable, shape (k, 2).

        One interval for each stable slice with monotone parameter, in order; up to 1e-9 of the
        window around folds and Hopf points is left out.
        """
        good = (self.stability == "stable") & self.decided
        runs = _runs(np.where(good, self.direction, 0))
        low, high = self.node_low[:, -1], self.node_high[:, -1]
        spans = [(high[a], low[b]) if self.direction[a] > 0 else (high[b], low[a]) for a, b in runs]
        return np.array([s for s in spans if s[0] <= s[1]], dtype=float).reshape(-1, 2)

    @property
    def over(self) -> tuple[float, float]:
        """The range of the parameter on the curve, within the widths of its enclosures."""
        return float(self.node_low[:, -1].min()), float(self.node_high[:, -1].max())

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return bounds of the nodes by name, such as ``"x low"`` and ``"x high"``.

        The stability is that of the arc that begins at the node, of the last node the arc before.
        """
        names = (*self.states, self.parameter)
        columns: dict[str, NDArray[Any]] = {
            f"{name} {end}": bounds[:, j]
            for j, name in enumerate(names)
            for end, bounds in (("low", self.node_low), ("high", self.node_high))
        }
        stability = self.stability
        return columns | {"stability": np.append(stability, stability[-1:])}

    def _count_at(self, value: float, stable: bool | None) -> int | None:
        """Number of equilibria at a value of the parameter, None if it is not decided."""
        low, high = self.node_low[:, -1], self.node_high[:, -1]
        side = np.where(high < value, -1, np.where(low > value, 1, 0))
        monotone = (self.direction != 0) & self.decided
        counted = np.ones(len(monotone), dtype=bool)
        if stable is not None:
            monotone &= self.stability != "undecided"
            counted = self.stability == ("stable" if stable else "unstable")
        arcs_low = np.minimum(self.low[:, -1], np.minimum(low[:-1], low[1:]))
        arcs_high = np.maximum(self.high[:, -1], np.maximum(high[:-1], high[1:]))
        if np.any(~monotone & (arcs_low <= value) & (value <= arcs_high)):
            return None
        total = 0
        for first, last in _runs(np.where(monotone & counted, self.direction, 0)):
            ends = []
            for node, at_end in ((first, first == 0), (last, last == len(monotone))):
                exact = low[node] == high[node] == value
                if side[node] == 0 and not (exact and at_end and not self.closed):
                    return None
                ends.append(int(side[node]))
            total += ends[0] != ends[1]
        return total

    def __repr__(self) -> str:
        low, high = self.over
        kind = "closed curve" if self.closed else "curve"
        virtual = "virtual " if not self.admissible else ""
        kinds = set(self.stability.tolist()) - {"undecided"} if self.admissible else set()
        words = [f"{kind} in part" if len(kinds) > 1 else kind for kind in sorted(kinds)]
        stability = f", {' and '.join(words)}" if words else ""
        lost = "".join(f", {end}" for end in (NOT_CONTINUED, NOT_SEPARATED) if end in self.ends)
        where = f" in {self.region}" if self.region else ""
        # within the widths of the enclosures
        vertical = high - low <= 4.0 * (self.node_high - self.node_low)[:, -1].max()
        over = (
            f"{self.parameter} = {0.5 * (low + high):.6g} within {high - low:.1g}"
            if vertical
            else f"{self.parameter} in [{low:.6g}, {high:.6g}]"
        )
        arcs = f"{len(self.free)} arc{'s' * (len(self.free) != 1)}"
        return f"ProvedCurve: {virtual}{kind} of equilibria{where}, {over}, {arcs}{stability}{lost}"


def _runs(direction: Whole) -> list[tuple[int, int]]:
    """First and last nodes of runs of arcs with one direction, without those of direction 0."""
    changes = np.flatnonzero(np.diff(direction)) + 1
    ends = [0, *changes.tolist(), len(direction)]
    return [(a, b) for a, b in pairwise(ends) if b > a and direction[a]]


@dataclass(frozen=True, eq=False, repr=False)
class OpenBoxes(Result):
    """Boxes of a window in which nothing is proved, or not the stability.

    Parameters
    ----------
    states : tuple of str
    parameter : str
    region : str
        The region or sliding motion whose equilibria may be there.
    low, high : ndarray, shape (k, n + 1)
        Boxes, in the states and the parameter.
    why : str
        ``"not decided"``, ``"not searched"`` or ``"stability not decided"``.
    fraction : float
        Their share of the volume of the window.
    """

    states: tuple[str, ...]
    parameter: str
    region: str
    low: Array
    high: Array
    why: str
    fraction: float

    def __len__(self) -> int:
        return len(self.low)

    def __repr__(self) -> str:
        names = (*self.states, self.parameter)
        low, high = self.low.min(axis=0), self.high.max(axis=0)
        within = ", ".join(
            f"{n} in [{a:.6g}, {b:.6g}]" for n, a, b in zip(names, low, high, strict=True)
        )
        return (
            f"OpenBoxes: {len(self)} boxes ({self.why}), {self.fraction:.2g} of the window, "
            f"within {within}"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(Framed, Result):
    """All equilibria of a frozen model in a window, proved in interval arithmetic.

    Parameters
    ----------
    states : tuple of str
    parameter : str
    window : mapping
        Range of each state and of the parameter. Nothing is known outside.
    curves : tuple of ProvedCurve
        Every equilibrium in the window is on one of these, or in ``left``.
    missing : tuple of ProvedCurve or SpecialPoint
        Those curves, or arcs of them, that the diagram lacked; then special points that it lacked
        on its branches.
    left : tuple of OpenBoxes
        Boxes in which nothing is proved.
    why : str
        Why the certificate is not complete, empty if it is.
    points : SpecialPoints
        Folds, Hopf points and boundary equilibria that are proved to exist, with python-flint each
        with its ``enclosure``. Folds are quadratic, and at Hopf points the pair crosses the axis
        with non-zero speed. With python-flint also other points of the diagram that are proved,
        such as branch points and neutral saddles, of which there may be more.
    diagram : Diagram
        The given diagram with the missing branches. Its ``completeness`` is ``"proved"`` if the
        certificate is complete and every curve is on one branch.
    searched : int
        Number of boxes searched.
    parameters : mapping
        The values of all other parameters.
    equations : str
        The model as text.
    settings : mapping
    notes : tuple of str
        What is not proved of the diagram: special points, and branches on the same curve.
    unresolved : tuple of OpenBoxes
        Boxes around arcs whose stability is not decided and that may have other special points:
        degenerate ones, such as cusps, or several at once.
    all_points : bool
        True if ``points`` are all folds, Hopf points and boundary equilibria in the window.

    Examples
    --------
    >>> import sympy as sp, fastslow as fs
    >>> x, p = sp.symbols("x p")
    >>> model = fs.Model({x: p + x - x**3}, parameters={p: 0})
    >>> diagram = fs.continue_equilibria(model, "p", (-1, 1))
    >>> proof = fs.certify(model, diagram, window={x: (-2, 2)})
    >>> proof.complete, len(proof.curves), proof.count(p=0.1), proof.count(p=0.5)
    (True, 1, 3, 1)
    >>> proof.all_points, proof.points["code"].tolist(), proof.count(p=0.1, stable=True)
    (True, ['LP', 'LP'], 2)
    """

    states: tuple[str, ...]
    parameter: str
    window: Mapping[str, tuple[float, float]]
    curves: tuple[ProvedCurve, ...]
    missing: tuple[ProvedCurve | SpecialPoint, ...]
    left: tuple[OpenBoxes, ...]
    why: str
    diagram: Diagram
    points: SpecialPoints = field(default_factory=SpecialPoints)
    searched: int = 0
    parameters: Mapping[str, float] = field(default_factory=dict)
    equations: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    unresolved: tuple[OpenBoxes, ...] = ()
    all_points: bool = False

    @property
    def complete(self) -> bool:
        """True if every equilibrium in the window is on one of the curves."""
        return not self.why

    @validated(stable=flag)
    def count(self, *, stable: bool | None = None, **value: Any) -> int:
        """Return the number of admissible equilibria in the window at a value of the parameter.

        Parameters
        ----------
        stable : bool, optional
            Only stable or unstable ones.
        **value : float
            The parameter by name, e.g. ``w=1.0``.

        Raises
        ------
        UnknownNameError
            For another name.
        ArgumentError
            Outside the window; at a value that is not decided: within 1e-9 of the window of a
            fold, a boundary equilibrium or an equilibrium on the edge of the window, or where
            boxes are left; with ``stable`` also near a Hopf point and where stability is not
            decided, or for a file of an earlier version.
        """
        name, given = named_value("parameter of the certificate", [self.parameter], value)
        number = finite(name, given)
        inside("certificate", name, number, self.window[name])
        for boxes in self.left:
            if np.any((boxes.low[:, -1] <= number) & (number <= boxes.high[:, -1])):
                raise ArgumentError(
                    f"the number of equilibria at {name} = {number:g} is not proved: boxes are "
                    f"left in {boxes.region or 'the window'} ({boxes.why}); expected another value"
                )
        if stable is not None and any(not len(c.unstable) for c in self.curves if c.admissible):
            raise ArgumentError(
                "the certificate is from a file of an earlier version, without stability; "
                f"expected stable = None, received {stable}, or a new certificate"
            )
        counts = [curve._count_at(number, stable) for curve in self.curves if curve.admissible]
        lost = any(
            NOT_CONTINUED in curve.ends
            or (NOT_SEPARATED in curve.ends and curve.over[0] <= number <= curve.over[1])
            for curve in self.curves
        )
        if None in counts or lost:
            kind = {None: "", True: "stable ", False: "unstable "}[stable]
            hopf = "" if stable is None else "a Hopf point, "
            undecided = "" if stable is None else ", or their stability is not decided"
            raise ArgumentError(
                f"the number of {kind}equilibria at {name} = {number!r} is not decided: a fold, "
                f"{hopf}a boundary equilibrium or the edge of the window is within 1e-9 of it, or "
                f"equilibria form a continuum{undecided}; expected another value"
            )
        return sum(count for count in counts if count is not None)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Return bounds of the nodes of all curves by name, with the index of the curve."""
        tables = [curve.to_dict() for curve in self.curves]
        lengths = [len(curve.node_low) for curve in self.curves]
        names = tables[0] if tables else {}
        columns = {name: np.concatenate([t[name] for t in tables]) for name in names}
        numbers = np.repeat(np.arange(len(tables)), lengths)
        regions = (
            np.repeat([c.region for c in self.curves], lengths) if tables else np.empty(0, str)
        )
        return {"curve": numbers, "region": regions, **columns}

    def __repr__(self) -> str:
        ranges = ", ".join(f"{n} in [{a:g}, {b:g}]" for n, (a, b) in self.window.items())
        count = sum(curve.admissible for curve in self.curves)
        curves = f"{count} curve{'s' * (count != 1)} of equilibria"
        numbers = {
            "curve": sum(isinstance(one, ProvedCurve) for one in self.missing),
            "special point": sum(isinstance(one, SpecialPoint) for one in self.missing),
        }
        given = [f"{n} {what}{'s' * (n != 1)}" for what, n in numbers.items() if n]
        lacked = f"; the diagram lacked {' and '.join(given)}" if given else ""
        also = "".join(f"; {note}" for note in self.notes)
        if self.complete:
            words = f"Certificate: {curves}, proved, and no other equilibrium with {ranges}"
            return f"{words}; {self._special()}{lacked}{also}"
        words = f"Certificate (not complete): {curves}, proved, with {ranges}"
        return f"{words}; {self._special()}{lacked}; {self.why}{also}"

    def _special(self) -> str:
        """Return how many special points are proved, and whether these are all."""
        codes = self.points["code"].tolist() if len(self.points) else []
        listed, others = (
            ", ".join(
                f"{codes.count(code)} {code}"
                for code in sorted(set(codes))
                if (code in LISTED) == complete
            )
            for complete in (True, False)
        )
        also = f"; also proved: {others}" if others else ""
        if self.all_points:
            return f"all folds, Hopf points and boundary equilibria: {listed or 'none'}{also}"
        places = sum(len(boxes) for boxes in self.unresolved)
        arcs = "1 arc" if places == 1 else f"{places} arcs"
        why = f", and {arcs} whose stability is not decided" if places else ""
        return f"special points: {listed or 'none'}; others are possible{why}{also}"
