"""Orbits of models, as the equations of multiple shooting, for the tests of special points."""

from dataclasses import replace

import numpy as np
import sympy as sp

import fastslow as fs
from fastslow.orbits.flow.forcing import forcing_of
from fastslow.orbits.flow.segments import restarted, segments_of
from fastslow.orbits.flow.shooting import Shooting, solved
from fastslow.orbits.flow.variations import variations_of
from fastslow.orbits.points.multiplier_signs import multipliers_at

x, v, y, t, a, b, c, k, w, z = sp.symbols("x v y t a b c k w z")


def orbit_of(model, chosen, state, settle, period=None):
    """Equations, unknowns and units of the orbit that a run settles on."""
    variations = variations_of(model, (chosen,))
    p = variations.parameter_array(model)
    forcing = forcing_of(model, variations, None)
    if forcing is not None:
        period = forcing.period(p)[0]
    fine = fs.Integration(rtol=1e-13)
    run = fs.simulate(model, state, t=(0, (settle + 1.5) * period), integration=fine)
    nothing = np.zeros(variations.n)
    form = segments_of(run, settle * period, period, nothing, variations, p)
    form = replace(form, start=0.0 if forcing is None else form.start % period)
    shooting = Shooting(variations, p, form, forcing, 1, nothing, nothing)
    shooting = shooting.with_phase(shooting.pack(form, period))
    unit = max(abs(p[variations.places[0]]), 1e-3)
    sizes = np.ptp(run(np.linspace(settle, settle + 1, 200) * period), axis=1)
    K = len(form)
    scale = np.concatenate([np.tile(sizes, K), np.full(K + 1, period), [unit]])
    u = solved(shooting, shooting.pack(form, period), scale[:-1]).u
    return shooting, u, scale


def walk(shooting, u, scale, values):
    """The orbit at the last of some parameter values, started in the middle of a segment."""
    for value in values:
        form, period = shooting.unpack(u)
        p = shooting.parameters_at(u)
        form = restarted(form, period, shooting.winding, shooting.variations, p)
        shooting = replace(shooting, form=form, parameters=p)
        shooting = shooting.with_phase(shooting.pack(form, period))
        K, n = len(form), shooting.variations.n
        sizes, rest = scale[:n], scale[[-2, -2, -1]]
        scale = np.concatenate([np.tile(sizes, K), np.full(K, period), rest[1:]])
        u = np.append(shooting.pack(form, period)[:-1], value)
        u = solved(shooting, u, scale[:-1]).u
    return shooting, u, scale


def multipliers(shooting, u):
    return multipliers_at(shooting, u, shooting.linearised(u))


def precise(point):
    assert point.converged
    assert point.residual < 1e-13
    assert point.accuracy < 1e-10
    return True


GEAR_PAIR = fs.Model(
    {
        x: v,
        v: -2 * z * v
        - sp.Piecewise((x - 1, x > 1), (x + 1, x < -1), (0, True))
        + k
        + a * w**2 * sp.sin(w * t),
    },
    parameters={z: 0.05, k: 0.1, a: 0.05, w: 0.8},
)


def linear_response(frequency):
    """The orbit of the gear pair that stays in contact, at t = 0."""
    H = 0.05 * frequency**2 / (1 - frequency**2 + 0.1j * frequency)
    return [1.1 + H.imag, (1j * frequency * H).imag]
