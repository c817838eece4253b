"""Closed forms derived in other units are the same points."""

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.model.structure import real
from tests.unit_systems import PARAMETER, SYSTEMS, drawn

pytestmark = pytest.mark.slow

#: Those whose critical points have closed forms, with how many of them there are.
CLOSED = {
    "folded gear": 6,
    "van der Pol": 2,
    "Brusselator": 1,
    "Rosenzweig-MacArthur": 2,
    "FitzHugh-Nagumo": 2,
    "Stommel": 2,
}


def points(derivation, parameter, values, units):
    """Code, parameter and state of every point in closed form, in the units of the model."""
    found = []
    place = {real(n): sp.Rational(v) for n, v in {**values, **units}.items() if n != parameter}
    critical = (
        *derivation.folds,
        *(p for r in derivation.regions.values() for p in r.branch_points),
        *derivation.hopf,
    )
    named = [(p.code, p) for p in critical]
    named += [("BE", p) for p in derivation.boundary_equilibria]
    for code, point in named:
        if point.equations or set(point.parameters) != {parameter}:
            continue
        everything = (*point.parameters.values(), *point.state.values())
        if any(e.has(sp.polys.rootoftools.ComplexRootOf) for e in everything):
            # roots of polynomials of numbers, which with symbols have no closed form
            continue
        numbers = [point.parameters[parameter] * place.get(real(PARAMETER), 1)]
        numbers += [e * place.get(real(f"unit_{n}"), 1) for n, e in point.state.items()]
        numbers = [sp.N(e.subs(place), 30) for e in numbers]
        if all(e.is_number and e.is_real for e in numbers):
            found.append((code, *map(float, numbers)))
    return sorted(set(found))


@pytest.mark.sample(2)
@pytest.mark.parametrize("system", [s for s in SYSTEMS if s.name in CLOSED], ids=lambda s: s.name)
def test_derived_points_are_the_same_in_other_units(system):
    p = system.parameter
    given = system.model.parameters
    own = points(fs.derive(system.model, parameter=p), p, given, {})
    assert len(own) >= CLOSED[system.name]
    other = system.measured()
    derivation = fs.derive(other, parameter=p)
    for seed in range(3):
        units = drawn(system, seed)
        theirs = points(derivation, p, other.parameters, units)
        assert [c for c, *_ in theirs] == [c for c, *_ in own]
        mine = np.array([n for _, *n in own])
        assert np.array([n for _, *n in theirs]) == pytest.approx(mine, rel=1e-9, abs=1e-12)
