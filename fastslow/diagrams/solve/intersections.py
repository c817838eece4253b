"""Attraction of an intersection of discontinuities, from the vector fields around a point of it.

To first order the heights h = (h_1, …, h_m) over the interfaces have a constant rate in each of
the 2**m orthants. Such a motion has no length scale: either all of its solutions end at h = 0 in
finite time, or one of them leaves (Filippov 1988, section 19).
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Relative size below which a rate is zero.
ZERO_RATE = 1e-9

#: Logarithm of the factor of a return map below which it is rounding.
RETURN_ROUNDING = 1e-12

#: Turns of a motion around an intersection after which its return map is known.
RETURN_TURNS = 40


def attracts(rates: Array) -> bool | None:
    """Decide whether an intersection of m interfaces attracts.

    Parameters
    ----------
    rates : ndarray, shape (2**m, m)
        dh/dt in the orthants, in the order of ``product((1, -1), repeat=m)``.

    Returns
    -------
    bool or None
        True if no motion nearby leaves the intersection, False if one does. None if the
        first order does not decide, as where rates vanish, for a spiral whose return map is the
        identity, or for m > 2 if neither a Lyapunov function Σ d_i (|h_i| − s_i h_i) nor a growing
        motion is found.

    Examples
    --------
    >>> attracts(np.array([[-1.0, -2.0], [-1.0, 2.0], [1.0, -2.0], [1.0, 2.0]]))
    True
    >>> attracts(np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]))
    False
    """
    signs = np.array(list(product((1, -1), repeat=rates.shape[1])), dtype=float)
    small = ZERO_RATE * np.abs(rates).max(initial=0.0)
    outwards = signs * rates
    # the motion remains in its orthant, and moves
    if ((outwards >= -small).all(axis=1) & (outwards > small).any(axis=1)).any():
        return False
    motionless = (np.abs(rates) <= small).all(axis=1)
    if rates.shape[1] == 1:
        # at an end of a set one of the vector fields vanishes
        return None if motionless.all() else True
    if motionless.any():
        return None
    if rates.shape[1] == 2:
        return _attracts_in_plane(rates.reshape(2, 2, 2), small)
    if _has_lyapunov_function(signs, rates):
        return True
    return False if _grows(signs, rates) else None


def two_fold_rate(
    fields: Array, jacobians: Array, gradient: Array, hessian: Array
) -> tuple[bool | None, float]:
    """Decide the stability of a planar equilibrium where an interface is crossed at equal speeds.

    Both fields are tangent to the interface there and point in opposite directions. If motions
    return to the interface on both sides, one turn changes the distance u along it by
    u²(2/3)(div f₊/|f₊| + div f₋/|f₋|) in a time 2u(1/|f₊| + 1/|f₋|): it decays, or grows, at a
    third of the divergence averaged over the turn (Filippov 1988, section 19, to second order).

    Parameters
    ----------
    fields : ndarray, shape (2, 2)
        Vector fields on the positive and the negative side, as rows.
    jacobians : ndarray, shape (2, 2, 2)
    gradient, hessian : ndarray, shapes (2,) and (2, 2)
        Of the interface function.

    Returns
    -------
    attracts : bool or None
        None if this order does not decide.
    rate : float
        Rate of growth of u; infinite where motions leave the interface, NaN if undecided.

    Examples
    --------
    A relay with friction: the velocity decays at a third of the coefficient.

    >>> fields, slopes = np.array([[0.0, -1.0], [0.0, 1.0]]), np.array([[0.0, 1.0], [0.0, -0.3]])
    >>> found = two_fold_rate(fields, np.array([slopes] * 2), np.eye(2)[0], np.zeros((2, 2)))
    >>> found[0], round(found[1], 12)
    (True, -0.1)
    """
    along = np.array([-gradient[1], gradient[0]]) / np.linalg.norm(gradient)
    speeds = fields @ along
    # change of the normal speed along the interface, the same for both fields
    change = float(along @ (hessian @ fields[0] + jacobians[0].T @ gradient))
    size = np.abs(hessian) @ np.abs(fields[0]) + np.abs(jacobians[0].T) @ np.abs(gradient)
    least = ZERO_RATE * np.abs(speeds).max()
    if not speeds.min() <= least or not speeds.max() >= -least or not least > 0:
        return None, float("nan")
    if abs(change) <= ZERO_RATE * size.max():
        return None, float("nan")
    if change * (speeds[0] - speeds[1]) > 0:
        return False, float("inf")
    # at the end of a branch, where one of the fields vanishes, the time beside it is all
    times = 1.0 / np.maximum(np.abs(speeds), least)
    divergences = np.trace(jacobians, axis1=1, axis2=2)
    rate = float(divergences @ times / times.sum() / 3.0)
    if abs(rate) <= ZERO_RATE * float(np.abs(jacobians).max()):
        return None, float("nan")
    return rate < 0, rate


def _attracts_in_plane(rates: Array, small: float) -> bool | None:
    """Decide for two interfaces; ``rates[i, j]`` is that where h₁ and h₂ have the signs i, j."""
    turns, growth, undecided = [], 0.0, False
    for number, other in ((0, 1), (1, 0)):
        for k, sign in enumerate((1.0, -1.0)):
            # the half-axis h_number = 0 where h_other has the sign
            above, below = (rates[side, k] if number == 0 else rates[k, side] for side in (0, 1))
            a, b = above[number], below[number]
            if max(abs(a), abs(b)) <= small:
                # motions remain beside the half-axis
                undecided = True
            if a * b < 0:
                along = sign * (above[other] + a / (a - b) * (below[other] - above[other]))
                if along > small:
                    return False
                turns.append(0.0)
            else:
                turns.append(float(np.sign(a + b)) * sign * (1.0 if number else -1.0))
    if undecided:
        return None
    if len(set(turns)) > 1 or turns[0] == 0.0:
        return True
    # a rotation: from half-axis to half-axis the distance is multiplied by a ratio of rates
    for i, j in product((0, 1), repeat=2):
        with np.errstate(divide="ignore"):
            # parallel to a half-axis the factor is 0 or infinite
            first, second = np.log(np.abs(rates[i, j]))
        growth += (second - first) * (1.0 if i == j else -1.0) * turns[0]
    return bool(growth < 0) if abs(growth) > RETURN_ROUNDING else None


def _has_lyapunov_function(signs: Array, rates: Array) -> bool:
    """Check dh/dt = B (s − s₀), s = sign h, for D > 0, diagonal, with D B + Bᵀ D < 0.

    Then Σ d_i (|h_i| − s₀_i h_i) decreases along all Filippov solutions.
    """
    from scipy.optimize import minimize

    matrix = (rates.T @ signs) / len(signs)
    rest = rates.mean(axis=0)
    mixed = np.abs(rates - (rest + signs @ matrix.T)).max()
    if mixed > ZERO_RATE * np.abs(rates).max() or not (np.diag(matrix) < 0).all():
        return False
    size = np.abs(np.diag(matrix))
    matrix = matrix / size[:, None]

    def largest(logarithms: Array) -> float:
        weighted = np.exp(logarithms)[:, None] * matrix
        weighted = weighted / np.exp(logarithms).max()
        return float(np.linalg.eigvalsh(weighted + weighted.T).max())

    start = np.zeros(len(size))
    found = min(largest(start), float(minimize(largest, start, method="Nelder-Mead").fun))
    return bool(found < -ZERO_RATE)


def _grows(signs: Array, rates: Array) -> bool:
    """Check whether a motion that crosses the interfaces without sliding returns with growth."""
    count = rates.shape[1]
    numbers = {tuple(pattern): k for k, pattern in enumerate(signs.tolist())}
    for pattern in signs:
        side, h = pattern.copy(), pattern * np.linspace(1.0, 2.0, count)
        sizes: list[float] = []
        places: list[Array] = []
        kind = None
        for number in range(2 * count * RETURN_TURNS):
            rate = rates[numbers[tuple(side.tolist())]]
            inwards = side * rate < 0
            if not inwards.any():
                return True
            times = np.where(inwards, -h / np.where(inwards, rate, 1.0), np.inf)
            j = int(np.argmin(times))
            h = h + times[j] * rate
            h[j] = 0.0
            side[j] = -side[j]
            if not rates[numbers[tuple(side.tolist())]][j] * side[j] > 0:
                break
            # the return map of one kind of crossing, reached after the first half
            if number == count * RETURN_TURNS:
                kind = (j, *side)
            if kind == (j, *side):
                sizes.append(float(np.abs(h).max()))
                places.append(h / sizes[-1])
        else:
            same = len(places) > 2 and np.abs(places[-1] - places[-2]).max() < ZERO_RATE
            if same and np.log(sizes[-1] / sizes[-2]) > ZERO_RATE:
                return True
    return False
