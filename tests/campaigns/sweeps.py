"""Sweeps with a store, killed at random moments and resumed with another executor each time.

Each sweep is ended five times by SIGKILL or by SIGINT, as of Ctrl-C, in threads, in its own
process, in processes and on two workers of Dask, and the bytes of its store are compared with those
of a sweep without interruption.
"""

import random
import signal
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from tests.sweeps.interrupted import content, killed_and_resumed, run

SIGNALS = (signal.SIGKILL, signal.SIGINT)
KINDS = ("threads", "none", "processes", "dask")


@dataclass
class Report:
    """Numbers of sweeps and of missing points after each kill, and what went wrong."""

    sweeps: int = 0
    missing: list[int] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        lines = [f"{self.sweeps} sweeps, missing points after the kills: {self.missing}"]
        return "\n".join([*lines, *self.failures, f"{len(self.failures)} failures"])


def campaign(count=5, seed=0):
    """Kill and resume so many sweeps."""
    report, chance = Report(), random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        unbroken = Path(folder) / "unbroken.zarr"
        grid, expected = run(unbroken), content(unbroken)
        for k in range(int(count)):
            path = Path(folder) / f"{k}.zarr"
            kinds = [chance.choice(KINDS) for _ in range(5)]
            missing, found = killed_and_resumed(path, chance.random(), kinds, SIGNALS)
            if path.with_name(f"{path.name}.lock").exists():
                report.failures.append(f"the lock of sweep {k} is left")
            report.sweeps += 1
            report.missing += missing
            if found != grid or content(path) != expected:
                report.failures.append(f"sweep {k} by {', '.join(kinds)} differs")
    return report
