"""Functions of the stepping loop by themselves, as Python, against formulas."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial import Polynomial, legendre

from fastslow.simulation import many_arguments, stopping
from fastslow.simulation.stepper import (
    collocation,
    event_location,
    extremes,
    implicit,
    instants,
    lobatto,
    matrices,
    motion_selection,
    polynomials,
    queued_events,
    radau,
    resets,
    scales,
    steps,
    switches,
)
from fastslow.simulation.stepper import workspace as place

ORDER = 12


def series_of(*rows):
    """Rows of coefficients, filled up to the order, one after the other."""
    return np.concatenate([np.pad(np.array(row, float), (0, ORDER + 1 - len(row))) for row in rows])


def exponential(size, rate):
    """Coefficients of size exp(rate t)."""
    return [size * rate**k / math.factorial(k) for k in range(ORDER + 1)]


def sizes_of(*reached):
    return np.array([np.zeros(len(reached)), reached], float)


def work_space(n_states=2, n_interfaces=2):
    return event_location.search_for(n_states, 0, n_interfaces, ORDER)


class TestScales:
    @pytest.mark.parametrize("lead", [0, 1, 2])
    def test_each_of_the_last_three_terms_limits_a_step(self, lead):
        row = np.zeros(ORDER + 1)
        row[0], row[ORDER - lead] = 2.0, 3.0
        found = scales.step_length(row, 1, ORDER, 1e-9, sizes := sizes_of(5.0))
        assert found == pytest.approx((1e-9 * 5.0 / 3.0) ** (1 / (ORDER - lead)), rel=1e-14)
        assert sizes[0, 0] == 5.0
        sizes = sizes_of(0.5)
        longer = scales.step_length(row, 1, ORDER, 1e-9, sizes)
        assert longer == pytest.approx((1e-9 * 2.0 / 3.0) ** (1 / (ORDER - lead)), rel=1e-14)

    def test_the_smallest_length_of_all_rows_counts(self):
        W = series_of(exponential(1.0, 2.0), exponential(1e6, 5.0), exponential(1.0, 1.0))
        alone = [
            scales.step_length(series_of(exponential(1.0, r)), 1, ORDER, 1e-8, sizes_of(0.0))
            for r in (1.0, 2.0, 5.0)
        ]
        together = scales.step_length(W, 3, ORDER, 1e-8, sizes_of(0.0, 0.0, 0.0))
        assert together == pytest.approx(alone[2], rel=1e-14)
        assert alone[0] == pytest.approx(2.0 * alone[1]) == pytest.approx(5.0 * alone[2])

    def test_series_that_end_or_are_not_finite(self):
        assert scales.step_length(series_of([1, 2]), 1, ORDER, 1e-9, sizes_of(0.0)) == np.inf
        for k in (0, ORDER - 1, ORDER):
            W = series_of([1.0])
            W[k] = np.nan
            assert np.isnan(scales.step_length(W, 1, ORDER, 1e-9, sizes_of(0.0)))

    def test_a_row_that_starts_at_zero_has_the_size_of_its_leading_terms(self):
        row = np.zeros(ORDER + 1)
        row[1], row[2], row[ORDER] = 3.0, 0.5, 7.0
        sizes = sizes_of(0.0)
        h = scales.step_length(row, 1, ORDER, 1e-8, sizes)
        by_first = (1e-8 * 3.0 / 7.0) ** (1 / (ORDER - 1))
        by_second = (1e-8 * 0.5 / 7.0) ** (1 / (ORDER - 2))
        assert h == pytest.approx(max(by_first, by_second), rel=1e-14)
        assert sizes[0, 0] == pytest.approx(max(3.0 * h, 0.5 * h**2), rel=1e-14)
        assert scales.within(row, 0, np.inf) == 0.0
        assert scales.within(np.array([0.0, 1, 2, 5, 9]), 0, 2.0) == 40.0

    def test_the_recent_maximum_decays_by_half_in_35_steps(self):
        rules = scales.rules_of(np.array([0.0, 4.0]), np.array([scales.FORGETTING, 0.0]), 1, 1)
        assert rules.tolist() == [[0, 4, 0, 0], [0.98, 0, 0.98, 1]]
        sizes = np.array([[8.0, 8.0, 8.0, 8.0], [0.0, 0.0, 0.0, 0.0]])
        for _ in range(35):
            scales.remember_sizes(rules, sizes)
            sizes[0] = sizes[1]
        assert sizes[1] == pytest.approx([8 * 0.98**35, 4, 8 * 0.98**35, 8])
        assert sizes[1, 0] == pytest.approx(4.0, rel=0.02)

    def test_sizes_are_raised_to_those_of_the_series_where_they_follow_the_run(self):
        rules = scales.rules_of(np.zeros(2), np.array([0.98, 0.0]), 0, 0)
        W = series_of(exponential(1.0, 1.0), exponential(1.0, 3.0))
        sizes = sizes_of(0.5, 0.5)
        scales.raise_sizes(W, 2, ORDER, 1e-9, 10.0, rules, sizes)
        length = scales.own_length(series_of(exponential(1.0, 3.0)), 0, ORDER, 1e-9)
        leading = max(length**k / math.factorial(k) for k in range(4))
        assert sizes[1] == pytest.approx([leading, 0.5])
        sizes = sizes_of(0.5, 0.5)
        scales.raise_sizes(W, 2, ORDER, 1e-9, 1e-3, rules, sizes)
        assert sizes[1] == pytest.approx([1.0, 0.5])

    def test_arguments_of_saturating_functions_shorten_steps(self):
        """Allowed: a change of 0.1 + 0.5 |a|, below 2, or above 6."""
        limits = np.array([[0.1, 0.5, 2.0, 6.0]])
        remains = lambda size, change: scales.remains_saturated(limits, 0, 0, size, change)  # noqa: E731
        assert remains(4.0, 2.1)
        assert not remains(4.0, 2.2)
        assert remains(0.5, 1.5)
        assert not remains(0.5, 1.6)
        assert remains(20.0, 14.0)
        assert not remains(20.0, 14.1)
        rows = np.array([[1, -1]])
        W = series_of([0.0], [4.0, 1.0])
        expected = 10.0
        while expected > 2.1:
            expected *= 0.7
        assert scales.unsaturated_length(W, ORDER, 0, rows, limits, 12.0, 10.0) == expected
        assert scales.unsaturated_length(W, ORDER, 0, rows, limits, 2.0, 10.0) == 2.0
        # a step longer than what is left is as it is
        assert scales.unsaturated_length(W, ORDER, 0, rows, limits, 50.0, 2.0) == 50.0

    @pytest.mark.parametrize(
        ("slope", "passes"), [(5.1, False), (5.3, True), (-5.1, False), (-5.3, True)]
    )
    def test_arguments_within_an_implicit_step_are_those_of_its_polynomial(
        self, monkeypatch, slope, passes
    ):
        """An argument 5 + slope s on a step of length 1/2, which may change by 2.6."""

        def argument(address, number, point, parameters, out):
            out[0] = point[1]

        monkeypatch.setattr(implicit, "call_address", argument)
        problem = SimpleNamespace(
            saturating=np.array([[0, -1]]),
            saturations=np.array([[0.1, 0.5, 2.0, 6.0]]),
            n_modes=1,
            n_interfaces=0,
            n_states=1,
            order=ORDER,
            series=None,
        )
        space = SimpleNamespace(
            arguments=np.zeros((1, radau.STAGES + 1)),
            ahead=np.zeros(2),
            radau=SimpleNamespace(out=np.zeros(ORDER + 1)),
        )
        run = SimpleNamespace(inputs=np.array([0.0, 5.0]), parameters=np.zeros(1))
        poly = np.zeros(ORDER + 1)
        poly[:2] = 5.0, slope
        assert implicit.saturating_within(problem, run, 0, 0.5, poly, space) == passes
        none = SimpleNamespace(**{**vars(problem), "saturating": np.array([[-1, -1]])})
        assert not implicit.saturating_within(none, run, 0, 0.5, poly, space)

    def test_ratios_and_residues(self):
        assert scales.ratio_of(0.0, 0.0) == 0.0
        assert scales.ratio_of(-3.0, 2.0) == 1.5
        assert scales.ratio_of(1e-300, 0.0) == np.inf
        scales.flush(inputs := np.array([1e-310, 1e-310, -1e-299, 1e-310]), 2)
        assert inputs.tolist() == [1e-310, 0.0, -1e-299, 1e-310]


class TestPolynomials:
    @pytest.mark.parametrize("last", [1, 2, 3, 6, 7])
    def test_values_derivatives_and_bounds(self, last):
        c = np.random.default_rng(last).normal(size=9)
        p = Polynomial(c[1 : last + 1])
        for s in (0.0, 0.3, -1.7):
            assert polynomials.horner(c, 1, last, s) == pytest.approx(p(s))
            assert polynomials.slope(c, 1, last, s) == pytest.approx(p.deriv()(s))
        if last > 2:
            rest = sum(abs(c[k]) * 0.7 ** (k - 1) for k in range(2, last + 1))
            assert polynomials.reach(c, 1, last, 0.7) == pytest.approx(rest)
        assert polynomials.curvature(c, last, 0.4) == pytest.approx(
            Polynomial(c[: last + 1]).deriv(2)(0.4)
        )

    def test_signs_that_the_moduli_decide(self):
        assert polynomials.bounded_away(np.array([1.0, -0.5, 0.24]), 0, 2, 1.0)
        assert not polynomials.bounded_away(np.array([1.0, -0.5, 0.26]), 0, 2, 1.4)
        assert polynomials.excluded(np.array([9.0, -1.0, 0.5, 0.4]), 1, 3)
        assert not polynomials.excluded(np.array([9.0, -1.0, 0.5, 0.6]), 1, 3)

    def test_halves_of_an_interval_have_the_same_values(self):
        c, n = np.random.default_rng(1).normal(size=6), 5
        stack = np.zeros((4, 10))
        polynomials.to_bernstein(c, 0, n, stack)
        polynomials.halve(stack, 0, n)
        for row, begin in ((0, 0.5), (1, 0.0)):
            assert stack[row, n + 1 : n + 3].tolist() == [begin, 0.5]
            for s in (0.0, 0.3, 1.0):
                value = sum(
                    stack[row, j] * math.comb(n, j) * s**j * (1 - s) ** (n - j)
                    for j in range(n + 1)
                )
                assert value == pytest.approx(Polynomial(c)(begin + 0.5 * s))

    def test_a_root_in_a_bracket_to_rounding(self):
        b = np.array([-2.0, 0.0, 1.0])
        assert polynomials.refine(b, 0, 2, 1.0, 2.0, -1.0) == pytest.approx(2**0.5, rel=3e-16)
        # at a triple root, where the rate vanishes, by bisection
        b = np.array([-0.125, 0.75, -1.5, 1.0])
        assert polynomials.refine(b, 0, 3, 0.1, 1.0, -1.0) == pytest.approx(0.5, abs=1e-5)

    def test_the_first_coefficients_that_count(self):
        b = np.array([9.0, 0.0, -1e-9, 1e-3])
        assert polynomials.first_above_noise(b, 1, 3, 1e-8) == 3
        assert polynomials.first_above_noise(b, 1, 3, 1.0) == 4
        assert polynomials.first_nonzero(b, 1, 3) == 2


class TestExtremes:
    @pytest.mark.parametrize("begin", [-1.0, 0.0, 0.4, 1.1])
    def test_extremes_of_a_step_from_an_offset_on(self, begin):
        rng = np.random.default_rng(5)
        for _ in range(20):
            W = rng.normal(size=2 * (ORDER + 1)) / np.tile(np.arange(1, ORDER + 2), 2)
            known = np.array([[0.2, 9.0], [0.3, 9.0]])
            extremes.widen_extremes(W, ORDER, begin, 1.3, known, work_space())
            for i, (low, high) in enumerate([(0.2, 0.3), (9.0, 9.0)]):
                p = Polynomial(W[i * (ORDER + 1) :][: ORDER + 1])
                turns = [z.real for z in p.deriv().roots() if abs(z.imag) < 1e-9]
                at = [max(begin, 0.0), 1.3, *(z for z in turns if max(begin, 0) < z < 1.3)]
                expected = min(low, *p(np.array(at))), max(high, *p(np.array(at)))
                assert known[:, i] == pytest.approx(expected, rel=1e-12)


class TestNodes:
    @pytest.mark.parametrize("n", [4, 7, 10])
    def test_lobatto_matrices_are_exact_for_polynomials(self, n):
        """Points are zeros of (P_{n−1})' and the ends; integrals of powers up to n − 1."""
        row = n - lobatto.LOWEST
        c, f = lobatto.C[row, :n], lobatto.F[row, : n + 1]
        inner = np.sort(c)[1:-1]
        slope = legendre.legval(2 * inner - 1, legendre.legder([0.0] * (n - 1) + [1.0]))
        assert np.abs(slope).max() < 1e-11
        assert [c.min(), c.max(), f.min(), f.max(), c[0]] == [0, 1, 0, 1, 0]
        for k in range(n):
            exact = np.array([x ** (k + 1) / (k + 1) for x in c])
            assert lobatto.TO_C[row, :n, :n] @ c**k == pytest.approx(exact, abs=1e-13)
            assert lobatto.TO_F[row, : n + 1, :n] @ c**k == pytest.approx(
                f ** (k + 1) / (k + 1), abs=1e-13
            )
            assert lobatto.AT_F[row, : n + 1, :n] @ c**k == pytest.approx(f**k, abs=1e-12)
        whole = lobatto.INTEGRALS[row, : n + 1, : n + 1] @ f**n
        assert whole == pytest.approx(f ** (n + 1) / (n + 1), abs=1e-13)
        between = np.linspace(0, 1, 4001)
        largest = np.abs(np.prod(between[:, None] - f, axis=1)).max()
        assert abs(np.prod(lobatto.WORST[row] - f)) == pytest.approx(largest, rel=1e-5)

    def test_leja_order_spreads_points(self):
        c = lobatto._in_order(lobatto.lobatto_points(5))
        assert c[:3].tolist() == pytest.approx([0.0, 1.0, 0.5])

    def test_power_coefficients_of_an_interpolating_polynomial(self):
        points, powers = np.array([0.0, 0.2, 0.5, 1.0]), np.array([2.0, -1.0, 0.5, 3.0])
        work = np.zeros(6)
        collocation.to_powers(Polynomial(powers)(points), points, 4, work)
        assert work == pytest.approx([*powers, 0.0, 0.0], abs=1e-13)

    def test_a_stage_polynomial_has_the_increments_at_its_stages(self):
        """Of a state, and of a forcing with other values; the next step extrapolates both."""
        rng, h = np.random.default_rng(3), 0.25
        increments, held = rng.normal(size=radau.STAGES), rng.normal(size=1 + radau.STAGES)
        poly = np.full(2 * (ORDER + 1), 9.0)
        radau.fill_polynomials(
            np.array([0.0, 2.0]),
            np.array([np.full(len(held), np.nan), held]),
            increments[:, None],
            h,
            ORDER + 1,
            poly,
        )
        for row, values in ((0, [2.0, *(2.0 + increments)]), (ORDER + 1, held.tolist())):
            at = [radau.value_at(poly, row, c * h) for c in (0.0, *radau.C)]
            assert at == pytest.approx(values, abs=1e-12)
            assert not poly[row + 1 + radau.STAGES : row + ORDER + 1].any()
        ahead = np.full((radau.STAGES, 1), np.nan)
        radau.first_increments(poly, ORDER + 1, h, 0.1, ahead)
        exact = Polynomial(poly[: radau.STAGES + 1])
        assert ahead[:, 0] == pytest.approx([exact(h + c * 0.1) - exact(h) for c in radau.C])
        radau.first_increments(poly, ORDER + 1, 0.0, 0.1, ahead)
        assert not ahead.any()


