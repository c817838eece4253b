"""The loops that serve every model own nothing: no array is counted, and nothing is allocated."""

import numpy as np
import pytest

from fastslow.compiled import generated
from fastslow.compiled.late import address_of
from fastslow.compiled.records import construction, flattened, type_of, types_within, zeros
from fastslow.compiled.store import writable_directory
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
    assert len(files) == 1
    return files[0].read_bytes()


@pytest.mark.parametrize("function", LOOPS)
def test_no_array_is_counted_and_nothing_is_allocated(function):
    LOOPS[function]()
    # Numba's functions that count and allocate are NRT_incref, NRT_Allocate, ...
    assert b"NRT_" not in code_of(function)


def test_a_loop_that_allocates_would_be_seen():
    loop = generated.compile_loop(ALLOCATING, "allocating")
    assert loop(3) == 3.0
    assert b"NRT_" in code_of("allocating")


def test_a_loop_of_known_types_cannot_allocate():
    from numba import types
    from numba.core.errors import NumbaError

    with pytest.raises((NumbaError, RuntimeError), match=r"empty|NRT"):
        generated.compile_loop(ALLOCATING + "# typed\n", "allocating", (types.int64,))


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
