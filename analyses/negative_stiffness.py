"""A gear with A < −D², where the equilibrium curve folds and the trajectory jumps.

Not a case of the source, whose stiffness is positive: there the curve has no
fold. Folds are at x = ±(D + √(D² − 3A))/3; for A = −0.6, D = 0.25 their load is
∓0.0894402097712473.
"""

from __future__ import annotations

from pathlib import Path

import fastslow as fs
from analyses.passages import OMEGA, Row, Setting, saved

STIFFNESS, GAP, SWING = -0.6, 0.25, 0.4


def settings() -> list[Setting]:
    """One case: the load swings across both folds."""
    gear = fs.systems.harmonic_gear(A=STIFFNESS, B=0.0, C=SWING, D=GAP, omega=OMEGA)
    title = f"$A = {STIFFNESS}$, $D = {GAP}$, $B = 0$, $C = {SWING}$"
    return [Setting("negative_stiffness", title, gear)]


def main(folder: Path) -> list[Row]:
    """Draw the panel into a folder and return its numbers."""
    return [saved(setting, folder) for setting in settings()]


if __name__ == "__main__":
    print(*main(Path("figures")), sep="\n")
