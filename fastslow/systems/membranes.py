"""Membranes whose channels open and close by gates: the giant axon and a Purkinje fibre."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from fastslow.model.model import Model

_GATES = sp.symbols("m h n")

_R = sp.Rational


def hodgkin_huxley(
    I_0: float = 10.0,
    C: float = 1.0,
    g_Na: float = 120.0,
    g_K: float = 36.0,
    g_L: float = 0.3,
    V_Na: float = 50.0,
    V_K: float = -77.0,
    V_L: float = -54.4,
) -> Model:
    """The Hodgkin-Huxley model of the squid giant axon, clamped in space.

    C V' = I_0 − g_Na m³ h (V − V_Na) − g_K n⁴ (V − V_K) − g_L (V − V_L), with
    z' = α_z (1 − z) − β_z z for the gates z = m, h, n, in millivolts, milliseconds and
    microamperes per square centimetre. The voltage is that inside the cell, with rest at −65 mV;
    the source measures the depolarisation from rest with the opposite sign. α_m and α_n are
    quotients with a removable singularity, at −40 and −55 mV.

    Parameters
    ----------
    I_0 : float
        Applied current. The Hopf points are at 9.77933800 and 154.526334.
    C : float
        Capacitance of the membrane.
    g_Na, g_K, g_L : float
        Largest conductances of sodium, potassium and leak.
    V_Na, V_K, V_L : float
        Their reversal potentials.

    Returns
    -------
    Model
        States V, m, h, n.

    References
    ----------
    A. L. Hodgkin and A. F. Huxley, Journal of Physiology 117(4), 500-544, 1952, equations (3) to
    (6), (12), (13), (20), (21), (23), (24), (26) and table 3.

    Examples
    --------
    >>> hodgkin_huxley().states
    ('V', 'm', 'h', 'n')
    """
    V, (m, h, n) = sp.Symbol("V"), _GATES
    names = sp.symbols("I_0 C g_Na g_K g_L V_Na V_K V_L")
    current, capacitance, sodium, potassium, leak, at_sodium, at_potassium, at_leak = names
    through = sodium * m**3 * h * (V - at_sodium)
    through += potassium * n**4 * (V - at_potassium) + leak * (V - at_leak)
    rest = V + 65
    opening = {
        m: _R(1, 10) * (25 - rest) / (sp.exp((25 - rest) / 10) - 1),
        h: _R(7, 100) * sp.exp(-rest / 20),
        n: _R(1, 100) * (10 - rest) / (sp.exp((10 - rest) / 10) - 1),
    }
    closing = {
        m: 4 * sp.exp(-rest / 18),
        h: 1 / (sp.exp((30 - rest) / 10) + 1),
        n: _R(1, 8) * sp.exp(-rest / 80),
    }
    return Model(
        {V: (current - through) / capacitance, **_gates(opening, closing)},
        parameters=dict(zip(names, (I_0, C, g_Na, g_K, g_L, V_Na, V_K, V_L), strict=True)),
    )


def noble(g_An: float = 0.0, I_0: float = 0.0, C: float = 12.0) -> Model:
    """Noble's model of a Purkinje fibre of the heart, a pacemaker.

    C V' = I_0 − (400 m³ h + 0.14)(V − 40) − (g_K1 + g_K2)(V + 100) − g_An (V + 60), where
    g_K1 = 1.2 exp(−(V + 90)/50) + 0.015 exp((V + 90)/60) and g_K2 = 1.2 n⁴, with
    z' = α_z (1 − z) − β_z z for the gates z = m, h, n, in millivolts and milliseconds. α_m, β_m and
    α_n are quotients with a removable singularity, at −48, −8 and −50 mV.

    Parameters
    ----------
    g_An : float
        Conductance of the anions. The fibre beats by itself at 0.
    I_0 : float
        Applied current.
    C : float
        Capacitance of the membrane.

    Returns
    -------
    Model
        States V, m, h, n.

    References
    ----------
    D. Noble, Journal of Physiology 160(2), 317-352, 1962, the equations of the section on the
    modified potassium and sodium equations.

    Examples
    --------
    >>> noble().states
    ('V', 'm', 'h', 'n')
    """
    V, (m, h, n) = sp.Symbol("V"), _GATES
    names = sp.symbols("g_An I_0 C")
    anions, current, capacitance = names
    one = _R(6, 5) * sp.exp(-(V + 90) / 50) + _R(3, 200) * sp.exp((V + 90) / 60)
    through = (400 * m**3 * h + _R(7, 50)) * (V - 40) + (one + _R(6, 5) * n**4) * (V + 100)
    opening = {
        m: _R(1, 10) * (-V - 48) / (sp.exp((-V - 48) / 15) - 1),
        h: _R(17, 100) * sp.exp((-V - 90) / 20),
        n: _R(1, 10000) * (-V - 50) / (sp.exp((-V - 50) / 10) - 1),
    }
    closing = {
        m: _R(12, 100) * (V + 8) / (sp.exp((V + 8) / 5) - 1),
        h: 1 / (sp.exp((-V - 42) / 10) + 1),
        n: _R(2, 1000) * sp.exp((-V - 90) / 80),
    }
    return Model(
        {V: (current - through - anions * (V + 60)) / capacitance, **_gates(opening, closing)},
        parameters=dict(zip(names, (g_An, I_0, C), strict=True)),
    )


def _gates(
    opening: Mapping[sp.Symbol, sp.Expr], closing: Mapping[sp.Symbol, sp.Expr]
) -> dict[sp.Symbol, sp.Expr]:
    """Rates of the gates."""
    return {z: opening[z] * (1 - z) - closing[z] * z for z in _GATES}