class TestMatrices:
    @pytest.mark.parametrize("n", [3, 6])
    def test_reduction_and_balance_keep_eigenvalues(self, n):
        rng = np.random.default_rng(n)
        even, units = rng.normal(size=(n, n)), np.logspace(0, 8, n)
        matrix = even * units[:, None] / units
        balanced = matrix.copy()
        matrices.balance(balanced, n)
        ratio = np.abs(balanced).sum(axis=0) / np.abs(balanced).sum(axis=1)
        assert ((ratio > 0.1) & (ratio < 10)).all()
        factors = np.log2(np.abs(balanced / matrix))
        assert np.abs(factors - np.round(factors)).max() < 1e-12
        assert np.diag(balanced) == pytest.approx(np.diag(matrix))
        matrices.to_hessenberg(balanced, n, np.zeros(n))
        assert np.abs(np.tril(balanced, -2)).max() == 0
        expected = np.sort_complex(np.linalg.eigvals(even))
        assert np.sort_complex(np.linalg.eigvals(balanced)) == pytest.approx(expected, rel=1e-9)

    def test_eigenvalues_need_few_iterations(self, monkeypatch):
        """Some three for each of the eigenvalues of a random matrix, on average."""
        counted, rng = [0], np.random.default_rng(3)
        step = matrices.double_step
        monkeypatch.setattr(
            matrices, "double_step", lambda *a: (counted.__setitem__(0, counted[0] + 1), step(*a))
        )
        space = matrices.spectrum_for(6)
        for _ in range(10):
            matrix = rng.normal(size=(6, 6))
            assert matrices.eigenvalues_of(matrix, 6, space)
            found = np.sort_complex(space.values[:6])
            assert found == pytest.approx(np.sort_complex(np.linalg.eigvals(matrix)), abs=1e-12)
        assert counted[0] <= 10 * 3 * 6

    def test_the_largest_modulus_among_modes_that_are_not_damped(self):
        space = matrices.spectrum_for(4)
        matrix = np.diag([-50.0, -0.5, 0.0, 3.0])
        matrix[1:3, 1:3] = [[-0.5, 7.0], [-7.0, -0.5]]
        assert matrices.undamped_modulus(matrix, 4, 1.0, space) == pytest.approx(np.hypot(0.5, 7))
        assert matrices.undamped_modulus(matrix, 1, 1.0, space) == 0.0
        assert matrices.undamped_modulus(matrix, 1, 60.0, space) == 50.0
        matrix[3, 3] = np.nan
        assert np.isnan(matrices.undamped_modulus(matrix, 4, 1.0, space))


