"""Delays over rates."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import fastslow as fs
from fastslow.plot.delays import DelayDrawing
from fastslow.results.base.outcome import Outcome
from fastslow.results.overlay.delays import BoundaryDelay, FoldDelay

from .conftest import special

EPS = np.array([1e-3, 1e-4, 1e-5])
HERE = {"point": special("LP", "LP1", 0.0, 0.0), "parameter": "p", "validity": "by hand"}


def scaling(power, delay, laws):
    good = np.isfinite(delay)
    return fs.DelayScaling(
        HERE["point"],
        "p",
        1,
        "x = 1",
        EPS,
        delay,
        laws,
        0.0,
        ("a", "b"),
        np.array([2.0, 1.0]),
        np.array([2.0, 1.0]),
        power,
        0.01,
        np.diff(np.log(delay)) / np.diff(np.log(EPS)),
        power,
        tuple(Outcome("reached" if g else "not reached", ".", bool(g)) for g in good),
    )


def folded(delay):
    laws = tuple(
        FoldDelay(
            **HERE,
            rate=e,
            delay=2 * e ** (2 / 3) + e,
            quadratic=1.0,
            slope=1.0,
            cubic=0.0,
            mixed=0.0,
            coefficients=(2.0, 0.0, 1.0),
        )
        for e in EPS
    )
    return scaling(2 / 3, delay, laws)


def cornered():
    size = EPS * np.log(1 / EPS)
    laws = tuple(
        BoundaryDelay(**HERE, rate=e, delay=d, lag=e, stable=-1.0, unstable=1.0)
        for e, d in zip(EPS, size, strict=True)
    )
    return scaling(np.nan, size, laws)


def drawn(line):
    return np.column_stack([line.get_xdata(), line.get_ydata()])


def test_measured_and_predicted_stand_side_by_side():
    measured = 2.02 * EPS ** (2 / 3) + EPS
    drawing = fs.plot.delay_scaling(folded(measured))
    assert isinstance(drawing, DelayDrawing)
    assert drawing.ax.get_xscale() == drawing.ax.get_yscale() == "log"
    assert np.allclose(drawn(drawing.measured), np.column_stack([EPS, measured]))
    assert np.allclose(drawn(drawing.predicted)[:, 1], 2 * EPS ** (2 / 3) + EPS)
    assert np.allclose(drawn(drawing.leading)[:, 1], 2 * EPS ** (2 / 3))
    assert drawing.ax.get_ylabel() == "delay past LP1 in $p$"
    words = [text.get_text() for text in drawing.legend.get_texts()]
    assert words[0].startswith("measured, ")
    assert "0.667\\pm0.010" in words[0]


def test_the_triangle_has_the_slope_of_the_law_and_hides_nothing():
    drawing = fs.plot.delay_scaling(folded(2 * EPS ** (2 / 3) + EPS))
    corners = np.log10(drawn(drawing.triangle))
    rise, run = corners[2] - corners[1], corners[1] - corners[0]
    assert rise[1] / run[0] == pytest.approx(2 / 3)
    assert [text.get_text() for text in drawing.texts] == ["1", "2/3"]
    drawing.figure.draw_without_rendering()
    frame = drawing.ax.get_window_extent()
    points = drawing.ax.transData.transform(drawn(drawing.measured))
    for text in drawing.texts:
        box = text.get_window_extent()
        assert frame.x0 < box.x0 < box.x1 < frame.x1
        assert frame.y0 < box.y0 < box.y1 < frame.y1
        assert not any(box.contains(*point) for point in points)


def test_no_power_no_triangle():
    drawing = fs.plot.delay_scaling(cornered())
    assert drawing.triangle is None
    assert drawing.leading is None
    assert drawing.texts == ()
    assert "ln" in drawing.legend.get_texts()[1].get_text()


def test_into_given_axes_without_a_legend():
    figure, ax = plt.subplots()
    drawing = fs.plot.delay_scaling(cornered(), ax=ax, legend=False)
    assert drawing.ax is ax
    assert drawing.legend is None
    plt.close(figure)


def test_runs_that_failed_are_left_out():
    drawing = fs.plot.delay_scaling(folded(np.array([0.03, np.nan, 0.001])))
    assert len(drawn(drawing.measured)) == 2
    with pytest.raises(fs.ArgumentError, match="no run of this scaling has a delay"):
        fs.plot.delay_scaling(folded(np.full(3, np.nan)))
