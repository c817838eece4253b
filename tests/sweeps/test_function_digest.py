"""The identity of a function changes with all that it reaches, and with nothing else."""

import re
import subprocess
import sys
import threading
import types
from functools import partial
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.special import gamma

import fastslow as fs
from fastslow.sweeps.function_digest import identity_of

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]

#: A module of the user, a package beside it, and the function f of a sweep. In each text of
#: `CHANGES`, one thing changes that f reaches.
HELPER = """
import enum, functools, operator, re
from collections import namedtuple
from dataclasses import dataclass, field
import numpy as np
from . import deeper

UNUSED = 1
CONSTANT = 102
TABLE = {"a": [1, 132], "b": {133, 134}}
ARRAY = np.array([1.0, 2.0])
MASKED = np.ma.masked_array([1.0, 2.0], [0, 1])
OBJECTS = np.array([1, "x"], dtype=object)
PATTERN = re.compile("a+b")
POINT = namedtuple("Point", "x y")(1, 135)

def g(a):
    return a * CONSTANT

def default(a, k=103, *, m=104):
    return a + k + m

def attribute(a):
    return a + attribute.k
attribute.k = 105

def caught(a):
    try:
        return a
    except ValueError:
        return 106

def cells(k):
    return lambda a: a + k
closure = cells(107)

def wrapper(f):
    @functools.wraps(f)
    def inner(a):
        return f(a)
    return inner

@wrapper
def wrapped(a):
    return a + 108

@functools.lru_cache
def remembered(a):
    return a + 109

def local(a):
    from . import late
    return late.value(a) + getattr(late, "other")

class Meta(type):
    rank = 110

class Slotted:
    __slots__ = ("slot",)

class Base(Slotted):
    inherited_value = 111
    def inherited(self, a):
        return a + 112

class Scale(Base, metaclass=Meta):
    value = 113
    def __init__(self):
        self.slot, self.own = 114, 115
    @property
    def gain(self):
        return 116
    @functools.cached_property
    def cached(self):
        return 117
    @staticmethod
    def static(a):
        return a + 118
    @classmethod
    def of_class(cls, a):
        return a + 119
    def __call__(self, a):
        return a + 120

class Colour(enum.Enum):
    RED = 121

@dataclass
class Settings:
    first: int = 122
    second: list = field(default_factory=lambda: [123])

class Several(list):
    pass

SCALE, SETTINGS, SEVERAL = Scale(), Settings(), Several([124])
PARTIAL = functools.partial(default, m=125)
METHOD = [126].index
CALLS = operator.methodcaller("of_class", 127)
FUNCTIONS = (g, default, attribute, caught, closure, wrapped, remembered, local, PARTIAL)
"""

USED = """
from helpers import helper

class Local(helper.Scale):
    pass

def f(a):
    m = helper
    Local.value, m.MASKED, m.OBJECTS, m.PATTERN, m.Colour, m.METHOD, m.CALLS, m.SETTINGS, m.SEVERAL
    m.SCALE(a), m.TABLE, m.ARRAY, m.POINT, m.deeper.number, {m.Settings}
    return [function(a) for function in m.FUNCTIONS] + [128 for _ in range(102)]
"""

FILES = {
    "helpers/__init__.py": "", "helpers/helper.py": HELPER, "used.py": USED,
    "helpers/deeper.py": "number = 129\nunused = 1\n",
    "helpers/late.py": "def value(a): return 130 * a\nother = 131\nunused = 1\n",
}  # fmt: skip

#: Files with a text in it and what replaces it: every number from 100 on, and some others.
CHANGES = [
    *((file, k, f"{k}5") for file, text in FILES.items() for k in re.findall(r"\b1\d\d\b", text)),
    ("helpers/helper.py", "array([1.0", "array([1.5"),
    ("helpers/helper.py", "[0, 1])", "[0, 0])"),
    ("helpers/helper.py", '[1, "x"]', '[1, "y"]'),
    ("helpers/helper.py", '"a+b"', '"a+c"'),
    ("helpers/helper.py", "except ValueError", "except KeyError"),
]

#: Changes that f does not reach.
UNREACHED = [
    ("helpers/helper.py", "UNUSED = 1", "UNUSED = 2"),
    ("helpers/deeper.py", "unused = 1", "unused = 2"),
    ("helpers/late.py", "unused = 1", "unused = 2"),
]

PRINT = """
import itertools, sys
from pathlib import Path
folder, changes = Path(sys.argv[1]), eval(sys.stdin.read())
sys.path.insert(0, str(folder))
sys.dont_write_bytecode = True
from fastslow.sweeps.function_digest import identity_of
for file, old, new in changes:
    text = (folder / file).read_text()
    (folder / file).write_text(text.replace(old, new, 1))
    for name in [n for n in sys.modules if n.split(".")[0] in ("helpers", "used")]:
        del sys.modules[name]
    import used
    found = identity_of(used.f)
    print(found.digest, found.undigested, sep="\\t")
    (folder / file).write_text(text)
"""


