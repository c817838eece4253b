"""Floquet multipliers of products of matrices against mpmath and closed forms."""

import mpmath
import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.kernels.saltations import saltation
from fastslow.orbits.flow.flows import fields, flow
from fastslow.orbits.flow.multipliers import multipliers_of, orbit_multipliers
from fastslow.orbits.flow.variations import variations_of

x, v, y, t, k, c, w, a = sp.symbols("x v y t k c w a")


def exact(factors, digits=400):
    """Logarithms of the moduli and the phases, with many digits."""
    with mpmath.workdps(digits):
        product = mpmath.eye(factors.shape[1])
        for factor in factors:
            product = mpmath.matrix(factor.tolist()) * product
        values = [product[0, 0]]
        if len(product) > 1:
            values = mpmath.eig(product, left=False, right=False)
        values = sorted(values, key=lambda z: (-abs(z), -mpmath.arg(z)))
        logs = np.array([float(mpmath.log(abs(z))) for z in values])
        return logs, np.array([float(mpmath.arg(z)) for z in values])


def phases(values):
    return np.abs(np.angle(values))


class TestProducts:
    @pytest.mark.parametrize("n", [1, 2, 3, 5])
    def test_random_products(self, n):
        factors = np.random.default_rng(n).standard_normal((200, n, n))
        values, logs, trivial = multipliers_of(factors)
        expected, arguments = exact(factors)
        np.testing.assert_allclose(logs, expected, rtol=1e-12, atol=1e-11)
        assert trivial is None
        finite = (values != 0) & np.isfinite(values)
        np.testing.assert_allclose(phases(values[finite]), np.abs(arguments[finite]), atol=1e-9)

    def test_from_1e_minus_300_to_1e30(self):
        rng = np.random.default_rng(7)
        sizes = 10.0 ** np.array([30, 0.1, 0, -0.1, -20, -300])
        bases = [np.linalg.qr(rng.standard_normal((6, 6)))[0] for _ in range(300)]
        step = np.diag(sizes ** (1 / 300)) + np.triu(np.full((6, 6), 0.1), 1)
        factors = np.array([bases[(i + 1) % 300] @ step @ bases[i].T for i in range(300)])
        values, logs, _ = multipliers_of(factors)
        expected, _ = exact(factors, 700)
        np.testing.assert_allclose(logs, np.log(sizes), atol=1e-9, rtol=1e-10)
        np.testing.assert_allclose(logs, expected, atol=1e-10, rtol=1e-12)
        assert (np.sign(values.real) == 1).all()

    def test_a_wide_pair_of_complex_pairs(self):
        rng = np.random.default_rng(3)
        block = np.zeros((5, 5))
        for place, (size, angle) in enumerate([(0.9, 0.3), (1e-4, 1.1)]):
            turn = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
            part = slice(2 * place, 2 * place + 2)
            block[part, part] = size * np.array(turn)
        block[4, 4] = -0.5
        bases = [rng.standard_normal((5, 5)) for _ in range(12)]
        factors = [bases[(i + 1) % 12] @ block @ np.linalg.inv(bases[i]) for i in range(12)]
        values, logs, _ = multipliers_of(np.array(factors))
        expected = 12 * np.log([0.9, 0.9, 0.5, 1e-4, 1e-4])
        # rounding errors of factors of condition 300, in units of the smallest modulus: 7e-10
        np.testing.assert_allclose(logs, expected, rtol=1e-14, atol=7e-10)
        angles = np.abs(np.angle(np.exp(1j * 12 * np.array([0.3, 0.3, np.pi / 2 * 4, 1.1, 1.1]))))
        np.testing.assert_allclose(phases(values), angles, atol=1e-11)
        assert values[0] == values[1].conjugate()
        assert values[0].imag > 0

    def test_equal_moduli(self):
        rng = np.random.default_rng(5)
        step = np.diag([-0.7, 0.7, 1e-3, -1e-3])
        bases = [rng.standard_normal((4, 4)) for _ in range(9)]
        factors = [bases[(i + 1) % 9] @ step @ np.linalg.inv(bases[i]) for i in range(9)]
        values, logs, _ = multipliers_of(np.array(factors))
        np.testing.assert_allclose(logs, 9 * np.log([0.7, 0.7, 1e-3, 1e-3]), rtol=1e-12)
        np.testing.assert_allclose(np.sort(values.real[:2]), [-(0.7**9), 0.7**9], rtol=1e-12)

    def test_a_geometric_sequence(self):
        # the gaps are too small for separation, and the whole range is too large for a product
        rng = np.random.default_rng(9)
        sizes = 0.3 ** np.arange(10)
        bases = [np.linalg.qr(rng.standard_normal((10, 10)))[0] for _ in range(8)]
        step = np.diag(sizes ** (1 / 8)) @ (np.eye(10) + np.triu(np.full((10, 10), 0.1), 1))
        factors = np.array([bases[(i + 1) % 8] @ step @ bases[i].T for i in range(8)])
        _, logs, _ = multipliers_of(factors)
        expected, _ = exact(factors, 60)
        np.testing.assert_allclose(logs, expected, atol=1e-11)

    def test_overflow_and_underflow(self):
        factors = np.array([[[1e-3, 0], [1, 10]]] * 1000)
        values, logs, _ = multipliers_of(factors)
        np.testing.assert_allclose(logs / np.log(10), [1000, -3000], rtol=1e-13)
        assert values.tolist() == [np.inf, 0]

    def test_zeros(self):
        rng = np.random.default_rng(2)
        factors = rng.standard_normal((6, 3, 3))
        normal, jump = rng.standard_normal(3), rng.standard_normal(3)
        factors[2] = np.eye(3) - np.outer(jump, normal) / (normal @ jump)
        values, logs, _ = multipliers_of(factors, zeros=1)
        expected, _ = exact(factors, 60)
        np.testing.assert_allclose(logs[:2], expected[:2], rtol=1e-12)
        assert values[2] == 0
        assert logs[2] == -np.inf

    def test_units_do_not_matter(self):
        factors = np.random.default_rng(1).standard_normal((50, 3, 3))
        units = np.array([1e-9, 1, 1e6])
        _, logs, _ = multipliers_of(factors)
        _, scaled, _ = multipliers_of(factors * units / units[:, None])
        np.testing.assert_allclose(scaled, logs, rtol=1e-12)

    def test_the_identity(self):
        values, logs, _ = multipliers_of(np.zeros((0, 2, 2)))
        assert values.tolist() == [1, 1]
        assert logs.tolist() == [0, 0]

    def test_a_second_multiplier_at_1(self):
        # of a Jordan block, two eigenvalues of the product alone would be 1 ± 1e-8
        rng = np.random.default_rng(4)
        tangents = rng.standard_normal((11, 3))
        tangents[10] = tangents[0]
        bases = [np.column_stack([f, *rng.standard_normal((2, 3))]) for f in tangents]
        bases[10] = bases[0]
        step = np.array([[1, 0.3, 0], [0, 1, 0], [0, 0, 0.2]])
        factors = [bases[i + 1] @ step @ np.linalg.inv(bases[i]) for i in range(10)]
        known = tangents.copy()
        known[[2, 3, 7]] = np.nan
        values, logs, trivial = multipliers_of(np.array(factors), tangents=known)
        np.testing.assert_allclose(logs, [0, 0, 10 * np.log(0.2)], atol=1e-12)
        np.testing.assert_allclose(values[:2], 1, atol=1e-12)
        assert trivial in (0, 1)

    @pytest.mark.filterwarnings("error")
    @pytest.mark.parametrize("zeros", [0, 1])
    @pytest.mark.parametrize("rows", [[0], [1], [0, 1]])
    def test_a_tangent_that_vanishes(self, zeros, rows):
        """At an equilibrium along the orbit the tangent is zero: nothing is known."""
        tangents = np.ones((3, 2))
        tangents[rows] = 0.0
        factors = np.array([np.eye(2), np.diag([1.0, 1.0 - zeros])])
        values, logs, trivial = multipliers_of(factors, zeros, tangents)
        assert np.isnan([values, logs]).all()
        assert trivial == 0


