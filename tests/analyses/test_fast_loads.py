"""Frequency responses, exponents and basins of the gear against independent computations."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import fsolve

import fastslow as fs
from analyses import coexistence, frequency_response, orbits
from analyses.cases import GAP, gear

pytestmark = pytest.mark.slow


def integrated(rates, start, span, D):
    """A run by SciPy, with a new start at each crossing of the interfaces x = ±D."""
    crossings = [lambda t, z, s=s: z[0] - s * D for s in (1, -1)]
    for event in crossings:
        event.terminal = True
    t, z, kept = span[0], np.asarray(start, dtype=float), []
    while t < span[1]:
        run = solve_ivp(
            rates, (t, span[1]), z, method="DOP853", rtol=1e-12, atol=1e-13, events=crossings,
            dense_output=True,
        )  # fmt: skip
        kept.append(run.sol(np.linspace(t, run.t[-1], 400))[0].max())
        t, z = run.t[-1], run.y[:, -1]
        if t < span[1]:
            # off the interface, so that the same crossing is not found again
            step = 1e-9
            z = z + step * np.array(rates(t, z))
            t += step
    return z, max(kept)


def test_orbits_of_the_gear_pair_by_shooting_with_scipy():
    frequency, zeta = 0.76, frequency_response.DAMPING

    def rates(t, z):
        load = frequency_response.MEAN + frequency_response.AMPLITUDE * frequency**2 * np.sin(
            frequency * t
        )
        x, v = z
        return [v, load - 2 * zeta * v - np.sign(x) * max(abs(x) - 1.0, 0.0)]

    span = (0.0, 2 * np.pi / frequency)
    known = frequency_response.pair().at(Omega=frequency)
    assert len(known) == 3
    for orbit in known:
        start = orbit(0.0)

        def short(z):
            return integrated(rates, z, span, 1.0)[0] - z

        found = fsolve(short, start + 1e-5, xtol=1e-11)
        assert found == pytest.approx(start, abs=1e-7)
        assert integrated(rates, found, span, 1.0)[1] == pytest.approx(orbit["max(x)"], abs=1e-5)


def test_describing_function_against_a_quadrature():
    for mean, amplitude, D in ((0.3, 0.2, 0.25), (0.1, 0.9, 0.25), (1.1, 0.2, 1.0), (0.0, 0.1, 1)):
        zone = lambda x, D=D: np.sign(x) * max(abs(x) - D, 0.0)  # noqa: E731
        at = lambda s, m=mean, a=amplitude, zone=zone: zone(m + a * np.sin(s))  # noqa: E731
        options = {"limit": 400, "epsabs": 1e-12}
        first = quad(at, -np.pi, np.pi, **options)[0] / (2 * np.pi)
        second = quad(lambda s, at=at: at(s) * np.sin(s), -np.pi, np.pi, **options)[0] / np.pi
        found = frequency_response.dead_zone(mean, amplitude, D)
        assert found == pytest.approx((first, second), abs=1e-9)


def test_one_harmonic_without_loss_of_contact_is_the_linear_response():
    curve = frequency_response.pair_approximation()
    inside = curve.top < 1.0 + 2 * frequency_response.MEAN - 1e-9
    f, zeta = curve.frequency[inside], frequency_response.DAMPING
    gain = frequency_response.AMPLITUDE * f**2 / np.hypot(1 - f**2, 2 * zeta * f)
    assert inside.sum() > 100
    assert curve.top[inside] == pytest.approx(1.0 + frequency_response.MEAN + gain, abs=1e-9)


def test_an_exponent_by_integration_is_that_of_a_multiplier():
    # real ones, −0.81 and −0.18: complex ones would need an average over their rotation
    model = orbits.fast_gear().with_parameters(omega=3.3)
    run = fs.simulate(model, [0.4, 0.0], periods=60)
    orbit = fs.find_orbit(model, run(run.span[1]))
    assert np.abs(orbit.multipliers.imag).max() == 0
    spectrum = fs.lyapunov(model, orbit(0.0), periods=40, settle=20)
    assert spectrum.per_period == pytest.approx(orbit.log_multipliers, abs=1e-9)


@pytest.mark.sample(0)
def test_motions_reached_from_the_basins_by_scipy():
    for load in coexistence.LOADS:
        found = coexistence.coexisting(*load)
        model = gear("consistent", load[1], D=GAP, T_am=load[0])
        p = model.parameters

        def rates(t, z, p=p):
            x, v = z
            contact = np.sign(x) * max(abs(x) - p["D"], 0.0)
            return [v, p["B"] + p["C"] * np.sin(p["omega"] * t) - v - (x * x + p["A"]) * contact]

        period = 2 * np.pi / p["omega"]
        names = set()
        for x, v in ((-0.25, 0.7), (0.25, 0.3), (0.2, 0.5), (0.3, -0.8)):
            name = found.plane.at(x=x, v=v)
            names.add(name)
            run = solve_ivp(
                rates, (0, 40 * period), [x, v], method="DOP853", rtol=1e-8, atol=1e-10,
                max_step=0.05,
            )  # fmt: skip
            last = run.y[0][run.t > 36 * period]
            assert np.ptp(last) == pytest.approx(coexistence.size(found.known[name]), abs=2e-3)
        assert names == {"A1", "A2"}
