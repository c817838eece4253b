"""Three widths of the gap (Fig. 3 of the source): D = 0.1, 0.25, 0.5.

The source states bilateral impacts at 0.1 and 0.25 and unilateral ones at 0.5.
Run here, all three are bilateral: the load falls to −1.2, far enough below zero
for long enough to carry the teeth across each of these gaps.
"""

from __future__ import annotations

from pathlib import Path

import fastslow as fs
from analyses.passages import OMEGA, Row, Setting, saved

STATED = {0.1: "bilateral", 0.25: "bilateral", 0.5: "unilateral"}


def settings() -> list[Setting]:
    """The three widths, all else from the source's physical values."""
    gear = fs.systems.harmonic_gear_physical().with_parameters(omega=OMEGA)
    return [
        Setting(f"gap_width_{D}", f"$D = {D}$", gear.with_parameters(D=D), stated)
        for D, stated in STATED.items()
    ]


def main(folder: Path) -> list[Row]:
    """Draw the panels into a folder and return their numbers."""
    return [saved(setting, folder) for setting in settings()]


if __name__ == "__main__":
    print(*main(Path("figures")), sep="\n")
