"""Periodic orbits of the forced gear pair over the frequency, beside AUTO-07p in the same run.

Both trace the branch through two grazings and two folds with all tests for bifurcations. AUTO
knows no interfaces; it takes the kinked rates with their Jacobian, and the forcing as two more
states, and runs in one thread. The times are those of 200 points; compiling is not counted.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import fastslow as fs
from tests.benchmarks.continuation import taken
from tests.benchmarks.measuring import Line

OVER = (0.6, 1.6)
POINTS = 200
#: By exact shooting, known to ten digits.
FOLDS = np.array([0.8284639844, 0.7080316187])
BRANCH = "200 points of the response of the gear pair, with all tests"
POINT = "one orbit of the gear pair"

#: x'' + 0.1 x' + g(x) = 0.1 + 0.05 W² p, where p = sin W t and q = cos W t attract.
EQUATIONS = """\
SUBROUTINE FUNC(NDIM,U,ICP,PAR,IJAC,F,DFDU,DFDP)
  IMPLICIT NONE
  INTEGER, INTENT(IN) :: NDIM, ICP(*), IJAC
  DOUBLE PRECISION, INTENT(IN) :: U(NDIM), PAR(*)
  DOUBLE PRECISION, INTENT(OUT) :: F(NDIM)
  DOUBLE PRECISION, INTENT(INOUT) :: DFDU(NDIM,NDIM), DFDP(NDIM,*)
  DOUBLE PRECISION W, G, S, R
  W = PAR(1)
  G = 0
  S = 0
  IF (ABS(U(1)) > 1) THEN
    G = U(1) - SIGN(1D0, U(1))
    S = 1
  END IF
  R = U(3)**2 + U(4)**2
  F(1) = U(2)
  F(2) = 0.1D0 + 0.05D0*W**2*U(3) - 0.1D0*U(2) - G
  F(3) = U(3)*(1 - R) + W*U(4)
  F(4) = U(4)*(1 - R) - W*U(3)
  IF (IJAC == 0) RETURN
  DFDU = 0
  DFDU(1,2) = 1
  DFDU(2,1) = -S
  DFDU(2,2) = -0.1D0
  DFDU(2,3) = 0.05D0*W**2
  DFDU(3,3) = 1 - R - 2*U(3)**2
  DFDU(3,4) = W - 2*U(3)*U(4)
  DFDU(4,3) = -W - 2*U(3)*U(4)
  DFDU(4,4) = 1 - R - 2*U(4)**2
  IF (IJAC == 1) RETURN
  DFDP(1,1) = 0
  DFDP(2,1) = 0.1D0*W*U(3)
  DFDP(3,1) = U(4)
  DFDP(4,1) = -U(3)
END SUBROUTINE FUNC

SUBROUTINE STPNT(NDIM,U,PAR,T)
  IMPLICIT NONE
  INTEGER, INTENT(IN) :: NDIM
  DOUBLE PRECISION, INTENT(INOUT) :: U(NDIM), PAR(*)
  DOUBLE PRECISION, INTENT(IN) :: T
  DOUBLE PRECISION W, PHASE, A, B, D
  W = 0.6D0
  PHASE = 8*ATAN(1D0)*T
  D = (1 - W**2)**2 + 0.01D0*W**2
  A = 0.05D0*W**2*(1 - W**2)/D
  B = -0.05D0*W**2*0.1D0*W/D
  PAR(1) = W
  PAR(11) = 8*ATAN(1D0)/W
  U(1) = 1.1D0 + A*SIN(PHASE) + B*COS(PHASE)
  U(2) = W*(A*COS(PHASE) - B*SIN(PHASE))
  U(3) = SIN(PHASE)
  U(4) = COS(PHASE)
END SUBROUTINE STPNT

