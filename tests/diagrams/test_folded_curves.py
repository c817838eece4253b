"""Curves of folded singularities and canard points, against closed forms."""

import math

import numpy as np
import pytest
import sympy as sp

import fastslow as fs

pytestmark = pytest.mark.slow

x, y, z, p, t = sp.symbols("x y z p t")
a, b, k, lam, eps, omega, D = sp.symbols("a b k lambda epsilon omega D")


def koper(scale=1, lagging=False, turned=False):
    """Koper's model at λ = 7, in other units of time, with an idle state or in another order."""
    fast = {x: scale * (k * y - x**3 + 3 * x - lam) / eps}
    if lagging:
        fast = {p: scale * 7 * (x - p) / eps, **fast}
    slow = {y: scale * (x - 2 * y + z), z: scale * (y - z)}
    slow = dict(reversed(slow.items())) if turned else slow
    return fs.Model(fast, slow=slow, parameters={k: -10, lam: 7, eps: 0.01})


def of(model, code, side=1, **given):
    points = fs.slow_flow(model, **given).points
    return next(q for q in points if q.code == code and q.values["x"] * side > 0)


@pytest.mark.parametrize("units", [{"scale": 1000, "turned": True}, {"lagging": True}], ids=str)
def test_kopers_folded_points_over_lambda(units):
    """At x = -1, σ² + 10σ + 6(8 − λ) = 0: a focus below 23/6, FSN2 at 8, a saddle beyond."""
    node = of(koper(**units), "FN", -1)
    curve = fs.continue_points(node, "lambda", (-12, 12))
    assert [(q.code, q.converged) for q in curve.special] == [("FSN2", True)]
    found = curve.special[0]
    assert [found[n] for n in ("lambda", "x", "y", "z")] == pytest.approx([8, -1, -1, -1])
    value = curve["lambda"]
    roots = np.sort_complex([np.roots([1, 10, 6 * (8 - v)]) for v in value])
    unit = 100 * units.get("scale", 1) ** 2 * (700 if "lagging" in units else 1)
    assert np.sort_complex(curve.eigenvalues) / unit == pytest.approx(roots, rel=1e-9, abs=1e-9)
    types = np.select([value < 23 / 6, value < 8 - 1e-9, value > 8 + 1e-9], ["FF", "FN", "FS"], "")
    rest = np.arange(len(curve)) != curve.special_rows[0]
    assert (curve.codes == types)[rest].all()
    mu = (5 - math.sqrt(19)) / (5 + math.sqrt(19))
    assert curve.at(**{"lambda": 7})[0].coefficient == pytest.approx(mu, rel=1e-12)
    # x' = 0 at x = y = z on the fold: k y + 2 − λ = 0 at x = -1, 3x = -3
    plane = {"k": (-15, -2), "lambda": (0, 20)}
    both = fs.continue_points(found, ("k", "lambda"), plane)
    assert both.code == "FSN2"
    assert both["lambda"] == pytest.approx(-2 - both["k"], abs=1e-12)
    assert len(both) > 10


def test_the_other_fold_and_fold_curves_of_koper():
    """At x = 1, σ² + 10σ + 6(8 + λ) = 0: complex for λ > -23/6; FSN2 at -8."""
    focus = of(koper(), "FF")
    curve = fs.continue_points(focus, lam, {lam: (-12, 12)})
    assert curve.special["lambda"] == pytest.approx([-8])
    value = curve["lambda"]
    assert set(curve.codes[value > -23 / 6]) == {"FF"}
    assert set(curve.codes[(value > -8 + 1e-9) & (value < -23 / 6)]) == {"FN"}
    # a fold curve in both slow states is a line y = const, with the point on it
    folds = fs.continue_points(focus, ("y", "z"), {"y": (-5, 5), "z": (-5, 5)})
    assert folds.code == "LP"
    assert [(q.code, round(q["y"], 12), round(q["z"], 12)) for q in folds.special] == [
        ("FF", -0.5, -2.0)
    ]


def forced(amplitude=2.0):
    return fs.Model(
        {x: (y - x**3 / 3 + x) / eps},
        slow={y: a * sp.sin(omega * t) - x},
        parameters={a: amplitude, omega: 1, eps: 0.01},
    )


