"""Settings of an integration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from fastslow.arguments import (
    Check,
    flag,
    instance,
    items,
    real_number,
    refusal,
    settings,
    tolerance,
    whole,
)
from fastslow.errors import ArgumentError, unknown_name
from fastslow.results.base.named_mapping import NamedMapping

#: Default limits of steps and of crossings.
MOST = 1_000_000


@settings
@dataclass(frozen=True, kw_only=True)
class Integration:
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
        Order of the Taylor series, 4 to 40, by default from the tolerance; at most 12 for
        collocation.
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
    max_steps: int = MOST
    max_crossings: int = MOST

    def __post_init__(self) -> None:
        for name, check in _CHECKS.items():
            value = getattr(self, name)
            if value is not None or name not in _OPTIONAL:
                object.__setattr__(self, name, check(name, value))

    @property
    def default_order(self) -> int:
        """Order of the series for the tolerance, one of two to limit compilation."""
        return 16 if self.rtol >= 1e-11 else 24


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
    return Resolved(
        rtol=integration.rtol,
        atol=_by_state(integration.atol, (*model.states, *model.slow_states)),
        order=integration.default_order if order is None else order,
        implicit=implicit if integration.implicit is None else integration.implicit,
        max_steps=integration.max_steps,
        max_crossings=integration.max_crossings,
    )


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


_CHECKS: dict[str, Check] = {
    "rtol": tolerance,
    "atol": _absolute,
    "order": whole(4, 40),
    "implicit": flag,
    "max_steps": whole(1, 2**40),
    "max_crossings": whole(1, 2**40),
}
_OPTIONAL = ("atol", "order", "implicit")

#: What is used where nothing is given.
DEFAULT = Integration()

#: The check of ``integration=``.
integration_settings = instance(Integration)
