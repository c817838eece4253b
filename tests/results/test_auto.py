"""Files of AUTO-07p against closed forms and against this package's own continuation."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.io.auto_files import _tangents

DATA = Path(__file__).parent / "data"


@pytest.fixture(scope="module")
def fhn():
    return fs.read_auto(DATA / "b.fhn")


def model(slow=False):
    x, y, w, e, a, b, t = sp.symbols("x y w e a b t")
    full = fs.Model(
        {x: x - x**3 / 3 - y + w, y: e * (x + a - b * y)},
        forcing={w: 0.2 + 0.6 * sp.sin(t / 1000)},
        parameters={e: 0.1, a: 0.7, b: 2},
    )
    return full if slow else full.frozen()


def load_at(x):
    return -x + x**3 / 3 + (x + 0.7) / 2


def test_what_is_in_the_file(fhn):
    assert fhn.states == ("x", "y")
    assert fhn.parameter == "w"
    assert fhn.parameters == {"e": 0.1, "a": 0.7, "b": 2.0}
    assert fhn.over == (pytest.approx(load_at(-2.2), abs=1e-10), 3.0)
    assert len(fhn) == 1
    assert np.abs(fhn["w"] - load_at(fhn["x"])).max() < 2e-9
    assert np.abs(fhn["x + a - b*y"]).max() < 2e-9
    assert [p.label for p in fhn.special if p.code != "UZ"] == ["EP1", "HB1", "LP1", "LP2", "HB2"]
    assert [p["w"] for p in fhn.special("UZ")] == [0.25, 0.25, 0.25, 3.0]
    assert fhn.outcome.message == (
        "read 1 curve of equilibria from b.fhn, a file of AUTO-07p; omitted: periodic solutions "
        "(IPS = 2), curves in two parameters (ISW = 2)."
    )


def test_special_points_against_closed_forms(fhn):
    # det = 0 at x² = 1/2, trace = 0 at x² = 0.8; AUTO locates them to about six digits
    root = np.sqrt(0.5)
    assert fhn.folds["x"] == pytest.approx([-root, root], abs=1e-6)
    assert fhn.folds["w"] == pytest.approx([load_at(-root), load_at(root)], abs=1e-9)
    hopf = np.sqrt(0.8)
    assert fhn.special("HB")["x"] == pytest.approx([-hopf, hopf], abs=1e-6)


def test_against_this_package(fhn):
    own = fs.continue_equilibria(model(), "w", over=fhn.over)
    for code in ("LP", "HB"):
        theirs, ours = (sorted(d.special(code)["w"]) for d in (fhn, own))
        assert theirs == pytest.approx(ours, abs=1e-7)
    assert fhn.bistable() == pytest.approx(own.bistable(), abs=1e-6)
    for value in (-1.0, 0.3, 0.5, 2.9):
        read, solved = fhn.at(w=value), own.at(w=value)
        assert [p.stability for p in read] == [p.stability for p in solved]
        assert [p["x"] for p in read] == pytest.approx([p["x"] for p in solved], abs=2e-5)
        assert [p.type for p in read] == [p.type for p in solved]
        assert all(p.interpolated for p in read)


def test_eigenvalues(fhn):
    x = fhn["x"]
    jacobians = np.array([[[1 - v**2, -1], [0.1, -0.2]] for v in x])
    exact = np.linalg.eigvals(jacobians).astype(complex)
    apart = np.sort_complex(fhn[0].eigenvalues) - np.sort_complex(exact)
    # printed with six digits
    assert np.abs(apart).max() < 1e-5


def test_it_lies_under_a_trajectory_and_is_drawn(fhn):
    run = fs.simulate(model(slow=True), [-1.3, -0.3], t=(0, 6000))
    theirs = fs.overlay(fhn, run)
    ours = fs.overlay(fs.continue_equilibria(model(), "w", over=fhn.over), run)
    assert len(theirs.transitions) == len(ours.transitions) > 0
    assert theirs.delays == pytest.approx(ours.delays, abs=1e-3)
    drawing = fs.plot.diagram(fhn)
    assert {line.get_label() for line in drawing.lines} >= {"stable", "unstable"}


def test_branches_that_meet():
    pitch = fs.read_auto(DATA / "b.pitch", names={"PAR(1)": "q", "U(1)": "x", "U(2)": "v"})
    assert pitch.states == ("x", "v")
    assert pitch.parameters == {}
    trivial, upper, lower = pitch
    assert [p.code for p in trivial.special] == ["EP", "BP", "EP"]
    assert np.abs(upper["x**2 - q"]).max() < 1e-9
    assert np.abs(upper["x"] + lower["x"]).max() == 0
    assert trivial.stable_intervals() == pytest.approx(np.array([[-1, 0]]), abs=1e-9)
    assert pitch.bistable() == pytest.approx(np.array([[0, 1.0088491623]]), abs=1e-9)
    assert upper.intersections(lower, "q", "x") == pytest.approx(np.zeros((1, 2)), abs=1e-9)


def test_without_solutions(tmp_path):
    alone = shutil.copy(DATA / "b.fhn", tmp_path / "b.alone")
    diagram = fs.read_auto(alone)
    assert diagram.parameters == {}
    assert np.isnan(diagram[0].eigenvalues).all()
    assert [p.stable for p in diagram.at(w=0.3)] == [True, False, True]
    assert {p.type for p in diagram.at(w=0.3)} == {"unknown"}
    given = fs.read_auto(alone, DATA / "s.fhn")
    assert given.parameters == {"e": 0.1, "a": 0.7, "b": 2.0}


def test_tangents_are_those_of_the_curve(fhn):
    x = fhn["x"]
    exact = np.column_stack([np.ones_like(x), np.full_like(x, 0.5), x**2 - 0.5])
    exact /= np.linalg.norm(exact, axis=1)[:, None]
    assert np.abs(fhn[0].tangent - exact).max() < 1e-3


def test_no_convergence_and_plain_names(tmp_path):
    lines = (DATA / "b.fhn").read_text().splitlines()
    lines = [line for line in lines[:200] if "names" not in line]
    lines[-1] = lines[-1].replace("  -4   11", "  -9   11")
    (tmp_path / "fort.7").write_text("\n".join(lines))
    diagram = fs.read_auto(tmp_path / "fort.7", names={"w": "load"})
    (branch,) = diagram.branches
    assert diagram.parameter == "load"
    assert branch.outcome.code == "no convergence"
    assert not branch.special[-1].converged


def test_what_cannot_be_read(tmp_path, fhn):
    def written(text, name="b.x"):
        path = tmp_path / name
        path.write_text(text)
        return path

    text = (DATA / "b.fhn").read_text()
    with pytest.raises(fs.FileError, match=r"b\.none cannot be read: No such file"):
        fs.read_auto(tmp_path / "b.none")
    with pytest.raises(fs.FileError, match="contains no curve"):
        fs.read_auto(written(""))
    with pytest.raises(fs.FileError, match="numbers without a header"):
        fs.read_auto(written("1 2 3 4 5 6"))
    with pytest.raises(fs.FileError, match="'hello' is no number"):
        fs.read_auto(written("   0    PT  TY  LAB  w  L2-NORM\nhello 1 2 3 4 5\n"))
    with pytest.raises(fs.FileError, match="5 numbers, expected 8; the file is cut short"):
        fs.read_auto(written(text[:5000].rsplit("\n", 1)[0] + "\n   1   -60   0    0 1.0"))
    with pytest.raises(fs.FileError, match=r"no curve of equilibria: periodic solutions \(IPS = 2"):
        fs.read_auto(written("\n".join(text.splitlines()[200:225])))
    solutions = (DATA / "s.fhn").read_text()
    with pytest.raises(fs.FileError, match="is cut short: the solution with label 12"):
        fs.read_auto(DATA / "b.fhn", written("\n".join(solutions.splitlines()[:100]), "s.x"))
    with pytest.raises(fs.FileError, match="line 1: expected the header of a solution"):
        fs.read_auto(DATA / "b.fhn", written("hello", "s.y"))
    with pytest.raises(fs.UnknownNameError, match=r"in the file 'PAR\(1\)'.*known: w"):
        fs.read_auto(DATA / "b.fhn", names={"PAR(1)": "w"})
    with pytest.raises(fs.UnknownNameError, match="unknown diagram parameter 'v'"):
        fs.read_auto(DATA / "b.fhn", parameter="v")
    with pytest.raises(fs.FastSlowError, match="no model"):
        fs.continue_points(fhn.folds[0], ("w", "b"), over={"w": (0, 1), "b": (1, 3)})


def damaged(folder, kind="b", **changes):
    """A copy of the files of fhn with words replaced in one of them."""
    for letter in "bsd":
        text = (DATA / f"{letter}.fhn").read_text()
        if letter == kind:
            for old, new in changes.items():
                assert old in text
                text = text.replace(old, new, 1)
        (folder / f"{letter}.fhn").write_text(text)
    return folder / "b.fhn"


def test_impossible_numbers_are_refused_or_left_out(tmp_path, fhn):
    """Each ended in a raw error, in a warning, or not at all."""
    last = (DATA / "b.fhn").read_text().splitlines()[-1]
    _, point, *_, number = last.split()
    for new in ("nan", "1E+999"):
        with pytest.raises(fs.FileError, match=r"a number is not finite; .* remove that row"):
            fs.read_auto(damaged(tmp_path, **{number: new}))
    with pytest.raises(fs.FileError, match="is no number of AUTO-07p; the file is damaged"):
        fs.read_auto(damaged(tmp_path, **{last: last.replace(point, "9" * 30, 1)}))
    long = fs.read_auto(damaged(tmp_path, **{"NPAR=   4": f"NPAR= {'9' * 5000}"}))
    many = fs.read_auto(damaged(tmp_path, **{"NPAR=   4": "NPAR= 999999999"}))
    assert len(long[0]) == len(many[0]) == len(fhn[0])
    deep = fs.read_auto(damaged(tmp_path, **{"parnames = {": "parnames = {" + "(" * 9999}))
    assert len(deep[0]) == len(fhn[0])
    head = (DATA / "s.fhn").read_text().splitlines()[0].split()
    back = "  ".join([*head[:8], "-1", *head[9:]])
    with pytest.raises(fs.FileError, match="line 1: expected the header of a solution"):
        fs.read_auto(damaged(tmp_path, "s", **{(DATA / "s.fhn").read_text().splitlines()[0]: back}))


def test_tangents_of_extreme_points():
    points = np.array([[1e308, 0.0], [-1e308, 0.0], [5e-324, 1e-300], [5e-324, 1e-300]])
    assert np.allclose(np.linalg.norm(_tangents(points), axis=1), 1)
    assert np.allclose(_tangents(np.zeros((3, 2))), [0, 1])
