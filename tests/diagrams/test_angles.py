"""States modulo a period: the pendulum in closed form, and what knows of the period."""

import matplotlib as mpl
import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq, root

import fastslow as fs
from fastslow.plot.quantities import along_branch, of_diagram

pytestmark = pytest.mark.slow

mpl.use("Agg")

theta, omega, p, a, t = sp.symbols("theta omega p a t")
TURN = {theta: 2 * sp.pi}


def pendulum(**values):
    """θ'' + a θ' + sin θ = p: equilibria arcsin p and π − arcsin p."""
    rates = {theta: omega, omega: p - sp.sin(theta) - a * omega}
    return fs.Model(rates, parameters={"p": 0.5, "a": 0.5, **values}, periodic=TURN)


@pytest.fixture(scope="module")
def whole():
    return fs.continue_equilibria(pendulum(), p, (-2, 2))


# ---------------------------------------------------------------- the model


def test_the_period_is_part_of_the_model():
    model = pendulum()
    assert model.periodic == {"theta": pytest.approx(2 * np.pi, rel=1e-15)}
    assert "theta modulo 2*pi" in repr(model)
    assert model.equations.endswith("theta modulo 2*pi")
    assert r"\theta \bmod 2 \pi" in model.to_latex()
    for other in (
        model.with_parameters(a=1),
        model.with_free("p"),
        model.with_ramp("p", 0.1),
        model.with_ramp("p", 0.1).frozen(),
    ):
        assert other.periodic == model.periodic


@pytest.mark.parametrize("period", [2 * sp.pi, 4 * np.pi, "2*pi", 6.283185307179586])
def test_periods_as_they_are_written(period):
    rates = {theta: omega, omega: sp.Abs(sp.sin(theta)) - omega}
    assert fs.Model(rates, periodic={"theta": period}).periodic["theta"] > 6


@pytest.mark.parametrize(
    ("rate", "period", "words"),
    [
        (1 - theta, 2 * sp.pi, "the rate of theta, 1 - theta, is not periodic in theta"),
        (sp.sin(theta), 3, "theta modulo 3: the rate of theta, sin\\(theta\\), is not periodic"),
        (sp.sin(theta / 2), 2 * sp.pi, "is not periodic"),
        (sp.sign(theta - 1), 2 * sp.pi, "is not periodic"),
        (sp.sin(theta), -1, "period of theta: expected a positive number"),
        (sp.sin(theta), theta, "period of theta: expected a positive number"),
        (sp.sin(theta), True, "period of theta: expected a positive number"),
        (sp.sin(theta), sp.oo, "period of theta: expected a positive number"),
    ],
)
def test_what_does_not_repeat(rate, period, words):
    with pytest.raises(fs.ModelError, match=words):
        fs.Model({theta: rate}, periodic={theta: period})


def test_an_interface_that_does_not_repeat():
    with pytest.raises(fs.ModelError, match="the interface edge, theta - 1, is not periodic"):
        fs.Model({theta: sp.sin(theta)}, interfaces={"edge": theta - 1}, periodic=TURN)


def test_a_name_that_is_no_state():
    with pytest.raises(fs.UnknownNameError, match="unknown state in periodic 'thet'"):
        fs.Model({theta: sp.sin(theta)}, periodic={"thet": 2 * sp.pi})


# ---------------------------------------------------------------- equilibria and branches


@pytest.mark.parametrize("value", [-0.9, -1e-3, 0.0, 0.5, 0.999])
def test_two_equilibria_in_the_principal_range(value):
    found = sorted(e["theta"] for e in fs.equilibria(pendulum(p=value)))
    other = np.pi - np.arcsin(value)
    expected = sorted([np.arcsin(value), other if other <= np.pi else other - 2 * np.pi])
    np.testing.assert_allclose(found, expected, atol=1e-13)


def test_one_closed_branch(whole):
    (branch,) = whole
    assert branch.closed
    np.testing.assert_allclose(np.sin(branch["theta"]), branch["p"], atol=1e-14)
    assert abs(np.ptp(branch["theta"]) - 2 * np.pi) < 1e-12
    assert len(branch) < 400
    assert sorted(round(q["p"], 12) for q in whole.folds) == [-1, 1]
    np.testing.assert_allclose(sorted(q["theta"] for q in whole.folds), [-np.pi / 2, np.pi / 2])


