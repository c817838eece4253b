"""Evaluation of a function at the points of one task, in the process of a worker."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import shown
from fastslow.errors import (
    ArgumentError,
    FastSlowError,
    UnknownNameError,
    raised_by_handler,
    unknown_name,
)
from fastslow.formulas.grammar import normalised
from fastslow.results.base.immutable import ReadOnly
from fastslow.results.base.outcome import Outcome
from fastslow.results.base.table import Table
from fastslow.results.maps.adaptive_map import NO_REASON
from fastslow.results.maps.grid import described
from fastslow.results.maps.tiles import FILL
from fastslow.results.trajectory.ensemble import Ensemble
from fastslow.simulation.settings import task_threads

Array = NDArray[Any]
Points = Mapping[str, Array]

#: The name of the output of a function that returns a single value.
VALUE = "value"

#: Whole numbers up to this one are floats too.
EXACT_FLOATS = 2**53

EXPECTED = "a number, text, a bool, an array, a mapping of these, or a result of fastslow"


@dataclass
class Computed:
    """Outputs of m points.

    Parameters
    ----------
    count : int
    outputs : dict
        Arrays by name, shape (m, ...); empty if every point failed.
    failures : dict
        Text of the error of each point that failed, by its index.
    error : Exception, optional
        That of a point that failed, where it ends the sweep.
    """

    count: int
    outputs: dict[str, Array]
    failures: dict[int, str] = field(default_factory=dict)
    error: Exception | None = None

    def __post_init__(self) -> None:
        self.failures = {
            row: _portable_text(text) or NO_REASON for row, text in self.failures.items()
        }


@dataclass(frozen=True)
class Evaluation:
    """A function, and how it is called.

    Parameters
    ----------
    function : callable
    vectorized : bool
        Whether it takes and returns arrays.
    keep : tuple of str, optional
    raises : bool
        Whether to stop at the first point that fails.
    threads : int, optional
        Number of threads of computations within the function.
    """

    function: Callable[..., Any]
    vectorized: bool
    keep: tuple[str, ...] | None
    raises: bool
    threads: int | None

    def __call__(self, points: Points) -> Computed:
        """Evaluate the function at m points, given as arrays of shape (m,)."""
        with task_threads(self.threads):
            found = self._several(points) if self.vectorized else self._in_turn(points)
        if self.raises and found.failures and found.error is None:
            found.error = FastSlowError(next(iter(found.failures.values())))
        return found

    def _in_turn(self, points: Points) -> Computed:
        columns = [values.tolist() for values in points.values()]
        rows: list[dict[str, Array] | Exception] = []
        for values in zip(*columns, strict=True):
            try:
                returned = self.function(**dict(zip(points, values, strict=True)))
            except Exception as error:
                if raised_by_handler(error):
                    raise
                if self.raises:
                    place = ", ".join(f"{n} = {v}" for n, v in zip(points, values, strict=True))
                    error.add_note(f"at {place}")
                    return Computed(len(columns[0]), {}, error=portable(error))
                rows.append(error)
            else:
                rows.append(self._row(returned))
                if len(rows) == 1 and isinstance(rows[0], dict):
                    size = sum(value.nbytes for value in rows[0].values())
                    require_memory(
                        size * len(columns[0]),
                        f"the outputs of a task of {len(columns[0])} points",
                        "set fewer points by execution=fs.Execution(chunk=…)",
                    )
        return _stacked(rows)

    def _several(self, points: Points) -> Computed:
        count = len(next(iter(points.values())))
        try:
            returned = self.function(**{name: values.copy() for name, values in points.items()})
        except Exception as error:
            if raised_by_handler(error):
                raise
            if self.raises:
                return Computed(count, {}, error=portable(error))
            if count == 1:
                return _stacked([error])
            # bisect, so that a point that raises does not affect the others
            halves = (slice(count // 2), slice(count // 2, None))
            return joined([self._several({n: v[s] for n, v in points.items()}) for s in halves])
        if isinstance(returned, list | tuple):
            _check_count(VALUE, len(returned), count)
            return _stacked([v if isinstance(v, Exception) else self._row(v) for v in returned])
        outputs = {name: _array(name, value) for name, value in self._kept(returned).items()}
        for name, values in outputs.items():
            _check_count(name, len(values) if values.ndim else None, count)
        failures = {}
        if isinstance(returned, Ensemble) and not returned.success.all():
            rows = np.flatnonzero(~returned.success)
            failures = {row: str(returned.outcomes[row]) for row in rows.tolist()}
            for name, values in outputs.items():
                outputs[name] = values.copy()
                outputs[name][rows] = FILL[values.dtype.kind]
        return Computed(count, outputs, failures)

    def _row(self, returned: Any) -> dict[str, Array] | Exception:
        """Return the outputs at one point, or the exception that stands for a failure."""
        outcome = returned if isinstance(returned, Outcome) else getattr(returned, "outcome", None)
        if isinstance(outcome, Outcome) and not outcome:
            return _Unsuccessful(str(outcome))
        return {name: _array(name, value) for name, value in self._kept(returned).items()}

    def _kept(self, returned: Any) -> dict[str, Any]:
        """Return the outputs by name, of a result those that are kept."""
        if returned is None:
            raise ArgumentError(f"the function returned nothing (None); expected {EXPECTED}")
        if isinstance(returned, ReadOnly) and not isinstance(returned, Mapping):
            if self.keep is None:
                kind = type(returned).__name__
                raise ArgumentError(
                    f"the function returned a {kind}; name the columns to keep by "
                    f"execution=fs.Execution(keep=[…]), of {', '.join(_names_of(returned))}"
                )
            return {name: _part(returned, name) for name in self.keep}
        found = {VALUE: returned}
        if isinstance(returned, Mapping):
            found = {normalised(str(name)): value for name, value in returned.items()}
            if len(found) < len(returned):
                raise ArgumentError(
                    f"the function returned two outputs of one name, of {', '.join(found)}"
                )
            if not found:
                raise ArgumentError(f"the function returned an empty mapping; expected {EXPECTED}")
        for name in self.keep or ():
            if name not in found:
                raise unknown_name("output to keep", name, found)
        return found if self.keep is None else {name: found[name] for name in self.keep}


class _Unsuccessful(Exception):
    """A result that ended early; its text is that of the outcome alone."""


def joined(parts: Sequence[Computed]) -> Computed:
    """Return the outputs of consecutive points together."""
    kinds: dict[str, Array] = next((part.outputs for part in parts if part.outputs), {})
    for part in parts:
        if part.outputs:
            check_kinds(part.outputs, kinds)
    outputs = {}
    for name, first in kinds.items():
        arrays = [
            part.outputs[name]
            if part.outputs
            else np.full((part.count, *first.shape[1:]), FILL[first.dtype.kind])
            for part in parts
        ]
        outputs[name] = np.concatenate(arrays)
    failures: dict[int, str] = {}
    start = 0
    for part in parts:
        failures |= {start + row: text for row, text in part.failures.items()}
        start += part.count
    error = next((part.error for part in parts if part.error is not None), None)
    return Computed(start, outputs, failures, error)


def _stacked(rows: Sequence[dict[str, Array] | Exception]) -> Computed:
    """Return the outputs of points that were evaluated one by one."""
    good = [(k, row) for k, row in enumerate(rows) if not isinstance(row, Exception)]
    outputs: dict[str, Array] = {}
    if good:
        kinds = {name: value[None] for name, value in good[0][1].items()}
        for _, row in good:
            check_kinds({name: value[None] for name, value in row.items()}, kinds)
        places = [k for k, _ in good]
        for name, first in kinds.items():
            values = np.stack([row[name] for _, row in good])
            shape = (len(rows), *first.shape[1:])
            outputs[name] = np.full(shape, FILL[values.dtype.kind], dtype=values.dtype)
            outputs[name][places] = values
    failures = {k: _text(row) for k, row in enumerate(rows) if isinstance(row, Exception)}
    return Computed(len(rows), outputs, failures)


def check_kinds(outputs: Mapping[str, Array], known: Mapping[str, Array]) -> None:
    """Raise ArgumentError for outputs whose names, kinds or shapes at a point differ."""
    if set(outputs) != set(known):
        raise ArgumentError(
            f"the function returned the outputs {', '.join(outputs)} at one point, "
            f"{', '.join(known)} at another; expected the same at all"
        )
    for name, values in outputs.items():
        one, other = described(values, 1), described(known[name], 1)
        if one != other:
            hint = "; return float(…) or complex(…)" if "complex" in one + other else ""
            raise ArgumentError(
                f"{name} is {one} at one point, {other} at another; expected the same at all{hint}"
            )


def _array(name: str, value: Any) -> Array:
    """Return an output as an array of floats, complex numbers, bools or text."""
    if isinstance(value, Outcome):
        value = value.code
    if value is None:
        value = np.nan
    if np.ma.is_masked(value):
        value = _unmasked(name, value)
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.empty(0, dtype=object)
    kind = array.dtype.kind
    if kind in "iu" and array.size and max(int(array.max()), -int(array.min())) > EXACT_FLOATS:
        raise ArgumentError(
            f"{name} = {shown(value)}; whole numbers are stored as floats, which are exact up to "
            "2^53: return a float or text"
        )
    if kind in "iuf":
        return array.astype(float, copy=False)
    if kind == "O" and all(isinstance(item, str) for item in array.flat) and array.size:
        array, kind = array.astype(str), "U"
    if kind not in "cbU":
        raise ArgumentError(f"{name} = {shown(value)}; expected a number, text, a bool or an array")
    if kind == "U" and _portable_text(text := "".join(array.flat)) != text:
        raise ArgumentError(f"{name} = {shown(value)}; expected text in Unicode")
    return array.astype(complex, copy=False) if kind == "c" else array


def _unmasked(name: str, value: Any) -> Array:
    """Return a masked array of numbers with NaN for what is masked."""
    if value.dtype.kind not in "iuf":
        raise ArgumentError(f"{name} = {shown(value)}; of masked arrays only numbers are accepted")
    return np.asarray(value.astype(float).filled(np.nan))


def _part(result: Any, name: str) -> Any:
    """Return an attribute or a column of a result, or an expression in its columns."""
    value = None if name.startswith("_") else getattr(result, name, None)
    if value is not None and not callable(value):
        return value
    if isinstance(result, Table):
        try:
            return result[name]
        except UnknownNameError:
            if not name.isidentifier():
                raise
    elif name in _names_of(result):
        return value
    raise unknown_name(f"column of {type(result).__name__} to keep", name, _names_of(result))


def _names_of(result: Any) -> list[str]:
    """Return the names of the attributes and columns of a result that an output can be."""
    fields: Iterable[str] = getattr(type(result), "__dataclass_fields__", ())
    columns = result.to_dict() if isinstance(result, Table) else ()
    return list(dict.fromkeys([*columns, *fields]))


def _check_count(name: str, received: int | None, expected: int) -> None:
    if received != expected:
        several = "a single value" if received is None else f"{received} values"
        raise ArgumentError(
            f"the function returned {several} of {name} for {expected} points; with "
            "vectorized=True it takes and returns arrays"
        )


def _text(error: Exception) -> str:
    """Return the text of an error as it is recorded."""
    if isinstance(error, _Unsuccessful):
        return str(error)
    return f"{type(error).__name__}: {error}".removesuffix(": ")


def _portable_text(text: str) -> str:
    """Return a text with escapes for what is not Unicode and cannot be stored."""
    return text.encode("utf-8", "backslashreplace").decode()


def portable(error: Exception) -> Exception:
    """Return an exception that can be sent between processes."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(_text(error))
    return error


def require_memory(size: float, what: str, instead: str) -> None:
    """Raise ArgumentError for arrays that are larger than the memory that is available."""
    try:
        free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return  # not known on this system
    if size > free:
        raise ArgumentError(
            f"{what} take {size / 1e9:.3g} GB, of which {free / 1e9:.3g} are available; {instead}"
        )
