"""Three amplitudes of the load (Fig. 5 of the source): T_am = 10, 50, 100 N m.

The source states bilateral impacts at 10 and unilateral ones at 50 and 100.
The load is w = B + C sin(ω t) with C/B = 0.0996 T_am/(N m): at 10 it never
changes sign, and the teeth stay in mesh; at 50 and 100 it does, and impacts are
bilateral.
"""

from __future__ import annotations

from pathlib import Path

import fastslow as fs
from analyses.passages import OMEGA, Row, Setting, saved

STATED = {10: "bilateral", 50: "unilateral", 100: "unilateral"}
GAP = 0.25


def settings() -> list[Setting]:
    """The three amplitudes at D = 0.25, all else from the source's physical values."""
    return [
        Setting(
            f"load_amplitude_{T_am}",
            rf"$T_\mathrm{{am}} = {T_am}\,\mathrm{{N\,m}}$, $D = {GAP}$",
            fs.systems.harmonic_gear_physical(T_am=T_am, D=GAP).with_parameters(omega=OMEGA),
            stated,
        )
        for T_am, stated in STATED.items()
    ]


def main(folder: Path) -> list[Row]:
    """Draw the panels into a folder and return their numbers."""
    return [saved(setting, folder) for setting in settings()]


if __name__ == "__main__":
    print(*main(Path("figures")), sep="\n")
