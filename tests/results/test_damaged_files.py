"""A sample of the campaign of damaged files."""

import copy
import json
import random
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import fastslow as fs
from fastslow.results.io.npz_netcdf import read_archive, write_archive
from fastslow.results.trajectory.long_time.spectrum import Spectrum
from tests.campaigns import files

pytestmark = pytest.mark.slow

DATA = Path(__file__).parent / "data"


def test_damaged_files_are_refused_or_identical():
    diagram = fs.read_auto(DATA / "b.fhn")
    amplitude = np.linspace(0.0, 1.0, 50)
    kept = {
        "diagram": diagram,
        "points": diagram.special,
        "spectrum": Spectrum("x", "hann", (0.0, 1.0), amplitude, amplitude),
    }
    report = files.campaign(24, 1, kept)
    assert not report.failures, str(report)
    assert sum(counts.total() for counts in report.outcomes.values()) == 96
    assert report.outcomes["nc"]["refused"] >= 20
    assert report.outcomes["AUTO"]["read"] >= 5
    assert report.largest < 100 * 2**20


#: What replaces a value of a file, and what else happens to lists.
WRONG = (None, -1, 1.5, "x", True, [], {"tuple": []}, {"mapping": []}, {"tuple": ["a", 1]})
CHANGES = (list.clear, list.reverse, list.pop, lambda items: items.append(items[0]))


def places(tree, path=()):
    """The path of every value in a tree."""
    inside = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in inside:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def forged(tree, chance):
    """A copy with one value replaced, or one list changed."""
    tree = copy.deepcopy(tree)
    *above, last = chance.choice(list(places(tree["result"])))
    holder = tree["result"]
    for key in above:
        holder = holder[key]
    if isinstance(holder[last], list) and holder[last]:
        chance.choice(CHANGES)(holder[last])
    else:
        holder[last] = copy.deepcopy(chance.choice(WRONG))
    return tree


def test_forged_files_are_refused_or_can_be_shown(tmp_path):
    """With a right checksum: what loads has a repr, a table and a hash."""
    x, p = sp.symbols("x p")
    model = fs.Model({x: p + x - x**3}, parameters={p: 0})
    diagram = fs.continue_equilibria(model, "p", over=(-1, 1))
    chance, path, refused = random.Random(5), tmp_path / "forged.npz", 0
    run = fs.simulate(model, [0.1], t=(0, 1))
    kept = (diagram, diagram[0], diagram.special, diagram.folds[0], run)
    for result in kept:
        result.save(path)
        arrays = {}

        def read(text, given, arrays=arrays):
            tree = json.loads(text)
            for place in list(places(tree)):
                node = tree
                for key in place:
                    node = node[key]
                if isinstance(node, dict) and "array" in node:
                    arrays[node["array"]] = given(node["array"], node["dtype"])
            return tree

        tree = read_archive(path.read_bytes(), read)
        for _ in range(60):
            path.write_bytes(write_archive(json.dumps(forged(tree, chance)), arrays))
            try:
                found = fs.load(path)
            except fs.FileError:
                refused += 1
                continue
            hash(found)
            for name in {"__repr__", "_repr_html_", "to_dict"} & {*dir(found)}:
                with suppress(fs.FastSlowError):
                    getattr(found, name)()
    assert 100 < refused < 300
