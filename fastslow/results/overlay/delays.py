"""What the laws of slow passage predict at special points."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

from fastslow.results.base.result import Result
from fastslow.results.overlay.drifts import Drift
from fastslow.results.points import SpecialPoint


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Delay(Result, ABC):
    """How far past a special point a drifting parameter is when something happens.

    Parameters
    ----------
    point : SpecialPoint
    parameter : str
        The parameter that drifts.
    rate : float
        Its rate where it passes the point, in its unit by time.
    delay : float
        How far past the point, along the drift, in units of the parameter; nan
        where the law has no answer, and ``validity`` says why.
    validity : str
        How good the prediction is, and what it leaves out.
    error : float
        Bound on the difference between ``delay`` and what the model does under this
        drift, in units of the parameter; nan where none can be stated.
    drift : Drift, optional
        How the parameter drifts, where that is more than its rate.
    time : float
        Time from the special point to there; by default at the rate alone.
    """

    point: SpecialPoint
    parameter: str
    rate: float
    delay: float
    validity: str
    error: float = math.nan
    drift: Drift | None = None
    time: float = math.nan

    def __post_init__(self) -> None:
        super().__post_init__()
        if math.isnan(self.time) and (self.drift is None or self.drift.constant):
            object.__setattr__(self, "time", self.delay / abs(self.rate))

    @property
    def value(self) -> float:
        """The parameter there."""
        return self.point[self.parameter] + (self.delay if self.rate > 0 else -self.delay)

    @property
    def bound(self) -> str:
        """The error as it is written after the delay; "" where none is stated."""
        return f" ± {self.error:.2g}" if math.isfinite(self.error) else ""

    @property
    @abstractmethod
    def law(self) -> str:
        """The law in words."""

    def __repr__(self) -> str:
        name = self.parameter
        return (
            f"{type(self).__name__}: {self.law}, {name} at {self.point.label} drifting by "
            f"{self.rate:.3g}\n  delay {self.delay:.6g}{self.bound}, to {name} = "
            f"{self.value:.6g}, in t = {self.time:.6g}\n  {self.validity}"
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FoldDelay(Delay):
    """Delay of the jump at a smooth fold, from y' = a y² + b μ + c y³ + g μ y, μ the parameter.

    delay = α |rate|^(2/3) + β |rate| ln |rate| + γ |rate| with (α, β, γ) = ``coefficients``.

    Parameters
    ----------
    quadratic, slope, cubic, mixed : float
        a, b, c and g of the motion along the null vector of length one.
    feedback : float
        k in μ' = rate + k y + …, from the drift.
    coefficients : tuple of float
        α = Ω₀ |ab|^(−1/3), β = (c/a² − κ)/3 with κ = k/(a rate), and γ, which depends on the
        level (nan without one).
    level : mapping or "turn", optional
        The state and its value at which the jump counts as done, or that the slow quantity
        turns round; without it a jump to infinity of the quadratic normal form.
    """

    quadratic: float
    slope: float
    cubic: float
    mixed: float
    coefficients: tuple[float, float, float]
    feedback: float = 0.0
    level: Mapping[str, float] | str | None = None

    @property
    def leading(self) -> float:
        """The first term alone, α |rate|^(2/3)."""
        return float(self.coefficients[0] * abs(self.rate) ** (2.0 / 3.0))

    @property
    def law(self) -> str:
        return "smooth fold, Ω₀ (rate²/|ab|)^(1/3)"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BoundaryDelay(Delay):
    """Passage of a boundary equilibrium: the lag of persistence, the delay of a non-smooth fold.

    Parameters
    ----------
    lag : float
        How far past the point the interface is crossed, in units of the parameter.
    stable : float
        Largest real part of the eigenvalues before the interface.
    unstable : float
        Largest real part of the eigenvalues behind it.
    level : mapping or "turn", optional
        The state and its value at which the jump counts as done, or that the slow quantity
        turns round.
    """

    lag: float
    stable: float
    unstable: float
    level: Mapping[str, float] | str | None = None

    @property
    def subtype(self) -> str:
        """``"persistence"`` or ``"non-smooth fold"``."""
        return str(self.point.subtype)

    @property
    def law(self) -> str:
        if self.subtype == "persistence":
            return "persistence, a lag of the order of the rate and no delay"
        return "non-smooth fold, of the order of rate ln(1/rate)"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class GapTransit(Delay):
    """Crossing of a region whose equilibria form a continuum, such as the gap of a backlash.

    ``delay`` is that at the far interface, solved for the motion in the region at this
    drift; `asymptotic` is its limit for slow drift, in closed form.

    Parameters
    ----------
    lag : float
        How far past the point the near interface is crossed, in units of the parameter.
    length : float
        Of the continuum, between the interfaces, in the norm of the states.
    slope : float
        b in ξ' = b μ, the drift along the continuum.
    relaxation : float
        τ, the time by which the other motions in the region hold the crossing up.
    interfaces : tuple of str
        The near one and the far one.
    lag_time : float
        Time from the special point to the near interface; by default at the rate alone.
    """

    lag: float
    length: float
    slope: float
    relaxation: float
    interfaces: tuple[str, str]
    lag_time: float = math.nan

    def __post_init__(self) -> None:
        super().__post_init__()
        if math.isnan(self.lag_time) and (self.drift is None or self.drift.constant):
            object.__setattr__(self, "lag_time", self.lag / abs(self.rate))

    @property
    def transit(self) -> float:
        """By how much the parameter changes between the two interfaces."""
        return self.delay - self.lag

    @property
    def transit_time(self) -> float:
        """Time between the two interfaces."""
        return self.time - self.lag_time

    @property
    def asymptotic(self) -> float:
        """The slow limit of the delay, √(2 length |rate/b|) + τ |rate|."""
        speed = abs(self.rate)
        return float((2.0 * self.length * speed / abs(self.slope)) ** 0.5 + self.relaxation * speed)

    @property
    def law(self) -> str:
        return f"gap crossing (slow limit √(2 length |rate/b|) + τ |rate| = {self.asymptotic:.6g})"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class HopfExit(Delay):
    """Delayed loss of stability at a Hopf point: where growth has made up for the decay before.

    Parameters
    ----------
    entry : float
        The parameter where the trajectory comes to its sheet.
    decay : float
        ∫ |Re λ| dp / |rate| from the entry to the Hopf point: the amplitude
        falls to exp(−decay).
    gain : float
        Amplitude at the exit by amplitude at the entry.
    forgotten : bool
        Whether the decay is below what is remembered, so that rounding, noise or the
        tolerance decides the exit.
    buffer : float
        The parameter beyond which the buffer point lets no trajectory stay, where it is
        below the exit that the entry alone would give; else nan.
    """

    entry: float
    decay: float
    gain: float = 1.0
    forgotten: bool = False
    buffer: float = math.nan

    @property
    def law(self) -> str:
        return f"entry at {self.entry:.6g} and exit of a Hopf point, ∫ Re λ = 0"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BranchPointExit(Delay):
    """Delayed loss of stability of an invariant branch: where growth has made up for the decay.

    Parameters
    ----------
    entry : float
        The parameter where the trajectory comes to the branch.
    decay : float
        ∫ |λ| dp / |rate| from the entry to the branch point: the distance from the
        branch falls to exp(−decay).
    gain : float
        Distance at the exit by distance at the entry.
    forgotten : bool
        Whether the decay is below what is remembered, so that rounding, noise or the
        tolerance decides the exit.
    """

    entry: float
    decay: float
    gain: float = 1.0
    forgotten: bool = False

    @property
    def law(self) -> str:
        return f"entry at {self.entry:.6g} and exit of an invariant branch, ∫ λ = 0"
