"""Pseudo-arclength continuation of a curve G(z) = 0 with difference quotients of G.

Used for curves of special points, whose equations already contain derivatives. Their
tables are short, so that plain NumPy suffices. The first entries of z are the point
(states, two parameters), followed by null vectors and the like.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from fastslow.continuation.location import newton
from fastslow.continuation.settings import Continuation
from fastslow.results.branch.windows import ON_EDGE

Array = NDArray[np.float64]

#: Angle in radians between the tangents of consecutive points beyond which the curvature may grow
#: by a factor alone: at a branch point the other curve has another tangent.
KINK_ANGLE, BENT = 0.02, 3.0

#: Step, in units of the last one, up to which a cubic is extrapolated.
LONGEST_EXTRAPOLATION = 2.0

#: Kinds of end of a trace.
FULL, RANGE, SMALL_STEP, WINDOW, CLOSED, STOPPED, BOUND = (
    "full",
    "range",
    "small step",
    "window",
    "closed",
    "stopped",
    "bound",
)


class System(ABC):
    """N equations G(z) = 0 in N + 1 unknowns, which include vectors of free length.

    A guide is a reference point z of the curve that normalises the vectors of others.
    """

    @property
    def tested(self) -> int | None:
        """Number of leading unknowns on which the tests along a curve depend, None for all."""
        return None

    @abstractmethod
    def residual(self, z: Array, guide: Array) -> Array:
        """G at points z of shape (…, N + 1), shape (…, N)."""

    def renewed(self, z: Array) -> Array:
        """The same point with unit vectors, usable as a guide."""
        return z


@dataclass(frozen=True, eq=False)
class Frame:
    """Domain and units of the continuation of a curve.

    Parameters
    ----------
    size : int
        Leading entries of z in which arclength is measured.
    scale : ndarray, shape (N + 1,)
        Unit of every entry.
    lower, upper : ndarray, shape (size,)
        Range of every leading entry, infinite if unbounded.
    """

    size: int
    scale: Array
    lower: Array
    upper: Array

    @cached_property
    def weight(self) -> Array:
        weight = np.zeros(len(self.scale))
        weight[: self.size] = self.scale[: self.size] ** -2.0
        return weight

    def stretch(self, z: Array, along: Array) -> float:
        """Growth factor of the step for states larger than their unit.

        A step is then a fixed relative change of a large state, so that a curve that
        diverges has equally many rows in every decade.
        """
        size = self.scale[: self.size].copy()
        states = self.size - 2
        size[:states] = np.maximum(size[:states], np.abs(z[:states]))
        part = along[: self.size] / size
        return float(1.0 / np.sqrt(part @ part))

    def passed(self, z: Array) -> NDArray[np.bool_]:
        """Masks of the bounds that a point violates, shape (2, size): lower and upper."""
        masks = np.zeros((2, self.size), dtype=bool)
        bounded, slack = self._bounded
        leading = z[bounded]
        slack = slack * np.maximum(np.abs(leading), self.scale[bounded])
        masks[0, bounded] = leading < self.lower[bounded] - slack
        masks[1, bounded] = leading > self.upper[bounded] + slack
        return masks

    @cached_property
    def _bounded(self) -> tuple[NDArray[np.intp], Array]:
        """Entries with a bound, and the relative tolerance of each."""
        bounded = np.flatnonzero(np.isfinite(self.lower) | np.isfinite(self.upper))
        # the parameter ranges need no tolerance for rounding
        return bounded, np.where(bounded < self.size - 2, ON_EDGE, 0.0)


class ExactSystem(System):
    """A system that computes its derivative."""

    @abstractmethod
    def slopes(self, z: Array, guide: Array) -> Array:
        """Derivative of G at a point z, shape (N, N + 1)."""

    def null_vector(self, z: Array, scale: Array) -> Array | None:
        """Null vector of the derivative in units of scales; None if it follows from ``slopes``."""
        return None

    def solved(
        self, guess: Array, direction: Array, frame: Frame, continuation: Continuation
    ) -> tuple[Array, int, Array] | None:
        """Solve for a point in the plane through a guess normal to a direction.

        Returns
        -------
        tuple, optional
            The point, the number of Newton steps, and a unit tangent with any sign; None
            without convergence.
        """
        return _solved(self, guess, direction, frame, continuation)


class ExtrapolatedSystem(ExactSystem):
    """A system whose Newton steps are so dear that a start is extrapolated from two points."""

    @abstractmethod
    def solved_from(
        self,
        start: Array,
        guess: Array,
        direction: Array,
        frame: Frame,
        continuation: Continuation,
    ) -> tuple[Array, int, Array] | None:
        """Solve in the plane through a guess normal to a direction, from a start beside it."""


def slopes(system: System, z: Array, guide: Array, scale: Array) -> Array:
    """Derivative of G, shape (N, N + 1): exact, or by central differences in one evaluation."""
    if isinstance(system, ExactSystem):
        return system.slopes(z, guide)
    steps = np.diag(6e-6 * np.maximum(np.abs(z), scale))
    both = np.concatenate([z + steps, z - steps])
    values = system.residual(both, guide)
    count = len(z)
    return np.asarray((values[:count] - values[count:]).T / (2.0 * np.diag(steps)))


def tangent(system: System, z: Array, frame: Frame) -> Array:
    """Null vector of the derivative, a unit vector in the frame."""
    null = system.null_vector(z, frame.scale) if isinstance(system, ExactSystem) else None
    if null is None:
        matrix = slopes(system, z, z, frame.scale) * frame.scale
        rows = np.abs(matrix).max(axis=1, keepdims=True)
        null = np.linalg.svd(matrix / np.where(rows > 0, rows, 1.0))[2][-1]
    along = null * frame.scale
    length = np.sqrt((along**2) @ frame.weight)
    return np.asarray(along / length) if length > 0 else along


@np.errstate(all="ignore")
def corrected(
    system: System, guess: Array, direction: Array, frame: Frame, continuation: Continuation
) -> tuple[Array, int] | None:
    """Correct a guess in the normal plane; return the point and the number of Newton steps."""
    z, normal = guess.copy(), direction * frame.weight
    guide = system.renewed(guess)
    for used in range(1, continuation.max_iterations + 1):
        matrix = np.vstack([slopes(system, z, guide, frame.scale), normal]) * frame.scale
        right = np.append(-system.residual(z, guide), (guess - z) @ normal)
        rows = np.abs(matrix).max(axis=1)
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(right)) and rows.all()):
            return None
        try:
            step = np.linalg.solve(matrix / rows[:, None], right / rows)
        except np.linalg.LinAlgError:
            return None
        z = z + step * frame.scale
        if np.abs(step).max() <= continuation.tolerance:
            # one more step with the same matrix
            left = system.residual(z, guide)
            right = np.append(-left, (guess - z) @ normal)
            z = z + np.linalg.solve(matrix / rows[:, None], right / rows) * frame.scale
            terms = np.abs(matrix[:-1] / frame.scale) @ np.maximum(np.abs(z), frame.scale)
            if np.any(np.abs(left) > 1e-6 * terms):
                return None
            return system.renewed(z), used
    return None


def _solved(
    system: System, guess: Array, direction: Array, frame: Frame, continuation: Continuation
) -> tuple[Array, int, Array] | None:
    """The corrected guess, the number of Newton steps, and the tangent."""
    found = corrected(system, guess, direction, frame, continuation)
    return None if found is None else (*found, tangent(system, found[0], frame))


def landed(system: System, guess: Array, frame: Frame) -> Array | None:
    """Correct a guess to the nearest point of the curve; None if Newton's method fails."""
    guide = system.renewed(guess)
    z, _, converged, _ = newton(
        lambda z: system.residual(z, guide),
        guess,
        frame.scale,
        lambda z: slopes(system, z, guide, frame.scale),
    )
    return system.renewed(z) if converged else None


