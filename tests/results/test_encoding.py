"""Plain data as text and arrays, and back, bit for bit."""

import json
import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from fastslow.results.base.named_mapping import NamedMapping
from fastslow.results.base.outcome import Outcome
from fastslow.results.branch.equilibrium_sets import Equilibria
from fastslow.results.io.encoding import decoded, encoded
from fastslow.results.io.npz_netcdf import read_archive, read_netcdf, write_archive, write_netcdf
from fastslow.results.points import SpecialPoints

pytestmark = pytest.mark.slow

numbers = st.floats(allow_nan=True, allow_infinity=True) | st.just(-0.0)
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=5)
tables = st.one_of(
    *(
        arrays_of.arrays(
            kind, arrays_of.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=6)
        )
        for kind in (np.float64, np.complex128, np.int64, np.bool_, np.int8, np.float32)
    ),
    arrays_of.arrays("<U5", arrays_of.array_shapes(min_side=0, max_side=4), elements=texts),
)
plain = st.one_of(
    st.none(), st.booleans(), st.integers(), numbers, texts, st.complex_numbers(), tables
)
trees = st.recursive(
    plain,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.lists(inner, max_size=3).map(tuple),
        st.dictionaries(texts, inner, max_size=3),
        st.dictionaries(texts, inner, max_size=3).map(lambda d: NamedMapping("parameter", d)),
        st.lists(inner, max_size=2).map(lambda items: Equilibria(items, "complete")),
        st.lists(inner, max_size=2).map(SpecialPoints),
        st.builds(Outcome, texts, texts, st.booleans()),
    ),
    max_leaves=8,
)


@given(tree=trees)
@settings(suppress_health_check=[HealthCheck.too_slow])
def test_anything_of_plain_data_comes_back_bit_for_bit(same, tree):
    arrays = {}
    text = json.dumps(encoded(tree, "", arrays), allow_nan=False)
    again = decoded(json.loads(text), lambda name, kind: arrays[name])
    assert same(tree, again)


@given(tree=trees)
@settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])
@pytest.mark.parametrize(
    ("write", "load"), [(write_archive, read_archive), (write_netcdf, read_netcdf)]
)
def test_files_keep_every_bit(same, write, load, tree):
    holder = {"kept": tree}
    arrays = {}
    text = json.dumps(encoded(holder, "x", arrays), allow_nan=False)
    again = load(write(text, arrays), lambda text, array: decoded(json.loads(text), array))
    assert same(holder, again)


@pytest.mark.parametrize("bits", ["7ff8000000000001", "fff8000000000000", "7ff0000000000001"])
def test_every_nan_keeps_its_bits(bits):
    (value,) = struct.unpack(">d", bytes.fromhex(bits))
    text = json.dumps(encoded([value, complex(value, 0)], "", {}), allow_nan=False)
    again = decoded(json.loads(text), None)
    assert [struct.pack(">d", v).hex() for v in (again[0], again[1].real)] == [bits] * 2
