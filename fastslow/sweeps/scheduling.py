"""Tasks in this process or an executor: a bounded number in flight, and dead workers replaced."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from concurrent.futures.process import ProcessPoolExecutor
from pickle import PicklingError
from typing import Any, Generic, NamedTuple, TypeVar

from fastslow.errors import ArgumentError

A = TypeVar("A")
R = TypeVar("R")

#: Number of tasks in flight for each worker, and for executors that do not tell their number.
PER_WORKER = 2
UNKNOWN = 16

#: Seconds after which the number of workers of a cluster is determined again.
RECOUNT = 10.0


#: Errors of a function that cannot be sent; those that it raises itself are recorded.
TRANSPORT = (PicklingError, AttributeError, TypeError, ImportError)


class Lost:
    """Stands for the result of a task during which a worker died twice."""


class _Task(NamedTuple, Generic[A]):
    key: int
    argument: A
    tries: int


def completed(
    call: Callable[[A], R], tasks: Iterable[tuple[int, A]], executor: Executor | None
) -> Iterator[tuple[int, R | Lost]]:
    """Yield the keys and results of tasks as they are completed.

    Parameters
    ----------
    call : callable
        Computes one task; sent to the workers.
    tasks : iterable of (int, object)
        Key and argument of each, taken when a worker needs it.
    executor : Executor, optional
        This process if None.

    Raises
    ------
    ArgumentError
        If the executor is shut down, or cannot carry the function.
    """
    if executor is None:
        for key, argument in tasks:
            yield key, call(argument)
        return
    with _Workers(executor) as workers:
        yield from workers.completed(call, tasks)


class _Workers:
    """An executor, replaced by one of the same kind when its pool breaks."""

    def __init__(self, executor: Executor) -> None:
        self.executor = executor
        self.own = False
        self.counted, self.limit = -RECOUNT, UNKNOWN

    def __enter__(self) -> _Workers:
        return self

    def __exit__(self, *_: object) -> None:
        if self.own:
            self.executor.shutdown(wait=False, cancel_futures=True)

    def completed(
        self, call: Callable[[A], R], tasks: Iterable[tuple[int, A]]
    ) -> Iterator[tuple[int, R | Lost]]:
        waiting = (_Task(key, argument, 1) for key, argument in tasks)
        suspects: deque[_Task[A]] = deque()
        running: dict[Future[R], _Task[A]] = {}
        try:
            while True:
                # tasks that ran when a pool broke are repeated alone, to find the one that broke it
                if suspects and not running:
                    task = suspects.popleft()
                    running[self._submit(call, task)] = task
                while not suspects and len(running) < self._most() and not self._alone(running):
                    following = next(waiting, None)
                    if following is None:
                        break
                    running[self._submit(call, following)] = following
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    task = running.pop(future)
                    error = future.exception()
                    if error is None:
                        yield task.key, future.result()
                    elif not _died(error):
                        raise _explained(error, self.executor) from error
                    elif task.tries > 1 or not isinstance(error, BrokenExecutor):
                        self._replace(error)
                        yield task.key, Lost()
                    else:
                        self._replace(error)
                        suspects.append(task._replace(tries=task.tries + 1))
        finally:
            for future in running:
                future.cancel()

    @staticmethod
    def _alone(running: dict[Future[R], _Task[A]]) -> bool:
        return any(task.tries > 1 for task in running.values())

    def _submit(self, call: Callable[[A], R], task: _Task[A]) -> Future[R]:
        try:
            return self.executor.submit(call, task.argument)
        except BrokenExecutor as error:
            self._replace(error)
            return self.executor.submit(call, task.argument)
        except RuntimeError as error:
            raise ArgumentError(f"executor: {error}; expected one that is open") from error
        except TRANSPORT as error:
            raise _explained(error, self.executor) from error

    def _replace(self, error: BaseException) -> None:
        """Replace a pool of processes that broke; a cluster replaces its workers itself."""
        if not isinstance(error, BrokenExecutor):
            return
        if not isinstance(self.executor, ProcessPoolExecutor):
            raise error
        old: Any = self.executor
        if not old._broken:
            return  # replaced already
        if self.own:
            old.shutdown(wait=False)
        self.executor = ProcessPoolExecutor(
            old._max_workers, old._mp_context, old._initializer, old._initargs
        )
        self.own = True

    def _most(self) -> int:
        """Return the largest number of tasks in flight."""
        now = time.monotonic()
        if now - self.counted > RECOUNT:
            self.counted = now
            self.limit = PER_WORKER * _workers(self.executor) or UNKNOWN
        return self.limit


def _workers(executor: Any) -> int:
    """Return the number of workers of an executor, 0 if it is unknown.

    Raises
    ------
    ArgumentError
        If it is that of a client of Dask that is closed.
    """
    client: Any = getattr(executor, "_client", None)
    if hasattr(client, "nthreads"):
        if client.status in ("closing", "closed"):
            raise ArgumentError("executor: its Dask client is closed; expected one that is open")
        return sum(client.nthreads().values())
    count = getattr(executor, "_max_workers", None)
    return count if isinstance(count, int) else 0


def _died(error: BaseException) -> bool:
    """Return True if a worker died; Dask has then repeated the task already."""
    return isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"


def _explained(error: BaseException, executor: Executor) -> BaseException:
    """Return the error of a task that is not one of the function, which are recorded."""
    if isinstance(error, TRANSPORT):
        kind = type(executor).__name__
        return ArgumentError(
            f"a {kind} cannot carry the function to its workers ({error}); put it into a module "
            "that they can import"
        )
    return error
