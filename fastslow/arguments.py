"""Validation of arguments: one check for each kind, and the decorator that applies them."""

from __future__ import annotations

import difflib
import inspect
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from functools import wraps
from types import FunctionType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from fastslow.errors import QUOTED, ArgumentError, OutOfRangeError, quoted, unknown_name

if TYPE_CHECKING:
    import sympy as sp

P = ParamSpec("P")
R = TypeVar("R")

#: A state, parameter or other quantity by its name.
Name: TypeAlias = "str | sp.Symbol"

#: A quantity as text or in SymPy.
Expression: TypeAlias = "str | sp.Expr"

#: A condition as text or in SymPy.
Condition: TypeAlias = "str | sp.Basic"

#: A state in the order of a model, or by name.
StateLike: TypeAlias = "Sequence[float] | NDArray[np.float64] | Mapping[Any, float]"

#: Maps the name of an argument and the value received to the validated value.
Check = Callable[[str, Any], Any]

#: Kinds of parameters that may be passed by position.
_POSITIONAL = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)

#: Kinds of arrays with real numbers; object arrays ("O") are converted if possible.
_REAL = "iufO"


def validated(**checks: Check) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Validate the arguments of a function at the call.

    None is accepted where it is the default. Masked values are refused in every argument, with or
    without a check.

    Parameters
    ----------
    **checks : callable
        The check of each argument by name; that of ``*args`` is applied to each of them,
        that of ``**kwargs`` to all of them as one mapping.

    Examples
    --------
    >>> @validated(eps=positive)
    ... def step(eps=None):
    ...     return eps
    >>> step(eps=-1)
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: eps = -1; expected a positive number
    >>> step(2), step()
    (2.0, None)
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        parameters = inspect.signature(function).parameters
        unknown = checks.keys() - parameters.keys()
        assert not unknown, f"{function.__qualname__} has no argument {unknown}"
        names = tuple(parameters)
        optional = {name for name in checks if parameters[name].default is None}
        kinds = {parameters[n].kind: n for n in checks}
        listed = kinds.get(inspect.Parameter.VAR_POSITIONAL)
        extra = kinds.get(inspect.Parameter.VAR_KEYWORD)
        places = [n for n in names if parameters[n].kind in _POSITIONAL]
        open_ended = any(p.kind is inspect.Parameter.VAR_POSITIONAL for p in parameters.values())

        without_name, called = _without_name, _called
        # names that are not globals of the function must be in the closure
        refuse, unmasked = raise_signature_error, refuse_masked

        def checked(*args: Any, **kwargs: Any) -> Any:
            if len(args) > len(places) and not open_ended:
                raise without_name(called(function, args), parameters, args, args[len(places)])
            given = list(args)
            for k, value in enumerate(given):
                name = names[k] if listed is None and k < len(names) else listed
                unmasked(name or "argument", value)
                if name in checks and not (value is None and name in optional):
                    given[k] = checks[name](name, value)
            for name, value in kwargs.items():
                unmasked(name, value)
            for name in kwargs.keys() & checks.keys():
                if not (kwargs[name] is None and name in optional):
                    kwargs[name] = checks[name](name, kwargs[name])
            if extra is not None:
                rest = {n: v for n, v in kwargs.items() if n not in names}
                kwargs |= checks[extra](extra, rest)
            try:
                return function(*given, **kwargs)
            except TypeError:
                refuse(function, given, kwargs)
                raise

        return like(function, checked)

    return decorate


def settings(**checks: Check) -> Callable[[type[R]], type[R]]:
    """Class decorator: validate the fields of a dataclass as the arguments of a function."""

    def decorate(cls: type[R]) -> type[R]:
        cls.__init__ = validated(**checks)(cls.__init__)  # type: ignore[method-assign]
        return cls

    return decorate


def _called(function: Callable[..., Any], args: Sequence[Any]) -> str:
    """Return the name under which a function is called: that of the class for ``__init__``."""
    name = function.__name__
    return type(args[0]).__name__ if name == "__init__" and args else name


