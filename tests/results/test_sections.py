"""Sections, spectra, steady states and contact statistics against numbers from elsewhere."""

import math

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import fastslow as fs

# period of the unforced van der Pol oscillator at mu = 1
VAN_DER_POL = 6.66328685932

MESH = 0.7


@pytest.fixture(scope="module")
def cycle():
    """The van der Pol oscillator, unforced."""
    model = fs.systems.van_der_pol().frozen().with_parameters(w=0)
    return fs.simulate(model, [2, 0], t=(0, 120), integration=fs.Integration(rtol=1e-13))


@pytest.fixture(scope="module")
def meshed():
    """A gear pair always in contact, which is a linear oscillator."""
    model = fs.systems.gear_pair(Omega=MESH)
    return fs.simulate(model, [1.1, 0], periods=120, integration=fs.Integration(rtol=1e-13))


@pytest.fixture(scope="module")
def rattling():
    """The same pair beyond the jump, where the teeth part once every period."""
    return fs.simulate(
        fs.systems.gear_pair(Omega=0.85),
        [1.1, 0],
        periods=120,
        integration=fs.Integration(rtol=1e-13),
    )


def response(times):
    """Position and speed of the linear oscillator, once settled."""
    amplitude = 0.05 * MESH**2 / (1 - MESH**2 + 0.1j * MESH)
    wave = amplitude * np.exp(1j * MESH * np.asarray(times))
    return np.array([1.1 + wave.imag, (1j * MESH * wave).imag])


def test_stroboscopic_points_of_a_linear_oscillator(meshed):
    late = 90 * meshed.period
    for phase in (0.0, 1.234):
        points = meshed.stroboscopic(phase=phase / meshed.period, since=late)
        assert points.t == pytest.approx(
            phase + meshed.period * np.arange(90, 121 - (phase > 0)), abs=1e-9
        )
        expected = response(points.t)
        assert np.abs(np.array([points["x"], points["v"]]) - expected).max() < 1e-12
        assert points["w"] == pytest.approx(np.full(len(points), points["w"][0]), abs=1e-12)
    every_second = meshed.stroboscopic(2 * meshed.period)
    assert len(every_second) == 61


def test_section_of_the_van_der_pol_oscillator(cycle):
    up = cycle.section("x", level=0.0, direction=1)
    assert np.diff(up.t)[5:] == pytest.approx(VAN_DER_POL, abs=1e-11)
    assert np.abs(up["x"]).max() < 1e-13
    event = solve_ivp(
        lambda t, u: [u[1], (1 - u[0] ** 2) * u[1] - u[0]],
        cycle.span,
        [2.0, 0.0],
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
        events=[lambda t, u: u[0], lambda t, u: u[1] - 0.5],
    )
    both = cycle.section("x")
    assert both.t == pytest.approx(event.t_events[0], abs=1e-9)
    assert both["v"] == pytest.approx(event.y_events[0][:, 1], abs=1e-9)
    assert both.directions.tolist() == np.sign(both["v"]).tolist()
    assert cycle.section("v", level=0.5).t == pytest.approx(event.t_events[1], abs=1e-9)
    assert len(up) + len(cycle.section("x", direction=-1)) == len(both)


def test_the_maxima_are_where_the_speed_falls_through_zero(cycle):
    top = cycle.section("v", level=0.0, direction=-1, since=60.0)
    high = cycle.extremes("x", since=60.0)[1]
    assert top["x"].max() == pytest.approx(high, abs=1e-14)
    touch = cycle.section("x", level=high, since=60.0)
    # the level of one maximum only touches there
    assert 0 in touch.directions
    assert np.abs(touch["x"] - high).max() < 1e-12


def test_a_section_may_be_a_polynomial(cycle):
    x, v, mu = sp.symbols("x v mu")
    circle = cycle.section(x**2 + v**2 / 4 - mu, level=2.0, since=60.0)
    assert len(circle)
    assert circle["x"] ** 2 + circle["v"] ** 2 / 4 - 1 == pytest.approx(2.0, abs=1e-12)
    minute = cycle.section("t/60 - 1")
    assert minute.t == pytest.approx([60.0], abs=1e-12)


