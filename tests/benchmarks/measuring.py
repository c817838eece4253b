"""How speed is measured: processor time, medians, everything that is compared in turn."""

from __future__ import annotations

import json
import os
import platform
import resource
import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

#: Packages whose versions a result depends on.
PACKAGES = ("numpy", "scipy", "sympy", "numba", "llvmlite", "matplotlib", "heyoka", "bice")


@dataclass(frozen=True)
class Line:
    """One line of a table.

    Parameters
    ----------
    work : str
        What was done.
    tool : str
        What did it.
    value : float
    unit : str
        ``"ms"`` of processor time, or something per second of it.
    ratio : float, optional
        How many times as fast fastslow is, where the tool is a peer.
    note : str
        Error, or what else is needed to judge the line.
    """

    work: str
    tool: str
    value: float
    unit: str
    ratio: float | None = None
    note: str = ""

    def __str__(self) -> str:
        ratio = "" if self.ratio is None else f"{self.ratio:.3g} x"
        return f"{self.tool:44}{self.value:12.4g} {self.unit:10}{ratio:>10}  {self.note}"


def used() -> float:
    """Processor time of this process and of those that it has waited for, in seconds."""
    spent = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in spent)


def medians(functions: Mapping[str, Callable[[], Any]], repeats: int = 9) -> dict[str, float]:
    """Median processor time of every function in ms, called one after the other.

    Short calls are repeated within a measurement until it lasts some milliseconds. Each
    function is called once before.
    """
    counts = {}
    for name, function in functions.items():
        function()
        begin = time.process_time()
        function()
        once = max(time.process_time() - begin, 1e-6)
        counts[name] = max(1, min(1000, int(0.005 / once)))
    taken: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(repeats):
        for name, function in functions.items():
            begin = used()
            for _ in range(counts[name]):
                function()
            taken[name].append((used() - begin) / counts[name])
    return {name: 1e3 * statistics.median(some) for name, some in taken.items()}


def against(
    work: str, ours: str, times: Mapping[str, float], notes: Mapping[str, str] | None = None
) -> list[Line]:
    """Lines of one work, with the ratio of each peer to one of ours.

    Examples
    --------
    >>> [line.ratio for line in against("a run", "fastslow", {"fastslow": 2.0, "SciPy": 500.0})]
    [None, 250.0]
    """
    notes = notes or {}
    return [
        Line(
            work,
            name,
            value,
            "ms",
            None if name.startswith("fastslow") else value / times[ours],
            notes.get(name, ""),
        )
        for name, value in times.items()
    ]


def machine() -> dict[str, Any]:
    """What a result depends on: processor, load, versions."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return {
        "date": time.strftime("%Y-%m-%d"),
        "processor": _processor(),
        "processors": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": versions,
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((x.split(":", 1)[1].strip() for x in lines if x.startswith("model name")), "")


def write(path: Path, tables: Mapping[str, Iterable[Line]]) -> None:
    """Write tables with what they depend on; those of other names that are there already stay."""
    known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    here = machine()
    for name, lines in tables.items():
        known[name] = {"machine": here, "lines": [asdict(line) for line in lines]}
    path.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")
