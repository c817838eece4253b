"""The flow and its derivatives against closed forms, mpmath and SciPy."""

from concurrent.futures import ThreadPoolExecutor

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.linalg import expm, expm_frechet

import fastslow as fs
from fastslow.errors import ModelError, UnknownNameError
from fastslow.model.structure import TIME, real
from fastslow.orbits.flow.flows import fields, flow
from fastslow.orbits.flow.variations import variations_of

pytestmark = pytest.mark.slow

x, v, y, t, k, c, w, a = sp.symbols("x v y t k c w a")


def one(model, chosen, state, time, duration, mode=0, **options):
    """The flow of one segment."""
    variations = variations_of(model, chosen)
    return flow(
        variations,
        np.array([mode]),
        np.array([state], dtype=float),
        np.array([time], dtype=float),
        np.array([duration], dtype=float),
        variations.parameter_array(model),
        **options,
    )


def reference(model, chosen, state, time, duration, region="S1"):
    """End and derivatives by SciPy's DOP853, from the variational equations in SymPy."""
    names = [*model.states, *model.slow_states]
    laws = {real(n): law for n, law in model.regions[region].forcing.items()}
    rates = sp.Matrix([model.regions[region].rates[n].xreplace(laws) for n in names])
    symbols = [real(n) for n in names]
    values = {real(n): number for n, number in model.parameters.items()}
    matrices = rates, rates.jacobian(symbols), rates.jacobian([TIME, *map(real, chosen)])
    f, by_states, by_others = (sp.lambdify([TIME, symbols], m.subs(values)) for m in matrices)
    n, others = len(names), 1 + len(chosen)

    def rate(s, u):
        z, X = u[:n], u[n:].reshape(n, n + others)
        A, B = by_states(time + s, z), by_others(time + s, z)
        forced = np.hstack([np.zeros((n, n)), B])
        return np.concatenate([f(time + s, z).ravel(), (A @ X + forced).ravel()])

    start = np.concatenate([state, np.eye(n, n + others).ravel()])
    options = {"method": "DOP853", "rtol": 3e-14, "atol": 1e-15}
    end = solve_ivp(rate, (0, duration), start, **options).y[:, -1]
    return end[:n], end[n:].reshape(n, n + others)


class TestLinear:
    OSCILLATOR = fs.Model(
        {x: v, v: -k * x - c * v + a * sp.cos(w * t)}, parameters={k: 2, c: 0.3, w: 1.1, a: 0.7}
    )

    @staticmethod
    def extended(k, c, w, a):
        """The oscillator with cosine and sine of its forcing as states."""
        return np.array([[0, 1, 0, 0], [-k, -c, a, 0], [0, 0, 0, -w], [0, 0, w, 0]], dtype=float)

    @pytest.mark.parametrize("duration", [6.0, -2.5, 1e-9, 40.0])
    def test_states_and_columns(self, duration):
        time, state = 1.7, np.array([1.0, 0.5])
        values = {"k": 2.0, "c": 0.3, "w": 1.1, "a": 0.7}
        A = self.extended(**values)
        start = np.array([*state, np.cos(1.1 * time), np.sin(1.1 * time)])
        flows = one(self.OSCILLATOR, tuple(values), state, time, duration)
        whole = expm(A * duration)
        scale = max(1.0, np.abs(whole).max())
        close = {"rtol": 0, "atol": 3e-14 * scale * max(1.0, abs(duration))}
        np.testing.assert_allclose(flows.ends[0], (whole @ start)[:2], **close)
        np.testing.assert_allclose(flows.slopes[0, :, :2], whole[:2, :2], **close)
        by_phase = np.array([0, 0, -start[3], start[2]])
        np.testing.assert_allclose(flows.slopes[0, :, 2], 1.1 * (whole @ by_phase)[:2], **close)
        for place, name in enumerate(values, start=3):
            moved = self.extended(**{**values, name: values[name] + 1}) - A
            slope = expm_frechet(A * duration, moved * duration, compute_expm=False) @ start
            if name == "w":
                slope = slope + whole @ (by_phase * time)
            tolerance = {"rtol": 1e-12, "atol": 3e-13 * scale * max(1.0, abs(duration))}
            np.testing.assert_allclose(flows.slopes[0, :, place], slope[:2], **tolerance)
        assert flows.traces[0] == pytest.approx(-0.3 * duration, rel=1e-14)
        assert flows.reached[0] == duration

    def test_no_duration_is_the_identity(self):
        flows = one(self.OSCILLATOR, ("k",), [1, 2], 0.5, 0)
        assert flows.ends.tolist() == [[1, 2]]
        assert flows.slopes.tolist() == [np.eye(2, 4).tolist()]
        assert flows.traces.tolist() == [0]
        assert len(flows.factors) == 0

    def test_there_and_back(self):
        there = one(self.OSCILLATOR, (), [1, 2], 0.5, 3)
        back = one(self.OSCILLATOR, (), there.ends[0], 3.5, -3)
        np.testing.assert_allclose(back.ends[0], [1, 2], atol=3e-15)
        product = back.slopes[0, :, :2] @ there.slopes[0, :, :2]
        np.testing.assert_allclose(product, np.eye(2), atol=5e-15)

    def test_an_equilibrium_at_zero(self):
        model = fs.Model({x: v, v: -k * x - v}, parameters={k: 5})
        flows = one(model, ("k",), [0, 0], 0, 7)
        assert not flows.ends.any()
        exact = expm(np.array([[0.0, 1], [-5, -1]]) * 7)
        np.testing.assert_allclose(flows.slopes[0, :, :2], exact, rtol=1e-12)
        assert not flows.slopes[0, :, 2:].any()

    def test_a_chain_that_couples_late(self):
        states = sp.symbols("s1:11")
        model = fs.Model({states[0]: -states[0], **dict(zip(states[1:], states, strict=False))})
        A = np.diag(np.ones(9), -1)
        A[0, 0] = -1
        flows = one(model, (), [1.0, *[0.0] * 9], 0, 2.0)
        with mpmath.workdps(40):
            exact = np.array(mpmath.expm(mpmath.matrix(2 * A)).tolist(), dtype=float)
        exact[np.triu_indices(10, 1)] = 0
        np.testing.assert_allclose(flows.slopes[0, :, :10], exact, rtol=1e-14)


