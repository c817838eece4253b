"""Sweeps, sections and spectra as drawn."""

import dataclasses

import numpy as np
import pytest
from matplotlib.figure import Figure

import fastslow as fs
from fastslow.results.base.outcome import Outcome
from fastslow.results.trajectory.long_time.section import Section
from fastslow.results.trajectory.long_time.spectrum import Spectrum
from fastslow.results.trajectory.long_time.sweep import BifurcationSweep, SweepPass

pytestmark = pytest.mark.slow

FINE = Outcome("end of time", "reached the end.", True)
LOST = Outcome("blow-up", "the state grew.", False)


def one_pass(direction):
    values = np.array([1.0, 2.0, 3.0])[::direction]
    counts = np.where(values == 3.0, 0, 2)
    return SweepPass(
        direction,
        values,
        counts,
        np.repeat(values, counts),
        np.array([0.1, 0.2, 0.3, 0.4]),
        np.zeros((3, 2)),
        tuple(LOST if v == 3.0 else FINE for v in values),
    )


@pytest.fixture
def swept():
    return BifurcationSweep("Omega", "x", "extremes", "…", (one_pass(1), one_pass(-1)))


def test_both_passes_differ_in_more_than_colour(swept):
    drawn = fs.plot.sweep(swept)
    assert np.array_equal(drawn.up.get_xdata(), [1, 1, 2, 2])
    assert np.array_equal(drawn.down.get_xdata(), [2, 2, 1, 1])
    # where both agree, the lower dots are a rim around the upper ones
    assert drawn.up.get_markersize() > 1.5 * drawn.down.get_markersize()
    assert drawn.up.get_color() != drawn.down.get_color()
    assert drawn.ax.get_xlabel() == r"$\Omega$"
    assert drawn.ax.get_ylabel() == "$x$ (extremes)"
    assert [t.get_text() for t in drawn.legend.get_texts()] == [
        "swept up",
        "swept down",
        "run failed",
    ]
    assert drawn.failures.get_xdata().tolist() == [3.0]


def test_one_pass_into_given_axes():
    ax = Figure().add_subplot()
    drawn = fs.plot.sweep(
        BifurcationSweep("c", "y", "section", "…", (one_pass(-1),)), ax=ax, color="red"
    )
    assert drawn.ax is ax
    assert drawn.up is None
    assert drawn.down.get_color() == "red"


def test_hysteresis_is_read_off_the_points(swept):
    # the passes have the same points at neither value, and none at the failed one
    assert swept.hysteresis().tolist() == [[1.0, 2.0]]
    assert swept.hysteresis(resolution=1.0).shape == (0, 2)


def test_section_by_direction():
    section = Section(
        "x = 0", ("x", "v"), np.arange(4.0), np.arange(8.0).reshape(2, 4), np.array([1, -1, 1, 0])
    )
    drawn = fs.plot.section(section, "x", "v")
    assert [line.get_marker() for line in drawn.points] == ["^", "v", "o"]
    assert drawn.points[0].get_xdata().tolist() == [0.0, 2.0]
    assert drawn.legend is not None
    over_time = fs.plot.section(section, "t", "x", ax=Figure().add_subplot())
    assert over_time.ax.get_xlabel() == "$t$"
    with pytest.raises(fs.UnknownNameError, match="unknown column 'y'"):
        fs.plot.section(section, "y", "v")
    alone = Section("", ("x",), np.zeros(1), np.zeros((1, 1)), np.zeros(1, dtype=int))
    with pytest.raises(fs.ArgumentError, match="with the single column"):
        fs.plot.section(alone)
    assert fs.plot.section(alone, "t", "x").legend is None
    nothing = Section("", ("x", "v"), np.zeros(0), np.zeros((2, 0)), np.zeros(0, dtype=int))
    assert fs.plot.section(nothing).points == ()


def test_points_that_agree_do_not_show_their_rounding():
    table = np.array([[2.0, 2.0 + 1e-12], [1.0, 3.0]])
    section = Section("every 1", ("x", "v"), np.arange(2.0), table, np.zeros(2, dtype=int))
    drawn = fs.plot.section(section)
    assert drawn.ax.get_xlim() == pytest.approx((1.8, 2.2))
    assert drawn.ax.get_ylim() == pytest.approx((0.9, 3.1))


def test_spectrum_marks_its_lines():
    frequency = np.arange(200) / 10
    amplitude = np.full(200, 1e-9)
    amplitude[[49, 50, 51, 99, 100, 101]] = [0.5, 1.0, 0.5, 0.05, 0.1, 0.05]
    spectrum = Spectrum("x", "hann", (0.0, 10.0), frequency, amplitude)
    drawn = fs.plot.spectrum(spectrum, angular=True, peaks=5)
    assert drawn.peaks.get_xdata() == pytest.approx(2 * np.pi * np.array([5.0, 10.0]))
    assert [label.get_text() for label in drawn.labels] == ["31.42", "62.83"]
    assert drawn.ax.get_yscale() == "log"
    assert drawn.ax.get_xlabel() == "angular frequency"
    with pytest.raises(fs.ArgumentError, match="the lower one first"):
        fs.plot.spectrum(spectrum, frequencies=(2, 1))


@pytest.mark.sample(1)
@pytest.mark.parametrize("height", [40, 54, 90])
@pytest.mark.parametrize("bins", [(1, 3), (40, 2000), (1, 1999)])
def test_frequencies_stand_within_the_axes(height, bins):
    # lines at the edges of the axes, as in runs that are very slow
    frequency = np.linspace(0.0, 100.0, 2001)
    amplitude = np.full_like(frequency, 1e-5)
    amplitude[list(bins)] = 1.0, 0.5
    spectrum = Spectrum("x", "hann", (0.0, 10.0), frequency, amplitude)
    figure = Figure(figsize=(85 / 25.4, height / 25.4), layout="constrained")
    ax = figure.subplots()
    drawn = fs.plot.spectrum(spectrum, ax=ax, frequencies=(0.0, 100.0), peaks=2)
    figure.draw_without_rendering()
    frame = ax.get_window_extent()
    boxes = [label.get_window_extent() for label in drawn.labels]
    assert boxes
    for box in boxes:
        assert frame.x0 < box.x0 < box.x1 < frame.x1
        assert frame.y0 < box.y0 < box.y1 < frame.y1


def test_a_section_at_a_constant_state_is_drawn_over_the_others(gear_run):
    section = gear_run.section("x - 0.25")
    drawn = fs.plot.section(section)
    assert (drawn.x, drawn.y) == ("v", "w")
    assert fs.plot.section(section, "x").x == "x"
    none = fs.plot.section(gear_run.section("x - 5"))
    assert [text.get_text() for text in none.ax.texts] == ["no points: x - 5 = 0"]


def test_rounding_errors_of_a_column_are_not_magnified(gear_diagram):
    noise = []
    for branch in gear_diagram.branches:
        state = branch.state.copy()
        state[:, 1] = 1e-29 * (np.arange(len(branch)) % 2)
        noise.append(dataclasses.replace(branch, state=state))
    drawn = fs.plot.diagram(dataclasses.replace(gear_diagram, branches=tuple(noise)), "v")
    low, high = drawn.ax.get_ylim()
    assert high - low > 0.1
