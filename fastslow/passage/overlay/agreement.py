"""Check that a diagram and a run belong to the same model."""

from __future__ import annotations

import re

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.columns import evaluated
from fastslow.model.functions import numpy_function
from fastslow.model.model import Model
from fastslow.model.structure import real
from fastslow.passage.slow_quantities import FrozenResult
from fastslow.results.branch.branch import Branch
from fastslow.results.branch.diagram import Diagram
from fastslow.results.orbits.orbit_branch import OrbitBranch
from fastslow.results.stored.operations import AT_REST
from fastslow.results.stored.switch_state_names import CHANGES
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]

#: Rows of each branch at which differently written rates are compared.
COMPARED_ROWS = 5

#: Residual of an equilibrium relative to the change of the rates over the states of the branch;
#: AUTO files have few digits.
AT_EQUILIBRIUM = 1e-4

#: Size of a state, in units of the largest one, below which it may be rounding.
ROUNDED_STATE = 1e-12

#: Relative tolerance of eigenvalues; a double eigenvalue has half the digits.
EIGENVALUE_TOLERANCE = 1e-2


def require_one_model(diagram: Diagram, run: Trajectory) -> bool:
    """Raise if the rates of a diagram's states are not those of the run.

    Rates that are written identically agree. Otherwise the equilibria of the diagram and
    their eigenvalues must be those of the run's model.

    Returns
    -------
    bool
        False if a comparison was not possible: along a path, or for a run read from a file.

    Raises
    ------
    ArgumentError
        If they differ.
    """
    ours, theirs = _rates(diagram.equations), _rates(run.equations)
    different = [n for n in diagram.states if ours.get(n) != theirs.get(n)]
    if not different:
        return True
    if run.symbolic_model is not None:
        agrees = [
            a
            for b in diagram.branches
            if (a := _agrees(run.symbolic_model, b, diagram)) is not None
        ]
        if agrees and all(agrees):
            return True
        if not agrees:
            return False
    elif diagram.path or not ours or not theirs:
        return False
    name = different[0]
    has = "other equilibria or eigenvalues" if not ours else f"{name}' = {ours.get(name)}"
    raise ArgumentError(
        f"the diagram is of another model: it has {has}, the run {name}' = {theirs.get(name)}; "
        "continue the equilibria of the frozen model of this run"
    )


def require_same_walls(diagram: Diagram, run: Trajectory) -> None:
    """Raise unless the walls of a diagram are those of the resets of a run.

    Raises
    ------
    ArgumentError
        Also for kicks at instants of time, at which no equilibrium remains.
    """
    ours = {name for name in diagram.interfaces if " = " in name and CHANGES not in name}
    theirs = {re.sub("[<>]=?", "=", name) for name in run.reset_names}
    kicks = sorted(name for name in theirs if " = " not in name)
    if kicks:
        raise ArgumentError(
            f"the run is kicked at instants of time ({', '.join(kicks)}), so that its model has no "
            "equilibria"
        )
    if ours != theirs:
        has, lacks = (", ".join(sorted(names)) or "none" for names in (ours, theirs))
        raise ArgumentError(
            f"the walls of the diagram are {has}, those of the resets of the run {lacks}; continue "
            "the equilibria of the frozen model of this run"
        )


def require_same_values(diagram: FrozenResult, run: Trajectory) -> None:
    """Raise if a state of a diagram is none of the run, or a parameter has another value.

    Raises
    ------
    UnknownNameError
    ArgumentError
    """
    for name in diagram.states:
        if name not in run.states:
            raise unknown_name("state of the trajectory", name, run.states)
    for name, value in diagram.parameters.items():
        if name in run.parameters and run.parameters[name] != value:
            raise ArgumentError(
                f"the diagram has {name} = {value:g}, the trajectory {run.parameters[name]:g}; "
                "expected the same parameters"
            )


