"""Damaged files of every kind of result, and of AUTO-07p, loaded in processes of their own.

A damaged file of a result must be refused with FileError or load identical, bit for bit; one of
AUTO must be refused or read. Neither may end in another error or a dead process, take longer than
`SECONDS`, or allocate more than `MEMORY`. Some damaged files get a right checksum again, as one
written by hand can have: these may load, but are held to the rest, except that nobody can promise
what the HDF5 library does with them.
"""

from __future__ import annotations

import random
import re
import resource
import select
import struct
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import sympy as sp

import fastslow as fs
from fastslow.results.io.npz_netcdf import SEAL_SIZE, sealed
from tests.results.conftest import same

ROOT = Path(__file__).parents[2]
AUTO = ROOT / "tests" / "results" / "data"

#: Time that one file may take, the start of a process included.
SECONDS = 60.0

#: Bytes that a process may allocate beyond those that it has at its start.
MEMORY = 2**30

#: Damages of bytes, each a function of a generator and the content.
DAMAGES = {}


def damage(function):
    """Add a function to those that damage files."""
    DAMAGES[function.__name__] = function
    return function


@damage
def bits_flipped(generator, content):
    """A few bits, anywhere."""
    changed = bytearray(content)
    for _ in range(generator.choice((1, 1, 2, 8, 64))):
        changed[generator.randrange(len(changed))] ^= 1 << generator.randrange(8)
    return bytes(changed)


@damage
def bytes_replaced(generator, content):
    """One byte, or a whole number of four or eight bytes, with an extreme value."""
    size = generator.choice((1, 2, 4, 8))
    at = generator.randrange(max(len(content) - size, 1))
    value = generator.choice((b"\0", b"\xff", b"\x7f", b"\x80", b"9", b"-"))
    return content[:at] + value * size + content[at + size :]


@damage
def cut_short(generator, content):
    """The rest is missing."""
    return content[: generator.randrange(len(content))]


@damage
def part_missing(generator, content):
    """Some bytes within are missing."""
    first, last = _block(generator, content)
    return content[:first] + content[last:]


@damage
def part_inserted(generator, content):
    """Bytes that do not belong there."""
    first, last = _block(generator, content)
    return content[:first] + generator.randbytes(min(last - first, 999)) + content[first:]


@damage
def part_twice(generator, content):
    """A block is repeated."""
    first, last = _block(generator, content)
    return content[:last] + content[first:]


@damage
def blocks_swapped(generator, content):
    """Two blocks of one size in each other's place."""
    size = generator.choice((16, 512, 4096))
    one, other = sorted(generator.randrange(max(len(content) - size, 1)) for _ in range(2))
    other = max(other, one + size)
    middle = content[one + size : other]
    return (
        content[:one] + content[other : other + size] + middle + content[one : one + size]
        + content[other + size :]
    )  # fmt: skip


@damage
def block_zeroed(generator, content):
    """A block that never reached the disk."""
    first, last = _block(generator, content)
    return content[:first] + bytes(last - first) + content[last:]


@damage
def other_tail(generator, content):
    """The end of another file."""
    at = generator.randrange(len(content))
    return content[:at] + generator.randbytes(len(content) - at)


def _block(generator, content):
    """Where a block begins and ends; its size is any power of two."""
    first = generator.randrange(len(content))
    return first, min(first + 2 ** generator.randrange(13), len(content))