@pytest.mark.sample(2)
@pytest.mark.parametrize("over", [(-0.5, 2), (-2, 0.3), (-0.5, 0.5), (0, 0.5), (0.2, 0.9)])
def test_a_part_of_it_once(over):
    diagram = fs.continue_equilibria(pendulum(), p, over)
    assert len(diagram) == (1 if over[1] > 1 or over[0] < -1 else 2)
    middle = 0.5 * (max(over[0], -1) + min(over[1], 1))
    found = sorted(e["theta"] for e in diagram.at(p=middle))
    assert len(found) == 2
    np.testing.assert_allclose(np.sin(found), middle, atol=1e-14)
    assert np.abs(found).max() <= np.pi


def test_nearest_modulo_the_period(whole):
    for turns in (-3, 0, 20):
        point = whole.nearest(theta=0.3 + 2 * np.pi * turns, p=np.sin(0.3))
        assert point["theta"] == pytest.approx(0.3, abs=1e-5)
        assert whole[0].nearest(theta=3.1 + 2 * np.pi * turns, p=0.0)["theta"] > 3


def test_seeds_and_windows_modulo_the_period(whole):
    far = {theta: 0.5 + 20 * np.pi, omega: 0, p: np.sin(0.5)}
    diagram = fs.continue_equilibria(pendulum(), p, (-2, 2), from_points=[far])
    assert len(diagram) == 1
    assert diagram[0].closed
    upper = fs.continue_equilibria(pendulum(), p, (-2, 2), window={theta: (2, 5)})
    (branch,) = upper
    assert sorted(branch["theta"][[0, -1]].tolist()) == [2, 5]
    assert len(fs.equilibria(pendulum(), window={theta: (2, 5)})) == 1
    assert len(fs.equilibria(pendulum(), window={theta: (2 + 2 * np.pi, 5 + 2 * np.pi)})) == 1


@pytest.mark.parametrize("ends", [(2, 50), (2, None), (-np.inf, np.inf)])
def test_a_window_longer_than_the_period(ends):
    with pytest.raises(fs.ArgumentError, match=r"no longer than the period 6\.28319 of theta"):
        fs.continue_equilibria(pendulum(), p, (-2, 2), window={theta: ends})


def test_through_an_interface_at_every_turn():
    """θ' = p − |sin θ|: four equilibria in a turn, folds and corners in each half of it."""
    model = fs.Model({theta: p - sp.Abs(sp.sin(theta))}, parameters={p: 0.5}, periodic=TURN)
    assert len(fs.equilibria(model)) == 4
    diagram = fs.continue_equilibria(model, p, (-1, 2))
    (branch,) = diagram
    assert branch.closed
    np.testing.assert_allclose(np.abs(np.sin(branch["theta"])), branch["p"], atol=1e-14)
    assert len(diagram.folds) == 2
    assert len(diagram.boundary_equilibria) == 2


def test_two_angles():
    """Two uncoupled rotors: 4 equilibria of the torus, no copies."""
    phi = sp.symbols("phi")
    rates = {theta: p - sp.sin(theta), phi: p / 2 - sp.sin(phi)}
    model = fs.Model(rates, parameters={p: 0.5}, periodic={theta: 2 * sp.pi, phi: 2 * sp.pi})
    assert len(fs.equilibria(model)) == 4
    diagram = fs.continue_equilibria(model, p, (-3, 3))
    assert sum(b.closed for b in diagram) == len(diagram) == 2


def test_a_file_keeps_the_period(whole, tmp_path):
    whole.save(tmp_path / "pendulum.npz")
    again = fs.load(tmp_path / "pendulum.npz")
    assert again.periods == whole.periods
    assert again.nearest(theta=0.3 - 6 * np.pi, p=0.29)["theta"] == pytest.approx(0.294, abs=1e-2)


def test_collapse_of_a_grid():
    """A generator over a lossless line, P = 2 sin δ: the power limit is the fold δ = π/2."""
    delta, P, v = sp.symbols("delta P v")
    rates = {delta: v, v: P - 2 * sp.sin(delta) - v / 10}
    grid = fs.Model(rates, parameters={P: 1}, periodic={delta: 2 * sp.pi})
    diagram = fs.continue_equilibria(grid, P, (0, 3))
    assert len(diagram) == 1
    (fold,) = diagram.folds
    assert fold["P"] == pytest.approx(2, rel=1e-14)
    assert fold["delta"] == pytest.approx(np.pi / 2, rel=1e-7)