def test_a_section_on_an_interface_is_its_crossings(rattling):
    late = 100 * rattling.period
    lifted = rattling.section(interface="x - D", direction=-1, since=late)
    wanted = [c for c in rattling.crossings if c.direction < 0 and c.time >= late]
    assert len(lifted) == len(wanted) == 20
    assert lifted.t.tolist() == [c.time for c in wanted]
    assert set(lifted["x"]) == {1.0}
    # the same from the series, where steps end on the interface
    again = rattling.section("x - D", direction=-1, since=late)
    assert again.t == pytest.approx(lifted.t, abs=1e-12)
    assert again["w"] == pytest.approx(lifted["w"], abs=1e-12)


def test_contacts_period_by_period(rattling):
    end, length = rattling.span[1], rattling.period
    contacts = rattling.contacts(since=end - 10 * length)
    assert contacts.hits.tolist() == [[10, 10], [0, 0]]
    assert contacts.per_period.shape == (10, 2, 2)
    assert (contacts.per_period[:, 0] == 1).all()
    assert sum(contacts.time_fractions.values()) == pytest.approx(1.0, abs=1e-12)
    apart = rattling.section(interface="x - D", since=end - 10 * length)
    first = apart.t[apart.directions < 0][:9]
    last = apart.t[apart.directions > 0][-9:]
    share = (last - first).mean() / length
    assert 0 < share < 1
    assert contacts.time_fractions["S2"] == pytest.approx(share, abs=1e-6)
    assert rattling.hits("x - D", direction=1, since=end - 3 * length) == 3
    half = rattling.hits("x - D", until=end / 2) + rattling.hits("x - D", since=end / 2)
    assert half == rattling.hits("x - D")


def test_spectrum_of_a_sine(meshed):
    late = meshed.span[1] / 2
    for taper in ("hann", "flattop", "blackman", "hamming", "rectangular"):
        forcing = meshed.spectrum("w", since=late, taper=taper)
        (peak,) = forcing.peaks(1)
        assert peak.angular == pytest.approx(MESH, abs=1e-6 if taper == "flattop" else 1e-9)
        assert peak.amplitude == pytest.approx(0.05 * MESH**2, rel=1e-7)
        assert forcing.amplitude[1:].max() == pytest.approx(0.05 * MESH**2, abs=1e-12)
        assert forcing.amplitude[0] == pytest.approx(0.1, abs=1e-12)
    (peak,) = meshed.spectrum("x", since=80 * meshed.period).peaks(3)
    amplitude = 0.05 * MESH**2 / abs(1 - MESH**2 + 0.1j * MESH)
    assert peak.amplitude == pytest.approx(amplitude, abs=1e-10)


def test_lines_between_the_bins_are_interpolated(cycle):
    found = cycle.spectrum("x", since=30.0)
    peaks = found.peaks(3)
    ratios = [p.frequency * VAN_DER_POL for p in peaks]
    # odd harmonics; leakage of the other lines is what is left
    assert ratios == pytest.approx([1, 3, 5], abs=2e-3)
    assert abs(np.round(peaks[0].frequency / found.frequency[1], 6) % 1) > 0
    assert found.angular[1] == 2 * math.pi * found.frequency[1]


def test_settled_on_the_forcing(meshed):
    settled = meshed.periodicity()
    assert settled.multiple == 1
    assert settled.period == pytest.approx(meshed.period, rel=1e-12)
    # the transient has fallen to the tolerance by then, and not much earlier
    slowest = math.log(1e-6) / -0.05
    assert 0.5 * slowest < settled.since < 1.5 * slowest
    assert meshed.periodicity(tol=1e-15).multiple is None


def test_settled_on_a_cycle(cycle):
    settled = cycle.periodicity()
    assert settled.multiple == 1
    assert settled.period == pytest.approx(VAN_DER_POL, abs=1e-6)
    assert settled.outcome.code == "periodic"


