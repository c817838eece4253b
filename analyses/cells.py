"""Three bursting cells, each from its file to the overlay: `python -m analyses.cells [docs]`.

The files are of our own writing, from the equations of the sources that they name.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import fastslow as fs
from analyses.output import Output, copy_figure

FILES = Path(__file__).parent / "cell_files"

#: Files, in the order of the figure, with the units of time and of the first state.
CELLS = {
    "hindmarsh_rose1984": ("", ""),
    "rinzel1987": ("", ""),
    "sherman_rinzel1992": (" (ms)", " (mV)"),
}


def figure() -> fs.plot.Drawing:
    """Draw each cell over time, and over the frozen cell."""
    axes = fs.plot.axes("abc;def", height=118)
    for (name, (time, state)), above, below in zip(CELLS.items(), axes[:3], axes[3:], strict=True):
        cell = fs.analyse(fs.read(FILES / f"{name}.ode"))
        fs.plot.time_series(cell.run, ax=above, label=False)
        assert cell.overlay is not None
        drawn = fs.plot.overlay(cell.overlay, ax=below, turning=False, inset=None)
        above.set(xlabel=f"$t${time}", ylabel=f"${drawn.y}${state}")
        below.set(ylabel=f"${drawn.y}${state}")
        below.locator_params(axis="x", nbins=4)
    return drawn


def main(arguments: Sequence[str]) -> None:
    """Draw the figure into a folder of documentation."""
    docs = Path(arguments[0]) if arguments else Path(__file__).parents[1] / "docs"
    with TemporaryDirectory() as folder:
        Output(Path(folder), formats=("png",)).save(figure().figure, "cells")
        copy_figure(Path(folder), docs, "cells")


if __name__ == "__main__":
    main(sys.argv[1:])