def directory_changed(generator, content):
    """A field in the directory of an archive: sizes, places, methods, names."""
    starts = [k for k in range(len(content) - 46) if content[k : k + 4] == b"PK\1\2"]
    starts += [k for k in range(len(content) - 30) if content[k : k + 4] in (b"PK\3\4", b"PK\5\6")]
    at = generator.choice(starts) + generator.choice((6, 8, 10, 14, 16, 20, 24, 26, 28, 42))
    kind = generator.choice(["<H", "<I"])
    most = 2 ** (8 * struct.calcsize(kind)) - 1
    value = generator.choice((0, 1, 8, 12, most, most // 2, generator.randrange(most)))
    return content[:at] + struct.pack(kind, value) + content[at + struct.calcsize(kind) :]


def header_changed(generator, content):
    """A word in the header of an array or in the text."""
    old, new = generator.choice(
        [
            (b"'shape': (", b"'shape': (99"),
            (b"'shape': (", b"'shape': (-1, "),
            (b"'shape': (", b"'shape': (((((("),
            (b"<f8", b"|O8"),
            (b"<f8", b"<U9"),
            (b"<f8", b">f8"),
            (b'"dtype": "<f8"', b'"dtype": "<f4"'),
            (b'"shape": [', b'"shape": [9'),
            (b'"shape": [', b'"shape": [[[['),
            (b'{"', b'"{'),
            (b'"class": "', b'"class": "_'),
            (b"True", b"eval"),
            (b"0", b"Infinity"),
            (b"1", b"9" * 400),
        ]
    )
    return content.replace(old, new, generator.choice((1, -1)))


def number_changed(generator, content):
    """A word of a text of AUTO is another one."""
    words = content.split(b" ")
    places = [k for k, word in enumerate(words) if word]
    at = generator.choice(places)
    words[at] = generator.choice(
        [
            b"0",
            b"-1",
            b"9" * 30,
            b"-" + b"9" * 5000,
            b"nan",
            b"1E+999",
            b"-9",
            b"{",
            b"=",
            b"",
            b"2",
        ]
    )
    return b" ".join(words)


def constant_changed(generator, content):
    """A constant in the header of AUTO is another one."""
    name = generator.choice([b"NDIM", b"NPAR", b"IPS", b"ISW", b"ILP", b"NTST"])
    value = generator.choice([b"-1", b"0", b"2", b"999999999", b"9" * 5000])
    return re.sub(
        name + rb" *= *-?\d+", name + b"= " + value, content, count=generator.choice((0, 1))
    )


def lines_changed(generator, content):
    """Lines missing, repeated, or in another order."""
    lines = content.split(b"\n")
    first, other = (generator.randrange(len(lines)) for _ in range(2))
    change = generator.choice(["missing", "repeated", "swapped"])
    if change == "missing":
        del lines[first : first + generator.choice((1, 2, 20))]
    elif change == "repeated":
        lines[other:other] = lines[first : first + 3]
    else:
        lines[first], lines[other] = lines[other], lines[first]
    return b"\n".join(lines)


def results():
    """One result of each kind that files keep."""
    x, p, q = sp.symbols("x p q")
    gear = fs.systems.harmonic_gear()
    diagram = fs.continue_equilibria(gear.frozen(), "w", over=(-2, 6))
    run = fs.simulate(gear, [0, 0], periods=1)
    fold_model = fs.Model({x: p + q * x - x**3}, parameters={p: 0, q: 1})
    fold = fs.continue_equilibria(fold_model, "p", (-1, 1)).folds[0]
    return {
        "diagram": diagram,
        "branch": diagram[0],
        "points": diagram.special,
        "point": diagram.boundary_equilibria[0],
        "equilibrium": diagram[0][0],
        "run": run,
        "samples": fs.simulate(gear, [0, 0], periods=1, samples=7, dense=False),
        "overlay": fs.overlay(diagram, run),
        "ensemble": fs.simulate_many(
            gear, [[0, 0], [1, 0]], parameters={"D": [0.2, 0.3]}, periods=1
        ),
        "sweep": fs.bifurcation_sweep(gear, "C", [3.4, 3.5], [0, 0], settle=0, keep=1),
        "section": run.section(interface="x - D"),
        "spectrum": run.spectrum("x"),
        "steady": run.periodicity(),
        "contacts": run.contacts(),
        "map": fs.refined_map(
            lambda a, b: a * b < 1, {"a": (0, 2), "b": (0, 2)}, refinement=fs.Refinement(levels=3)
        ),
        "load": fs.systems.slow_load_criterion(gear, {"D": [0.5, 0.6], "C": 2.5}),
        "curve": fs.continue_points(fold, ("p", "q"), over={"p": (-1, 1), "q": (-1, 2)}),
        "delay": fs.predict_delay(fold, 1e-3),
    }


@dataclass
class Report:
    """What became of the damaged files."""

    seed: int
    outcomes: dict[str, Counter[str]] = field(default_factory=dict)
    kinds: int = 0
    slowest: float = 0.0
    largest: int = 0
    faults: list[str] = field(default_factory=list)

    @property
    def failures(self) -> bool:
        """Whether a file was read differently, or ended in anything but an answer or FileError."""
        return bool(self.faults)

    def __str__(self) -> str:
        lines = [
            f"seed {self.seed}, {self.kinds} kinds of results; slowest {self.slowest:.2f} s, "
            f"largest growth of a process {self.largest / 2**20:.0f} MB"
        ]
        for name, counts in self.outcomes.items():
            text = ", ".join(f"{count} {outcome}" for outcome, count in counts.most_common())
            lines.append(f"{counts.total()} {name}: {text}")
        return "\n".join(lines + [f"    {fault}" for fault in self.faults])


class Worker:
    """A process that loads files, started again where it dies."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.process: subprocess.Popen[str] | None = None

    def outcome(self, kind: str, path: Path, original: Path) -> tuple[str, float, int]:
        """What became of a file, the processor time it took, and the growth in bytes."""
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-c", "from tests.campaigns.files import work; work()"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                cwd=ROOT,
            )
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        started = time.monotonic()
        print(kind, path, original, sep="\t", file=self.process.stdin, flush=True)
        if not select.select([self.process.stdout], [], [], SECONDS)[0]:
            self.close()
            return "took too long", time.monotonic() - started, 0
        line = self.process.stdout.readline()
        if not line:
            code = self.process.wait()
            self.process = None
            return f"dead process ({code})", time.monotonic() - started, 0
        outcome, seconds, growth = line.rstrip("\n").split("\t")
        return outcome, float(seconds), int(growth)

    def close(self) -> None:
        """End the process."""
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
            self.process = None


def work() -> None:
    """Load the files named on standard input and print what became of them."""
    with Path("/proc/self/statm").open() as file:
        used = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, resource.RLIM_INFINITY))
    warnings.simplefilter("error")
    whole = cache(fs.load)
    before = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for line in sys.stdin:
        kind, path, original = line.rstrip("\n").split("\t")
        expected = whole(original) if kind == "result" else None
        started = time.process_time()
        try:
            if kind == "result":
                outcome = "identical" if same(expected, fs.load(path)) else "different"
            else:
                read = fs.read_auto(path, f"{path}.s", f"{path}.d")
                outcome = f"read{'' if read.branches else ' as nothing'}"
        except fs.FileError as error:
            short = "MemoryError" in str(error) or "allocate" in str(error)
            outcome = "refused for want of memory" if short else "refused"
        except BaseException as error:
            outcome = f"{type(error).__name__}: {str(error)[:120]!r}"
        seconds = time.process_time() - started
        grown = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        print(outcome, seconds, grown, sep="\t", flush=True)


#: NetCDF that only the HDF5 library can check.
FORGED = "nc with a right checksum"

#: What may become of a file, by what it is.
ALLOWED = {
    "npz": {"refused", "identical"},
    "nc": {"refused", "identical"},
    "npz with a right checksum": {"refused", "identical", "different"},
    "AUTO": {"refused", "read"},
    FORGED: {"refused", "identical", "different"},
}


def damaged(generator, name, content):
    """A damaged copy of a file, and the name of the damage."""
    more = {
        "npz": [directory_changed, header_changed],
        "nc": [header_changed],
        "AUTO": [number_changed, constant_changed, lines_changed] * 4,
    }[name.split()[0]]
    function = generator.choice([*DAMAGES.values(), *more])
    if name.endswith("checksum"):
        return sealed(function(generator, content[:-SEAL_SIZE])), function.__name__
    return function(generator, content), function.__name__


def campaign(
    count: int = 1000, seed: int = 1, kept: dict[str, object] | None = None, forged: int = 0
) -> Report:
    """So many damaged files of each format; every kind of result takes its turn.

    With ``forged``, as many NetCDF files with a right checksum too; their failures are counted,
    but are the HDF5 library's and no faults.
    """
    report = Report(seed)
    kept = results() if kept is None else kept
    report.kinds = len(kept)
    generator = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        worker = Worker(folder)
        try:
            for ending in ("npz", "nc"):
                for kind, result in kept.items():
                    result.save(folder / f"{kind}.{ending}")  # type: ignore[attr-defined]
            for group in ALLOWED:
                size = forged if group == FORGED else count
                _group(report, generator, worker, group, size, list(kept))
        finally:
            worker.close()
    return report


def _group(report, generator, worker, group, count, kinds):
    """Damage so many files of one group and gather the outcomes."""
    folder = worker.folder
    counts = report.outcomes.setdefault(group, Counter()) if count else Counter()
    for k in range(count):
        path = folder / "damaged"
        if group == "AUTO":
            kind = generator.choice(("fhn", "pitch"))
            texts = {letter: (AUTO / f"{letter}.{kind}").read_bytes() for letter in "bs"}
            texts["d"] = (AUTO / "d.fhn").read_bytes()
            letter = generator.choice("bbsd")
            texts[letter], how = damaged(generator, group, texts[letter])
            path.write_bytes(texts["b"])
            for letter in "sd":
                path.with_name(f"damaged.{letter}").write_bytes(texts[letter])
            outcome, seconds, growth = worker.outcome("auto", path, path)
        else:
            kind = kinds[k % len(kinds)]
            original = folder / f"{kind}.{group.split()[0]}"
            content, how = damaged(generator, group, original.read_bytes())
            path.write_bytes(content)
            outcome, seconds, growth = worker.outcome("result", path, original)
        counts[outcome] += 1
        report.slowest = max(report.slowest, seconds)
        report.largest = max(report.largest, growth)
        if outcome not in ALLOWED[group] and group != FORGED:
            report.faults.append(f"{group} {k}, {kind}, {how}: {outcome}")
