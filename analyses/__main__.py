"""Run all analyses: `python -m analyses [folder]`, by default into `figures`."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from tqdm import tqdm

from analyses import (
    dead_zone,
    gap_width,
    load_amplitude,
    negative_stiffness,
    regime_maps,
    stiffness,
)
from analyses.passages import OMEGA, PERIODS, Row, saved

PANELS = (gap_width, stiffness, load_amplitude, negative_stiffness)


def table(rows: Sequence[Row | regime_maps.MapRow]) -> str:
    """The numbers of all cases in aligned columns."""
    head = [f.name.replace("_", " ") for f in fields(rows[0])]
    body = [
        [f"{v:.4g}" if isinstance(v, float) else str(v) or "-" for v in asdict(row).values()]
        for row in rows
    ]
    widths = [max(map(len, column)) for column in zip(head, *body, strict=True)]
    lines = [head, ["-" * width for width in widths], *body]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def write(rows: Sequence[Row | regime_maps.MapRow], path: Path) -> None:
    """Write rows as comma-separated values."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(rows[0])])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def main(arguments: Sequence[str] | None = None) -> list[Row]:
    """Draw every figure into a folder, print the summary table and return its rows."""
    parser = argparse.ArgumentParser(prog="python -m analyses", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("figures"))
    folder: Path = parser.parse_args(arguments).folder
    settings = [setting for analysis in PANELS for setting in analysis.settings()]
    rows: list[Row] = []
    maps: list[regime_maps.MapRow] = []
    with tqdm(total=1 + len(settings) + len(regime_maps.PLANES), unit="figure") as bar:
        bar.set_description("dead_zone")
        dead_zone.main(folder)
        bar.update()
        for setting in settings:
            bar.set_description(setting.name)
            rows.append(saved(setting, folder))
            bar.update()
        for plane in regime_maps.PLANES:
            bar.set_description(plane.name)
            maps.append(regime_maps.saved(plane, folder))
            bar.update()
    write(rows, folder / "summary.csv")
    write(maps, folder / "regime_maps.csv")
    print(f"\n{table(rows)}\n\n{table(maps)}\n")
    print(f"Load of angular frequency {OMEGA:g} (dimensionless), {PERIODS} periods from rest.")
    print(f"Figures, summary.csv and regime_maps.csv are in {folder}.")
    return rows


if __name__ == "__main__":
    main()