def at_time(t, until, *, late=0.0, taken=0.0, interface=-1, final=0):
    carried, counted = np.zeros(place.SIZES + 9), np.zeros(place.INTEGERS, dtype=np.int64)
    carried[place.UNTIL], carried[place.LATE], carried[place.STEP_LENGTH] = until, late, taken
    counted[place.INTERFACE], counted[place.FINAL] = interface, final
    inputs = np.array([t, 0.0, 0.0])
    return SimpleNamespace(inputs=inputs, carried=carried, counted=counted, begin=0.0, stop=until)


class TestTime:
    def test_what_rounding_leaves_out_of_the_time_is_carried(self):
        assert steps.remaining_time(at_time(3.0, 10.0, late=0.25)) == 6.75
        run = at_time(1e6, 2e6, late=1e-11, taken=3e-11)
        assert steps.advance_time(run) == 1e6
        assert run.carried[place.LATE] == pytest.approx(4e-11, rel=1e-12)
        run.carried[place.STEP_LENGTH] = 1e-10
        t = steps.advance_time(run)
        assert t == np.nextafter(1e6, 2e6)
        assert t - 1e6 + run.carried[place.LATE] == pytest.approx(1.4e-10, rel=1e-9)

    def test_a_step_to_an_event_or_to_the_end(self):
        run = at_time(1e6, 2e6, late=1e-11, taken=0.1 + 3e-11, interface=0)
        t = steps.advance_time(run)
        assert t - 1e6 + run.carried[place.LATE] == pytest.approx(0.1 + 4e-11, rel=1e-15)
        run = at_time(1.0, 1.5, late=1e-11, taken=0.4999, final=1)
        assert steps.advance_time(run) == 1.5
        assert run.carried[place.LATE] == 0.0

    def test_lengths_end_at_floating_point_numbers(self):
        assert steps.length_at(1.0, 1e-17, False) == 0.0
        assert steps.length_at(1.0, 1e-17, True) == 1e-17
        assert steps.length_at(1.0, 0.1, True) == 1.1 - 1.0

    @pytest.mark.parametrize("on", [(True, False), (False, False)])
    def test_no_implicit_step_begins_on_an_interface_or_slides(self, on):
        """The second mode slides along the second interface."""
        problem = SimpleNamespace(signs=np.array([[1, 1], [1, 0]]))
        run = at_time(0.0, 1.0)
        series = SimpleNamespace(poly=None)
        space = SimpleNamespace(radau=SimpleNamespace(phase=np.zeros(1)))
        search = SimpleNamespace(on=np.array(on))
        lengths = implicit.Lengths(0.5, 0.1, 0.1, 1.0)
        mode = 0 if any(on) else 1
        found = implicit.long_step(problem, run, mode, lengths, series, None, search, space)
        assert found == (0.0, 1.0)
        # nor one that does not pay
        short = implicit.Lengths(0.05, 0.1, 0.1, 1.0)
        search.on[:] = False
        found = implicit.long_step(problem, run, 0, short, series, None, search, space)
        assert found == (0.0, 1.0)

    def test_stability_limits_a_step_with_small_middle_terms(self):
        problem = SimpleNamespace(order=ORDER, tol=1e-8, n_states=1, n_forcing=0, n_interfaces=0)
        sizes = np.array([[1.0], [1.0]])
        slow, fast = series_of(exponential(1.0, 1.0)), series_of(exponential(1e-8, 100.0))
        limited = implicit.limited_by_stability
        h = scales.step_length(slow, 1, ORDER, 1e-8, sizes_of(0.0))
        assert not limited(problem, slow, h, sizes)
        assert limited(problem, fast, ORDER / math.e / 100.0, sizes)
        # for each of the two middle terms
        most = 1e-8 * math.exp(0.5 * ORDER)
        for k in (ORDER // 2 - 1, ORDER // 2):
            for factor in (0.9, 1.1):
                W = series_of([1.0])
                W[k] = factor * most * 2.0 / 0.5**k
                assert limited(problem, W, 0.5, 2.0 * sizes) == (factor < 1)


class TestModes:
    SIGNS = np.array([[1, 1], [-1, 1], [0, 1], [1, -1], [0, -1]])

    def test_neighbours_and_distances(self):
        for mode, j, other in [(0, 0, 1), (1, 0, 0), (0, 1, 3), (2, 1, 4), (1, 1, 1), (2, 0, 2)]:
            assert motion_selection.neighbour_mode(self.SIGNS, mode, j) == other
        assert [motion_selection.distance(self.SIGNS, 0, k) for k in range(5)] == [0, 1, 1, 1, 2]
        assert resets.matching_mode(self.SIGNS, np.array([0, -1])) == 4
        assert resets.matching_mode(self.SIGNS, np.array([-1, -1])) == -1

    def test_bounds_of_sliding_interfaces_and_walls(self):
        """Two rows for each sign 0, in the order of the interfaces; the last one is a wall."""
        problem = SimpleNamespace(signs=np.array([[0, 1, 0, 0], [1, 0, 1, 1]]), first_wall=3)
        found = [motion_selection.bounds_of(problem, 0, j, 10) for j in (0, 2, 3)]
        assert found == [(10, True), (12, True), (14, False)]
        assert motion_selection.bounds_of(problem, 1, 1, 10) == (10, False)

    def test_agreement_with_a_side(self):
        agree = lambda *b: motion_selection.agreement(np.array(b), len(b) - 1, 1e-3, 1.0)  # noqa: E731
        assert agree(9.0, 1.0, -5.0) == motion_selection.AGREES
        assert agree(9.0, 1e-4, -5.0) == motion_selection.DISAGREES
        assert agree(9.0, 1e-4, -1e-5) == motion_selection.WEAKLY_AGREES
        assert agree(9.0, 0.0, -1e-5) == motion_selection.WEAKLY_DISAGREES
        assert agree(9.0, 0.0, 0.0) == motion_selection.UNDETERMINED
        assert (
            motion_selection.agreement(np.array([0.0, -1.0]), 1, 1e-3, -1.0)
            == motion_selection.AGREES
        )

    @pytest.mark.parametrize(
        ("low", "high", "several", "agrees"),
        [
            ([-1.0], [2.0], False, True),
            ([1.0], [2.0], False, False),
            ([-1.0], [-2.0], False, False),
            ([2.0], [-1.0], False, False),
            ([2.0], [-1.0], True, True),
            ([2.0], [1.0], True, False),
            ([0.0, -1.0], [2.0], False, True),
            ([0.0, 1.0], [2.0], False, False),
            ([0.0], [2.0], False, False),
            ([-1e-9], [2.0], False, False),
        ],
    )
    def test_sliding_between_two_drifts_of_opposite_signs(self, low, high, several, agrees):
        W, b = series_of(low, high), np.zeros(ORDER + 1)
        found = motion_selection.sliding_agreement(W, 0, several, ORDER, 0.1, 1e-8, b)
        assert (found == motion_selection.AGREES) == agrees

    def test_sums_of_moduli_of_scaled_rows(self):
        b = np.zeros(ORDER + 1)
        total = motion_selection.scaled(series_of([9.0], [1.0, -2.0, 4.0]), 1, ORDER, 0.5, b)
        assert b[:4].tolist() == [1.0, -1.0, 1.0, 0.0]
        assert total == 2.0

    def test_all_motions_around_one_are_formed(self):
        problem = SimpleNamespace(signs=self.SIGNS, continuous=np.array([True, False]))
        # across the first, continuous: (-1, 1) and one beside it
        assert [motion_selection.all_formed(problem, 0, j) for j in (-1, 0, 1)] == [
            False,
            False,
            False,
        ]
        problem.signs = self.SIGNS[:2]
        assert motion_selection.all_formed(problem, 0, 0)
        problem.continuous[0] = False
        assert not motion_selection.all_formed(problem, 0, 0)
        problem.signs = self.SIGNS[:3]
        assert motion_selection.all_formed(problem, 0, 0)


class TestLocation:
    @pytest.mark.parametrize(
        ("c", "s", "touch"),
        [
            # (s − 1/2)² less 1e-12: roots at a distance of 1e-6, the same to a rounding of 1e-11
            ([0.25 - 1e-12, -1.0, 1.0], 0.5, True),
            ([0.25 - 1e-8, -1.0, 1.0], 0.5 - 1e-4, False),
            # downwards through zero with the other curvature
            ([0.25, 0.0, -1.0], 0.5, False),
        ],
    )
    def test_two_roots_that_are_the_same_to_rounding_are_a_touch(self, c, s, touch):
        root = 0.5 - (1e-6 if touch else 1e-4 if c[1] else 0.0)
        found, same = event_location.grazing_point(np.array(c), 2, root, 1e-11, 1.0)
        assert (found, same) == (pytest.approx(s, abs=1e-9), touch)

    def test_depth_of_a_crossing_relative_to_the_function(self):
        b = np.array([0.25 - 1e-4, -1.0, 1.0])
        assert event_location.crossing_depth(b, 2, 0.49, 2.0) == pytest.approx(0.5e-4)
        assert event_location.crossing_depth(b[:2], 1, 0.25, 2.0) == 1.0
        assert event_location.crossing_depth(b, 2, 0.49, 0.0) == 1.0
        assert event_location.crossing_depth(100 * b, 2, 0.49, 1e-9) == 1.0

    def test_units_are_powers_of_two(self):
        assert [event_location.unit_at(x) for x in (0.75, 1.0, 3.0)] == [1.0, 1.0, 4.0]
        assert [event_location.unit_at(x) for x in (0.0, np.inf, np.nan)] == [0.0, 0.0, 0.0]
        run = SimpleNamespace(inputs=np.array([9.0, 0.1, -5.0]))
        sizes = np.array([[3.0, 0.5], [0.0, 0.0]])
        assert [event_location.unit_of(run, sizes, i) for i in range(2)] == [4.0, 8.0]

    @pytest.mark.parametrize("crossed", [-1, 0])
    def test_projection_onto_two_planes_is_a_least_step_in_units(self, monkeypatch, crossed):
        """Of x + y = 1 and y + z = 2, in units 1, 2 and 4."""
        rows = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0]])

        def gradient(_, number, inputs, __, out):
            out[0] = rows[number - 5] @ inputs[1:] - (1.0, 2.0)[number - 5]
            out[2:5] = rows[number - 5]

        monkeypatch.setattr(event_location, "call_address", gradient)
        problem = SimpleNamespace(n_states=3, n_modes=5, series=0, tol=1e-9)
        z = np.array([0.4, 0.7, 1.2])
        run = SimpleNamespace(inputs=np.array([0.0, *z]), parameters=None)
        search = work_space(3, 2)
        search.hit[:] = True
        sizes = np.array([[1.0, 2.0, 4.0], [0.0, 0.0, 0.0]])
        event_location.project_onto_interfaces(problem, run, crossed, search, sizes)
        units = np.array([1.0, 2.0, 4.0])
        if crossed == 0:
            # farther than the tolerance from the first, and projected onto the second alone
            rows = rows[1:]
        step = np.linalg.pinv(rows * units) @ (np.array([1.0, 2.0])[-len(rows) :] - rows @ z)
        assert run.inputs[1:] == pytest.approx(z + units * step, abs=1e-14)


