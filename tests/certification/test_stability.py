"""Stability along proved curves, and the complete list of folds, Hopf and boundary points."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.certification.boxes.linking import IntervalProblem, curves_of
from fastslow.certification.boxes.pruning import prune_window
from fastslow.certification.equations import ExactEquations
from fastslow.certification.spectra.linearisations import linearisation
from fastslow.certification.spectra.spectra import Balls, spectra_of, transformed
from fastslow.certification.spectra.stability import examined
from fastslow.kernels.intervals.printer import interval_program
from tests.campaigns.deleted_points import without
from tests.certification.systems import (
    SYSTEMS,
    fitzhugh_nagumo_ring,
    hodgkin_huxley,
    window_of,
)

pytestmark = pytest.mark.slow

x, y, z, p = sp.symbols("x y z p")


def examination(system):
    rates, unknowns, ranges = system
    low, high = window_of(ranges)
    program = interval_program(rates, unknowns)
    problem = IntervalProblem(program, None, (), low, high)
    curves = curves_of(problem, prune_window(program, low, high, max_boxes=10**6, width=1e-6))
    equations = ExactEquations("S1", tuple(unknowns), tuple(rates), (), (), ())
    return examined(problem, linearisation(equations), (), curves), equations


def certified(rates, over=(-1, 1), **window):
    model = fs.Model(rates, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", over, window=window)
    return fs.certify(model, diagram, window=window)


# -- eigenvalues --------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_bounds_of_eigenvalues_are_those_of_all_matrices(n):
    rng = np.random.default_rng(n)
    count = 600
    middle = rng.normal(size=(count, n, n))
    slope = rng.normal(size=(count, n, n))
    reach = 10.0 ** rng.uniform(-3, 0, size=count)
    spread = 10.0 ** rng.uniform(-6, -2, size=(count, 1, 1)) * np.ones((n, n))
    unit = 10.0 ** rng.uniform(-2, 2, size=n)
    scaled = unit[:, None] / unit
    found = spectra_of(
        Balls(middle * scaled, spread * scaled),
        Balls(slope * scaled, 30 * spread * scaled),
        reach,
        unit,
    )
    decided = found.unstable >= 0
    # most are decided for narrow ranges
    narrow = (reach < 0.003) & (spread[:, 0, 0] < 1e-3)
    assert decided[narrow].mean() > 0.9
    critical = np.zeros(3, dtype=int)
    for k in range(count):
        part = np.linspace(-1, 1, 41)
        noise = spread[k] * rng.uniform(-1, 1, size=(n, n))
        # another derivative within the bounds for each matrix
        drift = slope[k] + 30 * spread[k] * rng.choice([-1, 1], size=(41, n, n))
        if not decided[k]:
            drift = drift[:1]
        values = np.linalg.eigvals(middle[k] + noise + part[:, None, None] * reach[k] * drift)
        unstable = (values.real > 0).sum(axis=1)
        if decided[k]:
            assert set(unstable) == {found.unstable[k]}
        elif found.kind[k]:
            # one real eigenvalue or one pair, which moves in one direction
            critical[found.kind[k]] += 1
            steps = np.diff(unstable) * found.sign[k]
            assert set(steps) <= {0, found.kind[k]}
    assert critical.sum() > 5


def test_inexact_inverses_are_covered():
    rng = np.random.default_rng(1)
    matrix, basis = rng.normal(size=(2, 50, 3, 3))
    exact = np.linalg.solve(basis, matrix @ basis)
    inverse = np.linalg.inv(basis)
    point = Balls(matrix, np.zeros((50, 3, 3)))
    off = rng.uniform(-1e-3, 1e-3, size=(50, 3, 3)) * np.abs(inverse)
    found = transformed(point, basis, inverse + off)
    bounded = np.isfinite(found.radius).all(axis=(1, 2))
    assert bounded.sum() > 30
    assert (np.abs(exact - found.middle) <= found.radius)[bounded].all()
    assert (np.abs(exact - found.middle) > 1e-5).any()
    assert np.isinf(transformed(point, basis, 0.3 * inverse).radius).all()


def test_parallel_eigenvectors():
    # a Jordan block of size 4, and one that is nearly so
    block = -np.eye(4) + np.diag([5.0, 5.0, 5.0], 1)
    both = np.array([block, block + 1e-9 * np.eye(4)[::-1]])
    still = Balls(np.zeros((2, 4, 4)), np.zeros((2, 4, 4)))
    found = spectra_of(Balls(both, np.full((2, 4, 4), 1e-14)), still, np.zeros(2), np.ones(4))
    assert found.unstable.tolist() == [0, 0]
    # within 1 the eigenvalues of the block may be anything
    wide = spectra_of(Balls(both, np.full((2, 4, 4), 1.0)), still, np.zeros(2), np.ones(4))
    assert wide.unstable.tolist() == [-1, -1]


@pytest.mark.parametrize(("n", "unit"), [(101, 1.0), (2, 1e-31), (2, 1e31), (2, np.nan)])
def test_spectra_beyond_the_bounds_of_rounding_are_not_decided(n, unit):
    stable, zero = -np.eye(n)[None], np.zeros((1, n, n))
    units = np.append(np.ones(n - 1), unit)
    matrices = Balls(stable, zero), Balls(zero, zero)
    assert spectra_of(*matrices, np.zeros(1), np.ones(n)).unstable.tolist() == [
        0 if n < 101 else -1
    ]
    assert spectra_of(*matrices, np.zeros(1), units).unstable.tolist() == [-1]


# -- curves -------------------------------------------------------------------------------------


def test_the_hodgkin_huxley_equations():
    found, _ = examination(hodgkin_huxley())
    # to 18 digits by Newton's method at 60 digits
    known = (9.77933799539312633, 154.526333665808)
    points = sorted(found.crossings, key=lambda c: c.low[-1])
    assert [c.code for c in points] == ["HB", "HB"]
    for point, value in zip(points, known, strict=True):
        assert point.low[-1] < value < point.high[-1] < point.low[-1] + 1e-5
    (curve,) = found.curves
    numbers = [k for k, _ in zip(*np.unique(curve.unstable, return_counts=True), strict=True)]
    assert numbers == [-1, 0, 2]
    assert not found.undecided


@pytest.mark.parametrize(
    ("system", "folds", "hopf"),
    [
        (SYSTEMS["Morris-Lecar"](), 2, 1),
        pytest.param(SYSTEMS["cubic n = 3"](), 9, 3, marks=pytest.mark.slow),
        (fitzhugh_nagumo_ring(2), 8, 12),
    ],
)
def test_all_folds_and_hopf_points(system, folds, hopf):
    # the numbers are those of Hurwitz determinants with interval coefficients
    found, equations = examination(system)
    codes = [c.code for c in found.crossings]
    assert (codes.count("LP"), codes.count("HB")) == (folds, hopf)
    assert not found.undecided
    # eigenvalues at the middles of some arcs
    rates = sp.Matrix(equations.rows)
    jacobian = sp.lambdify(equations.unknowns, rates.jacobian(equations.unknowns[:-1]), cse=True)
    for curve in found.curves:
        for k in range(0, len(curve.free), 1 + len(curve.free) // 30):
            middle = 0.5 * curve.low[k] + 0.5 * curve.high[k]
            values = np.linalg.eigvals(np.array(jacobian(*middle), dtype=float))
            if curve.unstable[k] >= 0 and np.abs(values.real).min() > 1e-3:
                assert (values.real > 0).sum() == curve.unstable[k]


# -- certificates -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hopf():
    """A Hopf point at p = −11/8 and folds at p = ±2: a normal form driven by a cubic."""
    rates = {
        x: (z - sp.Rational(1, 2)) * x - 2 * y - x * (x**2 + y**2),
        y: 2 * x + (z - sp.Rational(1, 2)) * y - y * (x**2 + y**2),
        z: p + 3 * z - z**3,
    }
    model = fs.Model(rates, parameters={p: 0})
    window = {"x": (-1, 1), "y": (-1.1, 1), "z": (-3, 3)}
    diagram = fs.continue_equilibria(model, "p", (-3, 3), window=window)
    return model, diagram, window


def test_the_list_of_points_is_complete(hopf, tmp_path):
    model, diagram, window = hopf
    proof = fs.certify(model, diagram, window=window)
    assert proof.complete
    assert proof.all_points
    assert proof.missing == ()
    # z = 1/2 at p = −11/8, and z = ±1 at p = ∓2
    assert sorted((q.code, round(q["p"], 9)) for q in proof.points) == [
        ("HB", -1.375), ("LP", -2.0), ("LP", 2.0),
    ]  # fmt: skip
    assert all(q.enclosure is not None for q in proof.points)
    assert "all folds, Hopf points and boundary equilibria: 1 HB, 2 LP" in repr(proof)
    # stable are those with z < −1: for z > 1 the real part z − 1/2 is positive
    for value in (-2.5, -1.9, 0.0, 1.9, 2.5):
        roots = np.roots([-1, 0, 3, value])
        real = roots.real[np.abs(roots.imag) < 1e-9]
        stable = sum((root < 0.5) and (3 - 3 * root**2 < 0) for root in real)
        assert proof.count(p=value, stable=True) == stable
        assert proof.count(p=value, stable=False) == len(real) - stable
        assert proof.count(p=value) == len(real)
    (curve,) = proof.curves
    assert curve.stable_intervals() == pytest.approx(np.array([[-3.0, 2.0]]), abs=1e-7)
    assert set(curve.unstable) == {-1, 0, 1, 2, 3}
    with pytest.raises(fs.ArgumentError, match=r"stable equilibria at p = -1\.375 is not"):
        proof.count(p=-1.375, stable=True)
    assert proof.count(p=-1.375) == 3
    proof.save(tmp_path / "one.nc")
    again = fs.load(tmp_path / "one.nc")
    assert again == proof
    assert again.count(p=0.0, stable=True) == 1
    # files of earlier versions have no stability
    before = replace(curve, unstable=np.empty(0, dtype=np.int64))
    earlier = replace(again, curves=(before,))
    assert earlier.count(p=0.0) == 3
    with pytest.raises(fs.ArgumentError, match="from a file of an earlier version, without stab"):
        earlier.count(p=0.0, stable=True)


@pytest.mark.sample(2)
@pytest.mark.parametrize("label", ["LP1", "LP2", "HB1"])
@pytest.mark.parametrize("row", [True, False])
def test_a_deleted_point_is_found_again(hopf, label, row, tmp_path):
    model, diagram, window = hopf
    (branch,) = diagram.branches
    changed = without(branch, label, row=not row)
    proof = fs.certify(model, replace(diagram, branches=(changed,)), window=window)
    (missing,) = proof.missing
    original = diagram[label]
    assert missing.code == original.code
    assert missing.enclosure is not None
    assert missing["p"] == pytest.approx(original["p"], abs=1e-9)
    for name in ("coefficient", "frequency", "lyapunov"):
        known = getattr(original, name)
        assert getattr(missing, name) == (None if known is None else pytest.approx(known, rel=1e-6))
    directions = [q.tangent / np.linalg.norm(q.tangent) for q in (missing, original)]
    assert np.ptp(directions, axis=0).max() < 1e-6
    assert len(proof.points) == 3
    assert proof.all_points
    assert "the diagram lacked 1 special point" in repr(proof)
    (again,) = proof.diagram.branches
    assert len(again) == len(branch)
    assert again.special_rows == branch.special_rows
    assert not again.unexplained
    proof.save(tmp_path / "one.npz")
    assert fs.load(tmp_path / "one.npz") == proof


def test_boundary_equilibria_are_found_again():
    gear = fs.systems.harmonic_gear(A=-0.6).frozen()
    diagram = fs.continue_equilibria(gear, "w", (-0.5, 0.5))
    window = {"x": (-2, 2), "v": (-1, 1)}
    proof = fs.certify(gear, diagram, window=window)
    assert proof.all_points
    assert sorted(proof.points["code"]) == ["BE", "BE", "LP", "LP"]
    # x is free in the dead zone: one eigenvalue is zero at all its equilibria
    assert {c.region: c.neutral for c in proof.curves} == {"S1": 0, "S2": 1, "S3": 0}
    (branch,) = diagram.branches
    changed = without(branch, "BE2", row=False)
    again = fs.certify(gear, replace(diagram, branches=(changed,)), window=window)
    (missing,) = again.missing
    original = diagram["BE2"]
    assert (missing.interface, missing.type) == (original.interface, original.type)
    assert missing.regions == original.regions
    assert missing["x"] == pytest.approx(original["x"], abs=1e-9)
    assert again.diagram.branches[0].special_rows == branch.special_rows


def test_stability_of_pseudo_equilibria():
    # x = 0, y = ±√p slides for |p| < 1; ẏ = p − y² along it
    model = fs.Model({x: -sp.sign(x) + x / 2, y: p - y**2 + x}, parameters={p: 0})
    window = {"x": (-1, 1), "y": (-2, 2)}
    diagram = fs.continue_equilibria(model, "p", (-1, 1), window=window)
    proof = fs.certify(model, diagram, window=window)
    assert proof.complete
    assert [proof.count(p=0.5, stable=one) for one in (True, False)] == [1, 1]
    assert [q.code for q in proof.points if q.code != "BE"] == ["LP"]
    # escaping: the same in reversed time
    back = fs.Model({x: sp.sign(x) + x / 2, y: -p + y**2 + x}, parameters={p: 0})
    proof = fs.certify(back, fs.continue_equilibria(back, "p", (-1, 1), window=window),
                       window=window)  # fmt: skip
    sliding = [c for c in proof.curves if c.region == "S1|S2"]
    assert set(np.concatenate([c.unstable for c in sliding])) == {-1, 1, 2}
    assert proof.count(p=0.5, stable=True) == 0


def test_equilibria_that_are_exactly_zero():
    # bounds of the ends of pieces contract to the smallest numbers
    proof = certified({x: p * x - y - x**3, y: x + p * y - y**3}, x=(-2, 2), y=(-2, 2))
    assert proof.all_points
    assert [(q.code, q["p"]) for q in proof.points] == [("HB", 0.0)]
    assert [proof.count(p=value, stable=True) for value in (-0.5, 0.5)] == [1, 0]


def test_a_weakly_damped_oscillator():
    # real parts of −1/2000 beside frequencies near 1
    model = {x: y, y: p + x - x**3 - y / 1000}
    proof = certified(model, over=(-2, 2), x=(-3, 3.1), y=(-1, 1.1))
    assert proof.all_points
    assert proof.points["code"].tolist() == ["LP", "LP"]
    for value in (-1.9, -0.38, 0.1, 0.384, 1.9):
        assert proof.count(p=value, stable=True) == (2 if abs(value) < 2 / 27**0.5 else 1)


def test_degenerate_points_are_reported():
    # the derivative of the eigenvalue vanishes at x = 0
    inflection = certified({x: p - x**3}, x=(-2, 2))
    assert inflection.complete
    assert not inflection.all_points
    assert "others are possible, and 1 arc whose stability" in repr(inflection)
    (boxes,) = inflection.unresolved
    assert boxes.why == "stability not decided"
    assert np.abs([boxes.low, boxes.high]).max() < 1e-2
    assert inflection.count(p=0.5, stable=True) == 1
    # two Hopf points at once
    twice = {x: p * x - y, y: x + p * y, z: -z}
    u, v = sp.symbols("u v")
    both = certified({**twice, u: p * u - 2 * v, v: 2 * u + p * v}, x=(-2, 2), y=(-2, 2),
                     z=(-2, 2), u=(-2, 2), v=(-2, 2))  # fmt: skip
    assert both.complete
    assert len(both.unresolved) == 1
    assert [both.count(p=q, stable=True) for q in (-0.5, 0.5)] == [1, 0]


def test_a_chain_with_a_multiple_eigenvalue_is_stable():
    proof = certified({x: p - x, y: x - y, z: y - z - z**3}, x=(-2, 2), y=(-2, 2), z=(-2, 2))
    assert proof.all_points
    assert proof.count(p=0.3, stable=True) == 1
    assert set(np.concatenate([c.unstable for c in proof.curves])) == {0}
