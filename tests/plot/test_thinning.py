"""Long runs: what is drawn of a million points, against the same figure with all of them."""

import dataclasses
import time

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import fastslow as fs
from fastslow.plot.layout.marks import draw_dots
from fastslow.plot.layout.thinning import LongLine, curve_rows

pytestmark = pytest.mark.slow

COUNT = 1_000_000

#: Points of curves that are compared with the same curve drawn with all of them.
COMPARED = 60_000


def rendered(line, ylim=(-2.2, 2.2), xlim=None, dpi=300):
    """Pixels of a line drawn alone: dark is 0, white 255."""
    figure = Figure((85 / 25.4, 60 / 25.4), dpi=dpi)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0, 0, 1, 1))
    ax.add_line(line)
    ax.set(xlim=xlim or (0, 1), ylim=ylim)
    ax.set_axis_off()
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, 0].astype(int)


def edges(image):
    """Rows of the first and last dark pixel of each column."""
    dark = image < 128
    return dark.argmax(axis=0), dark[::-1].argmax(axis=0)


@pytest.fixture(scope="module")
def logistic():
    """A chaotic orbit of the logistic map, by blocks of orbits that start apart."""
    x = np.linspace(0.1, 0.9, 1000) + 1e-3 * np.pi
    rows = []
    for _ in range(COUNT // len(x)):
        x = 3.99 * x * (1 - x)
        rows.append(x)
    return np.ravel(np.transpose(rows))


def wave(count):
    """An oscillation of slowly varying amplitude, with an interruption."""
    t = np.linspace(0, 1, count)
    x = np.sin(2 * np.pi * 4e3 * t) * (1 + 0.8 * np.sin(11 * t)) + 0.3 * np.sin(5 * t)
    x[count // 3 : count // 3 + count // 100] = np.nan
    return t, x


@pytest.mark.parametrize("xlim", [(0, 1), (0.2, 0.203)])
def test_the_envelope_is_the_same_in_every_column_of_pixels(xlim):
    t, x = wave(COMPARED)
    look = {"linewidth": 0.8, "color": "black"}
    line = LongLine(t, x, **look)
    drawn, whole = rendered(line, xlim=xlim), rendered(Line2D(t, x, **look), xlim=xlim)
    assert len(line.drawn_data()) < 10_000
    assert len(line.get_xdata()) == COMPARED
    missing = np.flatnonzero((whole > 250).all(axis=0))
    assert (drawn[:, missing] > 250).all()
    # beside the interruption a column is partly grey
    ends = np.r_[missing[:1] - 1, missing[-1:] + 1]
    for one, other in zip(edges(drawn), edges(whole), strict=True):
        assert np.abs(np.delete(one - other, ends)).max() <= 1


def test_the_rows_are_the_extremes_of_each_column():
    t, x = wave(100_003)
    rows = curve_rows(np.column_stack([t, x]), 0.01)
    for column in range(100):
        inside = np.floor(t / 0.01) == column
        kept = np.isin(np.arange(len(t)), rows) & inside
        if np.isfinite(x[inside]).any():
            assert np.nanmax(x[kept]) == np.nanmax(x[inside])
            assert np.nanmin(x[kept]) == np.nanmin(x[inside])
        assert np.count_nonzero(kept) <= 8


def test_a_curve_in_the_plane_covers_the_same_pixels():
    s = np.linspace(0, 2000, 5 * COMPARED)
    radius = 0.55 + 0.4 * np.sin(0.618 * s)
    x, y = 0.5 + 0.5 * radius * np.cos(7.1 * s), 2 * radius * np.sin(7.1 * s)
    look = {"linewidth": 0.8, "color": "black"}
    line = LongLine(x, y, **look)
    drawn, whole = rendered(line, dpi=150), rendered(Line2D(x, y, **look), dpi=150)
    assert len(line.drawn_data()) < 0.75 * len(s)
    assert np.mean(np.abs(drawn - whole) > 64) < 2e-3


def test_a_long_run_and_its_section_are_drawn_fast_and_small(gear_run, logistic, tmp_path):
    x = logistic
    v = np.r_[x[1:], 0.5]
    t = np.linspace(0, gear_run.span[1], COUNT)
    other = {name: np.zeros(COUNT) for name in gear_run.columns}
    table = np.array([{**other, "x": x, "v": v}[name] for name in gear_run.columns])
    run = dataclasses.replace(gear_run, sampled=(t, table), period=None)
    section = gear_run.section("v")
    points = np.zeros((len(section.names), COUNT))
    points[0], points[1] = x, v
    strobed = dataclasses.replace(section, t=t, table=points, directions=np.ones(COUNT, dtype=int))
    fs.plot.time_series(gear_run).save(tmp_path / "first.png")
    for name, draw in {
        "series": lambda: fs.plot.time_series(run, crossings=False),
        "section": lambda: fs.plot.section(strobed, section.names[0], section.names[1]),
    }.items():
        start = time.process_time()
        drawn = draw()
        drawn.save(tmp_path / f"{name}.png", dpi=300)
        assert time.process_time() - start < 1.0
        assert drawn.save(tmp_path / f"{name}.pdf").stat().st_size < 1_000_000
        (curve,) = next(iter(drawn.data.values()))
        assert len(curve) == COUNT
        assert name != "series" or list(drawn.data) == ["trajectory (envelope)"]


def test_crossings_that_would_cover_each_other_are_thinned():
    ax = Figure((85 / 25.4, 60 / 25.4), dpi=300).add_subplot()
    dots = draw_dots(ax, [np.linspace(0, 1, 900), np.zeros(900)])
    ax.figure.draw_without_rendering()
    assert dots.get_label() == "interface crossing (900, thinned)"
    assert len(dots.get_xdata()) == 900
    across = ax.transData.transform(dots.drawn_data())[:, 0] * 72 / 300
    # squares of twice the size of a dot
    assert 35 < len(across) < 45
    assert np.diff(across).min() > dots.get_markersize()
    few = draw_dots(ax, [np.linspace(0, 1, 9), np.zeros(9)])
    assert few.get_label() == "interface crossing"
