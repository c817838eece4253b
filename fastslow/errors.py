"""What goes wrong, in words: every error of the package, and the nearest valid name."""

from __future__ import annotations

import difflib
import signal
from collections.abc import Iterable


class FastSlowError(Exception):
    """Base class of every error raised by this package."""


class ModelError(FastSlowError, ValueError):
    """The model as written cannot be read: a symbol, a value or a region is wrong."""


class UnknownNameError(FastSlowError, KeyError):
    """A name that is not one of the valid ones."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class ArgumentError(FastSlowError, ValueError):
    """An argument has the wrong value, shape or range."""


class OutOfRangeError(FastSlowError, IndexError):
    """A number in a sequence that there is not: of a branch, a row, a special point."""


class IncompleteWarning(UserWarning):
    """An answer may lack something, because what it was read from was cut short."""


class FileError(FastSlowError, OSError):
    """A file cannot be written or read: it is missing, cut short, foreign or newer."""


class MissingPackageError(FastSlowError, ImportError):
    """A package of an extra is needed that is not installed."""


#: The longest text that an error repeats.
QUOTED = 60


def quoted(text: str) -> str:
    """A text as an error repeats it, a long one cut short.

    Examples
    --------
    >>> quoted("x +"), quoted("x + " * 100)
    ("'x +'", "'x + x + x + x + x + x + x + x …' (400 characters)")
    """
    if len(text) > QUOTED:
        return f"{quoted(text[: QUOTED // 2] + '…')} ({len(text)} characters)"
    return repr(text) if _encodable(text) else ascii(text)


def _encodable(text: str) -> bool:
    """Whether a text can be printed: it holds no half of a pair of surrogates."""
    return text.isascii() or not any("\ud800" <= c <= "\udfff" for c in text)


def unknown_name(kind: str, name: object, valid: Iterable[object]) -> UnknownNameError:
    """Build the error for a name that is not valid, with the nearest valid one.

    Parameters
    ----------
    kind : str
        What the name was taken for, for instance ``"parameter"``.
    name : object
        The name received (a symbol counts by what it prints).
    valid : iterable of object
        The names that would have been accepted.

    Returns
    -------
    UnknownNameError
        To be raised by the caller.

    Examples
    --------
    >>> print(unknown_name("parameter", "omga", ["A", "omega"]))
    unknown parameter 'omga'; did you mean 'omega'? (known: A, omega)
    """
    names = [str(v) for v in valid]
    text = str(name)
    near = difflib.get_close_matches(text[: 2 * QUOTED], names, n=1, cutoff=0.5)
    near = near or [v for v in names if v.casefold() == text.casefold()]
    shown = f"'{text}'" if len(text) <= QUOTED and _encodable(text) else quoted(text)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    known = ", ".join(names) if names else "none"
    return UnknownNameError(f"unknown {kind} {shown}{hint} (known: {known})")


def raised_by_handler(error: BaseException) -> bool:
    """Whether the handler of a signal raised an exception, and so nothing that was called.

    Such an exception passes through whatever deals with those of the same class.

    Examples
    --------
    >>> raised_by_handler(TimeoutError())
    False
    """
    codes = {
        getattr(getattr(handler, "func", handler), "__code__", None)
        for handler in map(signal.getsignal, signal.valid_signals())
    }
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code in codes:
            return True
        trace = trace.tb_next
    return False