# Constants of the grid of Dobson and Chiang, angles in radians: the line as a Thévenin
# equivalent, the generator, and the load (a motor beside a constant demand).
LINE_E, LINE_Y, LINE_ANGLE = sp.Rational(5, 2), 8, -sp.pi / 15
EMF, GENERATOR_Y, GENERATOR_ANGLE, INERTIA, DAMPING, POWER = (
    1, 5, -sp.pi / 36, sp.Rational(3, 10), sp.Rational(1, 20), 1,
)  # fmt: skip
KPW, KPV, KQW, KQV, KQV2, LAG, DEMAND_P, DEMAND_Q = map(
    sp.Rational, ("0.4", "0.3", "-0.03", "-2.8", "2.1", "8.5", "0.6", "1.3")
)


def voltage_collapse():
    """Generator, line and dynamic load; the reactive demand Q1 is the parameter.

    I. Dobson, H.-D. Chiang, J. S. Thorp, L. Fekih-Ahmed, A model of voltage collapse in
    electric power systems, Proc. 27th IEEE CDC (1988); I. Dobson, H.-D. Chiang, Towards a
    theory of voltage collapse in electric power systems, Systems & Control Letters 13 (1989).
    """
    rotor, speed, phase, volts, demand = sp.symbols("delta_m omega delta V Q1")
    line, between = phase + LINE_ANGLE, phase - rotor
    active = (
        -LINE_E * LINE_Y * volts * sp.sin(line)
        - EMF * GENERATOR_Y * volts * sp.sin(between + GENERATOR_ANGLE)
        + (LINE_Y * sp.sin(LINE_ANGLE) + GENERATOR_Y * sp.sin(GENERATOR_ANGLE)) * volts**2
    )
    reactive = (
        LINE_E * LINE_Y * volts * sp.cos(line)
        + EMF * GENERATOR_Y * volts * sp.cos(between + GENERATOR_ANGLE)
        - (LINE_Y * sp.cos(LINE_ANGLE) + GENERATOR_Y * sp.cos(GENERATOR_ANGLE)) * volts**2
    )
    torque = (
        POWER
        + EMF * GENERATOR_Y * volts * sp.sin(between - GENERATOR_ANGLE)
        + EMF**2 * GENERATOR_Y * sp.sin(GENERATOR_ANGLE)
    )
    unmet = reactive - DEMAND_Q - demand
    rates = {
        rotor: speed,
        speed: (torque - DAMPING * speed) / INERTIA,
        phase: (unmet - KQV * volts - KQV2 * volts**2) / KQW,
        volts: (
            KPW * KQV2 * volts**2
            + (KPW * KQV - KQW * KPV) * volts
            + KQW * (active - DEMAND_P)
            - KPW * unmet
        )
        / (LAG * KQW * KPV),
    }
    turn = 2 * sp.pi
    return fs.Model(rates, parameters={demand: 10}, periodic={rotor: turn, phase: turn})


@pytest.mark.sample(0)
def test_voltage_collapse_has_one_branch_and_its_known_loads():
    """Hopf points at Q1 = 10.946 and 11.407 and the fold at 11.411, by SciPy from the rates."""
    model = voltage_collapse()
    states, demand = sp.symbols("delta_m omega delta V"), sp.Symbol("Q1")
    rates = sp.Matrix([model.regions["S1"].rates[s] for s in model.states])
    plain = rates.subs({s: sp.Symbol(s.name) for s in rates.free_symbols})
    field = sp.lambdify([*states, demand], plain)
    jacobian = sp.lambdify([*states, demand], plain.jacobian(states))

    def rest(volts):
        """Angles and demand at rest with this voltage."""
        start = (0.35, 0.14, 11.4)
        found = root(lambda z: field(z[0], 0, z[1], volts, z[2])[1:].ravel(), start, tol=1e-14)
        assert np.abs(found.fun).max() < 1e-9
        return found.x

    def growth(volts):
        first, second, load = rest(volts)
        values = np.linalg.eigvals(jacobian(first, 0, second, volts, load).astype(float))
        return values[np.abs(values.imag) > 1].real.max()

    def determinant(volts):
        first, second, load = rest(volts)
        return np.linalg.det(jacobian(first, 0, second, volts, load).astype(float))

    hopf = [brentq(growth, *ends, xtol=1e-14) for ends in ((1.05, 1.15), (0.935, 0.95))]
    fold = brentq(determinant, 0.92, 0.935, xtol=1e-14)
    loads = [rest(volts)[2] for volts in (*hopf, fold)]
    assert loads == pytest.approx([10.946, 11.407, 11.411], abs=6e-4)

    diagram = fs.continue_equilibria(model, "Q1", (9, 12))
    (branch,) = diagram
    assert diagram.unexplained == ()
    assert len(branch) < 200
    first, second = branch.special("HB")
    assert [first["Q1"], second["Q1"]] == pytest.approx(loads[:2], rel=1e-12)
    assert [first["V"], second["V"]] == pytest.approx(hopf, rel=1e-9)
    assert [first.criticality, second.criticality] == ["subcritical", "supercritical"]
    (last,) = diagram.folds
    assert last["Q1"] == pytest.approx(loads[2], rel=1e-12)
    assert last["V"] == pytest.approx(fold, rel=1e-6)
    # the operating point and the one of low voltage, in the principal range of both angles
    assert len(fs.equilibria(model)) == 2
    high, low = sorted(diagram.at(Q1=10), key=lambda e: -e["V"])
    assert (high.stable, low.stable) == (True, False)


