"""Settings of simulations: error control, execution, and observation by a sweep."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import KW_ONLY, dataclass, fields
from typing import Any, Literal, Protocol, get_args

from fastslow.arguments import (
    Check,
    Expression,
    Name,
    among,
    finite,
    flag,
    formula,
    instance,
    items,
    path,
    real_number,
    refusal,
    settings,
    text,
    tolerance,
    whole,
    within,
    word,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.stored.operations import Operations, contain_exponentials

#: Default limits of steps and of crossings.
DEFAULT_LIMIT = 1_000_000

#: The lower one of the default orders.
LOW_ORDER = 16


def _absolute(name: str, value: Any) -> Any:
    """Validate one absolute tolerance, or one for each of several states."""
    if isinstance(value, Mapping):
        checked = {str(k): _nonnegative(f"{name} of {k}", v) for k, v in value.items()}
        return NamedMapping("state", checked)
    if real_number(value) is not None or isinstance(value, str | bool):
        return _nonnegative(name, value)
    return items(_nonnegative)(name, value)


def _nonnegative(name: str, value: Any) -> float:
    number = real_number(value)
    if number is None or not 0.0 <= number < float("inf"):
        raise refusal(name, value, "a finite number from 0")
    return number


@settings(
    rtol=tolerance,
    atol=_absolute,
    order=whole(4, 40),
    implicit=flag,
    max_steps=whole(1, 2**40),
    max_crossings=whole(1, 2**40),
)
@dataclass(frozen=True, kw_only=True)
class Integration(Displayed):
    """How a trajectory is integrated: error control, method and limits.

    The error allowed in a step is the larger of rtol |y| and atol for every state y.

    Parameters
    ----------
    rtol : float
        Relative tolerance of a step, 1e-16 (rounding) to 0.1.
    atol : float, sequence or mapping, optional
        Absolute tolerance of a step, in the unit of the state: one number for all states,
        one for each in order, or by name; 0 is allowed. By default, and for states not
        named, it is rtol times the recent size of the state in the run, independent of
        units. A state that is a factor of its own rate (x' = x g, such as an extinct species
        or a laser below threshold) gets 0, so that a slow passage along the invariant plane
        x = 0 is resolved down to 1e-300, below which x is set to zero.
    order : int, optional
        Order of the Taylor series, 4 to 40, by default 16 or, for rtol < 1e-11, 24. In models
        with resets and exponentials, whose spikes would overflow the coefficients, it is 16; at
        most 12 for collocation.
    implicit : bool, optional
        Whether implicit steps may be taken where stability rather than accuracy limits the
        series (stiff phases); by default in single runs, not in ensembles. Ensembles take
        explicit steps so cheaply that implicit ones pay only if stability shortens the steps
        by a factor of about thirty, as in stiff contacts.
    max_steps, max_crossings : int
        Limits at which a trajectory stops.

    Raises
    ------
    ArgumentError
        For a value outside these ranges.

    Examples
    --------
    >>> Integration(rtol=1e-12).default_order
    24
    >>> Integration(atol={"x": -1})
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: atol of x = -1; expected a finite number from 0
    """

    rtol: float = 1e-9
    atol: float | Sequence[float] | Mapping[Any, float] | None = None
    order: int | None = None
    implicit: bool | None = None
    max_steps: int = DEFAULT_LIMIT
    max_crossings: int = DEFAULT_LIMIT

    @property
    def default_order(self) -> int:
        """Order of the series for the tolerance, one of two to limit compilation."""
        return LOW_ORDER if self.rtol >= 1e-11 else 24


@dataclass(frozen=True, kw_only=True)
class Resolved:
    """An `Integration` with its defaults resolved for a model.

    ``atol`` names every state; None stands for the scale determined by the run.
    """

    rtol: float
    atol: Mapping[str, float | None]
    order: int
    implicit: bool
    max_steps: int
    max_crossings: int

    @property
    def limits(self) -> tuple[int, int]:
        """Largest numbers of steps and of crossings."""
        return self.max_steps, self.max_crossings

    def recorded(self) -> dict[str, Any]:
        """The ``settings`` stored in a result."""
        given = {name: value for name, value in self.atol.items() if value is not None}
        return {
            "rtol": self.rtol,
            "atol": given or None,
            "order": self.order,
            "implicit": self.implicit,
            "max_steps": self.max_steps,
            "max_crossings": self.max_crossings,
        }


class HasStates(Protocol):
    """Attributes of a model that settings depend on."""

    @property
    def states(self) -> tuple[str, ...]: ...

    @property
    def slow_states(self) -> tuple[str, ...]: ...

    @property
    def resets(self) -> Collection[str]: ...

    @property
    def operations(self) -> Operations: ...


def resolve(integration: Integration, model: HasStates, *, implicit: bool) -> Resolved:
    """Resolve the defaults of settings for a model.

    Parameters
    ----------
    integration : Integration
    model : Model
    implicit : bool
        Whether implicit steps are taken by default.

    Raises
    ------
    UnknownNameError
        For an absolute tolerance of an unknown state.
    ArgumentError
        If the number of absolute tolerances differs from that of the states.
    """
    order = integration.order
    if order is None:
        order = LOW_ORDER if _has_spikes(model) else integration.default_order
    return Resolved(
        rtol=integration.rtol,
        atol=_by_state(integration.atol, (*model.states, *model.slow_states)),
        order=order,
        implicit=implicit if integration.implicit is None else integration.implicit,
        max_steps=integration.max_steps,
        max_crossings=integration.max_crossings,
    )


def _has_spikes(model: HasStates) -> bool:
    """Whether a reset may end an exponential upstroke.

    At a time δ before its singularity the coefficients grow as δ^-k, where δ may be 1e-15.
    """
    if not model.resets:
        return False
    partition = getattr(model, "partition", None)
    if partition is not None and partition.pieces is not None:
        from fastslow.model.piece_operations import operations_by_signs

        return contain_exponentials(operations_by_signs(partition).nodes)
    return model.operations.has_exponentials


def _by_state(atol: Any, names: tuple[str, ...]) -> dict[str, float | None]:
    """Absolute tolerance of every state, None if determined by the run."""
    if isinstance(atol, Mapping):
        for name in atol:
            if name not in names:
                raise unknown_name("state", name, names)
        return {name: atol.get(name) for name in names}
    if isinstance(atol, tuple):
        if len(atol) != len(names):
            raise ArgumentError(
                f"atol: received {len(atol)} values; expected {len(names)}, for {', '.join(names)}"
            )
        return dict(zip(names, atol, strict=True))
    return dict.fromkeys(names, atol)


#: Number of threads of computations in the current task of an executor, None elsewhere.
_TASK_THREADS: ContextVar[int | None] = ContextVar("threads", default=None)


@contextmanager
def task_threads(threads: int | None) -> Iterator[None]:
    """Limit the threads of computations within a task, where they do not set their own number."""
    token = _TASK_THREADS.set(threads)
    try:
        yield
    finally:
        _TASK_THREADS.reset(token)


def _executor(name: str, value: Any) -> Executor:
    """Validate an executor; a Dask client is not one, but has one."""
    if not isinstance(value, Executor):
        method = hasattr(value, "get_executor")
        hint = ", here that of get_executor()" if method else ", such as ProcessPoolExecutor()"
        raise refusal(name, value, f"a concurrent.futures.Executor{hint}")
    return value


def _resumption(name: str, value: Any) -> bool | str:
    """Validate True, False or "anyway"."""
    if isinstance(value, str) and value == "anyway":
        return value
    try:
        return flag(name, value)
    except ArgumentError:
        raise refusal(name, value, "True, False or 'anyway'") from None


@settings(
    executor=_executor,
    chunk=whole(1),
    store=path,
    resume=_resumption,
    threads=whole(1, 1024),
    progress=flag,
    errors=word("treatment of errors", ("record", "raise")),
    keep=items(text),
)
@dataclass(frozen=True, kw_only=True)
class Execution(Displayed):
    """How a computation of many runs is executed.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        Where the tasks of a sweep are computed: a pool of threads or processes, Dask's
        ``client.get_executor()``, ``mpi4py.futures.MPIPoolExecutor``; by default this process.
        It is not shut down.
    chunk : int, optional
        Number of points in a task: at most one row of the last axis, or whole rows. By default
        it depends on the axes alone.
    store : str or path, optional
        Zarr directory to which finished tasks are written (extra ``cluster``), such as
        ``"map.zarr"``. The same call resumes an interrupted sweep.
    resume : bool or "anyway"
        Whether to continue an existing store; if False, an existing one is refused. A store is
        also refused if the function has changed, or reaches values that cannot be compared; with
        ``"anyway"`` only if it has changed.
    threads : int, optional
        Maximum number of threads of each task, by default the number of cores available to
        this process, or one in tasks of an executor. Runs that depend on each other, as those
        of a bifurcation sweep without strips, take one.
    progress : bool
        Whether to show a progress bar.
    errors : {"record", "raise"}
        Whether points at which the function raises are recorded as failures, or end the sweep.
    keep : sequence of str, optional
        Names of the outputs to keep; required for functions that return results of fastslow:
        attributes, columns, or expressions in columns.

    Raises
    ------
    ArgumentError
        For an invalid value.
    UnknownNameError
        For an unknown treatment of errors.

    Examples
    --------
    >>> Execution(threads=0)
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: threads = 0; expected an integer from 1
    """

    executor: Executor | None = None
    chunk: int | None = None
    store: str | os.PathLike[str] | None = None
    resume: bool | Literal["anyway"] = True
    threads: int | None = None
    progress: bool = False
    errors: str = "record"
    keep: Sequence[str] | None = None

    @property
    def task_threads(self) -> int | None:
        """Threads of a task: one in an executor, whose workers are many, unless given."""
        return 1 if self.threads is None and self.executor is not None else self.threads

    @property
    def workers(self) -> int:
        """Number of threads, by default that of the current task or of available cores."""
        if self.threads is not None:
            return self.threads
        inherited = _TASK_THREADS.get()
        if inherited is not None:
            return inherited
        if hasattr(os, "sched_getaffinity"):
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1


def progress_bar(execution: Execution, unit: str, total: int | None = None) -> Any:
    """Return a context manager with a progress bar, which is hidden by default."""
    from tqdm import tqdm

    return tqdm(total=total, disable=not execution.progress, unit=unit)


What = Literal["stroboscopic", "extremes", "section"]


@settings(
    what=word("type of observation", get_args(What)),
    column=formula,
    phase=within(0.0, 1.0),
    section=formula,
    level=finite,
    direction=among(-1, 0, 1, None),
)
@dataclass(frozen=True)
class Observation(Displayed):
    """Which points of a run a sweep records.

    Parameters
    ----------
    what : {"stroboscopic", "extremes", "section"}
        Record a column once every period, its minimum and maximum in every period, or its
        values on a Poincaré section.
    column : str or Symbol, optional
        Recorded column, by default the first state.
    phase : float
        For stroboscopic points: phase of the period, 0 to 1.
    section : str or Expr
        For a Poincaré section: the expression, see `Trajectory.section`. The rate of a state
        with direction −1 gives its maxima.
    level : float
        Level of the section.
    direction : int, optional
        Direction of crossing: +1 upwards, −1 downwards, 0 for tangencies, None for all.

    Raises
    ------
    UnknownNameError
        For an unknown type of observation.
    ArgumentError
        For an invalid phase, level or direction, or a section with another type.

    Examples
    --------
    >>> Observation("section")
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: Observation("section") needs section=, the expression of the \
Poincaré section
    """

    what: What = "stroboscopic"
    _: KW_ONLY
    column: Name | None = None
    phase: float = 0.0
    section: Expression | None = None
    level: float = 0.0
    direction: int | None = 1

    def __post_init__(self) -> None:
        if self.section is None and self.what == "section":
            raise ArgumentError(
                'Observation("section") needs section=, the expression of the Poincaré section'
            )
        if self.section is not None and self.what != "section":
            raise ArgumentError(
                f'section= goes with Observation("section"), received Observation("{self.what}")'
            )


#: What is used where nothing is given.
DEFAULT = Integration()
EXECUTION = Execution()
STROBOSCOPIC = Observation()

#: The checks of ``integration=``, ``execution=`` and ``observe=``.
integration_settings = instance(Integration)
execution_settings = instance(Execution)


def _execution(*accepted: str) -> Check:
    """Accept an execution whose other parts are the default ones."""

    def check(name: str, value: Any) -> Execution:
        given: Execution = execution_settings(name, value)
        for entry in fields(given):
            part = entry.name
            if part not in accepted and getattr(given, part) != getattr(EXECUTION, part):
                raise ArgumentError(
                    f"{name}: {part}= is for fs.sweep; this computation accepts "
                    f"{', '.join(f'{n}=' for n in accepted)}"
                )
        return given

    return check


#: The checks of computations in threads of this process, and of adaptive maps.
thread_settings = _execution("threads", "progress")
map_settings = _execution("executor", "chunk", "store", "resume", "threads", "progress")


observation = instance(Observation)