class TestSpans:
    @pytest.mark.parametrize(
        ("given", "spans", "since"),
        [
            ({"t": (1, 5), "settle": 2.0}, [[1, 5], [1, 5]], [3, 3]),
            ({"periods": 3, "t0": 1.0, "settle": 1.0}, [[1, 7], [1, 13]], [3, 5]),
        ],
    )
    def test_spans_and_what_counts_of_them(self, given, spans, since):
        """Periods of 2 and 4; what settles is in units of time or of these."""
        options = {"t": None, "periods": None, "t0": 0.0, "settle": 0.0} | given
        found = many_arguments.spans_of(**options, own=np.array([2.0, 4.0]))
        assert found[0].tolist() == spans
        assert found[1].tolist() == since

    def test_samples_are_common_to_equal_spans_alone(self):
        spans, since = np.array([[0.0, 4.0], [0.0, 4.0]]), np.array([1.0, 1.0])
        assert many_arguments.times_of(3, spans, since).tolist() == [[1, 2.5, 4]]
        later = many_arguments.times_of(3, spans, np.array([1.0, 2.0]))
        assert later.tolist() == [[1, 2.5, 4], [2, 3, 4]]
        assert many_arguments.times_of([0.5, 4], spans, since).tolist() == [[0.5, 4]]

    @pytest.mark.parametrize(("values", "sign"), [([1e-9, -2], -1), ([0, 3, -1], 1), ([1e-9], 0)])
    def test_the_first_sign_that_is_no_rounding(self, values, sign):
        assert stopping._first_sign(np.array(values, float), 1e-8) == sign