def follow(
    system: System,
    start: Array,
    direction: Array,
    frame: Frame,
    continuation: Continuation,
    stop: Callable[[Array], bool] = lambda _: False,
    bounds: Callable[[Array], Array] | None = None,
    aside: float = np.inf,
    corners: bool = False,
) -> tuple[Array, Array, str]:
    """Trace a curve from one of its points to its end.

    Parameters
    ----------
    system : System
    start, direction : ndarray, shape (N + 1,)
    frame : Frame
    continuation : Continuation
    stop : callable
        Whether the curve ends after a point.
    bounds : callable, optional
        Functions that are positive in the admissible domain; the curve ends exactly where
        the first of them vanishes.
    aside : float
        Largest distance of a point from its prediction, as a fraction of the step; more
        is another curve, as is a tangent that turns more than the curve has turned so far.
    corners : bool
        Whether the tangent may turn more than that on one curve.

    Returns
    -------
    z, tangents : ndarray, shape (M, N + 1)
        With ``RANGE`` and ``WINDOW`` the last row is exactly on the bound of a parameter or
        of a state.
    status : str
    """
    rows, tangents = [start], [direction]
    step, weight = continuation.step, frame.weight
    solve = system.solved if isinstance(system, ExactSystem) else partial(_solved, system)
    least_cosine, straight = np.cos(continuation.max_turn), np.cos(0.5 * continuation.max_turn)
    bend, settled = np.inf, False
    while len(rows) < continuation.max_points:
        last, along = rows[-1], tangents[-1]
        if step < continuation.min_step:
            return np.array(rows), np.array(tangents), SMALL_STEP
        known, ahead = (last + step * along, along, frame, continuation), None
        if isinstance(system, ExtrapolatedSystem):
            ahead = _extrapolated(rows, tangents, step, weight)
            found = solve(*known) if ahead is None else system.solved_from(ahead, *known)
        else:
            found = solve(*known)
        cosine = -1.0
        if found is not None:
            z, used, turned = found
            cosine = float((turned * weight) @ along)
            if cosine < 0:
                # the sign of a null vector is arbitrary
                cosine, turned = -cosine, -turned
            off = z - last - step * along
            angle = float(np.sqrt(2.0 * max(1.0 - cosine, 0.0)))
            kink = aside < np.inf and not corners and angle > KINK_ANGLE + BENT * bend * step
            if np.sqrt(off**2 @ weight) > aside * step or kink:
                found = None
        if found is None or cosine < least_cosine:
            own = None if settled else _own_tangent(system, last, along, frame, continuation)
            settled = True
            if own is None:
                step *= 0.5
            else:
                tangents[-1] = own
            continue
        settled = False
        if (passed := frame.passed(z)).any():
            at_edge = _on_edge(system, last, z, frame, passed, continuation)
            if at_edge is not None:
                rows.append(at_edge[0])
                tangents.append(turned)
            states = not passed[:, -2:].any() if at_edge is None else at_edge[1]
            return np.array(rows), np.array(tangents), WINDOW if states else RANGE
        if bounds is not None and np.any(bounds(z) < 0):
            edge = _on_bound(system, last, z, frame, bounds)
            if edge is not None:
                rows.append(edge)
                tangents.append(turned)
            return np.array(rows), np.array(tangents), BOUND
        rows.append(z)
        tangents.append(turned)
        bend = angle / step
        if len(rows) > 4 and _returns(start, direction, last, along, turned, step, frame):
            rows[-1], tangents[-1] = start, direction
            return np.array(rows), np.array(tangents), CLOSED
        if stop(z):
            return np.array(rows), np.array(tangents), STOPPED
        # Newton's method needs about one step less from the cubic than from the tangent
        easy = 3 if ahead is None else 2
        if used <= easy and cosine > straight:
            step *= 1.5
        elif used >= easy + 3:
            step *= 0.7
        step = min(step, continuation.max_step * frame.stretch(z, turned))
    return np.array(rows), np.array(tangents), FULL


