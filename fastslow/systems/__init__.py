"""Ready-made models with their sources, and the slow-load criterion for gaps."""

from fastslow.results.trajectory.long_time.slow_loads import SlowLoad
from fastslow.systems.classics import cusp, van_der_pol, van_der_pol_relaxation
from fastslow.systems.converters import buck_converter
from fastslow.systems.gears import (
    GearScales,
    gear_pair,
    gear_scales,
    harmonic_gear,
    harmonic_gear_from_physical,
    rigid_gear,
)
from fastslow.systems.geartrain import harmonic_gear_twist, harmonic_gear_two_inertias
from fastslow.systems.impacts import bouncing_ball, impact_oscillator, moving_wall_oscillator
from fastslow.systems.membranes import hodgkin_huxley, noble
from fastslow.systems.neurons import fitzhugh_nagumo, hindmarsh_rose, izhikevich
from fastslow.systems.oscillators import bilinear_oscillator, stick_slip
from fastslow.systems.relays import relay_feedback
from fastslow.systems.slow_loads import slow_load_criterion, slow_load_gap

__all__ = [
    "GearScales",
    "SlowLoad",
    "bilinear_oscillator",
    "bouncing_ball",
    "buck_converter",
    "cusp",
    "fitzhugh_nagumo",
    "gear_pair",
    "gear_scales",
    "harmonic_gear",
    "harmonic_gear_from_physical",
    "harmonic_gear_twist",
    "harmonic_gear_two_inertias",
    "hindmarsh_rose",
    "hodgkin_huxley",
    "impact_oscillator",
    "izhikevich",
    "moving_wall_oscillator",
    "noble",
    "relay_feedback",
    "rigid_gear",
    "slow_load_criterion",
    "slow_load_gap",
    "stick_slip",
    "van_der_pol",
    "van_der_pol_relaxation",
]


def __dir__() -> list[str]:
    return sorted(__all__)
