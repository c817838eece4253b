"""Damaged stores of sweeps: each damage must be noticed on load, and mended or refused on resume.

A file of a store, of chunks or of metadata, is deleted, exchanged with another one, changed in a
bit, cut short, zeroed, or replaced by a copy of another one. Then `fs.load` must raise FileError
or name missing points, and the same call of `fs.sweep` must raise FileError or complete the store
to the bytes that it had. Some stores have failures, paired axes, text, arrays, and outputs whose
values are those of chunks that do not exist.
"""

import random
import shutil
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import fastslow as fs


def plain(a):
    """Outputs of which some chunks have the value of an empty one."""
    return {"stable": bool(a > 2), "y": 2.0 * a, "none": np.nan, "text": "u" * int(a)}


def failing(a, b):
    """Outputs of each kind; some points have none."""
    if (a + b) % 3 == 0:
        raise ValueError(f"no value at {a}, {b}")
    return {"z": a + 1j * b, "both": [a, b], "word": "even" if a % 2 else ""}


#: Functions with their axes, whether these are paired, and the sizes of tasks.
SWEEPS = (
    (plain, {"a": np.arange(6.0)}, False, 2),
    (plain, {"a": np.arange(5.0)}, True, 3),
    (failing, {"a": np.arange(4), "b": np.arange(3)}, False, 3),
    (failing, {"a": np.arange(4), "b": np.arange(4)}, True, 1),
)


def swept(path, k):
    """Return the grid of a sweep with a store."""
    function, over, paired, chunk = SWEEPS[k]
    execution = fs.Execution(store=path, chunk=chunk)
    return fs.sweep(function, over, paired=paired, execution=execution)


def content(path):
    """The bytes of every file of a store."""
    return {p.relative_to(path): p.read_bytes() for p in path.rglob("*") if p.is_file()}


def damage(path, chance):
    """Change a store at random; return what was done."""
    files = sorted(p for p in path.rglob("*") if p.is_file())
    while True:
        file, other = chance.sample(files, 2)
        old = file.read_bytes()
        kind = chance.choice(("deleted", "exchanged", "bit", "cut", "zeroed", "copied"))
        if kind == "deleted":
            file.unlink()
        elif kind in ("exchanged", "copied"):
            if old == other.read_bytes():
                continue
            file.write_bytes(other.read_bytes())
            if kind == "exchanged":
                other.write_bytes(old)
        elif kind == "cut":
            file.write_bytes(old[: chance.randrange(len(old))])
        elif kind == "zeroed":
            file.write_bytes(bytes(len(old)))
        else:
            new = bytearray(old)
            new[chance.randrange(len(old))] ^= 1 << chance.randrange(8)
            file.write_bytes(new)
        return f"{kind} {file.relative_to(path)} {other.relative_to(path)}"


@dataclass
class Report:
    """What became of the damaged stores."""

    outcomes: Counter = field(default_factory=Counter)
    failures: list = field(default_factory=list)

    def __str__(self):
        counts = [f"{count} {what}" for what, count in self.outcomes.most_common()]
        return "\n".join([*counts, *self.failures, f"{len(self.failures)} failures"])


def outcome_on_load(path, expected):
    """Whether a damage was noticed by `fs.load`."""
    try:
        grid = fs.load(path)
    except fs.FileError:
        return "refused"
    if len(grid.missing) > len(expected.missing):
        return "missing"
    return "passed"


def outcome_on_resume(path, k, grid, before):
    """What the same call made of a damaged store."""
    try:
        again = swept(path, k)
    except fs.FileError:
        return "refused"
    same = content(path) == before and all(
        np.array_equal(again[n], grid[n], equal_nan=grid[n].dtype.kind in "fc")
        for n in grid.outputs
    )
    return "completed" if same else "different"


def campaign(count=1000, seed=0):
    """Damage so many stores."""
    report, chance = Report(), random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{k}.zarr" for k in range(len(SWEEPS))]
        grids = [swept(path, k) for k, path in enumerate(paths)]
        whole = [content(path) for path in paths]
        for n in range(int(count)):
            k = chance.randrange(len(SWEEPS))
            path = Path(folder) / "damaged.zarr"
            shutil.copytree(paths[k], path)
            what = damage(path, chance)
            loaded = outcome_on_load(path, grids[k])
            resumed = outcome_on_resume(path, k, grids[k], whole[k])
            report.outcomes[f"{loaded} on load, {resumed} on resume"] += 1
            if loaded == "passed" or resumed == "different":
                report.failures.append(f"{n}, sweep {k}, {what}: {loaded}, {resumed}")
            shutil.rmtree(path)
    return report
