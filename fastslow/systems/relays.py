"""A plant with relay feedback."""

from __future__ import annotations

import sympy as sp

from fastslow.model.model import Model


def relay_feedback(epsilon: float = 0.1, K: float = 1.0) -> Model:
    """Three equal lags with relay feedback, with hysteresis.

    The plant 1/(s + 1)³, x' = u − x, y' = x − y, z' = y − z, is controlled by the relay
    u = K once z has fallen below −ε and u = −K once it has risen above ε. It oscillates
    with the half-period h at which C (1 + e^(A h))⁻¹ A⁻¹ (e^(A h) − 1) b = ε/K, where
    (A, b, C) is the plant.

    Parameters
    ----------
    epsilon : float
        Half-width of the hysteresis.
    K : float
        Output of the relay.

    Returns
    -------
    Model
        States x, y, z; switch q, which is 1 while u = K.

    References
    ----------
    K. J. Åström, in Adaptive Control, Filtering, and Signal Processing, IMA Volumes 74,
    1-25, Springer 1995; K. H. Johansson, A. Rantzer and K. J. Åström, Automatica 35(4),
    539-552, 1999.

    Examples
    --------
    >>> list(relay_feedback().switches)
    ['q']
    """
    x, y, z, q = sp.symbols("x y z q")
    width, output = sp.symbols("epsilon K")
    return Model(
        {x: output * (2 * q - 1) - x, y: x - y, z: y - z},
        parameters={width: epsilon, output: K},
        switches={q: (z < -width, z > width)},
    )
