"""Explorers of the gear."""

import pytest
from matplotlib.backend_bases import MouseEvent

import fastslow as fs


@pytest.fixture(scope="module")
def folded():
    """The gear with two folds and a small load."""
    return fs.systems.harmonic_gear(A=-0.6, B=0.0, C=0.4, omega=0.02)


@pytest.fixture
def explorer(folded):
    return fs.explore(folded, over=(-0.5, 0.5), periods=1, sliders={"D": (0.1, 0.5), "C": (0, 1)})


@pytest.fixture
def mouse():
    """Sends a figure a mouse event at a place in data coordinates of some axes."""

    def send(name, ax, x, y, button=1):
        canvas = ax.figure.canvas
        place = ax.transData.transform((x, y))
        button = button if name == "button_press_event" else None
        canvas.callbacks.process(name, MouseEvent(name, canvas, *place, button=button))

    return send
