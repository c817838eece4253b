"""The queries that all tables share; see `fastslow.results.base.table.Table`."""

from dataclasses import dataclass, field
from functools import cache

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.formulas.columns import rows_where

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Case:
    """What is asked of a table; empty for queries that it does not have."""

    column: str
    condition: str = ""
    matching: dict = field(default_factory=dict)
    at: dict = field(default_factory=dict)
    nearest: dict = field(default_factory=dict)
    label: str = ""
    sliced: bool = True


P = {"p": 0.1}
CASES = {
    "Branch": Case("x", "x > 0 and x**2 + p < 1", {"stable": True}, P, {"x": 0.9}, "LP1"),
    "Diagram": Case("x", "x > 0", {"stable": True}, P, {"x": 0.9}, "LP2", sliced=False),
    "SpecialPoints": Case("p", "p > 0", {"code": "LP"}, nearest={"x": 0.5}, label="LP1"),
    "PointBranch": Case("q", "q < 1", {"admissible": True}, {"q": 0.75}, {"p": 0.1}, "CP1"),
    "PointCurves": Case("q", "q < 1", {"code": "CP"}, {"q": 0.75}, {"p": 0.1}, "CP1"),
    "Equilibria": Case("x", "x > 0", {"stable": True}, {}, {"x": 0.9}),
    "Tangencies": Case("x", "x > -1", {"two_fold": True}, {}, {"x": 0.9}),
    "Trajectory": Case("x", "x > 0 and v**2 < D", {"region": "S1"}, {"x": 0.1}, {"x": 0.1}),
    "Crossings": Case("v", "v > 0", {"interface": "x - D"}, nearest={"t": 10.0}),
    "Section": Case("v", "v**2 > 0.01", {"direction": 1}, nearest={"t": 10.0}),
    "Spectrum": Case("amplitude", sliced=False),
    "Overlay": Case("distance", "distance > 0.05", {"stable_branch": "S1.1"}, P, {"x": 0.0}),
    "Transitions": Case("delay", "p > 0 and delay > 0", {"type": "jump"}, P, {"p": 0.4}),
    "Ensemble": Case("final x", "C > 2.2 and maximum x > D", {"success": True}, {}, {"C": 2.4}),
    "BifurcationSweep": Case("x", "C < 2.6 and x < 1", {"direction": -1}, {"C": 2.4}, {"x": 0.0}),
    "OrbitBranch": Case("a", "a > 1 and x < 0", {"stable": True}, {"a": 1.5}, {"a": 1.2}),
    "Overlay of orbits": Case(
        "distance", "w > 0.5", {"stable_branch": "O1"}, {"w": 0.4}, {"w": 0.5}
    ),
    "RefinedMap": Case("a", at={"a": 0.7, "b": 0.2}, sliced=False),
}


def orbit_overlay():
    """A run with a fast periodic term over the orbits of its frozen model."""
    x, w, t = sp.symbols("x w t")
    full = fs.Model({x: w - x + sp.cos(t)}, forcing={w: t / 50})
    orbit = fs.find_orbit(full.frozen(fast=["t"]).with_parameters(w=0), [0.5])
    branch = fs.continue_orbits(orbit, "w", over=(-0.1, 1.1))
    return fs.overlay(branch, fs.simulate(full, [0.5], t=(0.0, 50.0)))


@cache
def tables():
    """The smallest table of each kind."""
    full = fs.systems.cusp(omega=0.002)
    diagram = fs.continue_equilibria(full.frozen(), "p", over=(-1.2, 1.2))
    curves = fs.continue_points(diagram, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)})
    overlay = fs.overlay(diagram, fs.simulate(full, [-1.0], periods=1))
    gear = fs.systems.harmonic_gear(omega=0.1, C=2.443)
    run = fs.simulate(gear, [0.0, 0.0], periods=2)
    x, y = sp.symbols("x y")
    pushed = fs.Model({x: sp.sign(y) - x, y: x**2 - 1 - y}, interfaces={"ground": y})
    v, a, t = sp.symbols("v a t")
    driven = fs.Model({x: v, v: a * sp.sin(t) - x - v}, parameters={a: 1})
    square = {"a": (0, 1), "b": (0, 1)}
    return {
        "Branch": diagram[0],
        "Diagram": diagram,
        "SpecialPoints": diagram.special,
        "PointBranch": curves[0],
        "PointCurves": curves,
        "Equilibria": fs.equilibria(full.frozen(), p=0.1),
        "Tangencies": fs.tangencies(pushed),
        "Trajectory": run,
        "Crossings": run.crossings,
        "Section": run.section(interface="x - D"),
        "Spectrum": run.spectrum("x"),
        "Overlay": overlay,
        "Transitions": overlay.transitions,
        "Ensemble": fs.simulate_many(
            gear, [0.0, 0.0], parameters={"C": [2.0, 2.5, 3.0]}, periods=2
        ),
        "BifurcationSweep": fs.bifurcation_sweep(
            gear, "C", [2.0, 2.5, 3.0], [0, 0], settle=1, keep=2
        ),
        "OrbitBranch": fs.continue_orbits(fs.find_orbit(driven, [-1, 0]), "a", over=(0.5, 2)),
        "Overlay of orbits": orbit_overlay(),
        "RefinedMap": fs.refined_map(
            lambda a, b: a > b, square, refinement=fs.Refinement(cells=(4, 4), levels=2)
        ),
    }


