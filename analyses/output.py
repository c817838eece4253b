"""Where the analyses write their figures, in which formats, and how their texts overlap."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from fastslow.disk import write_file
from fastslow.plot.layout.collisions import Overlap, overlaps
from fastslow.plot.layout.style import save

#: Dots per inch of the figures that the pages show.
SHOWN = 150

#: Colours of a figure that are kept exactly: lines, areas and markers have few, edges many.
FREQUENT = 128

#: Colours of an image that is no drawing of lines and areas.
MANY = 65536

FORMATS = ("png", "pdf")


@dataclass(frozen=True)
class Output:
    """A folder of figures.

    Parameters
    ----------
    folder : Path
        Made when the first figure is saved.
    formats : tuple of str
        Suffixes of the files.
    check : bool
        Whether to measure the overlaps of texts in each figure.
    overlaps : dict
        The overlaps by name of the figure, filled as figures are saved.
    """

    folder: Path
    formats: tuple[str, ...] = FORMATS
    check: bool = False
    overlaps: dict[str, tuple[Overlap, ...]] = field(default_factory=dict)

    def save(self, figure: Figure, name: str, dpi: float = SHOWN) -> None:
        """Write a figure; an interruption leaves the file as it was, never half of one."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for suffix in self.formats:
            part = self.folder / f".{name}.{suffix}"
            try:
                save(figure, part, dpi)
                part.replace(self.folder / f"{name}.{suffix}")
            finally:
                part.unlink(missing_ok=True)
            if self.check and suffix == "png":
                self.overlaps[name] = overlaps(figure, drawn=dpi == figure.dpi)


def overlap_report(found: Mapping[str, tuple[Overlap, ...]]) -> str:
    """The overlaps of each figure, one figure per line."""
    lines = [
        f"{name}: {'; '.join(map(str, each)) or 'no overlaps'}" for name, each in found.items()
    ]
    return "\n".join(lines)


def copy_figure(drawn: Path, docs: Path, name: str) -> None:
    """Copy a figure, in fewer colours, from a folder of drawn ones into the documentation."""
    few = in_few_colours(shrunk(drawn / f"{name}.png"))
    stream = BytesIO()
    few.save(stream, format="PNG", optimize=True)
    write_file(docs / "figures" / f"{name}.png", stream.getvalue())


def in_few_colours(image: Image.Image) -> Image.Image:
    """An image with a palette of 256 colours, which has all frequent ones as they are.

    Of a figure with fewer than 65536 colours each becomes the nearest one of the palette.
    """
    colours, index, counts = np.unique(
        np.asarray(image).reshape(-1, 3), axis=0, return_inverse=True, return_counts=True
    )
    if len(colours) > MANY:
        return image.quantize(256)
    kept = colours[np.argsort(-counts)[:FREQUENT]]
    others = np.reshape(image.quantize(256 - FREQUENT).getpalette() or [], (-1, 3))
    palette = np.vstack([kept, others]).astype(np.uint8)
    distances = (colours[:, None, :].astype(np.int32) - palette.astype(np.int32)) ** 2
    nearest = distances.sum(axis=2).argmin(axis=1).astype(np.uint8)
    found = Image.fromarray(nearest[index].reshape(image.height, image.width))
    found.putpalette(palette.tobytes())
    return found


def shrunk(path: Path) -> Image.Image:
    """A figure as pages show it: all in one scale, so that their text is equally large."""
    with Image.open(path) as image:
        scale = SHOWN / image.info.get("dpi", (SHOWN,))[0]
        image.thumbnail((round(scale * image.width), round(scale * image.height)))
        return image.convert("RGB")
