"""Drift of the slow quantity through a special point."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fastslow.arguments import finite, flag, mapping, text
from fastslow.errors import ArgumentError
from fastslow.results.base.immutable import Immutable


@dataclass(frozen=True, eq=False, repr=False)
class Drift(Immutable):
    """Rate of change of the slow quantity w near a special point (x*, w*), passed at t = 0.

    w' = rate + change·t + by_value·(w − w*) + Σ by_state[x]·(x − x*).

    Parameters
    ----------
    rate : float
        w' at the point, finite and not zero; its sign is the direction of the drift.
    change : float
        Rate of change of w' in time, such as the second derivative of a forcing.
    by_value : float
        ∂w'/∂w.
    by_state : mapping
        Fast state (symbol or name) to ∂w'/∂x: the feedback of a slow state.
    law : str
        w' as a formula in the fast states, w and t, if it is nonlinear; the other
        arguments are then its linearisation.
    complete : bool
        False if only the rate is known, as for a run read from a file; predictions then
        have no error bound.

    Raises
    ------
    ArgumentError
        For a rate of zero, or a number that is not finite.

    Examples
    --------
    >>> Drift(0.01)
    Drift(w' = 0.01)
    >>> Drift(0.01, change=-2e-4, by_state={"x": -0.01})
    Drift(w' = 0.01 − 0.0002 t − 0.01 (x − x*))
    >>> Drift(0.01).constant
    True
    """

    rate: float
    change: float = 0.0
    by_value: float = 0.0
    by_state: Mapping[str, float] = field(default_factory=dict)
    law: str = ""
    complete: bool = True

    def __post_init__(self) -> None:
        expected = "a finite rate of drift other than zero"
        by_state = {
            str(name): finite(f"by_state[{str(name)!r}]", value)
            for name, value in mapping("by_state", self.by_state).items()
        }
        values: dict[str, Any] = {
            "rate": finite("rate", self.rate, expected),
            "change": finite("change", self.change),
            "by_value": finite("by_value", self.by_value),
            "by_state": {name: value for name, value in by_state.items() if value != 0.0},
            "law": text("law", self.law),
            "complete": flag("complete", self.complete),
        }
        if values["rate"] == 0.0:
            raise ArgumentError(f"rate = {self.rate!r}; expected {expected}")
        for name, value in values.items():
            object.__setattr__(self, name, value)
        super().__post_init__()

    @property
    def constant(self) -> bool:
        """Whether w' is constant."""
        return not (self.change or self.by_value or self.by_state or self.law)

    @property
    def way(self) -> float:
        """Direction of the drift, +1 for increasing w."""
        return math.copysign(1.0, self.rate)

    def __repr__(self) -> str:
        words = f"Drift(w' = {self.rate:.6g}"
        terms = [(self.change, "t"), (self.by_value, "(w − w*)")]
        terms += [(value, f"({name} − {name}*)") for name, value in self.by_state.items()]
        for value, of in terms:
            if value:
                words += f" {'−' if value < 0 else '+'} {abs(value):.6g} {of}"
        if self.law:
            words += f", linearised from {self.law}"
        return words + ("" if self.complete else ", the rest unknown") + ")"