def _without_name(
    function: str, parameters: Mapping[str, inspect.Parameter], args: tuple[Any, ...], value: Any
) -> ArgumentError:
    """Return the error for a positional value that must be passed by keyword."""
    if any(p.kind is inspect.Parameter.VAR_KEYWORD for p in parameters.values()):
        owner = args[0] if "self" in parameters else None
        name = getattr(owner, "parameter", "t" if owner is not None else "name")
        wanted = f"its name, such as {function}({name}={shown(value)})"
    else:
        named = [n for n, p in parameters.items() if p.kind is inspect.Parameter.KEYWORD_ONLY]
        wanted = " or ".join(f"{n}=" for n in named) if named else "fewer arguments"
        wanted = f"{wanted} before it" if named else wanted
    return ArgumentError(f"{function} received {shown(value)} without a name; expected {wanted}")


def like(function: Callable[P, R], wrapper: Callable[..., Any]) -> Callable[P, R]:
    """Return a wrapper with the metadata of its function; its names must be in its closure."""
    # the function's own globals, by which doctest finds the module of an example
    own = FunctionType(
        wrapper.__code__, function.__globals__, function.__name__, None, wrapper.__closure__
    )
    return wraps(function)(own)


def raise_signature_error(function: Callable[..., Any], args: Sequence[Any], kwargs: Any) -> None:
    """Raise TypeError for arguments that do not match a signature.

    Python names the class that defines a method; this message names the class of the object.
    """
    signature = inspect.signature(function)
    try:
        signature.bind(*args, **kwargs)
    except TypeError as error:
        names = list(signature.parameters)
        call = function.__name__
        if names[:1] in (["self"], ["cls"]) and args:
            names, owner = names[1:], args[0]
            owner = owner if isinstance(owner, type) else type(owner)
            call = owner.__name__ if call == "__init__" else f"{owner.__name__}.{call}"
        unknown = next((n for n in kwargs if n not in names), None)
        near = difflib.get_close_matches(unknown or "", names, 1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        accepted = f"its arguments are {', '.join(names)}" if names else "it takes no argument"
        raise TypeError(f"{call}() {error}{hint or f'; {accepted}'}") from None


def shown(value: object) -> str:
    """Describe a received value in an error message: short values literally, others by class.

    Examples
    --------
    >>> shown("omga"), shown(np.zeros((40, 3)))
    ("'omga'", 'an ndarray of shape (40, 3)')
    """
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"an ndarray of shape {value.shape}"
    if isinstance(value, str):
        return quoted(value)
    text = repr(value)
    return class_of(value) if len(text) > QUOTED or "\n" in text else text


def class_of(value: object) -> str:
    """Return the class name of a value with its article, for error messages.

    Examples
    --------
    >>> class_of(1.5), class_of(3)
    ('a float', 'an int')
    """
    return with_article(type(value).__name__)


def with_article(noun: str) -> str:
    """Return a noun with its indefinite article."""
    return f"an {noun}" if noun[:1].lower() in "aeio" or noun == "ndarray" else f"a {noun}"


def refusal(name: str, value: object, expected: str) -> ArgumentError:
    """Return the error for an invalid argument."""
    return ArgumentError(f"{name} = {shown(value)}; expected {expected}")


#: Largest depth of containers in an argument, these, and what is in them without a mask.
_DEPTH = 4
_CONTAINERS, _UNMASKED = (list, tuple, dict), (float, int, str)


def refuse_masked(name: str, value: Any, depth: int = _DEPTH) -> None:
    """Raise ArgumentError for masked values, which NumPy would replace by what is under the mask.

    Examples
    --------
    >>> refuse_masked("values", {"load": np.ma.masked_array([1.0, 2.0], [False, True])})
    Traceback (most recent call last):
    ...
    fastslow.errors.ArgumentError: values: 1 of 2 values of an array is masked; expected an array \
without a mask: leave these values out, or fill them
    """
    if isinstance(value, _CONTAINERS):
        for item in value.values() if isinstance(value, dict) else value:
            if not isinstance(item, _UNMASKED) and depth:
                refuse_masked(name, item, depth - 1)
    elif isinstance(value, np.ma.MaskedArray) and (count := int(np.ma.count_masked(value))):
        verb = "are" if count > 1 else "is"
        raise ArgumentError(
            f"{name}: {count} of {value.size} values of an array {verb} masked; expected an "
            "array without a mask: leave these values out, or fill them"
        )


def real_number(value: object) -> float | None:
    """Return a real number as a float, None for anything else: text, a bool, an array.

    Examples
    --------
    >>> real_number(np.float32(0.5)), real_number("0.5"), real_number(True), real_number(1j)
    (0.5, None, None, None)
    """
    if isinstance(value, bool | np.bool_ | str | bytes | bytearray | complex | np.complexfloating):
        return None
    if (
        getattr(value, "ndim", 0)
        or getattr(getattr(value, "dtype", None), "kind", "f") not in _REAL
    ):
        return None
    try:
        return float(value)  # type: ignore[arg-type]
    except OverflowError:
        return math.inf
    except (TypeError, ValueError):
        return None


def finite(name: str, value: Any, expected: str = "a finite number") -> float:
    """Accept a finite number."""
    result = real_number(value)
    if result is None or not math.isfinite(result):
        raise refusal(name, value, expected)
    return result


def within(low: float, high: float) -> Check:
    """Accept a number in a closed interval."""

    def check(name: str, value: Any) -> float:
        expected = f"a number from {low:g} to {high:g}"
        result = finite(name, value, expected)
        if not low <= result <= high:
            raise refusal(name, value, expected)
        return result

    return check


def positive(name: str, value: Any) -> float:
    """Accept a positive finite number."""
    result = finite(name, value, "a positive number")
    if result <= 0:
        raise refusal(name, value, "a positive number")
    return result


def whole(least: int, most: int = 2**62) -> Check:
    """Accept an integer within bounds."""

    def check(name: str, value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int | np.integer):
            raise refusal(name, value, "an integer")
        if value < least or value > most:
            # a large bound, which only limits memory and time, is named when it is exceeded
            upper = f" to {most}" if value > most or most <= 1000 else ""
            raise refusal(name, value, f"an integer from {least}{upper}")
        return int(value)

    return check


def tolerance(name: str, value: Any) -> float:
    """Accept an error tolerance, from rounding to 0.1."""
    result = positive(name, value)
    if not 1e-16 <= result <= 0.1:
        raise refusal(name, value, "a number from 1e-16 to 0.1")
    return result


def among(*values: Any) -> Check:
    """Accept one of the given integers, or None if it is given."""
    expected = ", ".join(map(repr, values[:-1])) + f" or {values[-1]!r}"

    def check(name: str, value: Any) -> Any:
        known = value is None or type(value) is int or isinstance(value, np.integer)
        if not known or value not in values:
            raise refusal(name, value, expected)
        return value

    return check


def flag(name: str, value: Any) -> bool:
    """Accept a bool."""
    if not isinstance(value, bool | np.bool_):
        raise refusal(name, value, "True or False")
    return bool(value)


def text(name: str, value: Any) -> str:
    """Accept a string."""
    if not isinstance(value, str):
        raise refusal(name, value, "text")
    return value


def formula(name: str, value: Any) -> Any:
    """Accept a name or an expression, as text or as a SymPy object."""
    if not isinstance(value, str) and not hasattr(value, "free_symbols"):
        raise refusal(name, value, "a name or an expression, as text or in SymPy")
    return value


def word(kind: str, valid: Iterable[str]) -> Check:
    """Accept one of the given strings."""
    known = tuple(valid)

    def check(name: str, value: Any) -> str:
        if not isinstance(value, str) or value not in known:
            raise unknown_name(kind, value if isinstance(value, str) else shown(value), known)
        return value

    return check


#: Largest modulus of the ends of a range: products of several lengths must not overflow.
LARGEST_BOUND = 1e100


def interval(name: str, value: Any) -> tuple[float, float]:
    """Accept two finite numbers, the lower one first."""
    expected = "two finite numbers, the lower one first"
    try:
        if isinstance(value, str | bytes | Set | Mapping):
            raise TypeError
        low, high = (real_number(end) for end in value)
    except (TypeError, ValueError):
        raise refusal(name, value, expected) from None
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        raise refusal(name, value, expected)
    if low >= high:
        hint = f"; did you mean ({high:g}, {low:g})?" if low > high else ""
        raise refusal(name, value, expected + hint)
    if max(abs(low), abs(high)) > LARGEST_BOUND:
        raise refusal(name, value, f"two numbers of at most {LARGEST_BOUND:g} in size")
    return low, high


def position(key: Any, count: int, what: str) -> int:
    """Return the index of an item in a sequence; a negative one counts from the end.

    Raises
    ------
    OutOfRangeError
        For an index out of range.
    """
    place = int(key)
    if not -count <= place < count:
        there = f"the last of {count} is {count - 1}" if count else "there is none"
        raise OutOfRangeError(f"no {what} {shown(place)}; {there}")
    return place % count


#: Types that NumPy converts to numbers, but that are not accepted as such.
_NO_NUMBER = (bool, str, bytes)


def numbers(name: str, value: Any) -> NDArray[np.float64]:
    """Accept an array of real numbers of any shape; they need not be finite."""
    refuse_masked(name, value)
    try:
        raw = np.asarray(value)
        kind = raw.dtype.kind
        if kind not in _REAL or (kind == "O" and any(isinstance(n, _NO_NUMBER) for n in raw.flat)):
            raise TypeError
        return np.array(raw, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(f"{name}: expected numbers, received {shown(value)}") from None


def finite_numbers(name: str, value: Any) -> NDArray[np.float64]:
    """Accept an array of finite numbers of any shape."""
    values = numbers(name, value)
    if not np.isfinite(values).all():
        raise refusal(name, value, "finite numbers")
    return values


def mapping(name: str, value: Any) -> Any:
    """Accept a mapping, such as a dict."""
    if not isinstance(value, Mapping):
        raise refusal(name, value, "a mapping, such as {name: value}")
    return value


def function(name: str, value: Any) -> Any:
    """Accept a callable."""
    if not callable(value):
        raise refusal(name, value, "a function")
    return value


def path(name: str, value: Any) -> Any:
    """Accept the path of a file."""
    plain = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(plain, str) or not plain or "\0" in plain:
        raise refusal(name, value, "the path of a file")
    return value


def instance(*kinds: type) -> Check:
    """Accept an instance of one of the given classes."""
    names = " or ".join(kind.__name__ for kind in kinds)

    def check(name: str, value: Any) -> Any:
        if not isinstance(value, kinds):
            received = shown(value) if value is None else class_of(value)
            reason = getattr(value, "not_enough", "")
            raise ArgumentError(
                f"{name}: expected {with_article(names)}, received {received}"
                + (f": {reason}" if isinstance(reason, str) and reason else "")
            )
        return value

    return check


def items(check: Check | None = None) -> Check:
    """Accept a sequence, whose items pass a check if one is given."""

    def checked(name: str, value: Any) -> tuple[Any, ...]:
        if isinstance(value, str | bytes | Set | Mapping) or not isinstance(value, Iterable):
            raise refusal(name, value, "a sequence")
        try:
            found = tuple(value)
        except TypeError:
            # a zero-dimensional array is Iterable but cannot be iterated over
            raise refusal(name, value, "a sequence") from None
        if check is None:
            return found
        return tuple(check(f"{name}[{k}]", item) for k, item in enumerate(found))

    return checked


def either(*checks: Check) -> Check:
    """Accept a value that passes one of several checks; else raise the error of the last."""

    def checked(name: str, value: Any) -> Any:
        for check in checks[:-1]:
            try:
                return check(name, value)
            except ArgumentError:
                continue
        return checks[-1](name, value)

    return checked