class TestInstants:
    def problem(self):
        """A table of three pieces with the period 6 in rows 1 to 3, and a clock."""
        knots = np.array([[9.0, 9.0], [0.0, 7.0], [1.0, 8.0], [4.0, 9.0], [6.0, np.nan]])
        table = np.array([[0, 2, 1, 3, -1], [3, 3, -1, -1, -1]])
        return SimpleNamespace(instants=table, knots=knots, n_resets=0, switch_place=7)

    def test_the_pieces_of_a_periodic_table_and_the_instants_of_a_clock(self):
        problem = self.problem()
        for piece, row, shift, after in [(0, 1, 0, 1), (2, 3, 0, 6), (3, 1, 6, 7), (-1, 3, -6, 0)]:
            parameters = np.array([piece, 0.0, 0.0, 4.0, 0.0, 0.5, 0.25, 0.0])
            assert instants.piece_of(problem, parameters, 0) == (row, shift)
            assert instants.instant_after(problem, parameters, 0) == after
            assert instants.instant_after(problem, parameters, 1) == 0.25 + 5 * 0.5
            assert instants.next_instant(problem, parameters) == min(after, 2.75)
        problem.knots[4, 0] = np.inf
        assert instants.piece_of(problem, np.array([2.0]), 0) == (3, 0.0)

    def test_instants_are_due_up_to_rounding(self):
        problem = self.problem()
        parameters = np.array([0.0, 0.0, 7.0, 4.0, 2.25, 0.5, 0.25, 0.0])
        size = {1.0: 2.0, 2.75: 2.75 + 0.5 + 0.25}
        for k, at in enumerate((1.0, 2.75)):
            near = instants.ROUNDING * size[at]
            assert instants.due(problem, parameters, k, at - 0.8 * near)
            assert not instants.due(problem, parameters, k, at - 1.2 * near)
        assert instants.instant_due(problem, parameters, 1.0)
        assert instants.instant_due(problem, parameters, 2.75)
        assert not instants.instant_due(problem, parameters, 0.9)

    def test_a_table_passes_to_its_next_piece(self):
        problem = self.problem()
        parameters = np.array([2.0, 4.0, 9.0, 100.0, 0.0, 0.5, 0.25, 0.0])
        run = SimpleNamespace(parameters=parameters, counted=np.zeros(place.INTEGERS, int))
        assert instants.pass_instant(problem, run, None, 6.0, None) == -1
        assert parameters.tolist() == [3.0, 6.0, 7.0, 100.0, 0.0, 0.5, 0.25, 0.0]
        parameters[3], parameters[4] = 11.0, 5.75
        assert instants.pass_instant(problem, run, None, 6.25, None) == -1
        assert parameters[3:5].tolist() == [12.0, 6.25]
        assert parameters[0] == 3.0


