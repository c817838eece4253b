"""Sobol indices of a function over independent uniform parameters, computed by SALib."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import flag, interval, mapping, validated, whole, within
from fastslow.arguments import function as callable_check
from fastslow.errors import ArgumentError
from fastslow.results.base.extras import extra
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome, with_notes
from fastslow.results.maps.grid import Grid, described
from fastslow.results.maps.sobol_indices import SobolIndices
from fastslow.simulation.settings import EXECUTION, Execution, execution_settings
from fastslow.sweeps.grid_sweep import sweep

Array = NDArray[np.float64]

#: Range of an output, relative to its size, of an output that does not vary but for rounding.
CONSTANT_OUTPUT = 1e-14


@validated(
    function=callable_check,
    over=mapping,
    n=whole(2),
    vectorized=flag,
    second_order=flag,
    confidence=within(0.5, 0.9999),
    resamples=whole(2),
    seed=whole(0, 2**32 - 2),
    execution=execution_settings,
)
def sobol(
    function: Callable[..., Any],
    over: Mapping[Any, tuple[float, float]],
    n: int,
    *,
    vectorized: bool = False,
    second_order: bool = False,
    confidence: float = 0.95,
    resamples: int = 100,
    seed: int = 0,
    execution: Execution = EXECUTION,
) -> SobolIndices:
    """Compute which share of the variance of outputs is due to which parameter.

    The d parameters are independent and uniform in their ranges; for another distribution let
    the function transform them. The function is evaluated by `sweep` at n (d + 2) points, with
    indices of second order at n (2 d + 2): a scrambled Sobol sequence, cross-sampled
    (Saltelli 2002). Indices are estimated by SALib (extra ``sensitivity``), those of first and
    total order by Saltelli et al. (2010), table 2 (b) and (f). The first point is evaluated once
    more, before all others, so that an output without indices is refused at once.

    Parameters
    ----------
    function : callable
        As in `sweep`; every output must be a number. Keep some of the outputs by
        ``execution=fs.Execution(keep=[...])``.
    over : mapping
        Name of each parameter to its range (low, high).
    n : int
        Number of base samples, best a power of 2: a Sobol sequence is balanced for those only.
    vectorized : bool
        Whether the function takes and returns arrays, as in `sweep`.
    second_order : bool
        Whether to compute the indices of pairs of parameters.
    confidence : float
        Probability of the confidence intervals.
    resamples : int
        Number of bootstrap samples for these intervals.
    seed : int
        Seed of the samples and of the bootstrap.
    execution : Execution
        Executor, store and others of the sweep. A store makes the evaluation resumable.

    Returns
    -------
    SobolIndices
        With NaN for an output that has no value at some point, or does not vary. Estimates may
        be slightly below 0 or above 1.

    Raises
    ------
    ArgumentError
        For no parameter, an invalid range, or outputs that are text, bools, complex or arrays.
    UnknownNameError
        For a name that is not an argument of the function.
    MissingPackageError
        When SALib is not installed.

    See Also
    --------
    fastslow.sweep, fastslow.plot.sobol

    References
    ----------
    I. M. Sobol', Math. Comput. Simul. 55, 271-280, 2001. A. Saltelli, Comput. Phys. Commun. 145,
    280-297, 2002. A. Saltelli et al., Comput. Phys. Commun. 181, 259-270, 2010.

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear(omega=0.1)
    >>> def swing(D, C):
    ...     many = fs.simulate_many(gear, [0, 0], parameters={"D": D, "C": C}, periods=2)
    ...     return {"swing": (many.maximum - many.minimum)[:, 0]}
    >>> found = fs.sobol(swing, {"D": (0.1, 0.2), "C": (2.5, 3.5)}, 64, vectorized=True)
    >>> found["swing", "D"]["total"] > found["swing", "C"]["total"]
    True
    """
    extra("SALib", "sensitivity")
    ranges = _ranges(over)
    problem = {
        "num_vars": len(ranges),
        "names": list(ranges),
        "bounds": [list(ends) for ends in ranges.values()],
    }
    sample = import_module("SALib.sample.sobol").sample
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The balance properties", UserWarning)
        points = sample(problem, n, calc_second_order=second_order, seed=seed)
    axes = dict(zip(ranges, points.T.copy(), strict=True))

    def evaluated(values: Mapping[str, Array], settings: Execution) -> Grid:
        return sweep(function, values, paired=True, vectorized=vectorized, execution=settings)

    here = replace(execution, executor=None, store=None, chunk=None, progress=False)
    _require_numbers(evaluated({name: values[:1] for name, values in axes.items()}, here))
    grid = evaluated(axes, execution)
    # all outputs are read for their indices
    grid = replace(grid, outputs={name: grid[name] for name in grid.outputs})
    _require_numbers(grid)
    names, d = tuple(grid.outputs), len(ranges)
    pairs = (len(names), d, d) if second_order else (len(names), 0, 0)
    found = {key: np.full((len(names), d), np.nan) for key in ("S1", "S1_conf", "ST", "ST_conf")}
    found |= {key: np.full(pairs, np.nan) for key in ("S2", "S2_conf")}
    analyze = import_module("SALib.analyze.sobol").analyze
    outcome, notes = _outcome(grid, n), []
    for k, name in enumerate(names if outcome else ()):
        values, reason = _scaled(grid[name])
        if reason:
            notes.append(f"{name} {reason}: no indices.")
            continue
        indices = analyze(
            problem,
            values,
            calc_second_order=second_order,
            num_resamples=resamples,
            conf_level=confidence,
            # of SALib, which takes zero as no seed
            seed=seed or 2**32 - 1,
        )
        for key in indices:
            found[key][k] = indices[key]
    # SALib fills the upper triangle
    second, second_error = (
        np.fmax(found[key], found[key].transpose(0, 2, 1)) for key in ("S2", "S2_conf")
    )
    return SobolIndices(
        outputs=names,
        parameters=tuple(ranges),
        ranges=NamedMapping("parameter", ranges),
        n=n,
        first=found["S1"],
        total=found["ST"],
        first_error=found["S1_conf"],
        total_error=found["ST_conf"],
        second=second,
        second_error=second_error,
        confidence=confidence,
        resamples=resamples,
        seed=seed,
        grid=grid,
        outcome=with_notes(outcome, notes),
    )


def _scaled(values: Array) -> tuple[Array, str]:
    """Values times a power of 2, on which no index depends, or why there are no indices."""
    absent = int((~np.isfinite(values)).sum())
    if absent:
        return values, f"is not finite at {absent} of {len(values)} points"
    scaled = np.ldexp(values, -int(np.frexp(np.abs(values).max())[1]))
    return scaled, "" if np.ptp(scaled) > CONSTANT_OUTPUT else "does not vary"


def _ranges(over: Mapping[Any, Any]) -> dict[str, tuple[float, float]]:
    """Validate the ranges of the parameters."""
    ranges: dict[str, tuple[float, float]] = {}
    for key, ends in over.items():
        if str(key) in ranges:
            raise ArgumentError(f"over: {key} is given twice")
        ranges[str(key)] = interval(f"over: {key}", ends)
    if not ranges:
        raise ArgumentError("over: expected the range of at least one parameter, received none")
    return ranges


def _require_numbers(grid: Grid) -> None:
    """Raise unless every output is a number."""
    for name, values in grid.outputs.items():
        if values.dtype.kind != "f" or values.shape != grid.shape:
            raise ArgumentError(
                f"{name} is {described(values, len(grid.shape))}; Sobol indices are of real "
                "numbers: return numbers, or name those to keep by "
                "execution=fs.Execution(keep=[...])"
            )


def _outcome(grid: Grid, n: int) -> Outcome:
    """Whether there is a value at every point; a missing one leaves no estimate of variances."""
    notes = list(grid.notes)
    if n & (n - 1):
        low = 2 ** (n.bit_length() - 1)
        notes.append(
            f"n = {n} is not a power of 2: the samples are not balanced; use {low} or {2 * low}."
        )
    if grid.outcome:
        return with_notes(Outcome("complete", "all points are computed.", True), notes)
    failed, missing = len(grid.failed), len(grid.missing)
    text = f"no indices, as {failed} of {len(grid)} points failed"
    text += f" and {missing} are missing." if missing else "."
    if failed:
        point, reason = grid.failures[0]
        words = ", ".join(f"{name} = {value:.6g}" for name, value in point.items())
        text += f" First failure, at {words}: {reason.rstrip('.')}."
    return with_notes(replace(grid.outcome, message=text, notes=()), notes)
