"""Explorers of the gear, and a browser."""

import os
import shutil

import pytest
from matplotlib.backend_bases import MouseEvent

import fastslow as fs

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
QUIET = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)


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


@pytest.fixture(scope="session")
def browser_page():
    """A page of a real browser, without a window and a network; another one would take long."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        message = f"no browser: none of {', '.join(BROWSERS)} is installed"
        if os.environ.get("CI"):
            pytest.fail(message)
        pytest.skip(message)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=found, args=list(QUIET))
        yield browser.new_context(offline=True).new_page()
        browser.close()