class TestNonlinear:
    def test_against_mpmath(self):
        # a pendulum with drag, with 20 digits
        model = fs.Model({x: v, v: -k * sp.sin(x) - c * v * sp.Abs(a) + sp.cos(t)},
                         parameters={k: 1.3, c: 0.1, a: 1})  # fmt: skip
        flows = one(model, ("k",), [1.0, 0.2], 0.3, 1.0)
        with mpmath.workdps(20):
            K, C = mpmath.mpf(1.3), mpmath.mpf(0.1)

            def rates(s, u):
                X = [[u[2 + 4 * i + j] for j in range(4)] for i in range(2)]
                g = -K * mpmath.cos(u[0])
                others = [0, 0, -mpmath.sin(s), -mpmath.sin(u[0])]
                lower = [g * X[0][j] - C * X[1][j] + others[j] for j in range(4)]
                return [u[1], -K * mpmath.sin(u[0]) - C * u[1] + mpmath.cos(s), *X[1], *lower]

            t0 = mpmath.mpf(0.3)
            start = [1, mpmath.mpf(0.2), *[1, 0, 0, 0], *[0, 1, 0, 0]]
            end = np.array([float(u) for u in mpmath.odefun(rates, t0, start)(t0 + 1)])
        np.testing.assert_allclose(flows.ends[0], end[:2], rtol=2e-14)
        np.testing.assert_allclose(flows.slopes[0], end[2:].reshape(2, 4), rtol=3e-14)

    @pytest.mark.parametrize(
        ("model", "chosen", "state", "duration"),
        [
            (fs.Model({x: v, v: k * (1 - x**2) * v - x}, parameters={k: 3}), "k", [2, 0.1], 9),
            (
                fs.Model({x: a - (k + 1) * x + x**2 * y, y: k * x - x**2 * y},
                         parameters={a: 1, k: 3}),
                "ka", [1, 1], 8,
            ),
            (
                fs.Model({x: sp.tanh(x - y) - x / (1 + x**2),
                          y: sp.exp(-x) * sp.sqrt(1 + y**2) / k}, parameters={k: 4}),
                "k", [0.3, 0.2], 5,
            ),
            (fs.Model({x: k * (y - x), y: x * (28 - v) - y, v: x * y - 8 * v / 3},
                      parameters={k: 10}), "k", [1, 2, 20], 2),
        ],
        ids=["van der Pol", "Brusselator", "functions", "Lorenz"],
    )  # fmt: skip
    def test_against_dop853(self, model, chosen, state, duration):
        flows = one(model, tuple(chosen), state, 0.4, duration)
        end, slopes = reference(model, tuple(chosen), state, 0.4, duration)
        np.testing.assert_allclose(flows.ends[0], end, rtol=1e-10)
        size = np.abs(slopes).max(axis=0) + 1e-300
        np.testing.assert_allclose(flows.slopes[0] / size, slopes / size, atol=1e-10)
        assert np.exp(flows.traces[0]) == pytest.approx(
            np.prod(np.linalg.det(flows.factors)), rel=1e-12
        )

    def test_ten_states(self):
        # a chain of masses with hardening springs, driven at its end
        q, u = sp.symbols("q1:6"), sp.symbols("u1:6")
        ends = [0, *q, 0]
        force = [k * s + a * s**3 for s in (ends[i + 1] - ends[i] for i in range(6))]
        rates = dict(zip(q, u, strict=True))
        rates |= {u[i]: force[i + 1] - force[i] - c * u[i] for i in range(5)}
        rates[u[4]] += sp.cos(w * t)
        model = fs.Model(rates, parameters={k: 1.5, a: 0.4, c: 0.05, w: 1.3})
        state = np.linspace(-0.5, 0.7, 10)
        flows = one(model, ("w", "a"), state, 0.1, 6.0)
        end, slopes = reference(model, ("w", "a"), state, 0.1, 6.0)
        np.testing.assert_allclose(flows.ends[0], end, atol=2e-11)
        np.testing.assert_allclose(flows.slopes[0], slopes, atol=2e-10)
        assert flows.traces[0] == pytest.approx(-0.05 * 5 * 6, rel=1e-14)

    def test_laws_are_substituted(self):
        model = fs.Model({x: -x + y}, forcing={y: a * sp.sin(w * t)}, parameters={a: 2, w: 3})
        plain = fs.Model({x: -x + a * sp.sin(w * t)}, parameters={a: 2, w: 3})
        both = [one(m, ("w", "a"), [0.5], 0.2, 4.0) for m in (model, plain)]
        np.testing.assert_allclose(both[0].slopes, both[1].slopes, rtol=1e-13)
        assert np.abs(both[0].slopes[0, 0, 1:]).min() > 1e-3


