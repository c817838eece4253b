"""Refined maps as figures: areas, boundaries, names that fit, and what is laid over."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid

import fastslow as fs

pytestmark = pytest.mark.slow

UNIT = {"x": (0, 1), "y": (0, 1)}


def area(vertices):
    x, y = vertices[:, 0], vertices[:, 1]
    return 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def drawn_area(collection):
    return sum(area(path.vertices[:-1]) for path in collection.get_paths())


@pytest.fixture(scope="module")
def three():
    def label(x, y):
        return np.where(
            y > 0.5 + 0.3 * np.sin(4 * x), "bilateral", np.where(x > 0.6, "new", "free")
        )

    return fs.refined_map(label, UNIT, refinement=fs.Refinement(levels=4, resolution=1e-6))


def test_areas_fill_the_plane_and_lines_part_them(three):
    drawn = fs.plot.regime_map(three)
    areas = {word: drawn_area(fill) for word, fill in drawn.fills.items()}
    assert sum(areas.values()) == pytest.approx(1, abs=1e-12)
    # cut at the refined boundary, more precisely than the shares by corners
    x = np.linspace(0, 1, 100_001)
    above = trapezoid(0.5 - 0.3 * np.sin(4 * x), x)
    assert areas["bilateral"] == pytest.approx(above, abs=1e-4)
    assert len(drawn.lines) == len(three.boundaries) == 3
    assert drawn.ax.get_xlim() == drawn.ax.get_ylim() == (0, 1)
    assert (drawn.ax.get_xlabel(), drawn.ax.get_ylabel()) == ("$x$", "$y$")
    assert drawn.figure.get_size_inches()[0] == pytest.approx(85 / 25.4)
    colours = {tuple(fill.get_facecolor()[0]) for fill in drawn.fills.values()}
    assert len(colours) == 3


def test_names_stand_within_their_areas(three):
    drawn = fs.plot.regime_map(three, annotate={"here": (0.3, 0.9)})
    assert set(drawn.names) == {"bilateral", "free", "new"}
    inverse = drawn.ax.transData.inverted()
    boxes = []
    for word, text in drawn.names.items():
        box = text.get_window_extent()
        corners = inverse.transform(box.corners())
        assert set(three.at(corners[:, 0], corners[:, 1])) == {word}
        boxes.append(box)
    (mark,) = drawn.marks
    boxes.append(mark.get_window_extent())
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])
    # areas named in the map are entries of a legend on request alone
    assert drawn.legend is None
    key = fs.plot.regime_map(three, legend=True).legend
    assert [text.get_text() for text in key.get_texts()] == ["bilateral", "free", "new"]


def test_an_area_too_small_for_its_name_is_hatched():
    island = fs.refined_map(
        lambda x, y: np.hypot(x - 0.5, y - 0.5) < 0.03,
        UNIT,
        refinement=fs.Refinement(cells=(16, 16)),
    )
    drawn = fs.plot.regime_map(island)
    assert set(drawn.names) == {False}
    assert drawn.fills[True].get_hatch()
    assert not drawn.fills[False].get_hatch()
    assert [patch.get_hatch() for patch in drawn.legend.get_patches()] == ["////"]


def test_curves_axes_and_style(three):
    x = np.linspace(0, 1, 50)
    curves = {"law": (x, 0.5 + 0.3 * np.sin(4 * x)), "other": (x, x)}
    drawn = fs.plot.regime_map(three, curves=curves, fills={"new": "#123456"}, linewidth=2.0)
    assert [c.get_label() for c in drawn.curves] == ["law", "other"]
    assert drawn.curves[0].get_linestyle() == "--"
    assert {line.get_linewidth() for line in drawn.lines} == {2.0}
    assert [t.get_text() for t in drawn.legend.get_texts()][-2:] == ["law", "other"]
    expected = [int("123456"[k : k + 2], 16) / 255 for k in (0, 2, 4)]
    assert drawn.fills["new"].get_facecolor()[0][:3] == pytest.approx(expected)
    again = fs.plot.regime_map(three, ax=drawn.ax, label=False, legend=False)
    assert again.ax is drawn.ax
    assert (again.names, again.legend, again.curves) == ({}, None, ())
    assert not any(fill.get_hatch() for fill in again.fills.values())


def test_saddles_corners_of_three_and_one_label(tmp_path):
    checks = fs.refined_map(
        lambda x, y: (x < 0.5) == (y < 0.5), UNIT, refinement=fs.Refinement(cells=(1, 1), levels=0)
    )
    drawn = fs.plot.regime_map(checks)
    # opposite corners that are True are cut off, as the lines say
    assert [drawn_area(drawn.fills[word]) for word in (False, True)] == [0.75, 0.25]
    corner = fs.refined_map(
        lambda x, y: (x > 0.5).astype(int) * (1 + (y > 0.5)),
        UNIT,
        refinement=fs.Refinement(cells=(1, 1), levels=0),
    )
    areas = [drawn_area(fill) for fill in fs.plot.regime_map(corner).fills.values()]
    assert areas == pytest.approx([0.5, 0.25, 0.25])
    single = fs.refined_map(lambda x, y: np.zeros(len(x)), UNIT, refinement=fs.Refinement(levels=0))
    path = fs.plot.regime_map(single).save(tmp_path / "single.pdf")
    assert path.stat().st_size > 3000


def test_numbers_that_are_not_finite_are_marked():
    def root(a, b):
        if a == 4:
            raise ValueError("four")
        return {"root": np.nan if a == 1 else np.inf if a == 2 else a + b}

    grid = fs.sweep(root, {"a": np.arange(6), "b": [0.5, 1.5]})
    plane = fs.plot.grid(grid)
    assert list(plane.fills) == ["failed", "no number"]
    assert [text.get_text() for text in plane.legend.get_texts()] == ["failed", "no number"]
    assert drawn_area(plane.fills["no number"]) == 2 * 2
    line = fs.plot.grid(grid.select(b=0.5))
    joined = line.lines[0].get_ydata()
    np.testing.assert_array_equal(joined, [0.5, np.nan, np.nan, 3.5, np.nan, 5.5])
    assert {one.get_label(): one.get_xdata().tolist() for one in line.lines[1:]} == {
        "failed": [4.0],
        "no number": [1.0, 2.0],
    }


def test_units_of_a_grid():
    grid = fs.sweep(
        lambda D, C: {"rise": D * C}, {"D": [0.1, 0.2], "C": [1, 2]}, units={"D": "mm", "rise": "s"}
    )
    drawn = fs.plot.grid(grid)
    assert (drawn.ax.get_xlabel(), drawn.ax.get_ylabel()) == ("$D$ (mm)", "$C$")
    assert drawn.bar.ax.get_ylabel() == r"$\mathrm{rise}$ (s)"


def test_legends_of_labels_that_are_long_or_empty():
    # a compact legend has another order than the areas
    words = ["", *(f"{k}" + " long long long" * (k % 2) for k in range(14))]
    grid = fs.sweep(lambda a, b: words[int(a + b)], {"a": np.arange(14.0), "b": [0.0, 1.0]})
    done = grid.done.copy()
    done[:4] = False
    key = fs.plot.grid(replace(grid, done=done)).legend
    entries = zip(key.get_texts(), key.get_patches(), strict=True)
    assert [text.get_text() for text, patch in entries if patch.get_hatch()] == ["missing"]