def orbit(model, chosen, modes, states, times, durations, ends):
    """Multipliers of segments that need not close."""
    variations = variations_of(model, chosen)
    p = variations.parameter_array(model)
    modes, times = np.array(modes), np.array(times, dtype=float)
    durations = np.array(durations, dtype=float)
    flows = flow(variations, modes, np.array(states, dtype=float), times, durations, p)
    until = times + durations
    before = fields(variations, modes, flows.ends, until, p)
    after = fields(variations, np.roll(modes, -1), flows.ends, until, p)
    return variations, modes, np.array(ends), flows, before, after


class TestOrbits:
    @pytest.mark.parametrize("damping", [1e-3, 0.1, 3.0])
    @pytest.mark.parametrize("omega", [0.01, 1.0])
    def test_the_determinant_of_a_damped_gear(self, damping, omega):
        """det M = exp(−c T), also where every multiplier underflows."""
        model = fs.Model(
            {x: v, v: -c * v - (x**2 + 40) * x + a * sp.cos(w * t)},
            parameters={c: damping, w: omega, a: 0.5},
        )
        period = 2 * np.pi / omega
        given = orbit(model, (), [0], [[0.5 / 40, 0.0]], [0.0], [period], [-1])
        found = orbit_multipliers(*given, autonomous=False)
        assert found.logs.sum() == pytest.approx(-damping * period, rel=1e-12)
        assert found.defect <= 1e-12 * max(1.0, damping * period)
        assert found.trivial is None
        assert found.stable

    def test_the_settled_gear(self):
        gear = fs.systems.harmonic_gear(omega=0.01)
        given = orbit(gear, (), [0], [[0.3068, 0.0]], [0.0], [600.0], [-1])
        found = orbit_multipliers(*given, autonomous=False)
        np.testing.assert_allclose(found.logs, -300, rtol=1e-12)
        assert (np.abs(found.values) < 1e-130).all()

    def test_a_circle_of_a_stable_cycle(self):
        """r' = r (1 − r²) with θ' = 1: multipliers 1 and exp(−4π)."""
        radius = x**2 + y**2
        model = fs.Model({x: x - y - x * radius, y: x + y - y * radius})
        given = orbit(model, (), [0, 0], [[1, 0], [0, 1]], [0, 0], np.pi * np.array([0.5, 1.5]),
                      [-1, -1])  # fmt: skip
        found = orbit_multipliers(*given, autonomous=True)
        np.testing.assert_allclose(found.logs, [0, -4 * np.pi], atol=1e-12)
        assert found.trivial == 0
        assert found.nontrivial.tolist() == [found.values[1]]
        assert found.stable

    def test_relay_oscillations(self):
        """y'' = −y with a relay: rotations and saltations in closed form."""
        model = fs.Model({x: y, y: -x - k * sp.sign(x) + a * sp.cos(t)}, parameters={k: 0.3, a: 0})
        given = orbit(model, (), [0, 1], [[0.0, 1.0], [0.0, -1.0]], [0, 0], [1.0, 1.0], [0, 0])
        found = orbit_multipliers(*given, autonomous=False)
        turn = np.array([[np.cos(1), np.sin(1)], [-np.sin(1), np.cos(1)]])
        product = np.eye(2)
        for side, state in zip([1, -1], given[3].ends, strict=True):
            before = np.array([state[1], -state[0] - 0.3 * side])
            jump = np.array([0.0, 0.6 * side])
            product = (np.eye(2) + np.outer(jump, [1, 0]) / before[0]) @ turn @ product
        expected = np.linalg.eigvals(product)
        order = np.lexsort((-expected.imag, -np.abs(expected)))
        np.testing.assert_allclose(found.values, expected[order], rtol=1e-13)
        assert found.defect < 1e-13

    def test_sliding_gives_an_exact_zero(self):
        relay = fs.Model({x: -2 * sp.sign(x - y), y: a * sp.cos(t)}, parameters={a: 0.7})
        variations = variations_of(relay)
        modes = [variations.modes.index(name) for name in ("S1", "S1|S2")]
        given = orbit(relay, (), modes, [[0.5, 0.0], [0.1, 0.1]], [0, 0.2], [0.2, 1.0], [0, -1])
        found = orbit_multipliers(*given, autonomous=False)
        assert found.logs[1] == -np.inf
        assert found.values[1] == 0
        assert np.isfinite(found.logs[0])


def test_saltation_of_an_entry_into_sliding():
    # at f⁺ the interface is not left: S is singular
    normal, before = np.array([1.0, 0.0, -0.3]), np.array([-2.0, 0.5])
    after = np.array([0.3, 0.5])
    matrix = saltation(before, after, normal)[:, :2]
    assert np.linalg.det(matrix) == pytest.approx(0, abs=1e-15)
    np.testing.assert_allclose(matrix @ [0, 1], [0, 1])