def test_too_short_and_at_rest(cycle):
    model = fs.systems.van_der_pol().frozen().with_parameters(w=0)
    short = fs.simulate(
        model, [2, 0], t=(0, 5), integration=fs.Integration(rtol=1e-13)
    ).periodicity()
    assert short.outcome.code == "too short"
    rest = fs.simulate(
        model.with_parameters(w=2), [2, 0.1], t=(0, 200), integration=fs.Integration(rtol=1e-13)
    ).periodicity()
    assert rest.outcome.code == "equilibrium"
    assert rest.multiple is None


def test_a_run_without_a_step():
    x = sp.Symbol("x")
    stuck = fs.simulate(fs.Model({x: -sp.log(x)}), [-1], t=(0, 1))
    assert not len(stuck.section("x"))
    assert stuck.contacts().time_fractions == {"S1": 0.0}
    for question in (stuck.periodicity, lambda: stuck.stroboscopic(1.0)):
        with pytest.raises(fs.ArgumentError, match="made no step"):
            question()
    with pytest.raises(fs.ArgumentError, match="is the end of the interval"):
        stuck.spectrum("x")


def test_wrong_questions(cycle, meshed):
    with pytest.raises(fs.ArgumentError, match="no forcing with a common period"):
        cycle.stroboscopic()
    with pytest.raises(fs.ArgumentError, match="period = -1"):
        meshed.stroboscopic(-1)
    with pytest.raises(fs.ArgumentError, match="since = 1e\\+06 is outside the run"):
        meshed.stroboscopic(since=1e6)
    with pytest.raises(fs.ArgumentError, match="received both"):
        meshed.section("x", interface="x - D")
    with pytest.raises(fs.ArgumentError, match="received neither"):
        meshed.section()
    with pytest.raises(fs.ArgumentError, match="direction = 2"):
        meshed.section("x", direction=2)
    with pytest.raises(fs.ArgumentError, match="level = nan"):
        meshed.section("x", level=math.nan)
    with pytest.raises(fs.UnknownNameError, match="unknown interface 'x-D'; did you mean 'x - D'"):
        meshed.section(interface="x-D")
    with pytest.raises(fs.UnknownNameError, match="unknown column or parameter 'zta'; did you"):
        meshed.section("x - zta")
    for text in ("sin(x)", "x**v", "1/x", "x**0.5", "x/0", "Max(x, v)"):
        with pytest.raises(fs.ArgumentError, match="is not a polynomial"):
            meshed.section(text)
    for text in ("x -", "x if v else x", "'x'", "x[0]", "x > v", "True", 5.0):
        with pytest.raises(fs.ArgumentError, match=r"is not an expression|expected a name or an"):
            meshed.section(text)
    for text, degree in (("(x**8)**8", 64), ("x**8*v", 9), ("(x + v)**1000", 1000)):
        with pytest.raises(fs.ArgumentError, match=f"has the degree {degree} .*up to 8"):
            meshed.section(text)
    with pytest.raises(fs.ArgumentError, match="is not finite along the run"):
        meshed.section("1e300*x*1e300*x")
    with pytest.raises(fs.ArgumentError, match=r"received 1.1 without a name; expected level="):
        meshed.section("x", 1.1)
    with pytest.raises(fs.ArgumentError, match="received 1 without a name; expected direction="):
        meshed.hits("x - D", 1)
    with pytest.raises(fs.UnknownNameError, match="unknown taper 'han'; did you mean 'hann'"):
        meshed.spectrum("x", taper="han")
    with pytest.raises(fs.UnknownNameError, match="unknown column 'y'"):
        meshed.spectrum("y")
    with pytest.raises(fs.UnknownNameError, match="unknown column 'y'"):
        meshed.section("x", level=1.1)["y"]
    light = fs.simulate(
        fs.systems.gear_pair(),
        [1.1, 0],
        periods=3,
        integration=fs.Integration(rtol=1e-13),
        dense=False,
    )
    with pytest.raises(fs.ArgumentError, match="dense=True"):
        light.section("x")
    with pytest.raises(fs.ArgumentError, match="dense=True"):
        light.periodicity()
    assert light.section(interface="x - D").names == ("x", "v")