class TestConditions:
    def test_conditions_of_events_as_programs(self):
        first = queued_events.PROGRAM
        AND, OR, NOT = queued_events.AND, queued_events.OR, queued_events.NEGATION
        END, TRUE = queued_events.END_OF_CONDITION, queued_events.TRUE
        programs = {
            (0, 1, AND): lambda a, b: a and b,
            (0, 1, OR): lambda a, b: a or b,
            (0, NOT, 1, AND): lambda a, b: not a and b,
            (0, 1, OR, NOT): lambda a, b: not (a or b),
            (0, 0, 1, AND, OR): lambda a, b: a or (a and b),
            (TRUE, 1, AND): lambda a, b: b,
            (0, 1, NOT, AND, 1, 0, NOT, AND, OR): lambda a, b: a != b,
        }
        for program, expected in programs.items():
            events = np.full((2, first + 12), END)
            events[1, first : first + len(program)] = program
            problem = SimpleNamespace(
                events=events, switch_place=1, first_trigger=4, first_switch=2
            )
            for a in (0, 1):
                for b in (0, 1):
                    parameters = np.array([9.0, 1, 0, 0, 1, a, 1 - a, b, 1 - b])
                    found = queued_events.condition_is_true(problem, parameters, 1)
                    assert bool(found) == bool(expected(a, b))

    def test_a_waiting_event_is_removed_and_the_others_keep_their_order(self):
        first, size = queued_events.TRUTH + 1, 3
        memory = np.zeros(first + 9)
        problem = SimpleNamespace(n_states=1, events=np.zeros((1, 9)))
        for k in range(3):
            memory[queued_events.QUEUED] = 3
            memory[first:] = np.repeat([10.0, 20.0, 30.0], size)
            queued_events.remove(problem, memory, k)
            left = [10.0, 20.0, 30.0]
            del left[k]
            assert memory[queued_events.QUEUED] == 2
            assert memory[first : first + 6].tolist() == np.repeat(left, size).tolist()

    def test_of_the_events_that_are_due_the_first_of_highest_priority_is_executed(
        self, monkeypatch
    ):
        """Events 0 and 3 have no priority, 1 and 2 have 2 and 5."""

        def expressions(problem, run, event, values):
            values[2] = (0.0, 2.0, 5.0, 0.0)[event]

        monkeypatch.setattr(queued_events, "expressions_of", expressions)
        events = np.zeros((4, 9))
        events[1:3, queued_events.PRIORITISED] = 1
        problem = SimpleNamespace(n_states=1, events=events)
        first = queued_events.TRUTH + 4

        def due(queue, until):
            memory = np.zeros(first + 3 * len(queue))
            memory[queued_events.QUEUED] = len(queue)
            for k, (event, time) in enumerate(queue):
                memory[first + 3 * k : first + 3 * k + 3] = event, time, 77.0
            monkeypatch.setattr(queued_events, "memory_start", lambda _: 0)
            run = SimpleNamespace(carried=memory)
            return queued_events.next_due(problem, run, until, np.zeros(3))

        assert due([(0, 1.0), (1, 1.0), (2, 1.0)], 1.0) == 2
        assert due([(2, 1.0), (1, 1.0), (0, 1.0)], 1.0) == 0
        assert due([(0, 1.0), (1, 1.0), (2, 1.5)], 1.0) == 1
        assert due([(3, 1.0), (0, 1.0)], 1.0) == 1
        assert due([(1, 2.0), (0, 2.0)], 1.0) == -1

    def test_a_switch_and_its_complement(self):
        problem = SimpleNamespace(switch_place=1)
        parameters = np.zeros(7)
        switches.set_switch(problem, parameters, 1, 1.0)
        assert parameters.tolist() == [0, 0, 0, 1, 0, 0, 0]
        switches.set_switch(problem, parameters, 2, np.nan)
        assert np.isnan(parameters[5:7]).all()