class TestSeveralSegments:
    def test_segments_are_independent(self):
        gear = fs.systems.harmonic_gear(omega=1)
        variations = variations_of(gear, ("D", "omega"))
        p = variations.parameter_array(gear)
        modes = np.array([0, 1, 2, 1])
        states = np.array([[0.3, 0.1], [0.2, -1.0], [-0.3, 0.2], [0.0, 1.0]])
        times, durations = np.array([0.0, 0.3, 1.1, 5.0]), np.array([0.4, 0.3, -0.2, 0.0])
        flows = flow(variations, modes, states, times, durations, p)
        for j in range(4):
            row = slice(j, j + 1)
            alone = flow(variations, modes[row], states[row], times[row], durations[row], p)
            assert (alone.ends[0] == flows.ends[j]).all()
            assert (alone.slopes[0] == flows.slopes[j]).all()
            assert (alone.factors == flows.factors_of(j)).all()
        for j, region in enumerate(["S1", "S2"]):
            given = states[j], times[j], durations[j], region
            end, slopes = reference(gear, ("D", "omega"), *given)
            np.testing.assert_allclose(flows.ends[j], end, atol=1e-12)
            np.testing.assert_allclose(flows.slopes[j], slopes, atol=1e-12)

    def test_threads_do_not_share_work_space(self):
        gear = fs.systems.harmonic_gear(omega=1)
        variations = variations_of(gear, ("D",))
        p = variations.parameter_array(gear)

        def ends(x0):
            start = np.array([[x0, 0.0]])
            zero, one = np.zeros(1, dtype=int), np.full(1, 30.0)
            return flow(variations, zero, start, zero.astype(float), one, p).slopes

        values = np.linspace(0.26, 0.5, 40)
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(ends, values))
        assert all((ends(v) == w).all() for v, w in zip(values, together, strict=True))

    def test_a_region_is_continued_past_its_border(self):
        gear = fs.systems.harmonic_gear(omega=1)
        flows = one(gear, (), [0.2, -3.0], 0.0, 1.0, mode=1)
        # x' = v, v' = w - v in the gap, far beyond x = -D
        end, _ = reference(gear, (), [0.2, -3.0], 0.0, 1.0, "S2")
        assert end[0] < -0.3
        np.testing.assert_allclose(flows.ends[0], end, rtol=1e-12)

    def test_sliding(self):
        # on a belt: the relay slides on x = a sin t, where x' = a cos t
        relay = fs.Model({x: -2 * sp.sign(x - y), y: a * sp.cos(t)}, parameters={a: 0.7})
        variations = variations_of(relay, ("a",))
        mode = variations.modes.index("S1|S2")
        flows = one(relay, ("a",), [0.1, 0.1], 0.2, 1.5, mode=mode)
        moved = np.sin(1.7) - np.sin(0.2)
        np.testing.assert_allclose(flows.ends[0], 0.1 + 0.7 * moved, rtol=1e-14)
        expected = np.array([[1, 0], [0, 1]])
        np.testing.assert_allclose(flows.slopes[0, :, :2], expected, atol=1e-15)
        np.testing.assert_allclose(flows.slopes[0, :, 3], moved, rtol=1e-14)
        by_time = 0.7 * (np.cos(1.7) - np.cos(0.2))
        np.testing.assert_allclose(flows.slopes[0, :, 2], by_time, rtol=1e-14)


