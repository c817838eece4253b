"""Settings of an integration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from fastslow.arguments import Check, flag, instance, tolerance, whole

#: Where a run ends that nothing else ends.
MOST = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Integration:
    """How a trajectory is integrated: error control, method and limits.

    Parameters
    ----------
    rtol : float
        Error allowed in a step, relative to 1 + |y| for every state y.
    order : int, optional
        Order of the series, 4 to 40, by default chosen by the tolerance; of
        collocation polynomials 12 at most.
    implicit : bool, optional
        Whether an implicit method may take long steps through settled phases, in
        which stability and not accuracy limits the series; by default in a single
        run, but not in an ensemble. They forget what is smaller than ``rtol``: where
        a slow passage through a Hopf point decays below it, its exit depends on
        ``rtol``, with them or without. Plain steps of an ensemble, taken together,
        are so cheap that implicit ones pay only where the fast motion is some thirty
        times faster than the slow one lets the steps be, as in stiff contacts.
    max_steps, max_crossings : int
        Where to stop a trajectory.

    Raises
    ------
    ArgumentError
        For a value outside the range that is named here.

    Examples
    --------
    >>> Integration(rtol=1e-12).default_order
    24
    """

    rtol: float = 1e-9
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
        """Order of the series for the tolerance, one of two so that little is compiled."""
        return 16 if self.rtol >= 1e-11 else 24

    @property
    def limits(self) -> tuple[int, int]:
        """Largest numbers of steps and of crossings."""
        return self.max_steps, self.max_crossings


@dataclass(frozen=True, kw_only=True)
class Resolved(Integration):
    """An `Integration` of which nothing is left open."""

    order: int
    implicit: bool

    def recorded(self) -> Mapping[str, Any]:
        """What a result keeps as its ``settings``."""
        return asdict(self)


def resolve(integration: Integration, *, implicit: bool) -> Resolved:
    """The settings with nothing left open.

    Parameters
    ----------
    integration : Integration
    implicit : bool
        Whether implicit steps are taken by default.
    """
    order = integration.order
    return Resolved(
        rtol=integration.rtol,
        order=integration.default_order if order is None else order,
        implicit=implicit if integration.implicit is None else integration.implicit,
        max_steps=integration.max_steps,
        max_crossings=integration.max_crossings,
    )


_CHECKS: dict[str, Check] = {
    "rtol": tolerance,
    "order": whole(4, 40),
    "implicit": flag,
    "max_steps": whole(1, 2**40),
    "max_crossings": whole(1, 2**40),
}
_OPTIONAL = ("order", "implicit")

#: What is used where nothing is given.
DEFAULT = Integration()

#: The check of ``integration=``.
integration_settings = instance(Integration)