def digests(folder, changes):
    """The digest of f after each of the changes, in a process of its own."""
    for name, text in FILES.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    command = [sys.executable, "-c", PRINT, str(folder)]
    run = subprocess.run(
        command, input=repr(changes), capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert not run.returncode, run.stderr
    return [line.split("\t") for line in run.stdout.splitlines()]


def test_a_digest_changes_with_all_that_a_function_reaches_and_with_nothing_else(tmp_path):
    nothing = ("used.py", "import", "import")
    changes = [nothing, *CHANGES, *UNREACHED, nothing]
    found = digests(tmp_path, changes)
    same = [c for c, (digest, _) in zip(changes, found, strict=True) if digest == found[0][0]]
    assert same == [nothing, *UNREACHED, nothing]
    assert {undigested for _, undigested in found} == {"()"}


def test_modules_that_members_of_a_set_use_are_part_of_a_digest():
    helper = types.ModuleType("helper_of_a_set")
    helper.g = lambda a: a

    def inside(a):
        return helper.g(a)

    members = frozenset([inside])

    def outside(a):
        return [f(a) for f in members]

    before = identity_of(outside)
    assert identity_of(outside).digest == before.digest
    helper.g = lambda a: 100 * a
    assert identity_of(outside).digest != before.digest


def text_of_argument(a):
    return getattr(a, str(a))


def evaluated(a):
    return eval("a + 1")


def imported(a):
    return import_module(a)


def test_what_cannot_be_known_is_named():
    hidden = np.frompyfunc(lambda a: a, 1, 1)
    lock, steps = threading.Lock(), (k for k in range(3))
    for function, names in (
        (lambda a: (a, lock), ["lock (lock)"]),
        (lambda a: (a, steps), ["steps (generator)"]),
        (lambda a: hidden(a), ["hidden (ufunc)"]),
        (evaluated, [f"eval in evaluated, line 2 of {__name__}"]),
        (text_of_argument, [f"getattr in text_of_argument, line 2 of {__name__}"]),
        (imported, [f"import_module in imported, line 2 of {__name__}"]),
    ):
        found = [re.sub(r"line \d+", "line 2", text) for text in identity_of(function).undigested]
        assert found == names


def test_known_objects_of_libraries_are_compared_by_version_and_state():
    noise = np.random.default_rng(1)
    knots = [CubicSpline([0, 1, 2, 3], [0, 1, 0, last]) for last in (1, 2, 2)]
    first, second, third = (identity_of(partial(CubicSpline.__call__, k)) for k in knots)
    assert first.digest != second.digest == third.digest
    assert second.undigested == ()
    assert second.libraries["scipy"] == scipy.__version__
    used = identity_of(lambda a: (np.sin(a), gamma(a), solve_ivp, np.linalg.norm(a), noise))
    assert used.undigested == ()
    assert used.libraries.keys() == {"numpy", "scipy"}


def node(value):
    """Two objects that refer to each other within sets."""
    first, second = SimpleNamespace(value=value), Node()
    first.others, second.others = (second,), {second}
    second.value = value
    return first


class Node:
    pass


def test_objects_that_contain_themselves():
    digests = [identity_of(partial(print, node(value))).digest for value in (1, 2, 2)]
    assert digests[0] != digests[1] == digests[2]
    deep = []
    for _ in range(10**4):
        deep = [deep]
    assert identity_of(partial(print, deep)).undigested == ("values that are nested too deeply",)


def test_a_store_whose_function_cannot_be_compared_is_resumed_only_on_request(tmp_path):
    pytest.importorskip("zarr", reason="zarr, of the extra 'cluster', is not installed")
    lock = threading.Lock()

    def swept(**given):
        execution = fs.Execution(store=tmp_path / "map.zarr", **given)
        return fs.sweep(lambda a: 2 * a if lock else a, {"a": [1, 2]}, execution=execution)

    first = swept()
    with pytest.raises(fs.ArgumentError, match=r"lock \(lock\); expected resume='anyway' to keep"):
        swept()
    assert swept(resume="anyway") == first
    with pytest.raises(fs.ArgumentError, match="resume = 'always'; expected True, False or 'any"):
        fs.Execution(resume="always")


def test_an_adaptive_map_is_not_resumed_with_a_changed_module(tmp_path, monkeypatch):
    pytest.importorskip("zarr", reason="zarr, of the extra 'cluster', is not installed")
    helper = types.ModuleType("helper")
    helper.inside = lambda x, y: x > y
    monkeypatch.setitem(globals(), "helper", helper)

    def mapped():
        return fs.refined_map(
            lambda x, y: helper.inside(x, y),
            {"x": (0, 1), "y": (0, 1)},
            refinement=fs.Refinement(cells=(2, 2), levels=1),
            execution=fs.Execution(store=tmp_path / "map.zarr"),
        )

    assert mapped() == mapped()
    helper.inside = lambda x, y: x < y
    with pytest.raises(fs.ArgumentError, match="or values that it reaches have changed"):
        mapped()