def test_forced_van_der_pol_over_amplitude_and_frequency():
    """a sin ωt = 1 and λ² + λ − 2ωa cos ωt = 0 at x = 1: two points meet at a = 1 (FSN1)."""
    saddle = of(forced(), "FS")
    curve = fs.continue_points(saddle, "a", (0.5, 5))
    (meet,) = curve.special
    assert (meet.code, meet.converged) == ("FSN1", True)
    assert (meet["a"], meet["t"]) == pytest.approx((1, math.pi / 2), abs=1e-12)
    assert curve["a"] * np.sin(curve["t"]) == pytest.approx(np.ones(len(curve)), abs=1e-13)
    assert {"FS", "FN", "FF"} < set(curve.codes)
    last = -2 * curve["a"] * np.cos(curve["t"])
    roots = np.sort_complex([np.roots([1, 1, v]) for v in last])
    assert np.sort_complex(curve.eigenvalues) / 100 == pytest.approx(roots, abs=1e-6)
    line = fs.continue_points(meet, ("a", "omega"), {"a": (0.5, 3), "omega": (0.2, 3)})
    assert line["a"] == pytest.approx(np.ones(len(line)), abs=1e-13)
    assert line["omega"] * line["t"] == pytest.approx(np.full(len(line), math.pi / 2))
    over = fs.continue_points(saddle, "omega", (0.1, 5))
    assert over["omega"] * over["t"] == pytest.approx(np.full(len(over), math.pi / 6))
    phases = fs.continue_points(saddle, ("y", "t"), {"y": (-3, 3), "t": (0, 6)})
    assert [(q.code, round(q["t"] / math.pi, 12)) for q in phases.special] == [
        ("FS", round(1 / 6, 12)),
        ("FF", round(5 / 6, 12)),
    ]


def test_canard_points_over_two_parameters_and_interfaces():
    """y' = a − x vanishes on the fold x = b^(1/2) of x' = y − x³/3 + b x."""
    model = fs.Model(
        {x: (sp.Piecewise((y - x**3 / 3 + b * x, x > D), (y - x, True))) / eps},
        slow={y: a - x},
        parameters={a: 0.5, b: 1, eps: 0.01, D: 0.5},
    )
    point = of(model, "CN", parameter="a")
    plane = {"a": (0.1, 3), "b": (0.05, 4)}
    curve = fs.continue_points(point, ("a", "b"), plane)
    assert curve["a"] ** 2 == pytest.approx(curve["b"], abs=1e-14)
    assert (curve.admissible == (curve["x"] >= 0.5)).all()
    assert not curve.admissible.all()
    inside = fs.continue_points(point, ("a", "b"), plane, virtual=False)
    assert inside["b"].min() == pytest.approx(0.25, abs=1e-12)
    assert "leave region" in str(inside.outcomes[0])


def test_saved_curves_and_their_points(tmp_path):
    curve = fs.continue_points(of(koper(), "FN", -1), "lambda", (6, 10))
    curve.save(tmp_path / "curve.npz")
    loaded = fs.load(tmp_path / "curve.npz")
    assert repr(loaded) == repr(curve)
    assert loaded.at(**{"lambda": 7})[0]["x"] == pytest.approx(-1)
    with pytest.raises(fs.ArgumentError, match="has no model"):
        fs.continue_points(loaded.special[0], ("k", "lambda"), {"k": (-15, 0), "lambda": (0, 9)})


def test_bad_input():
    node, canard = of(koper(), "FN", -1), of(koper(), "FF")
    for arguments, words in (
        ((node, ("k", "lambda"), {"k": (-15, 0), "lambda": (0, 9)}), "expected one parameter"),
        ((node, ("lambda", "y"), {"lambda": (0, 9), "y": (-2, 2)}), "expected one parameter"),
        ((node, "lambda", (8, 9)), "is outside over"),
        ((canard, "mu", (8, 9)), "unknown parameter 'mu'"),
        ((node, "lambda", {"k": (8, 9)}), "parameter in over"),
    ):
        with pytest.raises(fs.FastSlowError, match=words):
            fs.continue_points(*arguments)
    with pytest.raises(fs.ArgumentError, match="marks"):
        fs.continue_points(node, "lambda", (0, 9), marks={"lambda": 7})
    saddle_node = next(
        q for q in fs.slow_flow(koper().with_parameters({lam: 8})).points if q.values["x"] < 0
    )
    with pytest.raises(fs.ArgumentError, match="folded saddle-node"):
        fs.continue_points(saddle_node, "lambda", (0, 9))
    found = fs.continue_points(node, "lambda", (6, 10)).special[0]
    with pytest.raises(fs.ArgumentError, match="no gradient"):
        found.gradient("k")
