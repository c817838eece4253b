"""Exceptions and warnings of the package, with suggestions for misspelled names."""

from __future__ import annotations

import difflib
import signal
from collections.abc import Iterable


class FastSlowError(Exception):
    """Base class of every error raised by this package."""


class ModelError(FastSlowError, ValueError):
    """A model definition is invalid: a symbol, a value or a region is wrong."""


class UnknownNameError(FastSlowError, KeyError):
    """A name is not among the valid ones."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class ArgumentError(FastSlowError, ValueError):
    """An argument has the wrong value, shape or range."""


class OutOfRangeError(FastSlowError, IndexError):
    """An index of a branch, a row or a special point is out of range."""


class IncompleteWarning(UserWarning):
    """A result may be incomplete, because it is based on a computation that was cut short."""


class FileError(FastSlowError, OSError):
    """A file cannot be written or read: missing, truncated, of another format or newer."""


class MissingPackageError(FastSlowError, ImportError):
    """A package that is required here is not installed."""


#: Maximal length of a text quoted in an error message.
QUOTED = 60


def quoted(text: str) -> str:
    """Quote a text for an error message, truncated if it is long.

    Examples
    --------
    >>> quoted("x +"), quoted("x + " * 100)
    ("'x +'", "'x + x + x + x + x + x + x + x …' (400 characters)")
    """
    if len(text) > QUOTED:
        return f"{quoted(text[: QUOTED // 2] + '…')} ({len(text)} characters)"
    return repr(text) if _encodable(text) else ascii(text)


def _encodable(text: str) -> bool:
    """Return True if a text can be printed: it contains no unpaired surrogate."""
    return text.isascii() or not any("\ud800" <= c <= "\udfff" for c in text)


def unknown_name(kind: str, name: object, valid: Iterable[object]) -> UnknownNameError:
    """Return the error for an invalid name, with the nearest valid one as a suggestion.

    Parameters
    ----------
    kind : str
        The expected kind of name, for instance ``"parameter"``.
    name : object
        The name received; a symbol is identified by its printed form.
    valid : iterable of object
        The accepted names.

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


def refuse_resets(names: Iterable[str], task: str) -> None:
    """Raise ModelError if a model has resets, for a task that does not take them into account.

    Parameters
    ----------
    names : iterable of str
        The resets of the model.
    task : str
        What was to be done, as the subject of a sentence.
    """
    found = ", ".join(names)
    if found:
        raise ModelError(
            f"{task} would ignore the reset of this model ({found}); models with resets are "
            "accepted by simulations and by functions for equilibria and periodic orbits"
        )


def refuse_switches(names: Iterable[str], task: str) -> None:
    """Raise ModelError if a model has switches, as `refuse_resets` for resets."""
    found = list(names)
    if found:
        states = ", ".join(f"{name}=0" for name in found)
        raise ModelError(
            f"{task} would ignore the changes of the switch of this model ({', '.join(found)}); "
            f"give it constant states by model.with_switches({states}). Models with switches are "
            "accepted by simulations and by functions for equilibria and periodic orbits"
        )


def refuse_events(names: Iterable[str], task: str) -> None:
    """Raise ModelError if a model has events, as `refuse_resets` for resets."""
    found = ", ".join(names)
    if found:
        raise ModelError(
            f"{task} would ignore the events of this model ({found}); models with events are "
            "accepted by simulations and by functions for equilibria and periodic orbits. A jump "
            "at a wall to which the motion returns from the same side may be written as a reset, "
            "resets={relation: {state: value}}"
        )


def raised_by_handler(error: BaseException) -> bool:
    """Return True if an exception was raised by a signal handler, not by the code it interrupted.

    Such an exception must propagate through handlers for other exceptions of its class.

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
