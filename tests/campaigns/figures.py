"""Figures of all analyses at full resolution, compared with those of the pages."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from analyses import __main__ as everything
from analyses import claims_page
from tests.analyses.drawn import SAME, difference


@dataclass
class Report:
    """Differences in grey levels by figure."""

    differences: dict[str, float] = field(default_factory=dict)

    @property
    def failures(self) -> list[str]:
        return [name for name, apart in self.differences.items() if not apart < SAME]

    def __str__(self) -> str:
        return "\n".join(f"{name}: {apart:.2f}" for name, apart in self.differences.items())


def campaign() -> Report:
    with tempfile.TemporaryDirectory() as folder:
        everything.main([folder, "--png"])
        return Report({n: float(difference(Path(folder), n)) for n in claims_page.CAPTIONS})
