"""Predicted delays of slow passages through special points."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fastslow.arguments import Name, formula, validated
from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.result import LIVE, Result
from fastslow.results.base.upper_layers import computed
from fastslow.results.overlay.drifts import Drift
from fastslow.results.points import SpecialPoint


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

    def __post_init__(self) -> None:
        super().__post_init__()
        if math.isnan(self.delay_time) and (self.drift is None or self.drift.constant):
            object.__setattr__(self, "delay_time", self.delay / abs(self.rate))

    @validated(name=formula)
    def gradient(self, name: Name) -> NamedMapping[float]:
        """Compute the derivatives of the prediction by a parameter, at the same drift.

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
            "fastslow.passage.delays.delay_gradients", "gradient_of_delay"
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

    def __repr__(self) -> str:
        name = self.parameter
        return (
            f"{type(self).__name__}: {self.law}, {name} at {self.point.label} drifting by "
            f"{self.rate:.3g}\n  delay {self.delay:z.6g}{self.bound}, to {name} = "
            f"{self.value:z.6g}, in t = {self.delay_time:.6g}\n  {self.validity}"
        )


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

    @property
    def type(self) -> str:
        """``"persistence"`` or ``"non-smooth fold"``."""
        return str(self.point.type)

    @property
    def law(self) -> str:
        if self.type == "persistence":
            return "persistence, a lag of the order of the rate, no delay"
        return "non-smooth fold, of the order of rate ln(1/rate)"


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


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class HopfExit(Delay):
    """Exit point of a slow passage through a Hopf bifurcation (entry-exit function).

    Parameters
    ----------
    entry : float
        Value of the parameter at which the trajectory enters the vicinity of the branch.
    decay : float
        ∫ |Re λ| dp / |rate| from the entry to the Hopf point: the amplitude
        decreases by the factor exp(−decay).
    gain : float
        Ratio of the amplitudes at exit and entry.
    forgotten : bool
        Whether the amplitude falls below rounding, noise or the tolerance of the
        integration, which then determine the exit.
    buffer : float
        Value of the parameter at the buffer point if it precedes the exit by the
        entry-exit function alone; else nan.
    source : CriticalMode, optional
        The branch with its critical mode; not saved to files.
    """

    entry: float
    decay: float
    gain: float = 1.0
    forgotten: bool = False
    buffer: float = math.nan
    source: Any = field(default=None, repr=False, metadata=LIVE)

    @property
    def law(self) -> str:
        return f"Hopf, entry at {self.entry:z.6g} and exit by ∫ Re λ = 0"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BranchPointExit(Delay):
    """Exit point of a slow passage along an invariant branch (entry-exit function).

    Parameters
    ----------
    entry : float
        Value of the parameter at which the trajectory enters the vicinity of the branch.
    decay : float
        ∫ |λ| dp / |rate| from the entry to the branch point: the distance from the
        branch decreases by the factor exp(−decay).
    gain : float
        Ratio of the distances from the branch at exit and entry.
    forgotten : bool
        Whether the amplitude falls below rounding, noise or the tolerance of the
        integration, which then determine the exit.
    source : CriticalMode, optional
        The branch with its critical mode; not saved to files.
    """

    entry: float
    decay: float
    gain: float = 1.0
    forgotten: bool = False
    source: Any = field(default=None, repr=False, metadata=LIVE)

    @property
    def law(self) -> str:
        return f"invariant branch, entry at {self.entry:z.6g} and exit by ∫ λ = 0"
