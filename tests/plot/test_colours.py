"""Colours that stand beside each other, as they are seen without red or green cones, or in grey."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from fastslow.plot.areas import FILLS, OTHERS
from fastslow.plot.layout import style
from fastslow.results.point_types import POINT_TYPES

# linear sRGB as a dichromat sees it (Machado, Oliveira and Fernandes 2009, severity 1), and grey
SIGHTS = {
    "all cones": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
    "grey": np.tile([0.2126, 0.7152, 0.0722], (3, 1)),
}

# sRGB to XYZ (IEC 61966-2-1), relative to the white point D65
XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
) / np.array([[0.95047], [1.0], [1.08883]])


def lab(colour, sight):
    """CIELAB (CIE 1976) of a colour as it is seen."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    x, y, z = XYZ @ np.clip(sight @ linear, 0.0, 1.0)

    def f(t):
        return np.cbrt(t) if t > 216 / 24389 else (24389 / 27 * t + 16) / 116

    return np.array([116 * f(y) - 16, 500 * (f(x) - f(y)), 200 * (f(y) - f(z))])


def difference(one, other, sight):
    return float(np.linalg.norm(lab(one, SIGHTS[sight]) - lab(other, SIGHTS[sight])))


def test_black_and_white_are_a_hundred_apart():
    for sight in SIGHTS:
        assert difference("black", "white", sight) == pytest.approx(100.0, abs=0.1)


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize(
    "colours",
    [
        style.BANDS,
        tuple(FILLS.values()),
        OTHERS,
        tuple(look["facecolor"] for look in style.PHASES.values()),
    ],
    ids=["regions", "regimes", "other labels", "phases"],
)
def test_neighbouring_areas_differ_to_every_eye(colours, sight):
    """A difference of 2.3 is just noticeable (Mahy et al. 1994); twice that for any two areas."""
    least = min(difference(*pair, sight) for pair in combinations(colours, 2))
    assert least > 4.5


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize("ground", [*style.BANDS, "white"])
def test_lines_and_words_stand_out_from_every_region(ground, sight):
    for colour in (style.BRANCH, style.MOTION, style.VERMILION, style.DARK):
        assert difference(colour, ground, sight) > 30.0
    assert difference(style.MOTION, style.BRANCH, sight) > 30.0


def test_transitions_and_curves_differ_in_more_than_colour():
    shapes = [marker for marker, _, _ in style.TRANSITIONS.values()]
    assert len(set(shapes)) == len(shapes)
    lines = [
        (str(known.line[0]), known.line[1] > 1.0)
        for known in POINT_TYPES.values()
        if known.line is not None
    ]
    assert len(set(lines)) == len(lines)
    styles = [str(look["linestyle"]) for look in style.LINES.values()]
    assert len(set(styles)) == len(styles)
