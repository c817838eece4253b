"""Measure speed against peers: ``python -m tests.benchmarks [TABLE ...] [--json FILE | --docs]``.

Without names all tables are measured. Peers that are not installed are left out, and said.
The table that `docs/theory/accuracy.md` shows is written by ``--docs``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
from importlib import import_module
from pathlib import Path

from tests.benchmarks.measuring import Line, machine, write

#: Every table, a module with a function `lines`.
TABLES = (
    "trajectories",
    "impacts",
    "ensembles",
    "continuation",
    "parameters",
    "overlays",
    "derivations",
    "bench_slow_flow",
    "first_diagrams",
    "queries",
    "bench_orbits",
    "bench_sweeps",
    "certificates",
    "memory",
)

#: What the page on accuracy and speed reads.
DOCS = Path(__file__).parents[2] / "docs" / "theory" / "benchmarks.json"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=", ".join(TABLES))
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the result")
    parser.add_argument("--docs", action="store_true", help=f"write {DOCS.name} for the docs")
    asked = parser.parse_args()
    for name in asked.tables:
        if name not in TABLES:
            parser.error(f"no table {name!r}; expected of {', '.join(TABLES)}")
    here = machine()
    print(f"{here['processor']}, load {here['load']}, Python {here['python']}")
    measured: dict[str, list[Line]] = {}
    for name in asked.tables or TABLES:
        print(f"\n{name}")
        lines: list[Line] = []
        for line in import_module(f"tests.benchmarks.{name}").lines():
            if not lines or lines[-1].work != line.work:
                print(f"  {line.work}")
            print(f"    {line}", flush=True)
            lines.append(line)
        measured[name] = lines
        # what is measured is kept, whatever happens to the next table
        for path in filter(None, (asked.json, DOCS if asked.docs else None)):
            write(path, {name: lines})


if __name__ == "__main__":
    main()
