"""Export of an explorer as an HTML page: computed in advance, drawn by the browser."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from html import escape
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

from tqdm import tqdm

from fastslow.disk import write_text
from fastslow.errors import ArgumentError, FastSlowError, unknown_name
from fastslow.interactive.explored import Explored
from fastslow.interactive.frames import Store, frame_of, greek, looks
from fastslow.interactive.sliders import SLIDER_VALUES, Slider
from fastslow.interactive.views import at_start, view_of

#: Placeholder for the source of the model.
SOURCE = """import fastslow as fs

# model: the fs.Model with the equations above"""


def write_page(
    explorer: Explored,
    path: Path,
    sliders: Mapping[Any, Any] | None,
    title: str,
    source: str,
    max_frames: int,
    progress: bool,
) -> Path:
    """Compute all frames and write the page; see `Explorer.export`."""
    data = page_data(explorer, sliders, source, max_frames, progress)
    heading = title or f"Model of {', '.join(explorer.model.states)}"
    write_text(path, page_text(heading, data))
    return path


def page_data(
    explorer: Explored,
    sliders: Mapping[Any, Any] | None,
    source: str = "",
    max_frames: int = 500,
    progress: bool = False,
) -> dict[str, Any]:
    """Compute the data of a page, with a frame for each combination of values."""
    chosen = _selected_sliders(explorer.sliders, sliders)
    values = {slider.name: slider.values(wanted).tolist() for slider, wanted in chosen}
    count = math.prod(map(len, values.values()))
    if count > max_frames:
        each = " × ".join(f"{len(v)} of {name}" for name, v in values.items())
        raise ArgumentError(
            f"the page would have {count} frames ({each}), more than "
            f"max_frames={max_frames}; give fewer values, as in "
            "sliders={'" + next(iter(values)) + "': 5}, or raise max_frames="
        )
    store = Store()
    frames = []
    for numbers in tqdm(product(*values.values()), total=count, disable=not progress, unit="frame"):
        frames.append(_frame(explorer, dict(zip(values, numbers, strict=True)), store))
    now = explorer.values
    return {
        "equations": explorer.model.equations,
        "source": source or SOURCE,
        "sliders": [
            {
                "label": greek(slider.label),
                "values": values[slider.name],
                "at": _closest(values[slider.name], now[slider.name]),
            }
            for slider, _ in chosen
        ],
        "looks": looks(),
        "frames": frames,
        "arrays": store.arrays,
    }


def page_text(title: str, data: Mapping[str, Any]) -> str:
    """Return the page as self-contained HTML.

    Examples
    --------
    >>> "<title>a &lt; b</title>" in page_text("a < b", {})
    True
    """
    folder = files("fastslow.interactive")
    parts = {
        "title": escape(title),
        # no text in a script may resemble a tag
        "data": json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        "script": (folder / "page.js").read_text(encoding="utf-8"),
    }
    template = (folder / "page.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], template)


def _selected_sliders(
    sliders: tuple[Slider, ...], wanted: Mapping[Any, Any] | None
) -> list[tuple[Slider, Any]]:
    """Return the sliders of the page, each with its number of values or its values."""
    if wanted is None:
        return [(slider, SLIDER_VALUES) for slider in sliders[:1]]
    known = {slider.name: slider for slider in sliders}
    for name in wanted:
        if str(name) not in known:
            raise unknown_name("slider", name, known)
    return [(known[str(name)], values) for name, values in wanted.items()]


def _frame(explorer: Explored, values: Mapping[str, float], store: Store) -> dict[str, Any]:
    """Compute a frame at some values, keeping the other values of the explorer."""
    names = (*explorer.model.states, *explorer.model.slow_states)
    begin = {name: explorer.values[name] for name in names}
    starts = {name: value for name, value in values.items() if name in begin}
    changes = {**explorer.view.changes}
    changes |= {name: value for name, value in values.items() if name not in begin}
    setup = at_start(explorer.setup, explorer.model, {**begin, **starts})
    try:
        return frame_of(view_of(explorer.model, setup, changes), store)
    except FastSlowError as error:
        # no model at these values: the frame shows the error
        return {"call": "", "outcomes": [str(error)], "tables": [], "panels": []}


def _closest(values: list[float], value: float) -> int:
    return min(range(len(values)), key=lambda k: abs(values[k] - value))