class TestWalls:
    def test_a_jump_to_values_that_are_not_finite_changes_nothing(self, monkeypatch):
        problem = SimpleNamespace(n_states=2, series=0)
        run = SimpleNamespace(inputs=np.array([0.0, 1.0, 2.0]), parameters=None)
        for values in ([3.0, np.inf], [np.nan, 3.0], [4.0, 5.0]):
            monkeypatch.setattr(
                resets, "call_address", lambda *a, v=values: a[-1].__setitem__(slice(2), v)
            )
            finite = bool(np.isfinite(values).all())
            assert resets.apply_jump(problem, run, 0, np.zeros(2)) == finite
            assert run.inputs[1:].tolist() == (values if finite else [1.0, 2.0])

    def test_resets_are_listed_or_counted(self):
        problem = SimpleNamespace(n_states=1, n_interfaces=4, first_wall=1, first_switch=3)
        run = SimpleNamespace(inputs=np.array([2.5, 7.0]), since=2.0)
        listed = SimpleNamespace(resets=np.zeros((2, 4)), extremes=np.zeros((0, 1)))
        resets.list_reset(problem, run, listed, 1, 0, False)
        run.inputs[1] = 8.0
        resets.list_reset(problem, run, listed, 1, 0, True)
        assert listed.resets.tolist() == [[0, 0, 0, 0], [2.5, 0, 7, 8]]
        counting = SimpleNamespace(
            resets=None, extremes=np.zeros((2, 1)), hits=np.zeros((6, 2), int)
        )
        for number in (0, 1, 2, 3, 3):
            resets.list_reset(problem, run, counting, 0, number, False)
            resets.list_reset(problem, run, counting, 0, number, True)
        # two walls follow one interface; two kicks follow all four rows
        assert counting.hits[:, 0].tolist() == [0, 1, 1, 0, 1, 2]
        run.since = 3.0
        resets.list_reset(problem, run, counting, 0, 0, True)
        assert counting.hits[:, 0].tolist() == [0, 1, 1, 0, 1, 2]
