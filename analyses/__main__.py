"""Run all analyses: `python -m analyses [folder]`, by default into `figures`.

The folder gets every figure, the numbers of all cases and maps as comma-separated
values, and `index.md`, which shows each figure with the claim that it tests and the
verdict. `python -m analyses --gallery [folder]` draws the gallery of published models instead.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields
from functools import partial
from io import StringIO
from pathlib import Path
from tempfile import TemporaryFile

from tqdm import tqdm

from analyses import (
    bursting,
    canards,
    case_maps,
    coexistence,
    converter,
    dead_zone,
    equilibria,
    frequency_response,
    gallery_pages,
    gap_region,
    impact_energies,
    impact_response,
    measured_torque,
    mesh_steps,
    negative_stiffness,
    orbits,
    physical_route,
    regime_maps,
    resonances,
    responses,
    rigid_limit,
    sensitivities,
    slow_torque,
    spiking,
    stick_slip,
    stiffness,
    stories,
    tipping,
)
from analyses.cases import draw, laid_cases
from analyses.claims_page import SOURCES, all_claims, page, write_docs
from analyses.output import FORMATS, Output, overlap_report
from analyses.passages import OMEGA, PERIODS, Row, row
from fastslow.disk import write_text
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
    text = StringIO(newline="")
    writer = csv.DictWriter(text, [f.name for f in fields(rows[0])])
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    write_text(path, text.getvalue())


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
        ("frequency response", partial(frequency_response.main, into)),
        ("orbits", partial(orbits.main, into)),
        ("stick-slip", partial(stick_slip.main, into)),
        ("slow torque", partial(slow_torque.main, into)),
        ("mesh steps", partial(mesh_steps.main, into)),
        ("bursting", partial(bursting.main, into)),
        ("impact response", partial(impact_response.main, into)),
        ("measured torque", partial(measured_torque.main, into)),
        ("spiking", partial(spiking.main, into)),
        ("converter", partial(converter.main, into)),
        ("sensitivities", partial(sensitivities.main, into)),
        ("impact energies", partial(impact_energies.main, into)),
        ("rigid limit", partial(rigid_limit.main, into)),
        ("coexistence", partial(coexistence.main, into)),
        ("tipping", partial(tipping.main, into)),
        ("canards", partial(canards.main, into)),
    ]
    found += [(plane.name, partial(case_maps.draw, plane, into)) for plane in case_maps.MAPS]
    found += [(plane.name, partial(regime_maps.draw, plane, into)) for plane in regime_maps.PLANES]
    found += [(f"claims: {s.__name__.split('.')[-1]}", s.claims) for s in SOURCES]
    return found


def chosen(arguments: Sequence[str] | None) -> tuple[Output, argparse.Namespace]:
    """Where to write, made if it is not there, and the options."""
    parser = argparse.ArgumentParser(
        prog="python -m analyses",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "folder", nargs="?", type=Path, default=Path("figures"), help="default: %(default)s"
    )
    parser.add_argument(
        "--png", action="store_true", help="figures for the screen only, without those for print"
    )
    parser.add_argument(
        "--docs", action="store_true", help="also write the pages of docs with these figures"
    )
    parser.add_argument(
        "--gallery", action="store_true", help="draw the gallery of published models"
    )
    parser.add_argument(
        "--only",
        choices=[entry.name for entry in gallery_pages.entries()],
        metavar="MODEL",
        help="of the gallery, this model",
    )
    parser.add_argument(
        "--check", action="store_true", help="also print the overlaps of the texts of each figure"
    )
    found = parser.parse_args(arguments)
    try:
        found.folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=found.folder):
            pass
    except OSError as error:
        parser.error(f"cannot write into {found.folder}: {error.strerror}")
    formats = FORMATS[:1] if found.png else FORMATS
    return Output(found.folder, formats, found.check), found


def run(work: Sequence[tuple[str, Callable[[], object]]], folder: Path) -> None:
    """Take every step, under a progress bar.

    Raises
    ------
    SystemExit
        With status 130 when interrupted; figures that are finished stay.
    """
    with tqdm(total=len(work), unit="step") as bar:
        for name, step in work:
            bar.set_description(name)
            try:
                step()
            except KeyboardInterrupt:
                bar.close()
                print(
                    f"\nInterrupted at step {bar.n + 1} of {len(work)}, {name}. The figures "
                    f"finished so far are in {folder}; pages and tables were not written."
                )
                raise SystemExit(130) from None
            bar.update()


def draw_gallery(into: Output, options: argparse.Namespace) -> None:
    """Draw the gallery of published models, and write its pages into the documentation."""
    found = [e for e in gallery_pages.entries() if options.only in (None, e.name)]
    run([(e.name, partial(e.draw, into)) for e in found], into.folder)
    if options.docs:
        gallery_pages.write_docs(into.folder, DOCS, found)
    if into.check:
        print(f"\n{overlap_report(into.overlaps)}")


def main(arguments: Sequence[str] | None = None) -> list[Row]:
    """Draw every figure into a folder, write the index page, and return the rows of all cases."""
    into, options = chosen(arguments)
    folder = into.folder
    if options.gallery:
        draw_gallery(into, options)
        return []
    run(steps(into), folder)
    maps = [regime_maps.row(plane) for plane in regime_maps.PLANES]
    cases = [c for f in equilibria.FIGURES for s in SCALINGS for c in laid_cases(f, s)]
    rows = [row(case) for case in (*cases, negative_stiffness.case())]
    write(rows, folder / "summary.csv")
    write(maps, folder / "regime_maps.csv")
    write_text(folder / "index.md", page(all_claims(), ""))
    if options.docs:
        write_docs(folder, DOCS)
    if into.check:
        print(f"\n{overlap_report(into.overlaps)}")
    print(f"\n{table(rows)}\n\n{table(maps)}\n")
    print(f"Load of angular frequency {OMEGA:g} (dimensionless), {PERIODS} periods from rest.")
    print(f"Every claim with its figures and verdict is in {folder / 'index.md'}.")
    return rows


if __name__ == "__main__":
    main()