SUBROUTINE BCND
END SUBROUTINE BCND
SUBROUTINE ICND
END SUBROUTINE ICND
SUBROUTINE FOPT
END SUBROUTINE FOPT
SUBROUTINE PVLS
END SUBROUTINE PVLS
"""

#: A branch of periodic orbits in PAR(1) with all special points looked for, nothing stored. With
#: less than 25 iterations for a special point, or 1e-7 for its accuracy, no fold is found.
CONSTANTS = f"""\
NDIM = 4, IPS = 2, ILP = 1, ISP = 2, ISW = 1, JAC = 1, ICP = [1, 11]
NTST = 200, NCOL = 4, IAD = 3, MXBF = 0, IID = 0, ITMX = 25, ITNW = 5, NWTN = 3
DS = 0.01, DSMIN = 1e-06, DSMAX = 0.05, IADS = 1, NPR = 0, NMX = 2000
EPSL = 1e-08, EPSU = 1e-08, EPSS = 1e-05, RL0 = 0.5, RL1 = {OVER[1]}
"""


def note(points: int, time: float, folds: np.ndarray) -> str:
    """Number of points, time, and largest error of the folds."""
    known = f"{points} points in {1e3 * time:.4g} ms"
    if len(folds) != len(FOLDS):
        return f"{known}, {len(folds)} of 2 folds"
    return f"{known}, error of the folds {np.abs(folds - FOLDS).max():.1e}"


def auto(folder: Path) -> tuple[float, int, np.ndarray] | None:
    """Time of a branch of AUTO-07p, number of its points, and the folds."""
    program = shutil.which("auto-07p") or shutil.which("auto")
    if program is None or shutil.which("gfortran") is None:
        print("AUTO-07p: not installed (it needs gfortran too), left out")
        return None
    (folder / "pair.f90").write_text(EQUATIONS)
    (folder / "c.pair").write_text(CONSTANTS)
    (folder / "compile.auto").write_text("run(e='pair', c='pair')\n")
    quiet: dict[str, Any] = {
        # its threads wait actively, up to 30 times the processor time on a busy machine
        "env": {**os.environ, "OMP_NUM_THREADS": "1"},
        "cwd": folder,
        "stdin": subprocess.DEVNULL,
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
    }
    subprocess.run([program, "compile.auto"], check=False, timeout=300, **quiet)
    executable = folder / "pair.exe"
    if not executable.exists():
        print(f"AUTO-07p: {Path(program).name} did not compile the equations, left out")
        return None
    (folder / "fort.2").write_text(CONSTANTS)
    time, _ = taken(lambda: subprocess.run([executable], check=True, **quiet), 9)
    rows = [line.split() for line in (folder / "fort.7").read_text().splitlines()]
    rows = [row for row in rows if row[0] != "0"]
    return time, len(rows), np.array([float(row[4]) for row in rows if row[2] == "5"])


def lines() -> Iterator[Line]:
    """Processor time of 200 points, and of one orbit beside a trajectory of one period."""
    pair = fs.systems.gear_pair(Omega=OVER[0])
    orbit = fs.find_orbit(pair, [1.1, 0])
    settings = fs.Continuation(step=0.02, max_step=0.032)  # about 200 points
    time, branch = taken(
        lambda: fs.continue_orbits(orbit, "Omega", (0.5, OVER[1]), continuation=settings), 9
    )
    ours = 1e3 * time / len(branch)
    folds = np.array([point["Omega"] for point in branch.special("LPC")])
    words = note(len(branch), time, folds)
    yield Line(BRANCH, "fastslow", POINTS * ours, "ms", None, words)
    with tempfile.TemporaryDirectory() as name:
        peer = auto(Path(name))
    if peer is not None:
        theirs = 1e3 * peer[0] / peer[1]
        words = note(peer[1], peer[0], peer[2])
        yield Line(BRANCH, "AUTO-07p, NTST = 200", POINTS * theirs, "ms", theirs / ours, words)

    starts = np.tile(orbit(0.0)[:2], (POINTS, 1))
    precise = fs.Integration(rtol=1e-12, atol=1e-12)
    time, _ = taken(lambda: fs.simulate_many(pair, starts, periods=1, integration=precise), 9)
    run = 1e3 * time / POINTS
    yield Line(POINT, "fastslow, a trajectory of one period, of 200", run, "ms")
    near = pair.with_parameters(Omega=OVER[0] + 1e-3)
    time, _ = taken(lambda: fs.find_orbit(near, orbit), 9)
    for tool, value in (("a point of the branch", ours), ("find_orbit", 1e3 * time)):
        yield Line(POINT, f"fastslow, {tool}", value, "ms", None, f"{value / run:.3g} trajectories")
