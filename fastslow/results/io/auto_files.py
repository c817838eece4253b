"""Equilibrium diagrams computed by AUTO-07p."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, formula, mapping, path, refusal, validated
from fastslow.errors import FileError, unknown_name
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.io.auto_text import (
    MOST_PARAMETERS,
    AutoCurve,
    eigenvalues_of,
    parameters_of,
    sections_of,
)
from fastslow.results.point_types import POINT_TYPES
from fastslow.results.points import SpecialPoint, SpecialPoints

Array = NDArray[np.float64]

#: Point types of an equilibrium curve, without regular output points.
CODES = {number: one.code for one in POINT_TYPES.values() for number in one.auto}

#: IPS of equilibria of ODEs, and of the ODEs of travelling waves.
IPS_OF_EQUILIBRIA = (1, 11)

#: The single region of a smooth model.
REGION = "S1"


@validated(path=path, solutions=path, diagnostics=path, names=mapping, parameter=formula)
def read_auto(
    path: str | os.PathLike[str],
    solutions: str | os.PathLike[str] | None = None,
    diagnostics: str | os.PathLike[str] | None = None,
    *,
    names: Mapping[str, str] | None = None,
    parameter: Name | None = None,
) -> Diagram:
    """Read a diagram of equilibria from files of AUTO-07p.

    The special points LP, HB, BP, UZ and EP keep their codes; a curve that ended
    without convergence (MX) has an unsuccessful outcome. The stability is that computed
    by AUTO; the eigenvalues, to five digits, are read from the diagnostics file (NaN
    without it) and are required by an overlay. Points between those of the file are
    interpolated and marked as such. Curves of periodic solutions and curves in two
    parameters are omitted, as reported by the outcome of the diagram.

    Parameters
    ----------
    path : str or path
        The diagram file, such as ``b.fhn`` or ``fort.7``.
    solutions : str or path, optional
        The solutions file, such as ``s.fhn`` or ``fort.8``, with the values of the other
        parameters; by default the one in the same folder, if it exists.
    diagnostics : str or path, optional
        The diagnostics file, such as ``d.fhn`` or ``fort.9``, with the eigenvalues; by
        default the one in the same folder, if it exists.
    names : mapping, optional
        New names for those of AUTO, e.g. ``{"PAR(1)": "w", "U(1)": "x"}``.
    parameter : str or Symbol, optional
        The parameter of the diagram, if the file has curves over several; by default
        that of the first curve.

    Returns
    -------
    Diagram
        With ``completeness`` "found" and the single region S1 of a smooth model.

    Raises
    ------
    FileError
        If the file is missing, truncated, of another program, or without equilibria.
    UnknownNameError
        For a name in ``names`` that is not in the file, or a parameter without a curve.

    See Also
    --------
    fastslow.load, fastslow.plot.diagram

    Examples
    --------
    >>> read_auto("b.nothing")
    Traceback (most recent call last):
    ...
    fastslow.errors.FileError: b.nothing cannot be read: No such file or directory
    """
    source = Path(path)
    sections = sections_of(source)
    if not sections:
        raise FileError(f"{source} contains no curve; expected a diagram file of AUTO-07p")
    beside = _beside(source, solutions, "s", "fort.8")
    known = {} if beside is None else parameters_of(beside)
    equilibria = [s for s in sections if _left_out(s) is None]
    if not equilibria:
        raise FileError(f"{source} contains no curve of equilibria: {_left_out(sections[0])}")
    called = _Names(equilibria[0], names or {})
    valid = tuple(dict.fromkeys(called.own(s.columns[0]) for s in equilibria))
    if parameter is not None and str(parameter) not in valid:
        raise unknown_name("diagram parameter", parameter, valid)
    chosen = valid[0] if parameter is None else str(parameter)
    kept = [s for s in equilibria if called.own(s.columns[0]) == chosen]
    first = next((known[n] for s in kept for n in s.labels.tolist() if n in known), None)
    constants = {} if first is None else called.values(first, chosen)
    counts: dict[str, int] = {}
    shown = _beside(source, diagnostics, "d", "fort.9")
    n = len(called.states)
    spectra = [np.full((len(s.points), n), np.nan + 0j) for s in sections]
    if shown is not None:
        spectra = eigenvalues_of(shown, sections, n)
    branches = tuple(
        _branch(s, called, chosen, constants, values, counts)
        for s, values in zip(sections, spectra, strict=True)
        if s in kept
    )
    rest = [s for s in sections if s not in kept]
    reasons = [_left_out(s) or f"curves over {called.own(s.columns[0])}" for s in rest]
    count = f"{len(kept)} curve{'s' * (len(kept) > 1)}"
    text = f"read {count} of equilibria from {source.name}, a file of AUTO-07p"
    if reasons:
        text += f"; omitted: {', '.join(dict.fromkeys(reasons))}"
    values = np.concatenate([b.values for b in branches])
    return Diagram(
        states=branches[0].states,
        parameter=chosen,
        over=(float(values.min()), float(values.max())),
        parameters=constants,
        branches=branches,
        completeness="found",
        interfaces=(),
        regions=(REGION,),
        interface_values={},
        equations=f"computed by AUTO-07p, read from {source.name}",
        outcome=Outcome("read", f"{text}.", True),
    )


def _beside(
    path: Path, given: str | os.PathLike[str] | None, letter: str, plain: str
) -> Path | None:
    """Return the given file, or else the one that belongs to a diagram file, if it exists."""
    if given is not None:
        return Path(given)
    name = f"{letter}{path.name[1:]}" if path.name.startswith("b.") else plain
    other = path.with_name(name)
    named = path.name.startswith("b.") or path.name == "fort.7"
    return other if named and other.exists() else None


def _left_out(section: AutoCurve) -> str | None:
    """Return the reason why a curve is not one of equilibria over one parameter, else None."""
    problem, switch = section.constants.get("IPS", 1), section.constants.get("ISW", 1)
    if problem not in IPS_OF_EQUILIBRIA:
        what = "periodic solutions" if problem == 2 else "another problem"
        return f"{what} (IPS = {problem})"
    return f"curves in two parameters (ISW = {switch})" if abs(switch) == 2 else None


@dataclass(frozen=True)
class _Names:
    """The names of AUTO, with the new names given by the user."""

    section: AutoCurve
    changes: Mapping[str, str]

    def __post_init__(self) -> None:
        valid = dict.fromkeys([*self.section.columns, *self._parameters])
        for name, own in self.changes.items():
            if name not in valid:
                raise unknown_name("name in the file", name, valid)
            if not isinstance(own, str):
                raise refusal(f"names[{name!r}]", own, "a name as text")

    @property
    def _parameters(self) -> tuple[str, ...]:
        constants = self.section.constants
        given = constants.get("parnames", {})
        count = min(max([constants.get("NPAR", 0), *given]), MOST_PARAMETERS)
        return tuple(str(given.get(k, f"PAR({k})")) for k in range(1, count + 1))

    @property
    def states(self) -> tuple[str, ...]:
        """AUTO's names of the states in the table, after parameter and norm."""
        shown = len(self.section.columns) - 2
        return self.section.columns[2 : 2 + min(shown, self.section.constants.get("NDIM", shown))]

    def own(self, name: str) -> str:
        return self.changes.get(name, name)

    def values(self, numbers: Array, parameter: str) -> dict[str, float]:
        """Return all parameters except the continuation parameter."""
        pairs = zip(self._parameters, numbers.tolist(), strict=False)
        return {self.own(n): v for n, v in pairs if self.own(n) != parameter}