def require_same_forcing(branch: OrbitBranch, run: Trajectory) -> bool:
    """Raise if the rates or the fast forcing of orbits are not those of a run.

    Returns
    -------
    bool
        False if the rates could not be compared: along a path, of results from files.

    Raises
    ------
    ArgumentError
        If they differ.
    """
    ours, theirs = _lines(branch.equations), _lines(run.equations)
    path = getattr(branch.template.model, "path", {})
    if path and run.symbolic_model is not None:
        along = {real(name): law for name, law in path.items()}
        rates = run.symbolic_model.structure.rates
        theirs |= {f"{n}'": str(rates[n].xreplace(along)) for n in branch.states}
    known = not path or run.symbolic_model is not None
    for name in sorted(name for name in ours if known or not name.endswith("'")):
        if ours.get(name) != theirs.get(name):
            raise ArgumentError(
                f"the orbits are of another model: they have {name} = {ours.get(name)}, the run "
                f"{name} = {theirs.get(name)}; continue the orbits of the frozen model of this run"
            )
    return known


def _lines(equations: str) -> dict[str, str]:
    """Left- and right-hand sides in the text of a model."""
    lines = (line.strip().partition(" = ") for line in equations.splitlines())
    return {name: formula for name, equals, formula in lines if equals}


def _rates(equations: str) -> dict[str, str]:
    """Right-hand sides in the text of a model."""
    lines = (line.strip().partition("' = ") for line in equations.splitlines())
    return {name: rate for name, equals, rate in lines if equals}


def _agrees(model: Model, branch: Branch, diagram: Diagram) -> bool | None:
    """Whether equilibria of a branch and their eigenvalues are those of a model.

    None for a branch of virtual, pseudo- or held equilibria, which are not zeros of the rates.
    """
    known_regions = [name for name in diagram.regions if AT_REST not in name]
    regular = [k for k, name in enumerate(branch.region) if name in known_regions]
    if not branch.admissible or not regular:
        return None
    rows = np.array(regular)[np.linspace(0, len(regular) - 1, COMPARED_ROWS).astype(int)]
    value = branch.values[rows]
    known = {**model.parameters, **diagram.parameters, diagram.parameter: value}
    along = {name: evaluated(law, known) for name, law in diagram.path.items()}
    known = {**known, **along, **{n: branch.state[rows, k] for k, n in enumerate(branch.states)}}
    states = [real(name) for name in branch.states]
    rates = [model.rates[name] for name in branch.states]
    slopes = sp.Matrix(rates).jacobian(states)
    symbols = sorted(set().union(*(rate.free_symbols for rate in rates)), key=lambda s: s.name)
    if any(symbol.name not in known for symbol in symbols):
        return False
    columns = [np.broadcast_to(known[symbol.name], len(rows)) for symbol in symbols]
    both = numpy_function(symbols, [*rates, *slopes], cse=True)
    with np.errstate(all="ignore"):
        found = np.array(
            [[float(v) for v in both(*numbers)] for numbers in zip(*columns, strict=True)]
        )
    n = len(states)
    jacobians = found[:, n:].reshape(-1, n, n)
    reach = np.abs(branch.state).max(axis=0)
    # a state that is zero but for rounding has no size of its own
    sizes = np.abs(jacobians) @ np.fmax(reach, ROUNDED_STATE * reach.max())
    # a Jacobian with a row of zeros, as at a fold, gives no scale for the rates there
    typical = np.where(np.isfinite(sizes), sizes, 0.0).max(axis=0)
    for number, rest, jacobian, size in zip(rows, found[:, :n], jacobians, sizes, strict=True):
        if not (np.abs(rest) <= AT_EQUILIBRIUM * np.fmax(size, typical)).all():
            return False
        here = np.sort_complex(branch.eigenvalues[number])
        if np.isfinite(here).all() and np.isfinite(jacobian).all():
            there = np.sort_complex(np.linalg.eigvals(jacobian))
            if not np.abs(here - there).max() <= EIGENVALUE_TOLERANCE * max(
                np.abs(there).max(), 1e-300
            ):
                return False
    return True