class TestContraction:
    def test_a_settled_phase_keeps_its_rates(self):
        """The gear at rest under a slow load: log det = -T though no entry is above 1e-60."""
        gear = fs.systems.harmonic_gear(omega=0.01)
        flows = one(gear, ("omega",), [0.3068, 0.0], 0.0, 300.0)
        assert np.abs(flows.slopes[0, :, :2]).max() < 1e-60
        logs = np.log(np.abs(np.linalg.det(flows.factors)))
        assert logs.sum() == pytest.approx(-300, rel=1e-12)
        assert flows.traces[0] == pytest.approx(-300, rel=1e-14)
        # both multipliers have modulus exp(-150): a focus with slowly changing frequency
        for matrix in flows.factors:
            inverse = np.linalg.inv(matrix)
            assert (np.abs(matrix) * np.abs(inverse.T)).sum() < 1e4

    def test_underflow(self):
        model = fs.Model({x: -k * x, y: -y}, parameters={k: 50})
        flows = one(model, (), [1.0, 1.0], 0.0, 40.0)
        assert flows.slopes[0, 0, 0] == 0
        logs = np.log([np.diag(m) for m in flows.factors]).sum(axis=0)
        np.testing.assert_allclose(logs, [-2000, -40], rtol=1e-13)
        assert len(flows.factors) > 50

    def test_units_do_not_matter(self):
        def counts(unit):
            model = fs.Model({x: v * unit, v: -(x**3) / unit**3 - c * v}, parameters={c: 0.1})
            flows = one(model, (), [1.3 * unit, 0.4], 0.0, 30.0)
            return len(flows.factors), flows.ends[0] / [unit, 1]

        (few, end), (other, moved) = counts(1.0), counts(1e-9)
        assert few == other
        np.testing.assert_allclose(end, moved, rtol=1e-12)


class TestTrouble:
    def test_blow_up_is_seen_in_the_duration_reached(self):
        flows = one(fs.Model({x: x**2}), (), [1.0], 0.0, 2.0)
        assert 0.9 < flows.reached[0] <= 1.0

    def test_limit_of_steps(self):
        model = fs.Model({x: -k * x}, parameters={k: 100})
        flows = one(model, (), [1.0], 0.0, 1.0, max_steps=3)
        assert 0 < flows.reached[0] < 0.5
        assert np.prod(flows.factors) == pytest.approx(np.exp(-100 * flows.reached[0]), rel=1e-13)

    def test_not_finite(self):
        flows = one(fs.Model({x: sp.sqrt(x)}), (), [-1.0], 0.0, 1.0)
        assert flows.reached[0] == 0
        assert flows.ends[0, 0] == -1

    def test_functions_without_recurrence(self):
        with pytest.raises(ModelError, match="none for gamma; write the model without it"):
            variations_of(fs.Model({x: -sp.gamma(x)}))

    def test_unknown_parameter(self):
        with pytest.raises(UnknownNameError, match="'kk'"):
            variations_of(fs.Model({x: -k * x}, parameters={k: 1}), ("kk",))


def test_fields():
    gear = fs.systems.harmonic_gear(omega=1)
    variations = variations_of(gear, ("omega", "D"))
    p = variations.parameter_array(gear)
    states, times = np.array([[0.3, 0.1], [0.2, 2]]), np.array([2.0, 3])
    found = fields(variations, np.array([0, 1]), states, times, p)
    values = gear.parameters
    A, B, C, D = (values[n] for n in "ABCD")
    load = B + C * np.sin([2.0, 3.0])
    np.testing.assert_allclose(
        found.f, [[0.1, load[0] - 0.1 - (0.09 + A) * (0.3 - D)], [2, load[1] - 2]], rtol=1e-14
    )
    slope = -2 * 0.3 * (0.3 - D) - (0.09 + A)
    np.testing.assert_allclose(
        found.f_u[0],
        [[0, 1, 0, 0, 0], [slope, -1, C * np.cos(2), 2 * C * np.cos(2), 0.09 + A]],
        rtol=1e-14,
    )
    heights = sorted((0.3 - D, 0.3 + D)) if found.g[0, 0] < 0.3 else [0.3 + D, 0.3 - D]
    np.testing.assert_allclose(found.g[0, :2], heights, rtol=1e-14)
    assert sorted(found.g_u[0, :2].tolist()) == [[1, 0, 0, 0, -1], [1, 0, 0, 0, 1]]
