"""Run all analyses: `python -m analyses [folder]`, by default into `figures`.

The folder gets every figure, the numbers of all cases and maps as comma-separated
values, and `index.md`, which shows each figure with the claim that it tests and the
verdict.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields
from functools import partial
from pathlib import Path

from tqdm import tqdm

from analyses import (
    case_maps,
    dead_zone,
    equilibria,
    gap_region,
    negative_stiffness,
    physical_route,
    regime_maps,
    responses,
    stiffness,
)
from analyses.cases import draw, laid_cases
from analyses.claims_page import SOURCES, all_claims, page, write_docs
from analyses.passages import OMEGA, PERIODS, Row, row
from fastslow.systems.gears import SCALINGS

DOCS = Path(__file__).parents[1] / "docs"


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


def steps(into: Output) -> list[tuple[str, Callable[[], object]]]:
    """Everything that is drawn and computed, by name; what several use is computed once."""
    found: list[tuple[str, Callable[[], object]]] = [
        ("dead zone", partial(dead_zone.main, into)),
        ("physical route", partial(physical_route.main, into)),
    ]
    for figure in equilibria.FIGURES:
        for scaling in SCALINGS:
            found.append((f"{figure} {scaling}", partial(draw, figure, scaling, into)))
    found += [
        ("gap region", partial(gap_region.draw, into)),
        ("resonances", partial(resonances.draw, into)),
        ("passages of the gap", partial(stories.draw_passages, into)),
        ("contact frequency", partial(stiffness.draw_frequencies, into)),
        ("responses", partial(responses.main, into)),
        ("equilibria", partial(equilibria.main, into)),
        ("negative stiffness", partial(negative_stiffness.main, into)),
    ]
    found += [(plane.name, partial(case_maps.draw, plane, into)) for plane in case_maps.MAPS]
    found += [(f"claims: {s.__name__.split('.')[-1]}", s.claims) for s in SOURCES]
    return found


def main(arguments: Sequence[str] | None = None) -> list[Row]:
    """Draw every figure into a folder, write the index page, and return the rows of all cases."""
    parser = argparse.ArgumentParser(prog="python -m analyses", description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("figures"))
    parser.add_argument(
        "--docs", action="store_true", help="also write docs/claims.md and its figures"
    )
    chosen = parser.parse_args(arguments)
    folder: Path = chosen.folder
    folder.mkdir(parents=True, exist_ok=True)
    maps: list[regime_maps.MapRow] = []
    work = steps(folder)
    with tqdm(total=len(work) + len(regime_maps.PLANES), unit="step") as bar:
        for name, step in work:
            bar.set_description(name)
            step()
            bar.update()
        for plane in regime_maps.PLANES:
            bar.set_description(plane.name)
            maps.append(regime_maps.saved(plane, folder))
            bar.update()
    cases = [c for f in equilibria.FIGURES for s in SCALINGS for c in laid_cases(f, s)]
    rows = [row(case) for case in (*cases, negative_stiffness.case())]
    write(rows, folder / "summary.csv")
    write(maps, folder / "regime_maps.csv")
    (folder / "index.md").write_text(page(all_claims(), ""), encoding="utf-8")
    if chosen.docs:
        write_docs(folder, DOCS)
    print(f"\n{table(rows)}\n\n{table(maps)}\n")
    print(f"Load of angular frequency {OMEGA:g} (dimensionless), {PERIODS} periods from rest.")
    print(f"Every claim with its figures and verdict is in {folder / 'index.md'}.")
    return rows


if __name__ == "__main__":
    main()
