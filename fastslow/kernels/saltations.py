"""The derivative of the map across an event: a switching surface, a reset or an instant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastslow.kernels.compiler.decorators import kernel

Array = NDArray[np.float64]


@kernel
def fill_saltation(before, after, slopes, reset, out):  # type: ignore[no-untyped-def]
    """Fill in the derivatives of the state after an event by u = (state, time, parameters).

    With d = n·f⁻ + h_t and g = f⁺ − R_z f⁻ − R_t they are R_u + g h_uᵀ / d.

    Parameters
    ----------
    before, after : float64 array, shape (n,)
        Rates f⁻ and f⁺.
    slopes : float64 array, shape (n + 1 + P,)
        h_u = (n, h_t, h_p).
    reset : float64 array, shape (n, n + 1 + P)
        R_u = (R_z, R_t, R_p).
    out : float64 array, shape (n, n + 1 + P)
    """
    n = before.shape[0]
    speed = slopes[n]
    for j in range(n):
        speed += slopes[j] * before[j]
    for i in range(n):
        gap = after[i] - reset[i, n]
        for j in range(n):
            gap -= reset[i, j] * before[j]
        for c in range(slopes.shape[0]):
            out[i, c] = reset[i, c] + gap * slopes[c] / speed


def saltation(before: Array, after: Array, slopes: Array, reset: Array | None = None) -> Array:
    """Derivatives of the state after an event h = 0 by state, time and parameters before it.

    With the state R(z, t, p) after the event, d = n·f⁻ + h_t and g = f⁺ − R_z f⁻ − R_t, the
    saltation matrix is S = R_z + g nᵀ/d, and a derivative s⁻ of the state by a parameter
    continues with s⁺ = S s⁻ + R_p + g h_p/d. At an instant kT, h = t − kT, n = 0 and S = R_z.

    Parameters
    ----------
    before, after : ndarray, shape (n,)
        Rates f⁻ and f⁺, the latter in the state after the reset. At an entry into sliding f⁺ is
        the sliding field, and S is singular.
    slopes : ndarray, shape (n + 1 + P,)
        Derivatives n, h_t and h_p of h by states, time and parameters.
    reset : ndarray, shape (n, n + 1 + P), optional
        Derivatives of R; by default the state does not jump.

    Returns
    -------
    ndarray, shape (n, n + 1 + P)
        S, then R_t + g h_t/d and R_p + g h_p/d. Not finite where d = 0, at a grazing contact.

    References
    ----------
    R. I. Leine & H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems,
    Springer 2004, equation (7.50); M. di Bernardo, C. J. Budd, A. R. Champneys & P. Kowalczyk,
    Piecewise-smooth Dynamical Systems, Springer 2008, section 2.5, for impacts.

    Examples
    --------
    >>> saltation(np.array([1.0, -1.0]), np.array([3.0, -1.0]), np.array([1.0, 0.0, 0.0]))[:, :2]
    array([[3., 0.],
           [0., 1.]])

    An impact with the velocity 2 and the coefficient of restitution 1/2:

    >>> impact = np.array([[1.0, 0.0, 0.0], [0.0, -0.5, 0.0]])
    >>> rates = np.array([2.0, -1.0]), np.array([-1.0, -1.0])
    >>> saltation(*rates, np.array([1.0, 0.0, 0.0]), impact)[:, :2]
    array([[-0.5 ,  0.  ],
           [-0.75, -0.5 ]])
    """
    n, width = len(before), len(slopes)
    whole = np.eye(n, width) if reset is None else reset
    found = np.empty((n, width))
    with np.errstate(divide="ignore", invalid="ignore"):
        fill_saltation(before, after, slopes, whole, found)
    return found
