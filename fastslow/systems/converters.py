"""A power converter that is switched by comparison with a sawtooth."""

from __future__ import annotations

import sympy as sp

from fastslow.model.model import Model


def buck_converter(
    V_in: float = 24.0,
    R: float = 22.0,
    L: float = 0.02,
    C: float = 47e-6,
    a: float = 8.4,
    V_ref: float = 11.3,
    V_L: float = 3.8,
    V_U: float = 8.2,
    T: float = 4e-4,
) -> Model:
    """The buck converter with voltage-mode control, in SI units.

    v' = (i − v/R)/C, i' = (u − v)/L. The switch is closed, u = V_in, while the control
    voltage a (v − V_ref) is below the sawtooth V_L + (V_U − V_L) (t mod T)/T, otherwise
    u = 0. The output of one period T doubles its period at V_in = 24.516.

    Parameters
    ----------
    V_in : float
        Input voltage, V.
    R, L, C : float
        Load, inductance and capacitance: Ω, H, F.
    a : float
        Gain of the controller.
    V_ref : float
        Reference voltage, V.
    V_L, V_U : float
        Lower and upper voltage of the sawtooth, V.
    T : float
        Period of the sawtooth, s.

    Returns
    -------
    Model
        States v (voltage of the capacitor) and i (current of the coil).

    References
    ----------
    E. Fossas and G. Olivar, IEEE Transactions on Circuits and Systems I 43(1), 13-25,
    1996; M. di Bernardo, F. Garofalo, L. Glielmo and F. Vasca, IEEE Transactions on
    Circuits and Systems I 45(2), 133-141, 1998.

    Examples
    --------
    >>> list(buck_converter(V_in=30).regions)
    ['S1', 'S2']
    """
    v, i, t = sp.symbols("v i t")
    names = sp.symbols("V_in R L C a V_ref V_L V_U T")
    source, load, coil, capacitor, gain, target, low, high, period = names
    sawtooth = low + (high - low) * sp.Mod(t, period) / period
    switched = sp.Piecewise((source, gain * (v - target) < sawtooth), (0, True))
    return Model(
        {v: (i - v / load) / capacitor, i: (switched - v) / coil},
        parameters=dict(zip(names, (V_in, R, L, C, a, V_ref, V_L, V_U, T), strict=True)),
    )
