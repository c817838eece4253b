"""Different models in turn, each run, and the equilibria of some traced: what the process grows by.

The memory of a process that uses many models in turn is bounded: caches hold a limited number of
models, and machine code is released with the last object that refers to it. After the first `WARM`
models, which fill the caches, the growth must be at most `MOST` bytes. Results of a few early
models are kept, and give the same numbers at the end.
"""

import gc
import random
import resource
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import fastslow as fs

#: Number of models that fill the caches, and bytes by which the others may add to the process.
WARM, MOST = 300, 100 * 2**20


def model_of(k):
    """A model whose code differs from that of all others."""
    return fs.Model({"x": f"w - x**3/{k + 1} + {k % 7 - 3}*x"}, parameters={"w": 0.1})


def used(k):
    """Return a run and an ensemble of a model, and a diagram of every tenth."""
    model = model_of(k)
    run = fs.simulate(model, [0.1], t=(0, 1))
    many = fs.simulate_many(model, [[0.1], [0.3]], t=(0, 1))
    diagram = fs.continue_equilibria(model, "w", over=(-0.5, 0.5)) if k % 10 == 0 else None
    return model, run, many, diagram


def numbers(results):
    """Numbers of results, some of which need the machine code of the model again."""
    model, run, many, diagram = results
    states = [] if diagram is None else [e.state for e in diagram.at(w=0.123)]
    again = fs.simulate(model, run.end[1:], t=(1, 2))
    return np.concatenate([run.end, np.ravel(many.final), np.ravel(states), again.end])


def resident():
    """Bytes of the process in memory."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


@dataclass
class Report:
    """Growth in bytes at some counts of models."""

    growth: dict = field(default_factory=dict)
    failures: list = field(default_factory=list)

    def __str__(self):
        lines = [f"{count} models: {size / 2**20:.1f} MB" for count, size in self.growth.items()]
        return "\n".join([*lines, *self.failures, f"{len(self.failures)} failures"])


def campaign(count=10_000, seed=0):
    """Use so many models, after those that fill the caches."""
    report, kept = Report(), {}
    chance = random.Random(seed)
    for k in range(WARM + count):
        results = used(k)
        if len(kept) < 10 and (k == 0 or chance.random() < 0.05):
            kept[k] = results, numbers(results)
        if k == WARM:
            gc.collect()
            before = resident()
        if k >= WARM and (k - WARM + 1) % max(count // 10, 1) == 0:
            gc.collect()
            report.growth[k - WARM + 1] = resident() - before
    for k, (results, expected) in kept.items():
        if not np.array_equal(numbers(results), expected):
            report.failures.append(f"the results of model {k} changed")
    if max(report.growth.values()) > MOST:
        report.failures.append("the process has grown by more than 100 MB")
    return report
