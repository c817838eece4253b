"""Damaged files of compiled code: every process ends with the right numbers, and whole files.

Each attempt damages files of four compiled functions in one of the ways of `WAYS`, and a process of
its own loads all four. Needs forks, which Windows has not.
"""

from __future__ import annotations

import random
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from fastslow.kernels.compiler import store
from tests.kernels.forks import prepare, run, use

NUMBERS = [1, 2, 3, 4]


@dataclass
class Report:
    """What was seen, by way of damage."""

    attempts: Counter[str] = field(default_factory=Counter)
    files: int = 0
    rebuilt: int = 0
    failures: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def __str__(self) -> str:
        ways = "\n".join(f"  {way}: {count}" for way, count in sorted(self.attempts.items()))
        wrong = "\n".join(self.failures) or "  none"
        return (
            f"{sum(self.attempts.values())} attempts in {self.seconds:.0f} s, "
            f"{self.files} damaged files, {self.rebuilt} functions compiled again\n{ways}\n"
            f"wrong numbers, crashes, errors, and files left damaged:\n{wrong}"
        )


def one_bit(content: bytes, chance: random.Random) -> bytes:
    place = chance.randrange(len(content))
    flipped = content[place] ^ 1 << chance.randrange(8)
    return content[:place] + bytes([flipped]) + content[place + 1 :]


def some_bits(content: bytes, chance: random.Random) -> bytes:
    for _ in range(chance.randint(2, 100)):
        content = one_bit(content, chance)
    return content


def cut_short(content: bytes, chance: random.Random) -> bytes:
    return content[: chance.randrange(len(content))]


def zeros(content: bytes, chance: random.Random) -> bytes:
    """As a disk leaves what was not written before the power went."""
    begin = chance.randrange(len(content))
    end = min(len(content), begin + chance.choice([1, 16, 512, 4096]))
    return content[:begin] + bytes(end - begin) + content[end:]


def nothing_but_zeros(content: bytes, chance: random.Random) -> bytes:
    return bytes(len(content))


def longer(content: bytes, chance: random.Random) -> bytes:
    return content + chance.randbytes(chance.randint(1, 100))


def doubled(content: bytes, chance: random.Random) -> bytes:
    return content + content


def noise(content: bytes, chance: random.Random) -> bytes:
    return chance.randbytes(chance.choice([1, 100, len(content)]))


def empty(content: bytes, chance: random.Random) -> bytes:
    return b""


WAYS: list[Callable[[bytes, random.Random], bytes]] = [
    *[one_bit] * 3,
    some_bits,
    *[cut_short] * 2,
    zeros,
    nothing_but_zeros,
    longer,
    doubled,
    noise,
    empty,
]


def use_all() -> list[float]:
    return [use(number) for number in NUMBERS]


def campaign(count: int = 500, seed: int = 1) -> Report:
    """Damage files and load them."""
    prepare()
    chance = random.Random(seed)
    report, began = Report(), time.perf_counter()
    folder = Path(tempfile.mkdtemp(prefix="fastslow-"))
    try:
        run(use_all, FASTSLOW_CACHE=folder)
        whole = {path: path.read_bytes() for path in sorted(folder.glob("*.code"))}
        assert len(whole) == len(NUMBERS)
        for attempt in range(count):
            damaged, way = damage(whole, chance)
            for path, content in damaged.items():
                path.write_bytes(content)
            report.attempts[way] += 1
            report.files += len(damaged)
            result = run(use_all, FASTSLOW_CACHE=folder)
            report.rebuilt += result.get("compiled", 0)
            if (result.get("value"), result["signal"]) != (NUMBERS, 0) or result["said"]:
                report.failures.append(f"  attempt {attempt}, {way}: {result}")
            if result.get("compiled") != len(damaged):
                report.failures.append(f"  attempt {attempt}, {way}: {result} for {len(damaged)}")
            for path, content in whole.items():
                if store.unwrapped(path.stem, path.read_bytes()) is None:
                    report.failures.append(f"  attempt {attempt}, {way}: left damaged")
                path.write_bytes(content)
    finally:
        shutil.rmtree(folder)
    report.seconds = time.perf_counter() - began
    return report


def damage(whole: dict[Path, bytes], chance: random.Random) -> tuple[dict[Path, bytes], str]:
    """New content of some files, and how they were damaged."""
    if chance.random() < 0.15:
        a, b = chance.sample(sorted(whole), 2)
        return {a: whole[b], b: whole[a]}, "exchanged"
    way = chance.choice(WAYS)
    chosen = chance.sample(sorted(whole), chance.choice([1, 1, 2]))
    new = {path: way(whole[path], chance) for path in chosen}
    # a run of zeros may meet zeros
    return {path: content for path, content in new.items() if content != whole[path]}, way.__name__