@pytest.fixture(params=CASES)
def name(request):
    return request.param


@pytest.fixture
def case(name):
    return CASES[name]


@pytest.fixture
def table(name):
    found = tables()[name]
    assert type(found).__name__ == name.removesuffix(" of orbits")
    return found


def with_query(query):
    """Run a test for the tables that have a query."""
    return pytest.mark.parametrize(
        "name", [name for name, case in CASES.items() if getattr(case, query)]
    )


def test_columns_expressions_and_rows(case, table):
    plain = table.to_dict()
    assert len({len(values) for values in plain.values()}) == 1
    for name, values in plain.items():
        if values.dtype.kind not in "c":
            np.testing.assert_array_equal(table[name], values)
    column = plain[case.column]
    np.testing.assert_array_equal(table[f"2*{case.column} - 1"], 2 * column - 1)
    np.testing.assert_array_equal(table[f"{case.column}*{case.column}"], column * column)
    assert not table[case.column].flags.writeable
    rows = list(table)
    assert len(rows) == len(table)
    assert table[-1] == rows[-1]
    with pytest.raises(IndexError, match=f"the last of {len(table)} is {len(table) - 1}"):
        table[len(table)]
    with pytest.raises(fs.UnknownNameError, match="unknown column 'zz'"):
        table["zz"]
    with pytest.raises(fs.UnknownNameError, match="unknown column 'zz'"):
        table["zz + 1"]
    with pytest.raises(fs.ArgumentError, match="is a condition; expected a value"):
        table[f"{case.column} > 0"]


def test_slices(case, table):
    if case.sliced:
        part = table[0:2]
        assert type(part) is type(table)
        assert part[0] == table[0]
        assert len(part) == min(2, len(table))
    else:
        with pytest.raises(fs.ArgumentError):
            table[0:2]


def parts_of(table, selected):
    """Tables of what is selected: one of the same kind, or several."""
    parts = selected if type(selected) is tuple else (selected,)
    assert all(type(part) is type(table) for part in parts)
    return parts


@with_query("condition")
def test_select_by_a_condition(name, case, table):
    parts = parts_of(table, table.select(case.condition))
    count = len(next(iter(table.to_dict().values())))
    wanted = rows_where(case.condition, table._columns(), table._constants(), count)
    assert 0 < wanted.sum() < count
    if name == "Trajectory":
        # with exact ends, at which the compared expressions are equal
        for part in parts:
            ends = [(p["x"], p["v"] ** 2 - p["D"]) for p in (part[0], part[-1])]
            assert all(min(np.abs(e)) < 1e-12 or p in (0, 1) for p, e in enumerate(ends))
            assert (part["x"][1:-1] > 0).all()
        inside = sum(part.span[1] - part.span[0] for part in parts)
        assert inside == pytest.approx(np.mean(wanted) * np.ptp(run_times(table)), rel=0.2)
    else:
        found = np.concatenate([part[case.column] for part in parts])
        np.testing.assert_array_equal(found, table[case.column][wanted])
    assert all(not len(part) for part in parts_of(table, table.select(f"{case.column} > 1e9")))
    with pytest.raises(fs.UnknownNameError, match="unknown column 'zz'"):
        table.select("zz > 0")
    with pytest.raises(fs.ArgumentError, match="is a value; expected a condition such as x > 0"):
        table.select("1 + 1")
    with pytest.raises(fs.ArgumentError):
        table.select(np.ones(count, dtype=bool))


def run_times(run):
    return np.array(run.span)


@with_query("matching")
def test_select_by_values_and_both(name, case, table):
    parts = parts_of(table, table.select(**case.matching))
    assert any(map(len, parts))
    both = parts_of(table, table.select(case.condition, **case.matching))
    in_turn = [
        part
        for one in parts_of(table, table.select(case.condition))
        for part in parts_of(table, one.select(**case.matching))
    ]
    count = sum(len(part.to_dict()[case.column]) for part in both)
    if name != "Trajectory":
        assert count == sum(len(part.to_dict()[case.column]) for part in in_turn)


@with_query("at")
def test_at_a_value_and_at_an_array(name, case, table):
    one = table.at(**case.at)
    several = table.at(**{key: [value, value] for key, value in case.at.items()})
    assert len(several) == 2
    for found in several:
        np.testing.assert_array_equal(np.asarray(found, object), np.asarray(one, object))
    first = next(iter(case.at))
    rest = {key: value for key, value in case.at.items() if key != first}
    with pytest.raises(fs.UnknownNameError, match="'zz'"):
        table.at(**{"zz": 0.0, **rest})
    with pytest.raises(fs.ArgumentError):
        table.at(**{first: "0", **rest})
    with pytest.raises(fs.ArgumentError):
        table.at(**rest)


