"""Deferral of signals that arrive during a compilation.

A signal handler may raise between any two instructions of Python: the usual one for Ctrl-C
raises KeyboardInterrupt. The compiler calls Python from C, where an exception is printed and
lost, and updates tables that must not be left inconsistent. So signals that arrive meanwhile
are stored, and handled between two passes of the compiler.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeVar

R = TypeVar("R")


class _PassStoppedError(BaseException):
    """Ends a compilation; not caught by the exception handlers of the compiler."""


class _Deferral:
    """Replaces the signal handlers during a compilation."""

    def __init__(self) -> None:
        self.handlers: dict[int, Callable[[int, FrameType | None], Any]] = {}
        self.received: list[tuple[int, FrameType | None]] = []
        self.raised: BaseException | None = None
        self.active = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if self.active:
            self.received.append((number, frame))
        else:
            self.handlers[number](number, frame)

    def start(self) -> None:
        """Replace every handler written in Python."""
        for kind in signal.valid_signals():
            handler = signal.getsignal(kind)
            # the two constants for no handler are not callable
            if callable(handler):
                self.handlers[int(kind)] = handler
        self.active = True
        for number in self.handlers:
            signal.signal(number, self)

    def stop(self) -> None:
        """Restore the handlers."""
        while self.active:
            # a restored handler may raise before the others are restored
            try:
                for number, handler in self.handlers.items():
                    if signal.getsignal(number) is self:
                        signal.signal(number, handler)
                self.active = False
            except BaseException as error:
                self.raised = self.raised or error

    def handle(self) -> None:
        """Call the handlers of the stored signals; the first exception is kept."""
        while self.received:
            number, frame = self.received.pop(0)
            try:
                self.handlers[number](number, frame)
            except BaseException as error:
                self.raised = self.raised or error

    def between_passes(self) -> None:
        """Call the handlers, and end the compilation if one of them raises."""
        if threading.current_thread() is threading.main_thread():
            self.handle()
            if self.raised is not None:
                raise _PassStoppedError


_deferral: _Deferral | None = None


def between_passes() -> None:
    """Handle stored signals at a point where the compilation is consistent."""
    if _deferral is not None:
        _deferral.between_passes()


def deferring_signals(compiling: Callable[..., R], *arguments: Any) -> R:
    """Call a function that compiles; signals are handled at its end, or `between_passes`.

    An exception of a handler ends the compilation and is raised unchanged. The next call
    repeats an unfinished compilation.

    Parameters
    ----------
    compiling : callable
    *arguments
        Its arguments.
    """
    global _deferral
    # handlers run in the main thread alone
    if _deferral is not None or threading.current_thread() is not threading.main_thread():
        return compiling(*arguments)
    deferral = _Deferral()
    failure: BaseException | None = None
    try:
        _deferral = deferral
        deferral.start()
        result = compiling(*arguments)
    except BaseException as error:
        failure = error
    _deferral = None
    deferral.stop()
    deferral.handle()
    if deferral.raised is not None:
        raise deferral.raised
    if failure is not None:
        raise failure
    return result
