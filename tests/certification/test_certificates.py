"""Certificates of diagrams: counts, regions, what a diagram lacks, and what is not proved."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.certification import certifying
from fastslow.certification.boxes import intersections, linking, pruning
from tests.certification.systems import cubic as random_cubic
from tests.certification.systems import morris_lecar

pytestmark = pytest.mark.slow

x, y, v, p = sp.symbols("x y v p")


def model_of(*rates, states=(x, y)):
    return fs.Model(dict(zip(states, rates, strict=False)), parameters={p: 0})


def certified(model, over=(-1, 1), **window):
    diagram = fs.continue_equilibria(model, "p", over)
    return fs.certify(model, diagram, window=window)


@pytest.fixture(scope="module")
def cubic():
    model = model_of(p + x - x**3)
    return model, fs.continue_equilibria(model, "p", (-1, 1))


@pytest.fixture(scope="module")
def proof(cubic):
    return fs.certify(*cubic, window={x: (-2, 2)})


def test_counts_are_those_of_the_closed_form(proof):
    assert proof.complete
    assert proof.why == ""
    assert proof.missing == ()
    assert proof.diagram.completeness == "proved"
    # p + x − x³ has three real roots for |p| < 2/√27
    for value in np.linspace(-1, 1, 101):
        assert proof.count(p=value) == (3 if abs(value) < 2 / 27**0.5 else 1)


def test_nodes_enclose_solutions_to_rounding(proof):
    (curve,) = proof.curves
    middle = 0.5 * (curve.node_low + curve.node_high)
    assert np.abs(middle[:, 1] - middle[:, 0] ** 3 + middle[:, 0]).max() < 1e-14
    assert (curve.node_high - curve.node_low).max() < 1e-14
    # from one edge of the window to the other, with two folds
    assert sorted(middle[[0, -1], 1]) == [-1, 1]
    signs = curve.direction[curve.direction != 0]
    assert np.count_nonzero(np.diff(signs)) == 2
    # consecutive arcs have a node in common
    inside = (curve.low <= curve.node_low[:-1]) & (curve.node_high[:-1] <= curve.high)
    assert inside.all()


def test_the_window_bounds_the_count(cubic):
    model, diagram = cubic
    # x = 1 at p = 0 is outside
    part = fs.certify(model, diagram, window={x: (-2, 0.5)})
    assert part.complete
    assert part.count(p=0.0) == 2
    assert part.count(p=0.9) == 0
    assert [c.ends for c in part.curves] == [("edge", "edge")]


def test_a_closed_curve():
    found = certified(model_of(p**2 + 4 * x**2 - 1), over=(-3, 3), x=(-2, 2))
    assert [c.closed for c in found.curves] == [True]
    assert [found.count(p=value) for value in (-2, 0.5, 0.99, 1.01)] == [0, 2, 2, 0]


@pytest.mark.parametrize("number", [0, 1])
def test_a_deleted_branch_is_found_again(number):
    # an isola at p² + 16 (x − 1)² = 1/16 and a curve below it
    model = model_of((p**2 + 16 * (x - 1) ** 2 - sp.Rational(1, 16)) * (p - x - 1) / 4)
    model = fs.Model({x: model.rates["x"]}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    assert len(diagram) == 2
    branches = tuple(b for k, b in enumerate(diagram.branches) if k != number)
    found = fs.certify(model, replace(diagram, branches=branches), window={x: (-4, 4)})
    assert found.complete
    assert len(found.missing) == 1
    assert "the diagram lacked 1" in repr(found)
    again = found.diagram
    assert len(again) == 2
    assert again.completeness == "proved"
    assert again.outcome.code == "added"
    for value in (-0.2, 0.0, 0.2):
        states = [e["x"] for e in diagram.at(p=value)]
        assert sorted(e["x"] for e in again.at(p=value)) == pytest.approx(sorted(states))
        assert found.count(p=value) == len(states) == 3


@pytest.mark.parametrize("width", [1e-2, 1e-6])
def test_a_window_between_two_rows_lacks_nothing(cubic, width):
    model, diagram = cubic
    found = fs.certify(model, diagram, window={x: (0, width)})
    assert found.complete
    assert found.missing == ()
    (branch,) = diagram.branches
    # without the half that passes through x = 0 nothing is there
    cut = replace(diagram, branches=(branch[: len(branch) // 3],))
    assert len(fs.certify(model, cut, window={x: (0, width)}).missing) == 1


def test_half_of_a_branch_is_found_again(cubic):
    model, diagram = cubic
    (branch,) = diagram.branches
    cut = replace(diagram, branches=(branch[: len(branch) // 2],))
    found = fs.certify(model, cut, window={x: (-2, 2)})
    assert len(found.missing) == 1
    assert sorted(e["x"] for e in found.diagram.at(p=0.1)) == pytest.approx(
        sorted(e["x"] for e in diagram.at(p=0.1))
    )


def test_the_gear_region_by_region():
    gear = fs.systems.harmonic_gear().frozen()
    diagram = fs.continue_equilibria(gear, "w", (-2, 6))
    found = fs.certify(gear, diagram, window={"x": (-2, 2), "v": (-3, 8)})
    assert found.complete
    real = {c.region: c for c in found.curves if c.admissible}
    assert sorted(real) == ["S1", "S2", "S3"]
    # the dead zone is one vertical segment between −D and D
    gap, width = real["S2"], gear.parameters["D"]
    assert set(gap.free) == {"x"}
    assert sorted(gap.node_low[[0, -1], 0]) == pytest.approx([-width, width], abs=1e-8)
    assert [found.count(w=value) for value in (-1.5, -0.1, 0.1, 5)] == [1, 1, 1, 1]
    with pytest.raises(fs.ArgumentError, match="form a continuum"):
        found.count(w=0.0)
    virtual = [c for c in found.curves if not c.admissible]
    assert {c.region for c in virtual} == {"S1", "S2", "S3"}


def test_pseudo_equilibria():
    model = fs.Model({x: p - x - 2 * sp.sign(x) + x * y, y: x - 2 * y + p}, parameters={p: 0})
    found = certified(model, over=(-3, 3), x=(-5, 5), y=(-5, 5))
    assert found.complete
    sliding = [c for c in found.curves if c.region == "S1|S2"]
    # x = 0, y = p/2 and p = 2 s for |s| ≤ 1
    assert [c.over for c in sliding] == [pytest.approx((-2, 2))]
    for value in (-2.9, -0.5, 1.0, 2.5):
        # roots of p − x ∓ 2 + x (x + p)/2 for x of the right sign, and x = 0
        real = sum(
            root.imag == 0 and np.sign(root.real) == sign
            for sign in (1, -1)
            for root in np.roots([0.5, value / 2 - 1, value - 2 * sign])
            if abs(root.real) < 5 and abs((root.real + value) / 2) < 5
        )
        assert found.count(p=value) == real + (abs(value) < 2)


@pytest.mark.parametrize("belt", [0, 1])
def test_dry_friction_is_named(belt):
    # in a unit of time in which the velocity is v/2, a multiple of the interface function
    block = fs.Model({x: 2 * (v - belt), v: 2 * (p - x - sp.sign(v - belt))}, parameters={p: 0})
    found = certified(block, over=(-1, 1), x=(-5, 5), v=(-2, 2))
    assert not found.complete
    assert found.why == (
        "equilibria on S1|S2 form continua, which are not certified (see the bands of the diagram)"
    )


def test_a_rate_that_vanishes_everywhere_is_named():
    model = model_of(p - x, 0 * y)
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    found = fs.certify(model, diagram, window={x: (-2, 2), y: (-2, 2)})
    assert found.searched == 0
    assert found.why.startswith("equilibria on S1 form continua, which are not certified")


def test_a_branch_point_is_not_proved():
    found = certified(model_of(x * (p - x**2)), x=(-2, 2))
    assert not found.complete
    assert "nothing is proved in" in found.why
    assert "a branch point, a degenerate equilibrium, or curves closer" in found.why
    (boxes,) = found.left
    assert np.abs([boxes.low, boxes.high]).max() < 1e-4
    assert found.diagram.completeness != "proved"
    assert found.missing == ()
    # counts are proved elsewhere
    assert [found.count(p=value) for value in (-0.5, 0.5)] == [1, 3]
    with pytest.raises(fs.ArgumentError, match="boxes are left"):
        found.count(p=0.0)


def test_curves_that_touch_are_left_in_few_boxes():
    """x = 1 ± p² have the same tangent at p = 0."""
    model = model_of((x - 1) ** 2 - p**4)
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    window, coarse = {x: (-3, 3)}, fs.Certification(width=1e-6)
    found = fs.certify(model, diagram, window=window, certification=coarse)
    assert "a branch point, a degenerate equilibrium, or curves closer" in found.why
    (boxes,) = found.left
    assert np.abs([boxes.low - [1, 0], boxes.high - [1, 0]]).max() < 1e-2
    assert found.searched < 100_000
    assert [found.count(p=value) for value in (-0.5, 0.5)] == [2, 2]


def test_terms_that_cancel_are_proved_and_named_by_what_was_given():
    """The curve x = p; in floating point its rate is a multiple of two."""
    found = certified(model_of((x + 10**8) ** 2 - x**2 - 2 * 10**8 * x - 10**16 + x - p), x=(-3, 3))
    assert found.complete
    assert [found.count(p=value) for value in (-0.41, 0.37)] == [1, 1]
    assert found.diagram.completeness == "proved"
    # no points were given
    assert "from_points" not in repr(found) + str(found.diagram.outcome)


def test_degenerate_cases():
    # the diagram has no branch for the equilibria at p = 0 alone
    still = certified(model_of(p), x=(-5, 5))
    assert still.complete
    assert len(still.missing) == 1
    assert (len(still.diagram), still.diagram.completeness) == (1, "proved")
    # a boundary equilibrium at the end of the range is no missing curve
    corner = certified(
        model_of(p - sp.Abs(x) + y / 2, -y + sp.Abs(y - 1) / 3 + p), x=(-5, 5), y=(-5, 5)
    )
    assert corner.complete
    assert corner.missing == ()
    # a periodic state
    turning = fs.Model({x: p - sp.sin(x)}, parameters={p: 0}, periodic={x: 2 * sp.pi})
    found = certified(turning, over=(-2, 2), x=(-3, 3))
    assert found.complete
    assert found.missing == ()
    assert [found.count(p=value) for value in (-1.5, 0.5, 1.5)] == [0, 2, 0]
    # irrational numbers
    assert certified(model_of(sp.pi * p - sp.sqrt(2) * x), x=(-5, 5)).complete


#: The angle of a pendulum under a torque, and one that turns with the parameter.
TORQUE, TURNING = {x: p - sp.sin(x)}, {x: sp.sin(x - 3 * p) + sp.sin(x) / 3}


@pytest.mark.parametrize(
    ("rates", "window"),
    [(TORQUE, (-3, 3)), (TORQUE, (20, 25)), (TORQUE, (9.42, 9.43)), (TURNING, (1, 7))],
)
def test_windows_of_periodic_states(rates, window):
    model = fs.Model(rates, parameters={p: 0}, periodic={x: 2 * sp.pi})
    diagram = fs.continue_equilibria(model, "p", (-2, 2))
    found = fs.certify(model, diagram, window={x: window})
    assert found.complete
    assert (found.missing, found.diagram.completeness) == ((), "proved")
    value = 0.123
    angles = np.array([row["x"] for row in diagram.at(p=value)])
    turns = angles[:, None] + 2 * np.pi * np.arange(-5, 6)
    assert found.count(p=value) == np.count_nonzero((turns > window[0]) & (turns < window[1]))
    # the whole branch is found again, also that part of it that is outside the window
    again = fs.certify(model, replace(diagram, branches=diagram.branches[1:]), window={x: window})
    assert again.diagram.completeness == "proved"
    assert len(again.diagram) == len(diagram)
    with pytest.raises(fs.ArgumentError, match="expected a range no longer than the period"):
        fs.certify(model, diagram, window={x: (-4, 4)})


def test_what_a_diagram_lacks_in_another_turn():
    model = fs.Model(TORQUE, parameters={p: 0}, periodic={x: 2 * sp.pi})
    diagram = fs.continue_equilibria(model, "p", (-2, 2))
    (branch,) = diagram.branches
    half = replace(diagram, branches=(branch[: len(branch) // 2],))
    found = fs.certify(model, half, window={x: (18.8, 25)})
    (curve,) = found.curves
    assert 0 < sum(len(part.free) for part in found.missing) < len(curve.free)


@pytest.mark.parametrize(
    ("force", "window", "open_"),
    [(0, (-3, 3), True), (0, (0.1, 3), False), (3, (-3, 3), False)],
)
def test_intersections_of_discontinuities(force, window, open_):
    # at x = y = 0 there is an equilibrium for no force, in the hull of the four fields
    rates = {x: force - sp.sign(x) + p / 2 - x, y: -sp.sign(y) - p / 3 - y}
    model = fs.Model(rates, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    found = fs.certify(model, diagram, window={x: window, y: (-3, 3)})
    assert found.complete != open_
    if open_:
        assert found.why == (
            "equilibria on intersections of discontinuities in the window are not certified: "
            "x = 0 and y = 0"
        )


def test_a_pole_is_named():
    found = certified(model_of(p + x - 1 / x), x=(-4, 4))
    assert "a pole, where x = 0" in found.why
    edge = certified(model_of(p + sp.log(x)), x=(-1, 4))
    assert "the edge of a domain, where x = 0" in edge.why
    assert len(edge.curves) == 1


@pytest.mark.parametrize(
    ("rate", "why"),
    [
        (p - sp.asin(x), "the edge of a domain, where 1 - x**2 = 0"),
        (p + 1 - sp.exp(400 * x) / 1000, "the rates have no bounds there, as at the edge"),
    ],
)
def test_what_has_no_bounds_is_named(rate, why):
    model = model_of(rate)
    diagram = fs.continue_equilibria(model, "p", (-0.5, 0.5))
    found = fs.certify(model, diagram, window={x: (-2, 2)})
    assert not found.complete
    assert why in found.why
    assert certifying._critical([p - sp.tan(x)]) == [("a pole", sp.cos(x))]


@pytest.mark.parametrize("roots", [(0, 1, -1), (sp.Rational(1, 3), sp.sqrt(2), -1 / sp.pi)])
def test_curves_through_the_edges_of_boxes_are_counted_once(roots):
    # x = 0 and x = ±1 are at edges of boxes, each of which proves the curve
    model = model_of(sp.expand(sp.prod([x - root for root in roots])))
    found = certified(model, x=(-2, 2))
    assert found.complete
    assert len(found.curves) == found.count(p=0.3) == 3
    assert found.diagram.completeness == "proved"


def test_pieces_that_are_not_separated_are_named(cubic, monkeypatch):
    first = linking._Linked._continued

    def without_containment(self, free):
        found = first(self, free)
        self.same = [(one[:0], other[:0]) for one, other in self.same]
        return found

    monkeypatch.setattr(linking._Linked, "_continued", without_containment)
    found = fs.certify(*cubic, window={x: (-2, 2)})
    assert "curves are not separated from one another, and may be the same" in found.why
    assert "not separated" in repr(found.curves[0])
    with pytest.raises(fs.ArgumentError, match="is not decided"):
        found.count(p=0.1)


def test_badly_scaled_ranges_are_ranges():
    nano = fs.Model({x: p * 1e9 + x - x**3 * 1e-18}, parameters={p: 0})
    found = certified(nano, x=(-3e9, 3e9))
    assert found.complete
    assert "p in [-1, 1]" in repr(found.curves[0])


def test_too_few_boxes_are_reported(cubic):
    few = fs.Certification(max_boxes=20)
    found = fs.certify(*cubic, window={x: (-2, 2)}, certification=few)
    assert not found.complete
    assert found.searched == 20
    assert "were not searched (max_boxes = 20)" in found.why
    assert "not complete" in repr(found)
    assert {boxes.why for boxes in found.left} == {"not searched"}


def test_diagrams_of_other_models_are_refused(cubic):
    _, diagram = cubic
    with pytest.raises(fs.ArgumentError, match="the diagram has the states x and the model x, y"):
        fs.certify(model_of(p - x, -y), diagram, window={x: (-1, 1), y: (-1, 1)})
    q = sp.Symbol("q")
    one = fs.Model({x: p - q * x}, parameters={p: 0, q: 1})
    found = fs.continue_equilibria(one, "p", (-1, 1))
    with pytest.raises(fs.ArgumentError, match=r"the diagram has q = 1\.0 and the model 2\.0"):
        fs.certify(one.with_parameters(q=2), found, window={x: (-2, 2)})


def test_models_without_interval_arithmetic_are_refused():
    model = model_of(p - sp.erf(x))
    diagram = fs.continue_equilibria(model, "p", (0.1, 0.3))
    with pytest.raises(fs.ModelError, match="erf, which has no interval arithmetic"):
        fs.certify(model, diagram, window={x: (-1, 1)})
    wall = fs.Model({x: v, v: -x + p}, parameters={p: 0}, resets={"x >= 1": {v: -v}})
    diagram = fs.continue_equilibria(wall, "p", (-1, 1))
    with pytest.raises(fs.ModelError, match="certify accepts models without resets"):
        fs.certify(wall, diagram, window={x: (-1, 1), v: (-1, 1)})


def test_certificates_are_saved(proof, tmp_path):
    for suffix in ("npz", "nc"):
        file = tmp_path / f"one.{suffix}"
        proof.save(file)
        again = fs.load(file)
        assert again == proof
        assert again.count(p=0.1) == 3
    frame = proof.to_frame()
    names = ["curve", "region", "x low", "x high", "p low", "p high", "stability"]
    assert list(frame.columns) == names
    assert len(frame) == len(proof.curves[0].node_low)
    assert set(frame["stability"]) == {"stable", "unstable", "undecided"}


def test_the_repr_names_the_window(proof):
    assert repr(proof) == (
        "Certificate: 1 curve of equilibria, proved, and no other equilibrium with x in [-2, 2], "
        "p in [-1, 1]; all folds, Hopf points and boundary equilibria: 2 LP"
    )


@pytest.mark.sample(1)
@pytest.mark.parametrize("system", [morris_lecar(), random_cubic(2, 2)])
def test_smooth_models_are_proved(system):
    rates, unknowns, ranges = system
    *states, parameter = unknowns
    model = fs.Model(dict(zip(states, rates, strict=True)), parameters={parameter: 0})
    *window, over = ranges
    name = parameter.name
    bounds = {s.name: tuple(map(float, r)) for s, r in zip(states, window, strict=True)}
    diagram = fs.continue_equilibria(model, name, over, window=bounds)
    found = fs.certify(model, diagram, window=bounds)
    assert found.complete
    for value in np.linspace(*map(float, over), 7)[1:-1]:
        # equilibria of the branches, which the window cuts
        assert found.count(**{name: value}) == len(diagram.at(**{name: value}))


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "name", ["cusp", "fitzhugh_nagumo", "hindmarsh_rose", "van_der_pol_relaxation"]
)
def test_ready_made_models_are_proved(name):
    # python -m tests.benchmarks certificates measures larger ones
    model = getattr(fs.systems, name)().frozen()
    parameter = next(iter(model.free))
    diagram = fs.continue_equilibria(model, parameter, (-1.5, 1.5))
    window = {s: (-60, 20) if s == "y" else (-6, 6) for s in model.states}
    found = fs.certify(model, diagram, window=window)
    assert found.complete, found.why
    assert found.missing == ()
    for value in np.linspace(-1.43, 1.47, 5):
        inside = [
            all(low <= e[s] <= high for s, (low, high) in window.items())
            for e in diagram.at(**{parameter: value})
        ]
        assert found.count(**{parameter: value}) == sum(inside)


def test_a_diagram_with_a_branch_twice_is_not_proved():
    x, p = sp.symbols("x p")
    model = fs.Model({x: p + x - x**3}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    found = fs.certify(model, replace(diagram, branches=2 * diagram.branches), window={x: (-2, 2)})
    assert found.complete
    assert found.diagram.completeness != "proved"
    assert "run along the same curve" in repr(found)


def test_special_points_twice_or_elsewhere():
    x, p = sp.symbols("x p")
    model = fs.Model({x: p + x - x**3}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", (-1, 1))
    (branch,) = diagram.branches
    same = [replace(point, label=f"{point.label}0") for point in branch.special]
    twice = replace(branch, special=type(branch.special)(same))
    found = fs.certify(model, replace(diagram, branches=(branch, twice)), window={x: (-2, 2)})
    # a point that is on two branches is listed once
    assert found.all_points
    assert [point.label for point in found.points] == ["LP1", "LP2"]
    false = replace(diagram["LP1"], label="LP7", state=diagram["LP1"].state + 0.3)
    special = type(branch.special)([*branch.special, false])
    more = replace(branch, special=special, special_rows=(*branch.special_rows, 1))
    found = fs.certify(model, replace(diagram, branches=(more,)), window={x: (-2, 2)})
    assert found.all_points
    assert [point.label for point in found.points] == ["LP1", "LP2"]
    assert "LP7 of the diagram is none of the proved special points" in found.notes


def test_points_at_some_distance_from_the_proved_ones_are_named():
    x, y, p = sp.symbols("x y p")
    model = fs.Model({x: p * x - y - x**3, y: x + p * y - y**3}, parameters={p: 0.5})
    window = {x: (-2, 2), y: (-2, 2)}
    diagram = fs.continue_equilibria(model, "p", (-1, 1), window=window)
    (branch,) = diagram.branches
    points = (replace(q, parameters={"p": 1e-3}) if q.code == "HB" else q for q in branch.special)
    moved = replace(branch, special=type(branch.special)(points))
    found = fs.certify(model, replace(diagram, branches=(moved,)), window=window)
    assert found.points["code"].tolist() == ["HB"]
    assert "HB1 is not accurate: the proved point is 0.0005 of the window from it" in found.notes
    assert fs.certify(model, diagram, window=window).notes == ()


@pytest.mark.parametrize("error", [3e-7, 2e-5])
def test_an_inaccurate_fold_is_not_added_again(cubic, error):
    model, diagram = cubic
    (branch,) = diagram.branches
    moved = (
        replace(q, state=q.state + 4 * error, parameters={"p": q["p"] + 2 * error})
        if q.label == "LP1"
        else q
        for q in branch.special
    )
    moved = replace(branch, special=type(branch.special)(moved))
    found = fs.certify(model, replace(diagram, branches=(moved,)), window={x: (-2, 2)})
    assert found.points["label"].tolist() == ["LP1", "LP2"]
    assert found.missing == ()
    assert ("LP1 is not accurate" in repr(found)) == (error > 1e-6)


def test_an_intersection_with_bounds_that_are_no_numbers_stays_open(monkeypatch):
    blocks = fs.Model(
        {x: -sp.sign(x) - sp.sign(y) / 2 + p, y: -sp.sign(y) + sp.sign(x) / 2 + p},
        parameters={p: 0},
    )
    ranges = {"x": (-1.0, 1.0), "y": (-1.0, 1.0), "p": (2.0, 3.0)}
    assert intersections.open_intersections(blocks, "p", ranges) == []
    known = intersections.enclosed

    def undefined(*arguments):
        low, high = known(*arguments)
        return np.full_like(low, np.nan), np.full_like(high, np.nan)

    monkeypatch.setattr(intersections, "enclosed", undefined)
    assert len(intersections.open_intersections(blocks, "p", ranges)) == 1


def test_equilibria_at_two_folds_are_not_certified():
    relay = fs.Model({x: v, v: p - x - v / 5 - sp.sign(x - 1) / 4}, parameters={p: 0})
    diagram = fs.continue_equilibria(relay, "p", (0, 2))
    found = fs.certify(relay, diagram, window={x: (-2, 3), v: (-1, 1)})
    assert not found.complete
    assert "the equilibria on S1|S2 (two-fold) are not certified" in found.why


def test_regions_that_an_interrupt_left_out_are_named(monkeypatch):
    gear = fs.systems.harmonic_gear().frozen()
    diagram = fs.continue_equilibria(gear, "w", (-2, 6))

    def interrupted(*program, **settings):
        return replace(pruning.prune_window(*program, **settings), interrupted=True)

    monkeypatch.setattr(certifying, "prune_window", interrupted)
    found = fs.certify(gear, diagram, window={"x": (-2, 2), "v": (-3, 8)})
    assert not found.complete
    assert found.diagram.completeness != "proved"
    assert found.why == "the search was interrupted; S2, S3 were not searched"
