"""Three torsional stiffnesses (Fig. 4 of the source): k1 = 1000, 3000, 7000 at D = 0.1.

The source states a faster vibration at smaller k1. The natural frequency on
the tooth flank, √(3x² − 2Dx + A − 1/4), falls with k1.
"""

from __future__ import annotations

from pathlib import Path

import fastslow as fs
from analyses.passages import OMEGA, Row, Setting, saved

STIFFNESSES = (1000, 3000, 7000)


def settings() -> list[Setting]:
    """The three stiffnesses, all else from the source's physical values."""
    return [
        Setting(
            f"stiffness_{k1}",
            rf"$k_1 = {k1}\,\mathrm{{N\,m/rad}}$, $D = 0.1$",
            fs.systems.harmonic_gear_physical(k1=k1, D=0.1).with_parameters(omega=OMEGA),
        )
        for k1 in STIFFNESSES
    ]


def main(folder: Path) -> list[Row]:
    """Draw the panels into a folder and return their numbers."""
    return [saved(setting, folder) for setting in settings()]


if __name__ == "__main__":
    print(*main(Path("figures")), sep="\n")