@with_query("nearest")
def test_nearest(name, case, table):
    found = table.nearest(**case.nearest)
    assert type(found) is type(next(iter(table))) or type(found).__name__ in (
        "Equilibrium",
        "SpecialPoint",
    )
    with pytest.raises(fs.UnknownNameError, match="'zz'"):
        table.nearest(zz=0.0)
    with pytest.raises(fs.ArgumentError, match="expected values of some of"):
        table.nearest()
    with pytest.raises(fs.ArgumentError, match="expected a finite number"):
        table.nearest(**dict.fromkeys(case.nearest, np.nan))


@with_query("label")
def test_labels(name, case, table):
    found = table[case.label]
    assert isinstance(found, fs.SpecialPoint)
    assert found.label == case.label
    wrong = case.label[:2] + "9"
    with pytest.raises(fs.UnknownNameError, match=f"unknown label '{wrong}'; did you mean"):
        table[wrong]
    with pytest.raises(fs.UnknownNameError, match="unknown label 'XX1'"):
        table["XX1"]


def test_files_frames_and_texts(table, tmp_path):
    table.save(tmp_path / "table.npz")
    assert fs.load(tmp_path / "table.npz") == table
    assert list(table.to_frame().columns) == list(table.to_dict())
    assert set(table.to_xarray().variables) == set(table.to_dict())
    assert len(repr(table).splitlines()) <= 10
    assert table._repr_html_().startswith("<table>")


def test_selected_slices_keep_what_is_between_rows():
    """A slice of a curve solves between its rows as the whole curve does."""
    curve = tables()["PointBranch"]
    whole = curve.at(q=0.75)
    parts = [point for part in curve.select("q < 1") for point in part.at(q=0.75)]
    assert [(p["p"], p["x"]) for p in parts] == [(p["p"], p["x"]) for p in whole]
    assert all(p.converged for p in parts)


def test_conditions_in_sympy_and_chained():
    branch = tables()["Branch"]
    x, p = sp.symbols("x p")
    for condition in ("-0.5 < x < 0.5", (x > -0.5) & (x < 0.5), "not (x <= -0.5 or x >= 0.5)"):
        (part,) = branch.select(condition)
        assert np.abs(part["x"]).max() < 0.5
    assert len(branch.select(sp.Abs(x) > p)) >= 1


def test_an_interval_on_which_a_condition_holds_has_exact_ends():
    x, v = sp.symbols("x v")
    fine = fs.Integration(rtol=1e-13)
    run = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 7), integration=fine)
    (first, last) = run.select("x > 1/2")
    assert first.span == pytest.approx((0, np.pi / 3), abs=1e-11)
    assert last.span == pytest.approx((5 * np.pi / 3, 7), abs=1e-11)
    # a tangency does not divide an interval
    assert [part.span for part in run.select("x <= 1")] == [run.span]
    assert run.select("x > 2") == ()
    both = run.select("x < 0 and v < 0", between=(0, 2))
    assert [part.span for part in both] == [pytest.approx((np.pi / 2, 2.0), abs=1e-11)]
    with pytest.raises(fs.ArgumentError, match="is not a polynomial"):
        run.select("sin(x) > 0")
    sampled = fs.simulate(fs.Model({x: v, v: -x}), [1, 0], t=(0, 7), samples=70, dense=False)
    (part, _) = sampled.select("sin(x) > 0")
    assert part.t[-1] < np.pi / 2 < sampled.t[len(part)]


@pytest.mark.parametrize(
    ("name", "matching", "error", "words"),
    [
        ("SpecialPoints", {"code": "LPX"}, KeyError, "unknown code 'LPX'; did you mean 'LP'"),
        ("SpecialPoints", {"code": 3}, ValueError, "code = 3; expected text"),
        ("SpecialPoints", {"x": 0.5}, ValueError, "by a condition, such as select('x > 0')"),
        ("SpecialPoints", {"cod": "LP"}, KeyError, "'cod'; did you mean 'code'"),
        ("Crossings", {"interface": "x - E"}, KeyError, "did you mean 'x - D'"),
        ("Section", {"direction": 2}, KeyError, "unknown direction '2"),
        ("Ensemble", {"regime": "bilatral"}, KeyError, "did you mean 'bilateral'"),
        ("Ensemble", {"success": 1}, ValueError, "success = 1; expected True or False"),
        ("Equilibria", {"stability": "stabel"}, KeyError, "did you mean 'stable'"),
        ("PointCurves", {"code": "XX"}, KeyError, "unknown special point code 'XX'"),
    ],
)
def test_values_that_no_column_has(name, matching, error, words):
    with pytest.raises(error) as raised:
        tables()[name].select(**matching)
    assert isinstance(raised.value, fs.FastSlowError)
    assert words in str(raised.value)


def test_no_rows_are_a_table_too():
    none = tables()["SpecialPoints"].select(code="HB")
    assert len(none) == 0
    assert none["x"].shape == (0,)
    assert none.select("x > 0", code="LP") == none
    with pytest.raises(fs.ArgumentError, match="has no rows"):
        tables()["Section"].select("v > 1e9").nearest(v=0.0)
    with pytest.raises(fs.UnknownNameError, match=r"unknown label 'LP1' \(known: none\)"):
        none["LP1"]
