"""Evaluation of a function at the points of a grid, by any executor."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastslow.arguments import flag, mapping, shown, text, validated
from fastslow.arguments import function as callable_check
from fastslow.errors import ArgumentError, unknown_name
from fastslow.formulas.grammar import normalised
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.maps.grid import Grid, shape_of
from fastslow.results.maps.tiles import Tiles, default_tiles, tiles_of
from fastslow.simulation.settings import EXECUTION, Execution, execution_settings, progress_bar
from fastslow.sweeps.collecting import Collector, Memory, Stored, usable
from fastslow.sweeps.evaluation import Evaluation, require_memory
from fastslow.sweeps.function_digest import identity_of, undigested_notes, versions
from fastslow.sweeps.scheduling import Lost, completed

Array = NDArray[Any]

#: Default number of points of a task that receives arrays, and largest number of one that
#: receives points.
VECTOR, SINGLE = 8192, 1000

#: Default number of tasks of points.
TASKS = 64


@validated(
    function=callable_check,
    values=mapping,
    paired=flag,
    vectorized=flag,
    units=mapping,
    execution=execution_settings,
)
def sweep(
    function: Callable[..., Any],
    values: Mapping[Any, ArrayLike],
    *,
    paired: bool = False,
    vectorized: bool = False,
    units: Mapping[Any, str] = NamedMapping("unit"),
    execution: Execution = EXECUTION,
) -> Grid:
    """Evaluate a function at many parameter sets, by any executor, and resume after interrupts.

    The points are divided into tasks, of which at most two per worker are sent at a time. The
    result does not depend on the executor, the order of the tasks or the number of workers.

    Parameters
    ----------
    function : callable
        Called with the value of each axis by name. Returns a number, text, a bool, an array, a
        mapping of these, or a result of fastslow with the columns to keep in ``execution``;
        whole numbers are stored as floats. With processes or a cluster it is best a function of
        a module.
    values : mapping
        Name of each axis to its values: numbers, text or bools. The points are all
        combinations, the last axis fastest.
    paired : bool
        Whether point k has the k-th value of each axis instead.
    vectorized : bool
        Whether the function takes and returns arrays, shape (m,) and (m, ...), for a whole task.
    units : mapping
        Name of an axis or output to its unit as text, such as ``{"D": "mm"}``: quantities of a
        model have no units. They are kept in the grid, its store and its data sets, and shown
        in figures.
    execution : Execution
        Executor, size of the tasks, store, treatment of errors, outputs to keep.

    Returns
    -------
    Grid

    Raises
    ------
    ArgumentError
        For an axis that is empty, repeated or not finite; outputs whose kind or shape differs
        between points; a function that returns nothing, or that the executor cannot carry; a
        store of another sweep.
    UnknownNameError
        For an axis that is not an argument of the function, an output to keep that does not
        exist, or the unit of neither.
    FileError
        If the store is in use, damaged or cannot be written.
    Exception
        The first error of the function with ``errors="raise"``.

    See Also
    --------
    fastslow.sobol, fastslow.refined_map, fastslow.plot.grid

    Examples
    --------
    >>> import fastslow as fs
    >>> gear = fs.systems.harmonic_gear(omega=0.1)
    >>> def motion(D, C):
    ...     return fs.simulate_many(gear, [0, 0], parameters={"D": D, "C": C}, periods=2)
    >>> grid = sweep(
    ...     motion,
    ...     {"D": [0.05, 0.29], "C": [2.3, 2.5]},
    ...     vectorized=True,
    ...     execution=fs.Execution(keep=["regime", "maximum x"]),
    ... )
    >>> grid["regime"]
    array([['meshed upper', 'bilateral'],
           ['meshed upper', 'unilateral upper']], dtype='<U16')
    """
    axes = _axes(values, paired)
    _check_names(function, axes)
    count = math.prod(shape_of(axes, paired))
    require_memory(2.0 * count, f"the marks of {count} points", "give fewer values")
    tiles = _tiles(axes, paired, vectorized, execution)
    identity = identity_of(function)
    keep = None if execution.keep is None else tuple(execution.keep)
    evaluation = Evaluation(
        function,
        vectorized,
        keep,
        execution.errors == "raise",
        execution.task_threads,
    )
    about = {
        "axes": axes,
        "paired": paired,
        "function": identity.name,
        "equations": identity.equations,
        "settings": NamedMapping("setting", {"vectorized": vectorized, "keep": keep}),
        "versions": NamedMapping("version", versions(identity)),
        "notes": undigested_notes(identity),
        "units": NamedMapping("unit", {str(n): text(f"units[{n}]", u) for n, u in units.items()}),
    }
    collector: Collector = Memory(about, tiles)
    if execution.store is not None:
        collector = Stored(
            execution.store,
            about,
            tiles,
            identity=identity,
            chunk=execution.chunk,
            resume=execution.resume,
        )
    with collector, progress_bar(execution, "point", math.prod(tiles.shape)) as bar:
        tiles = collector.tiles
        tasks = ((k, _points(axes, paired, tiles, k)) for k in _waiting(collector, tiles, bar))
        for k, found in completed(evaluation, tasks, execution.executor):
            if isinstance(found, Lost):
                collector.lose(k)
            elif found.error is not None:
                raise found.error
            else:
                collector.add(k, found)
            bar.update(math.prod(tiles.box(k)))
    return collector.grid()


def _axes(given: Mapping[Any, ArrayLike], paired: bool) -> NamedMapping[Array]:
    axes: dict[str, Array] = {}
    for key, along in given.items():
        name = normalised(str(key))
        if name in axes:
            raise ArgumentError(f"values: {name} is given twice")
        if not usable(name):
            raise ArgumentError(
                f"values: the name {name or repr(name)} is used by the grid; rename this axis"
            )
        axes[name] = _axis(name, along, paired)
    if not axes:
        raise ArgumentError("values: expected the values of at least one axis, received none")
    lengths = {name: len(values) for name, values in axes.items()}
    if paired and len(set(lengths.values())) > 1:
        received = ", ".join(f"{n} of {name}" for name, n in lengths.items())
        raise ArgumentError(f"values: paired axes need equally many values, received {received}")
    return NamedMapping("axis", axes)


def _axis(name: str, given: Any, paired: bool) -> Array:
    """Validate the values of an axis."""
    if isinstance(given, str | bytes | Mapping):
        raise ArgumentError(f"values: {name} = {shown(given)}; expected several values")
    try:
        values = np.array(given)
    except ValueError:
        values = np.empty((0, 0))
    if values.ndim != 1 or (values.size and values.dtype.kind not in "biufU"):
        raise ArgumentError(
            f"values: {name} = {shown(given)}; expected a sequence of numbers, text or bools"
        )
    if not values.size:
        raise ArgumentError(f"values: {name} has no values")
    if not isinstance(given, np.ndarray) and len({_type_of(value) for value in given}) > 1:
        raise ArgumentError(
            f"values: {name} = {shown(given)}; expected numbers, text or bools, not a mixture"
        )
    if values.dtype.kind == "f":
        values = values.astype(float)
        if not np.isfinite(values).all():
            raise ArgumentError(f"values: {name} has values that are not finite")
    elif values.dtype.kind in "iu":
        if values.max() > np.iinfo(np.int64).max:
            raise ArgumentError(
                f"values: {name} has whole numbers of 2^63 or more; give them as floats"
            )
        values = values.astype(np.int64)
    known, counts = np.unique(values, return_counts=True)
    if not paired and counts.max() > 1:
        raise ArgumentError(f"values: {name} has the value {known[counts > 1][0]} more than once")
    values.flags.writeable = False
    return values


def _type_of(value: Any) -> str:
    """Return "text", "bool" or "number": NumPy would convert a mixture to one of them."""
    if isinstance(value, str):
        return "text"
    return "bool" if isinstance(value, bool | np.bool_) else "number"


def _check_names(function: Callable[..., Any], axes: Mapping[str, Array]) -> None:
    """Compare the axes with the arguments of a function, where Python knows them."""
    try:
        parameters = inspect.signature(function).parameters
    except (TypeError, ValueError):
        return
    kinds = inspect.Parameter
    named = [
        n
        for n, p in parameters.items()
        if p.kind in (kinds.POSITIONAL_OR_KEYWORD, kinds.KEYWORD_ONLY)
    ]
    open_ended = any(p.kind is kinds.VAR_KEYWORD for p in parameters.values())
    for name in axes:
        if name not in named and not open_ended:
            raise unknown_name("argument of the function", name, named)
    needed = [
        n
        for n, p in parameters.items()
        if p.default is kinds.empty and p.kind not in (kinds.VAR_KEYWORD, kinds.VAR_POSITIONAL)
    ]
    missing = [name for name in needed if name not in axes]
    if missing:
        raise ArgumentError(
            f"values: the function also needs values of {', '.join(missing)}; received axes "
            f"{', '.join(axes)}"
        )


def _tiles(
    axes: Mapping[str, Array], paired: bool, vectorized: bool, execution: Execution
) -> Tiles:
    shape = shape_of(axes, paired)
    count = math.prod(shape)
    if execution.chunk is None:
        return default_tiles(shape, VECTOR if vectorized else min(count // TASKS, SINGLE))
    tiles = tiles_of(shape, execution.chunk)
    require_memory(
        16.0 * len(axes) * math.prod(tiles.size),
        f"chunk = {execution.chunk}: its points",
        "reduce it",
    )
    return tiles


def _points(axes: Mapping[str, Array], paired: bool, tiles: Tiles, k: int) -> dict[str, Array]:
    """Return the values of the axes at the points of a task, shape (m,)."""
    rows = tiles.points(k)
    if paired:
        return {name: values[rows] for name, values in axes.items()}
    places = np.unravel_index(np.arange(rows.start, rows.stop), tiles.shape)
    return {n: values[place] for (n, values), place in zip(axes.items(), places, strict=True)}


def _waiting(collector: Collector, tiles: Tiles, bar: Any) -> Iterator[int]:
    """Yield the tasks that are not finished."""
    for k in range(len(tiles)):
        if collector.finished(k):
            bar.update(math.prod(tiles.box(k)))
        else:
            yield k
