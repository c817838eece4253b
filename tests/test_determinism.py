"""The same bits whatever the hash seed, the number of threads, and what was computed before."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

#: Prints a digest of every result, computed in the order that is asked for.
PROGRAM = """
import hashlib, json, sys
import sympy as sp
import fastslow as fs
from fastslow.results.io.encoding import encoded

backwards = sys.argv[1] == "backwards"
execution = fs.Execution(threads=int(sys.argv[2]))
gear = fs.systems.harmonic_gear(omega=0.1)
block = fs.systems.stick_slip()
x, y, p = sp.symbols("x y p")
hopf = fs.Model({x: p * x - y - x * (x**2 + y**2), y: x + p * y - y * (x**2 + y**2)},
                parameters={p: 0})
loads = fs.Model({x: p + y * x - sp.Abs(x)}, parameters={p: 0, y: 0.5})


def digest(value):
    arrays = {}
    text = value if isinstance(value, str) else json.dumps(encoded(value, "", arrays))
    sum = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        sum.update(name.encode() + arrays[name].tobytes())
    return sum.hexdigest()[:16]


def regime(A, C):
    values = {"A": A, "C": C}
    many = fs.simulate_many(gear, [0, 0], parameters=values, periods=2, execution=execution)
    return many.regime


TASKS = {
    "diagram of a gear": lambda: fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6)),
    "diagram with Hopf points": lambda: fs.continue_equilibria(hopf, "p", over=(-1, 1)),
    "diagram with a corner": lambda: fs.continue_equilibria(loads, "p", over=(-1, 1)),
    "derivation": lambda: fs.derive(gear.frozen()).summary() + fs.derive(loads).summary(),
    "run": lambda: fs.simulate(gear, [0, 0], periods=2),
    "sliding run": lambda: fs.simulate(block, [0.1, 0.0], t=(0, 10)),
    "overlay": lambda: fs.overlay(TASKS["diagram of a gear"](), TASKS["run"]()),
    "ensemble": lambda: fs.simulate_many(
        gear, [0, 0], parameters={"C": [2.0, 2.5, 3.0, 3.5]}, periods=2, execution=execution
    ),
    "sweep": lambda: fs.bifurcation_sweep(gear, "C", [2.0, 2.5], [0, 0], settle=1, keep=2),
    "map": lambda: fs.refined_map(
        regime, {"A": (0.1, 1), "C": (0.1, 3)}, refinement=fs.Refinement(cells=(2, 2), levels=1)
    ),
}
found = {}
for name in reversed(TASKS) if backwards else TASKS:
    found[name] = digest(TASKS[name]())
for name in sorted(found):
    print(name, found[name])
"""


def digests(seed, order, threads):
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM, order, str(threads)],
        env={**os.environ, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()


@pytest.fixture(scope="module")
def first():
    return digests("0", "forwards", 1)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("seed", "order", "threads"), [("1", "backwards", 2), ("4321", "forwards", 3)]
)
def test_seeds_orders_and_threads_change_no_bit(first, seed, order, threads):
    assert len(first) == 10
    assert digests(seed, order, threads) == first
