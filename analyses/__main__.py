"""Run all analyses: `python -m analyses [folder]`, by default into `figures`."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

from tqdm import tqdm

from analyses import dead_zone, gap_width, load_amplitude, negative_stiffness, stiffness
from analyses.passages import OMEGA, PERIODS, Row, saved

PANELS = (gap_width, stiffness, load_amplitude, negative_stiffness)


def table(rows: Sequence[Row]) -> str:
    """The numbers of all cases in aligned columns."""
    head = [f.name.replace("_", " ") for f in fields(Row)]
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


def main(arguments: Sequence[str] | None = None) -> list[Row]:
    """Draw every figure into a folder, print the summary table and return its rows."""
    parser = argparse.ArgumentParser(prog="python -m analyses", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("figures"))
    folder: Path = parser.parse_args(arguments).folder
    settings = [setting for analysis in PANELS for setting in analysis.settings()]
    rows: list[Row] = []
    with tqdm(total=1 + len(settings), unit="figure") as bar:
        bar.set_description("dead_zone")
        dead_zone.main(folder)
        bar.update()
        for setting in settings:
            bar.set_description(setting.name)
            rows.append(saved(setting, folder))
            bar.update()
    with (folder / "summary.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [f.name for f in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    print(f"\n{table(rows)}\n")
    print(f"Load of angular frequency {OMEGA:g} (dimensionless), {PERIODS} periods from rest.")
    print(f"Figures and summary.csv are in {folder}.")
    return rows


if __name__ == "__main__":
    main()
