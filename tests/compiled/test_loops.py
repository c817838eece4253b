"""The loops that serve every model own nothing: no array is counted, and nothing is allocated."""

from types import SimpleNamespace

import numba
import numpy as np
import pytest
import sympy as sp
from numba.core.errors import NumbaError

import fastslow as fs
from fastslow.compiled import generated
from fastslow.compiled.late import address_of
from fastslow.compiled.records import construction, flattened, type_of, types_within, zeros
from fastslow.compiled.store import writable_directory
from fastslow.continuation.loops import _ARGUMENTS, loop
from fastslow.diagrams.fields import FrozenField
from fastslow.passage.local_passages import Event, Place, follow
from fastslow.passage.sites import Site
from fastslow.passage.stays import _nearness
from fastslow.simulation.ensembles import _many_loop
from fastslow.simulation.events import Search, search_for
from fastslow.simulation.trajectories import drive_loop

LOOPS = {
    "drive": drive_loop,
    "drive_many": _many_loop,
    "collocate": lambda: address_of(
        "fastslow.simulation.collocation", "collocate", "CollocationStep"
    ),
    "radau_step": lambda: address_of("fastslow.simulation.radau", "radau_step", "RadauStep"),
}

ALLOCATING = """
import numpy as np


def allocating(n):
    return np.ones(n).sum()
"""


def code_of(function):
    """Machine code of a function, and the symbols of others that it calls, from the disk."""
    names = [name for name in generated._compiled if name.startswith(f"fastslow_{function}_")]
    files = [f for name in names for f in writable_directory().glob(f"{name}_*.code")]
    assert files, function
    return b"".join(file.read_bytes() for file in files)


@pytest.mark.parametrize("function", LOOPS)
def test_no_array_is_counted_and_nothing_is_allocated(function):
    LOOPS[function]()
    # Numba's functions that count and allocate are NRT_incref, NRT_Allocate, ...
    assert b"NRT_" not in code_of(function)


def test_no_loop_of_continuation_counts_arrays_or_allocates():
    x, y, p = sp.symbols("x y p")
    # Newton's method, where polynomials do not do
    model = fs.Model({x: p + sp.exp(x) - 2 * x**2, y: x - y + sp.sin(y) / 2}, parameters={p: 0})
    assert len(fs.continue_equilibria(model, "p", over=(-2, 2)).branches)
    # boxes of polynomials
    model = fs.Model({x: p + x**2 * y - x, y: x**2 + y**2 - 2}, parameters={p: 0.1})
    assert len(fs.equilibria(model))
    field = FrozenField(model, "p")
    field.at(0, np.zeros((2, 3)))
    field.spectrum(np.eye(2)[None])
    loop("passing")(np.eye(2), np.ones(2), np.ones(2), 1.0, np.zeros(1, dtype=int), np.zeros(1))
    for function in _ARGUMENTS:
        assert b"NRT_" not in code_of(function), function


def test_no_loop_of_passages_counts_arrays_or_allocates():
    x, p = sp.symbols("x p")
    here = FrozenField(fs.Model({x: p + x**2}, parameters={p: 0}), "p")
    point = SimpleNamespace(source=SimpleNamespace(unit=np.ones(1)))
    place = Place(0, np.array([-1.0, -0.1]), 0.0)
    _, reason = follow(
        Site(point, here, np.zeros(2)), fs.Drift(0.1), place, Event((0, 1.0)), span=1e3
    )
    assert not reason
    assert b"NRT_" not in code_of("pass_through")
    near = np.empty(1)
    _nearness()(np.zeros((1, 2)), np.array([[0.0, 0.0], [1.0, 1.0]]), 0.5, near)
    assert near[0] == 0.5
    assert b"NRT_" not in code_of("nearness_to_chain")


def test_what_allocates_is_refused():
    loop = generated.compile_loop(ALLOCATING, "allocating")
    with pytest.raises((NumbaError, RuntimeError), match=r"empty|NRT"):
        loop(3)


def test_what_allocates_would_be_seen():
    counted = numba.njit(lambda n: np.ones(n).sum())
    assert counted(3) == 3.0
    (assembly,) = counted.inspect_asm().values()
    assert "NRT_" in assembly


def test_a_loop_of_known_types_takes_no_others():
    source = "def double(a):\n    a[0] *= 2.0\n    return 0\n"
    from numba import float64

    loop = generated.compile_loop(source, "double", (float64[::1],))
    given = np.ones(3)
    loop(given)
    assert given[0] == 2.0
    for wrong in (np.ones(3, dtype=np.float32), np.ones((3, 3))[:, 0], np.ones((1, 1)), 1.0):
        with pytest.raises(TypeError, match="No matching definition"):
            loop(wrong)


def test_a_record_is_made_again_from_its_fields():
    fields = []
    search = search_for(2, 1, 3, 16)
    flattened(search, fields)
    assert len(fields) == len(Search._fields) == len(types_within(Search))
    assert construction(Search, iter("abcdefghijklm")) == f"Search({', '.join('abcdefghijklm')})"


def test_the_types_of_records_are_those_of_what_they_hold():
    from numba import typeof

    assert typeof(search_for(2, 1, 3, 16)) == type_of(Search)


def test_zeros_refuse_a_missing_field():
    with pytest.raises(ValueError, match="shorter"):
        zeros(Search, 3, 3)
