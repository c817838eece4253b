"""Hostile values in every argument of every public function: refused in words, or served."""

from __future__ import annotations

import inspect
import os
import random
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy as sp

import fastslow as fs
from tests.errors.subjects import results, subjects


class Odd:
    """Something that no argument can be."""


#: What a figure may well be given: it is drawn then, which takes time.
DRAWN = (True, False, 0, 0.5, "5")


def hostile(drawn=False):
    """Values that are wrong almost everywhere."""
    r = results()
    numbers = [-1, 0, 0.5, np.nan, np.inf, -np.inf, 1j, True, False, 10**400, sp.oo]
    texts = ["", "omga", "5", "x +", "__import__('os')", b"x"]
    arrays = [np.zeros(3), np.zeros((2, 3, 4)), np.array([np.nan, 1.0]), np.array(["a"])]
    symbols = [sp.Symbol("omga"), sp.Symbol("x") > 0, sp.nan, sp.I, sp.Matrix([[1, 2]])]
    others = [None, [], (), {}, {"omga": 1.0}, {1, 2}, (1, -1), [[1], [2, 3]], [None, None]]
    found = [
        *(*numbers, *texts, *arrays, *symbols, *others),
        *(Odd(), slice(None), range(3), lambda *given: 1),
        *(r["equilibrium"], r["diagram"], r["fast"], r["section"], r["map"]),
    ]
    if drawn:
        return [v for v in found if not isinstance(v, bool | int | float | str) or v not in DRAWN]
    return found


def spoilt(value, wrong):
    """A value of an argument with one of the things inside it replaced."""
    if isinstance(value, dict):
        for key, inside in value.items():
            yield {**value, key: wrong}
            for other in spoilt(inside, wrong):
                yield {**value, key: other}
    elif isinstance(value, list | tuple):
        for k, inside in enumerate(value):
            changed = [*value]
            changed[k] = wrong
            yield type(value)(changed)
            for other in spoilt(inside, wrong):
                changed = [*value]
                changed[k] = other
                yield type(value)(changed)


def keys_spoilt(value, wrong):
    """A mapping with one of its names replaced."""
    for key in value:
        if getattr(wrong, "__hash__", None) is not None:
            yield {wrong if name is key else name: inside for name, inside in value.items()}


def calls(subject):
    """Every call with one thing wrong, as changes to the good one."""
    wrongs = hostile(subject.name.startswith("plot."))
    for name, parameter in subject.signature.parameters.items():
        for wrong in wrongs:
            if parameter.kind is inspect.Parameter.VAR_POSITIONAL:
                yield {name: [wrong]}
            elif parameter.kind is inspect.Parameter.VAR_KEYWORD:
                key = next(iter(subject.arguments.get(name, {})), "linewidth")
                yield {name: {key: wrong}}
            else:
                yield {name: wrong}
    for name, value in subject.more.items():
        for wrong in wrongs:
            for other in spoilt(value, wrong):
                yield {**subject.more, name: other}
            plain = subject.signature.parameters[name].kind is not inspect.Parameter.VAR_KEYWORD
            if isinstance(value, dict) and plain:
                for other in keys_spoilt(value, wrong):
                    yield {**subject.more, name: other}


def outcomes_of(subject, changes):
    """What came out as another error, and how many calls were refused."""
    escaped, refused = [], 0
    for change in changes:
        try:
            subject.call(**change)
        except fs.FastSlowError as error:
            refused += bool(str(error))
        except Exception as error:
            escaped.append(f"{subject.name} with {change}: {error!r}")
    return escaped, refused


def drawn(subject, count, seed):
    """At most so many of the calls of a function, drawn at random."""
    found = list(calls(subject))
    choice = random.Random(f"{seed} {subject.name}")
    return choice.sample(found, count) if len(found) > count else found


@dataclass(frozen=True)
class Report:
    """Calls made, those refused, and those that ended in another error."""

    made: int
    refused: int
    failures: tuple[str, ...]

    def __str__(self):
        head = f"{self.made} calls: {self.refused} refused, {len(self.failures)} escaped"
        return "\n".join((head, *self.failures))


def campaign(count=10_000, seed=1):
    """Call every public function up to so many times."""
    made, refused, failures = 0, 0, []
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for subject in subjects().values():
                found = drawn(subject, count, seed)
                escaped, said = outcomes_of(subject, found)
                made, refused = made + len(found), refused + said
                failures += escaped
        finally:
            os.chdir(before)
    return Report(made, refused, tuple(failures))