def _extrapolated(
    rows: Sequence[Array], tangents: Sequence[Array], step: float, weight: Array
) -> Array | None:
    """The point a step ahead on the cubic through the last two points, along their tangents."""
    if len(rows) < 2:
        return None
    (before, last), (along, ahead) = rows[-2:], tangents[-2:]
    chord = last - before
    length = np.sqrt(chord**2 @ weight)
    if not step < LONGEST_EXTRAPOLATION * length:
        return None
    bent = (2.0 * along + 4.0 * ahead - 6.0 * chord / length) / length
    twist = (6.0 * (along + ahead) - 12.0 * chord / length) / length**2
    return np.asarray(last + step * (ahead + step * (bent / 2.0 + step * twist / 6.0)))


def _own_tangent(
    system: System, last: Array, along: Array, frame: Frame, continuation: Continuation
) -> Array | None:
    """Return the tangent at a point with the conditions that are set there, None if it is known.

    The phase condition of an orbit is set at the prediction. Where orbits are as small as the step,
    it differs from the condition at the solution, and so does the tangent.
    """
    if not isinstance(system, ExactSystem):
        return None
    found = system.solved(last, along, frame, continuation)
    if found is None:
        return None
    own = found[2]
    cosine = float((own * frame.weight) @ along)
    angle = np.sqrt(2.0 * max(1.0 - abs(cosine), 0.0))
    return np.copysign(1.0, cosine) * own if angle > KINK_ANGLE else None


