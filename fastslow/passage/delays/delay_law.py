"""A law of delay: the prediction at a kind of special point, and what is derived from it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple, cast

from fastslow.arguments import Name
from fastslow.errors import ArgumentError
from fastslow.model.model import Model
from fastslow.passage.delays.critical_modes import CriticalMode
from fastslow.passage.delays.delay_gradients import gradient_by_differences
from fastslow.passage.delays.exit_gradients import gradient_of_exit
from fastslow.passage.delays.local_field import LocalField
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.branch.diagram import Diagram
from fastslow.results.overlay.delays import Delay, EntryExit
from fastslow.results.overlay.drifts import Drift
from fastslow.results.points import SpecialPoint

#: Number of relaxation times after which initial transients are negligible.
FORGOTTEN = 40.0


class InvariantMode(NamedTuple):
    """Critical mode of a branch that the drift does not leave.

    Parameters
    ----------
    mode : CriticalMode
    reason : str
        Reason for the invariance.
    memory : float
        Decay exponent up to which the exit depends on the entry.
    """

    mode: CriticalMode
    reason: str
    memory: float


class DelayLaw(ABC):
    """Law of the delay past the special points whose type names it.

    The module of a law in `fastslow.passage.delays.laws` contains its one instance, ``LAW``. The
    prediction is a `Delay`, whose class contains what follows from its numbers alone: the event
    that ends the passage, the terms in the rate, and the words.
    """

    #: The name in `PointType.law`.
    name: ClassVar[str]

    #: Types of transition in overlays whose delay the law predicts.
    transitions: ClassVar[tuple[str, ...]] = ("jump", "crossing", "gap crossing")

    @property
    def entry_exit(self) -> EntryExitLaw | None:
        """The law itself, if the exit depends on the entry to the branch; else None."""
        return None

    def applies(self, point: SpecialPoint) -> bool:
        """Whether it is the law of a point, of those whose type names it."""
        return True

    @abstractmethod
    def predict(
        self,
        point: SpecialPoint,
        rate: float | Drift,
        *,
        level: Mapping[Any, float] | str | None = None,
        parameter: Name | None = None,
        model: Model | None = None,
        diagram: Diagram | None = None,
        entry: float | None = None,
        gain: float = 1.0,
    ) -> Delay:
        """Predict a delay; see `fastslow.predict_delay`."""

    @abstractmethod
    def gradient(self, delay: Delay, name: str) -> NamedMapping[float]:
        """Differentiate a prediction of this law; see `Delay.gradient`."""

    @abstractmethod
    def settling_distance(self, local: LocalField, delay: Delay) -> float:
        """Distance before the point over which initial transients decay."""


class LocalLaw(DelayLaw):
    """Law that follows from the vector field near the point, such as the law of a fold."""

    @abstractmethod
    def at_point(
        self,
        point: SpecialPoint,
        rate: float | Drift,
        *,
        level: Mapping[Any, float] | str | None,
        parameter: Name | None,
        model: Model | None,
    ) -> Delay:
        """Predict a delay from the point, the drift and the level that ends the passage."""

    def predict(
        self,
        point: SpecialPoint,
        rate: float | Drift,
        *,
        level: Mapping[Any, float] | str | None = None,
        parameter: Name | None = None,
        model: Model | None = None,
        diagram: Diagram | None = None,
        entry: float | None = None,
        gain: float = 1.0,
    ) -> Delay:
        if not (diagram is None and entry is None):
            raise ArgumentError(
                "diagram= and entry= go with a Hopf (HB) or branch point (BP); the delay past "
                f"{point.label} does not depend on the entry"
            )
        return self.at_point(point, rate, level=level, parameter=parameter, model=model)

    def gradient(self, delay: Delay, name: str) -> NamedMapping[float]:
        def law(point: SpecialPoint, rate: float | Drift) -> Delay:
            return self.at_point(
                point, rate, level=delay.level, parameter=delay.parameter, model=None
            )

        return gradient_by_differences(delay, name, law)


class EntryExitLaw(DelayLaw):
    """Law by which the integral of the critical eigenvalue from entry to exit is zero."""

    #: Class of its predictions.
    result: ClassVar[type[EntryExit]]

    transitions: ClassVar[tuple[str, ...]] = ()

    @property
    def entry_exit(self) -> EntryExitLaw | None:
        return self

    @abstractmethod
    def exit_of(
        self,
        diagram: Diagram,
        point: SpecialPoint,
        entry: float,
        rate: float,
        *,
        gain: float,
        model: Model | None,
    ) -> EntryExit:
        """Predict the exit for a constant drift."""

    @abstractmethod
    def mode(
        self, diagram: Diagram, point: SpecialPoint, way: int, *, alone: bool
    ) -> InvariantMode:
        """Critical mode of the branch through a point.

        Parameters
        ----------
        diagram : Diagram
        point : SpecialPoint
        way : int
            Direction of the drift.
        alone : bool
            Whether no other quantity varies in the rates.
        """

    def with_buffer(self, mode: CriticalMode, delay: EntryExit, *, constant: bool) -> EntryExit:
        """Bound an exit along a run by a buffer point, for a constant drift, where there is one."""
        return delay

    def predict(
        self,
        point: SpecialPoint,
        rate: float | Drift,
        *,
        level: Mapping[Any, float] | str | None = None,
        parameter: Name | None = None,
        model: Model | None = None,
        diagram: Diagram | None = None,
        entry: float | None = None,
        gain: float = 1.0,
    ) -> Delay:
        if diagram is None or entry is None:
            raise ArgumentError(
                f"the exit past {point.label}, a {point.kind.name}, depends on the entry to "
                "the branch; give diagram= and entry="
            )
        if level is not None:
            raise ArgumentError(
                f"level= goes with a fold (LP) or boundary equilibrium (BE), not {point.label}; "
                "the distance at the exit is gain="
            )
        speed = rate.rate if isinstance(rate, Drift) else rate
        found = self.exit_of(diagram, point, entry, speed, gain=gain, model=model)
        if not isinstance(rate, Drift) or rate.constant:
            return found
        words = "; with the rate at the point, the change of the drift is neglected: no error bound"
        return replace(found, error=math.nan, validity=found.validity + words)

    def gradient(self, delay: Delay, name: str) -> NamedMapping[float]:
        return gradient_of_exit(cast("EntryExit", delay), name)

    def settling_distance(self, local: LocalField, delay: Delay) -> float:
        """Return 0: the decay before the point is what the exit depends on."""
        return 0.0
