"""Figures of the analyses beside those of the pages."""

from pathlib import Path

import numpy as np
from PIL import Image

from analyses import output

FIGURES = Path(output.__file__).parents[1] / "docs" / "figures"

#: Figures with maps of chaotic motions.
CHAOTIC = ("map_frequency_width", "resonances")


def difference(folder, name):
    """Mean difference in grey levels from the figure of the pages; infinite for another size."""
    drawn = np.asarray(output.shrunk(folder / f"{name}.png"), dtype=float)
    with Image.open(FIGURES / f"{name}.png") as image:
        shown = np.asarray(image.convert("RGB"), dtype=float)
    return np.abs(shown - drawn).mean() if shown.shape == drawn.shape else np.inf


#: Largest difference of the same figure by another version of Matplotlib.
SAME = 6.0