# ---------------------------------------------------------------- runs


@pytest.fixture(scope="module")
def rotating():
    return fs.simulate(pendulum(p=1.2), [0.0, 0.0], t=(0, 60))


def test_a_run_keeps_the_unwrapped_angle(rotating):
    assert rotating["theta"][-1] > 20 * np.pi
    assert rotating.periods == {"theta": pytest.approx(2 * np.pi)}


def test_a_section_at_an_angle(rotating):
    """Every turn passes θ = 0.3 once, on its way up."""
    section = rotating.section("theta", level=0.3)
    turns = int((rotating["theta"][-1] - 0.3) // (2 * np.pi)) + 1
    assert len(section) == turns
    np.testing.assert_allclose(np.mod(section["theta"], 2 * np.pi), 0.3, atol=1e-9)
    assert (section.directions == 1).all()
    assert (np.diff(section.t) > 0).all()


def test_a_rotation_repeats(rotating):
    """After one turn: the period solves the energy balance; here against the section."""
    steady = rotating.periodicity()
    assert steady.outcome.code == "periodic"
    assert steady.multiple == 1
    times = rotating.section("theta", level=0.0).t
    assert steady.period == pytest.approx(times[-1] - times[-2], rel=1e-6)


def test_the_nearest_moment_modulo_the_period(rotating):
    found = rotating.nearest(theta=1000.3, omega=3.0)
    away = (found["theta"] - 1000.3 + np.pi) % (2 * np.pi) - np.pi
    assert abs(away) < 1.0


def test_an_overlay_modulo_the_period():
    """A run ten turns off follows the same branch, and leaves it at the fold p = 1."""
    model = fs.Model(
        {theta: omega, omega: p - sp.sin(theta) - omega / 2},
        forcing={p: sp.Rational(1, 2) + t / 200},
        periodic=TURN,
    )
    diagram = fs.continue_equilibria(model.frozen(), p, (0, 1.4))
    runs = [fs.simulate(model, [np.arcsin(0.5) + 2 * np.pi * k, 0.0], t=(0, 150)) for k in (0, 10)]
    first, second = (fs.overlay(diagram, run) for run in runs)
    for overlay in (first, second):
        assert overlay.transitions[0].special.code == "LP"
        assert overlay.phases[0].type == "quasi-static"
        assert overlay.phases[-1].type == "oscillating"
    assert second.transitions[0].time == pytest.approx(first.transitions[0].time, rel=1e-6)
    inside = first.t < 90
    assert first.distance[inside].max() < 0.05


# ---------------------------------------------------------------- figures


def test_a_diagram_is_drawn_in_the_principal_range(whole):
    drawn = fs.plot.diagram(whole)
    for line in drawn.lines:
        heights = line.get_ydata()
        assert np.nanmax(np.abs(heights)) <= np.pi
        # no line across the jump
        assert np.nanmax(np.abs(np.diff(heights))) < 1.0
    ends = np.concatenate([line.get_ydata() for line in drawn.lines])
    assert np.nanmax(ends) == pytest.approx(np.pi)
    assert np.nanmin(ends) == pytest.approx(-np.pi)
    (heights,) = along_branch(whole, whole[0], of_diagram(whole, "theta", ""))
    assert np.abs(heights).max() <= np.pi
    # an expression in the angle is drawn as it is
    assert np.ptp(fs.plot.diagram(whole, "sin(theta)").lines[0].get_ydata()) > 0.5


def test_a_rotation_is_drawn_in_parts(rotating):
    for drawn in (
        fs.plot.phase_portrait(rotating),
        fs.plot.time_series(rotating, "theta"),
        fs.plot.phase_portrait(rotating, "theta", "omega", "t"),
    ):
        assert drawn.lines
    turns = fs.plot.time_series(rotating, "theta").lines[-1].get_ydata()
    assert np.isnan(turns).sum() == int((rotating["theta"][-1] + np.pi) // (2 * np.pi))
