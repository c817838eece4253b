"""Ready-made models: the harmonic gear and classics of the field, each with its source."""

from fastslow.systems.classics import (
    cusp,
    fitzhugh_nagumo,
    hindmarsh_rose,
    van_der_pol,
    van_der_pol_relaxation,
)
from fastslow.systems.gears import (
    GearScales,
    gear_pair,
    gear_scales,
    harmonic_gear,
    harmonic_gear_from_physical,
)
from fastslow.systems.geartrain import harmonic_gear_twist, harmonic_gear_two_inertias
from fastslow.systems.oscillators import bilinear_oscillator, stick_slip

__all__ = [
    "GearScales",
    "bilinear_oscillator",
    "cusp",
    "fitzhugh_nagumo",
    "gear_pair",
    "gear_scales",
    "harmonic_gear",
    "harmonic_gear_from_physical",
    "harmonic_gear_twist",
    "harmonic_gear_two_inertias",
    "hindmarsh_rose",
    "stick_slip",
    "van_der_pol",
    "van_der_pol_relaxation",
]