def _branch(
    section: AutoCurve,
    called: _Names,
    parameter: str,
    constants: Mapping[str, float],
    eigenvalues: NDArray[np.complex128],
    counts: dict[str, int],
) -> Branch:
    states = tuple(called.own(name) for name in called.states)
    n = len(states)
    points = np.column_stack([section.numbers[:, 2 : 2 + n], section.numbers[:, 0]])
    tangent = _tangents(points)
    stability = np.where(section.points < 0, "stable", "unstable")
    special, rows = [], []
    for row, (kind, label) in enumerate(zip(section.types, section.labels, strict=True)):
        code = CODES.get(int(np.sign(kind)) * (abs(int(kind)) % 10))
        if code is None or label == 0:
            continue
        if POINT_TYPES[code].event:
            stability[row] = "neutral"
        counts[code] = counts.get(code, 0) + 1
        special.append(
            SpecialPoint(
                code=code,
                label=f"{code}{counts[code]}",
                states=states,
                state=points[row, :n].copy(),
                parameters={**constants, parameter: float(points[row, n])},
                regions=(REGION,),
                eigenvalues=eigenvalues[row].copy(),
                tangent=tangent[row].copy(),
                residual=float("nan"),
                converged=kind != -9,
                note=f"label {label} in AUTO's file" + ", no convergence" * bool(kind == -9),
            )
        )
        rows.append(row)
    return Branch(
        states=states,
        parameter=parameter,
        state=points[:, :n].copy(),
        values=points[:, n].copy(),
        tangent=tangent,
        eigenvalues=eigenvalues,
        region=np.full(len(points), REGION),
        special=SpecialPoints(special),
        special_rows=tuple(rows),
        outcomes=(_BEGIN, _outcome(int(section.types[-1]), parameter, float(points[-1, n]))),
        parameters=dict(constants),
        known_stability=stability,
    )


_BEGIN = Outcome("start", "where AUTO began.", True)


def _outcome(kind: int, parameter: str, value: float) -> Outcome:
    where = f"{parameter} = {value:.6g}"
    if kind == -9:
        return Outcome("no convergence", f"AUTO did not converge beyond {where} (MX).", False)
    return Outcome("end", f"AUTO ended at {where}.", True)


def _tangents(points: Array) -> Array:
    """Return unit tangents of a curve by second-order differences, shape (N, k)."""
    # scale by a power of two, which is exact, so that no square overflows
    points = np.ldexp(points, -np.frexp(np.abs(points).max(initial=0.0))[1])
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    distinct = np.append(True, length > 1e-150)
    place = np.cumsum(np.append(0.0, length))[distinct]
    slopes = np.zeros_like(points)
    if len(place) > 1 and (np.diff(place) > 0).all():
        found = np.gradient(points[distinct], place, axis=0, edge_order=2 if len(place) > 2 else 1)
        slopes = found[np.cumsum(distinct) - 1]
    sizes = np.linalg.norm(slopes, axis=1, keepdims=True)
    slopes[sizes[:, 0] == 0, -1] = 1.0
    return np.asarray(slopes / np.where(sizes == 0, 1.0, sizes))
