"""Predicted delays of slow passages through special points."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastslow.arguments import Name, formula, validated
from fastslow.results.base.display import Displayed
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.result import LIVE, Result
from fastslow.results.base.upper_layers import computed
from fastslow.results.overlay.drifts import Drift
from fastslow.results.points import SpecialPoint
from fastslow.results.trajectory.long_time.section import Section
from fastslow.results.trajectory.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PassageEnd(Displayed):
    """Event that ends a passage; without an interface and a state, the extremum of w.

    Parameters
    ----------
    interface : str
        The interface that is crossed.
    state : str
        The state that reaches a level.
    level : float
        The level.
    """

    interface: str = ""
    state: str = ""
    level: float = 0.0

    def __str__(self) -> str:
        return f"{self.interface or self.state} = {self.level:g}"

    def hits(self, run: Trajectory, since: float) -> Section:
        """Return the section of a run; a level is reached after ``since``."""
        if self.interface:
            return run.section(interface=self.interface)
        return run.section(self.state, level=self.level, since=min(since, run.span[1]))


@dataclass(frozen=True)
class DelayTerm(Displayed):
    """Term of a law of delay.

    Parameters
    ----------
    name : str
        E.g. ``"eps^(2/3)"``.
    of : callable
        Its values at an array of rates.
    coefficient : float
        Its coefficient by the law; nan if the law does not give it.
    """

    name: str
    of: Callable[[Array], Array] = field(repr=False)
    coefficient: float


#: Points of the predicted path across a gap.
GAP_PATH_POINTS = 41


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Delay(Result, ABC):
    """Delay of a slow passage: distance of the drifting parameter past a special point.

    Parameters
    ----------
    point : SpecialPoint
    parameter : str
        Name of the drifting parameter.
    rate : float
        Its rate of change at the point, in its unit per time.
    delay : float
        Distance past the point in the direction of the drift, in units of the parameter;
        nan without a prediction, with the reason in ``validity``.
    validity : str
        Accuracy of the prediction and neglected effects.
    error : float
        Bound on the difference between ``delay`` and the delay of the model under this
        drift, in units of the parameter; nan if no bound is available.
    drift : Drift, optional
        Drift of the parameter, unless it is constant.
    delay_time : float
        Time since the passage of the special point; by default ``delay`` / |``rate``|.
    """

    point: SpecialPoint
    parameter: str
    rate: float
    delay: float
    validity: str
    error: float = math.nan
    drift: Drift | None = None
    delay_time: float = math.nan

    quantities: ClassVar[tuple[str, ...]] = ("delay", "value", "delay_time")

    def __post_init__(self) -> None:
        super().__post_init__()
        if math.isnan(self.delay_time) and (self.drift is None or self.drift.constant):
            object.__setattr__(self, "delay_time", self.delay / abs(self.rate))

    @validated(name=formula)
    def gradient(self, name: Name) -> NamedMapping[float]:
        """Compute the derivatives of the prediction with respect to a parameter, at the same drift.

        The special point moves with the parameter along its curve (`SpecialPoint.gradient`), and
        the law is evaluated there: at a fold and a boundary equilibrium by central differences
        extrapolated to zero step (Ridders 1982), for an entry-exit integral by differentiation
        under the integral. A level that ends a jump, and the entry, are kept.

        Parameters
        ----------
        name : str or Symbol
            A parameter of the frozen model other than that of the diagram; ``"rate"`` for
            a constant drift; ``"entry"`` for an entry-exit relation.

        Returns
        -------
        NamedMapping of float
            Of ``delay``, ``value`` and ``delay_time``; of ``lag``, and in a gap crossing of
            ``width`` and ``duration``.

        Raises
        ------
        UnknownNameError
            For another name.
        ArgumentError
            Without a prediction; if rounding or a buffer point determines the exit; for an exit
            predicted along a run, or a delay read from a file; where the law has no derivative.

        References
        ----------
        C. J. F. Ridders, Adv. Eng. Softw. 4, 75-76, 1982.

        Examples
        --------
        >>> import fastslow as fs
        >>> fast = fs.systems.cusp().frozen()
        >>> fold = fs.continue_equilibria(fast, "p", over=(-1, 1)).folds[0]
        >>> law = fs.predict_delay(fold, 1e-3)  # the leading term is of order rate^(2/3)
        >>> bool(abs(law.gradient("rate")["delay"] - 2 / 3 * law.delay / 1e-3) < 1e-9)
        True
        """
        found: NamedMapping[float] = computed(
            "fastslow.passage.delays.predicting", "gradient_of_delay"
        )(self, name)
        return found

    @property
    def value(self) -> float:
        """Value of the parameter after the delay."""
        return self.point[self.parameter] + (self.delay if self.rate > 0 else -self.delay)

    @property
    def bound(self) -> str:
        """The error bound as printed after the delay, or that there is none."""
        if math.isfinite(self.error):
            return f" ± {self.error:.2g}"
        return ", without an error bound" if math.isfinite(self.delay) else ""

    @property
    @abstractmethod
    def law(self) -> str:
        """Short description of the law."""

    @property
    def predicted(self) -> float:
        """The number that is compared with a measured transition: the delay."""
        return self.delay

    @property
    def in_words(self) -> Mapping[str, str]:
        """The predicted quantities of a transition, as printed after the measured ones."""
        return {"delay": f"{self.delay:z.3g}{self.bound}"} if math.isfinite(self.delay) else {}

    @property
    def level(self) -> Mapping[str, float] | str | None:
        """The level that ends the passage, as given; None without one."""
        return None

    @property
    def lost(self) -> str:
        """Why the end is determined by noise and not by the law; empty if it is not."""
        return ""

    @property
    def end(self) -> PassageEnd | None:
        """Event that ends the passage; None if the law names none."""
        return None

    @property
    def terms(self) -> tuple[DelayTerm, ...]:
        """Terms of the law in the rate, which are fitted to measured delays."""
        return ()

    @property
    def exponent(self) -> float:
        """Exponent of the rate in the limit of slow drift; nan if the law is not a power."""
        return math.nan

    @property
    def offset(self) -> float:
        """The power is that of delay − ``offset``·|rate|."""
        return 0.0

    @property
    def path(self) -> tuple[Array, Array] | None:
        """The predicted path in figures: distances past the point, and fractions of the way.

        None for a law that predicts the end alone.
        """
        return None

    def __repr__(self) -> str:
        name = self.parameter
        return (
            f"{type(self).__name__}: {self.law}, {name} at {self.point.label} drifting by "
            f"{self.rate:.3g}\n  delay {self.delay:z.6g}{self.bound}, to {name} = "
            f"{self.value:z.6g}, in t = {self.delay_time:.6g}\n  {self.validity}"
        )


def _end_of_jump(level: Mapping[str, float] | str | None) -> PassageEnd | None:
    """Return the event of a level that ends a jump."""
    if level is None:
        return None
    return PassageEnd() if isinstance(level, str) else PassageEnd("", *next(iter(level.items())))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FoldDelay(Delay):
    """Delay of the jump at a saddle-node, from y' = a y² + b μ + c y³ + g μ y, μ the parameter.

    delay = α |rate|^(2/3) + β |rate| ln |rate| + γ |rate| with (α, β, γ) = ``coefficients``.

    Parameters
    ----------
    quadratic, slope, cubic, mixed : float
        a, b, c and g on the center manifold, with a null vector of unit length.
    feedback : float
        k in μ' = rate + k y + … of the drift.
    coefficients : tuple of float
        α = Ω₀ |ab|^(−1/3), β = (c/a² − κ)/3 with κ = k/(a rate), and γ, which depends on the
        level (nan without a level).
    level : mapping or "turn", optional
        State and value that mark the end of the jump, or the extremum of the slow quantity;
        by default the blow-up of the quadratic normal form.
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
        """Leading term, α |rate|^(2/3)."""
        return float(self.coefficients[0] * abs(self.rate) ** (2.0 / 3.0))

    @property
    def law(self) -> str:
        return "smooth fold, Ω₀ (rate²/|ab|)^(1/3)"

    @property
    def end(self) -> PassageEnd | None:
        return _end_of_jump(self.level)

    @property
    def terms(self) -> tuple[DelayTerm, ...]:
        first, second, third = self.coefficients
        return (
            DelayTerm("eps^(2/3)", lambda eps: eps ** (2.0 / 3.0), first),
            DelayTerm("eps ln eps", lambda eps: eps * np.log(eps), second),
            DelayTerm("eps", np.positive, third),
        )

    @property
    def exponent(self) -> float:
        return 2.0 / 3.0


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BoundaryDelay(Delay):
    """Passage of a boundary equilibrium: lag at persistence, delay at a non-smooth fold.

    Parameters
    ----------
    lag : float
        Distance past the point at which the interface is crossed, in units of the parameter.
    stable : float
        Largest real part of the eigenvalues on the side before the interface.
    unstable : float
        Largest real part of the eigenvalues on the side behind it.
    level : mapping or "turn", optional
        State and value that mark the end of the jump, or the extremum of the slow quantity.
    """

    lag: float
    stable: float
    unstable: float
    level: Mapping[str, float] | str | None = None

    quantities: ClassVar[tuple[str, ...]] = ("delay", "value", "delay_time", "lag")

    @property
    def type(self) -> str:
        """``"persistence"`` or ``"non-smooth fold"``."""
        return str(self.point.type)

    @property
    def law(self) -> str:
        if self.type == "persistence":
            return "persistence, a lag of the order of the rate, no delay"
        return "non-smooth fold, of the order of rate ln(1/rate)"

    @property
    def end(self) -> PassageEnd | None:
        if self.type == "persistence":
            return PassageEnd(str(self.point.interface))
        return _end_of_jump(self.level)

    @property
    def terms(self) -> tuple[DelayTerm, ...]:
        if self.type == "persistence":
            return (DelayTerm("eps", np.positive, self.lag / abs(self.rate)),)
        return (
            DelayTerm("eps ln(1/eps)", lambda eps: -eps * np.log(eps), 1.0 / self.unstable),
            DelayTerm("eps", np.positive, math.nan),
        )

    @property
    def exponent(self) -> float:
        return 1.0 if self.type == "persistence" else math.nan


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class GapCrossing(Delay):
    """Crossing of a region with a continuum of equilibria, such as a backlash gap.

    ``delay`` is measured at the far interface and computed from the motion in the region
    under this drift; `asymptotic` is its closed-form limit for slow drift.

    Parameters
    ----------
    lag : float
        Distance past the point at which the near interface is crossed, in units of the
        parameter.
    length : float
        Length of the continuum between the interfaces, in the norm of the states.
    slope : float
        b in ξ' = b μ, the slow motion along the continuum.
    relaxation : float
        τ, the additional time due to the other modes in the region.
    interfaces : tuple of str
        Near and far interface.
    lag_time : float
        Time from the special point to the near interface; by default ``lag`` / |``rate``|.
    """

    lag: float
    length: float
    slope: float
    relaxation: float
    interfaces: tuple[str, str]
    lag_time: float = math.nan

    quantities: ClassVar[tuple[str, ...]] = (
        *("delay", "value", "delay_time"),
        *("lag", "width", "duration"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if math.isnan(self.lag_time) and (self.drift is None or self.drift.constant):
            object.__setattr__(self, "lag_time", self.lag / abs(self.rate))

    @property
    def width(self) -> float:
        """Change of the parameter between the two interfaces."""
        return self.delay - self.lag

    @property
    def duration(self) -> float:
        """Time from the near to the far interface."""
        return self.delay_time - self.lag_time

    @property
    def asymptotic(self) -> float:
        """Limit of the delay for slow drift, √(2 length |rate/b|) + τ |rate|."""
        speed = abs(self.rate)
        return float((2.0 * self.length * speed / abs(self.slope)) ** 0.5 + self.relaxation * speed)

    @property
    def law(self) -> str:
        return f"gap crossing (slow limit √(2 length |rate/b|) + τ |rate| = {self.asymptotic:.6g})"

    @property
    def predicted(self) -> float:
        """The number that is compared with a measured transition: the width."""
        return self.width

    @property
    def in_words(self) -> Mapping[str, str]:
        bound = "" if math.isfinite(self.error) else self.bound
        return {
            "duration": f"{self.duration:.4g}",
            "width": f"{self.width:.4g}{bound}; slow limit {self.asymptotic:.4g}",
        }

    @property
    def end(self) -> PassageEnd | None:
        return PassageEnd(self.interfaces[1])

    @property
    def terms(self) -> tuple[DelayTerm, ...]:
        first = math.sqrt(2.0 * self.length / abs(self.slope))
        return (
            DelayTerm("eps^(1/2)", np.sqrt, first),
            DelayTerm("eps", np.positive, self.relaxation),
        )

    @property
    def exponent(self) -> float:
        return 0.5

    @property
    def offset(self) -> float:
        return self.relaxation

    @property
    def path(self) -> tuple[Array, Array] | None:
        """The path across the gap.

        The velocity follows b μ with the relaxation time τ, and μ' is the rate: after a time t
        the path has the length b rate (t²/2 − τ t + τ² (1 − exp(−t/τ))). It ends at the predicted
        crossing of the far interface.
        """
        late = self.relaxation * abs(self.rate)
        past = np.linspace(0.0, self.delay, GAP_PATH_POINTS)
        length = 0.5 * past**2
        if late > 0.0:
            length -= late * past + late**2 * np.expm1(-past / late)
        return past, length / length[-1]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EntryExit(Delay):
    """Exit of a slow passage by the entry-exit relation: growth balances the decay before.

    Parameters
    ----------
    entry : float
        Value of the parameter at which the trajectory enters the vicinity of the branch.
    decay : float
        ∫ |Re λ| dp / |rate| from the entry to the point: the distance from the branch decreases
        by the factor exp(−decay).
    gain : float
        Ratio of the distances from the branch at exit and entry.
    forgotten : bool
        Whether this distance falls below rounding, noise or the tolerance of the integration,
        which then determine the exit.
    source : CriticalMode, optional
        The branch with its critical mode; not saved to files.
    """

    entry: float
    decay: float
    gain: float = 1.0
    forgotten: bool = False
    source: Any = field(default=None, repr=False, metadata=LIVE)

    @property
    def lost(self) -> str:
        if not self.forgotten:
            return ""
        return (
            f"the amplitude decreases by exp(−{self.decay:.0f}), below rounding or the tolerance "
            "of the run, which determine the exit"
        )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class HopfExit(EntryExit):
    """Exit point of a slow passage through a Hopf bifurcation (entry-exit function).

    Parameters
    ----------
    buffer : float
        Value of the parameter at the buffer point if it precedes the exit by the
        entry-exit function alone; else nan.
    """

    buffer: float = math.nan

    @property
    def law(self) -> str:
        return f"Hopf, entry at {self.entry:z.6g} and exit by ∫ Re λ = 0"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BranchPointExit(EntryExit):
    """Exit point of a slow passage along an invariant branch (entry-exit function)."""

    @property
    def law(self) -> str:
        return f"invariant branch, entry at {self.entry:z.6g} and exit by ∫ λ = 0"
