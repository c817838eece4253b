"""What moves on the front page: `python -m analyses.front_page [docs]`.

Writes ``figures/overlay.gif``, the overlay of the README as it comes about in time, and
``_static/gear.html``, an explorer of the same gear that needs neither Python nor a network.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

import fastslow as fs
from analyses.output import in_few_colours
from fastslow.disk import write_file
from fastslow.plot.layout.style import BLUE, MM, VERMILION, new_figure, styled_axes

#: Pictures of the animation, their distance in milliseconds, and their resolution.
PICTURES, PACE, DPI = 72, 90, 110

#: Sliders of the explorer: number of values of each.
SLIDERS = {"D": (0.1, 0.4), "C": (0.12, 0.24)}
VALUES = {"D": 4, "C": 3}


def gear() -> fs.Model:
    """The gear of the README: its equilibrium curve folds, and the load passes both folds."""
    return fs.systems.harmonic_gear(A=-0.6, B=0, C=0.2, D=0.25, omega=0.005)


def animation() -> bytes:
    """The load, and the motion over the equilibria, picture by picture, as a GIF."""
    diagram = fs.continue_equilibria(gear().frozen(), "w", over=(-0.25, 0.25))
    run = fs.simulate(gear(), [0, 0], periods=2)
    overlay = fs.overlay(diagram, run)
    figure = new_figure(150 * MM, 62 * MM)
    left, right = (styled_axes(ax) for ax in figure.subplots(1, 2))
    left.plot(run.t, run["w"], color="0.8", linewidth=1)
    left.set(xlabel="$t$", ylabel="load $w$", xlim=(0, run.t[-1]))
    fs.plot.diagram(diagram, "x", ax=right, legend=False)
    right.set(xlabel="$w$", ylabel="$x$", ylim=(-1.6, 1.6))
    loaded = left.plot([], [], color=BLUE, linewidth=1.2)[0]
    moved = right.plot([], [], color=BLUE, linewidth=1.2)[0]
    dots = [ax.plot([], [], "o", color=VERMILION, markersize=5)[0] for ax in (left, right)]
    shown = right.set_title(" ", fontsize=8)
    figure.get_layout_engine().execute(figure)  # type: ignore[union-attr]
    figure.set_layout_engine("none")
    pictures = []
    for time in np.linspace(0.0, run.t[-1], PICTURES):
        so_far = np.linspace(0.0, time, 1500)
        x, w = (run.dense_columns(so_far)[run.columns.index(name)] for name in ("x", "w"))
        loaded.set_data(so_far, w)
        moved.set_data(w, x)
        dots[0].set_data([time], [w[-1]])
        dots[1].set_data([w[-1]], [x[-1]])
        shown.set_text(sentence(overlay, float(time)))
        stream = BytesIO()
        figure.savefig(stream, format="png", dpi=DPI)
        pictures.append(in_few_colours(Image.open(stream).convert("RGB")))
    stream = BytesIO()
    first, *others = pictures
    first.save(
        stream, "GIF", save_all=True, append_images=others, duration=PACE, loop=0, optimize=True
    )
    return stream.getvalue()


def sentence(overlay: fs.Overlay, time: float) -> str:
    """What the motion does at a time: the branch it follows, or the jump that it makes."""
    phase = next((p for p in overlay.phases if p.start <= time <= p.end), overlay.phases[-1])
    if phase.type == "quasi-static":
        return f"follows the stable branch {phase.stable_branches[0]}"
    jumps = [t for t in overlay.transitions if t.time <= time and t.special is not None]
    if phase.type == "jump" and jumps and jumps[-1].special is not None:
        return f"leaves it {jumps[-1].delay:.3f} behind {jumps[-1].special.label}"
    return phase.type


def main(arguments: Sequence[str]) -> None:
    """Write both files into a folder of documentation."""
    docs = Path(arguments[0]) if arguments else Path(__file__).parents[1] / "docs"
    write_file(docs / "figures" / "overlay.gif", animation())
    explorer = fs.explore(gear(), over=(-0.25, 0.25), sliders=SLIDERS)
    (docs / "_static").mkdir(exist_ok=True)
    explorer.export(docs / "_static" / "gear.html", sliders=VALUES, title="A gear with clearance")


if __name__ == "__main__":
    main(sys.argv[1:])