def _on_edge(
    system: System,
    inside: Array,
    outside: Array,
    frame: Frame,
    passed: NDArray[np.bool_],
    continuation: Continuation,
) -> tuple[Array, bool] | None:
    """Locate the first bound crossed between two points, and whether it belongs to a state."""
    best: tuple[float, Array, bool] | None = None
    for side, entry in np.argwhere(passed):
        bound = (frame.lower, frame.upper)[side][entry]
        before, after = inside[entry] - bound, outside[entry] - bound
        share = float(np.clip(before / (before - after), 0.0, 1.0))
        guess = inside + share * (outside - inside)
        if isinstance(system, ExactSystem):
            guess[entry] = bound
            found = system.solved(guess, np.eye(len(guess))[entry], frame, continuation)
            converged, z = found is not None, guess if found is None else found[0]
        else:
            guide = system.renewed(guess)

            def equations(
                z: Array, guide: Array = guide, entry: int = entry, bound: float = bound
            ) -> Array:
                return np.append(system.residual(z, guide), z[entry] - bound)

            z, _, converged, _ = newton(equations, guess, frame.scale)
        if converged and (best is None or share < best[0]):
            z[entry] = bound
            best = share, system.renewed(z), bool(entry < frame.size - 2)
    return None if best is None else best[1:]


def _on_bound(
    system: System,
    inside: Array,
    outside: Array,
    frame: Frame,
    bounds: Callable[[Array], Array],
) -> Array | None:
    """Locate the first zero of the bounds between two points of the curve."""
    before, after = bounds(inside), bounds(outside)
    share, number = min(
        (before[k] / (before[k] - after[k]), int(k)) for k in np.flatnonzero(after < 0)
    )
    guess = inside + min(max(share, 0.0), 1.0) * (outside - inside)
    guide = system.renewed(guess)
    z, _, converged, _ = newton(
        lambda z: np.append(system.residual(z, guide), bounds(z)[number]), guess, frame.scale
    )
    return system.renewed(z) if converged else None


def _returns(
    start: Array,
    direction: Array,
    last: Array,
    along: Array,
    turned: Array,
    step: float,
    frame: Frame,
) -> bool:
    """Check whether the last step passed the start again, in its direction."""
    gap = start - last
    ahead = float((gap * frame.weight) @ along)
    if not 0.0 < ahead <= step:
        return False
    off = gap - ahead * along
    apart = float(np.sqrt((off**2) @ frame.weight))
    same = float((direction * frame.weight) @ turned)
    return apart < 0.2 * step and same > 0.9
