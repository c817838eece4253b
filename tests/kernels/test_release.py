"""Machine code is released with the last reference to its address, and not before."""

import copy
import ctypes
import gc
from pathlib import Path

import numpy as np
import pytest

import fastslow as fs
from fastslow.kernels.compiler import machine_code, model_code
from fastslow.kernels.compiler.machine_code import Address, load_object, object_code
from fastslow.kernels.compiler.native import translate
from fastslow.model import operations
from tests.campaigns.models_in_turn import model_of, numbers, resident, used

SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 3)


def code_of(value):
    """Machine code of a function that returns a number."""
    source = f"def field(region, u, p, out):\n    out[0] = u[0] + {value}.0\n"
    return object_code(lambda module: translate(source, module))


def value_of(address):
    """What a function returns at 0."""
    given, out = np.zeros(1), np.full(1, np.nan)
    SIGNATURE(address)(0, given.ctypes.data, given.ctypes.data, out.ctypes.data)
    return out[0]


@pytest.fixture
def released(monkeypatch):
    """Numbers of the functions whose code was released."""
    found = []

    class Library(machine_code._Library):
        def __del__(self):
            found.append(self.number)
            super().__del__()

    monkeypatch.setattr(machine_code, "_Library", Library)
    return found


def test_code_is_released_with_its_last_reference(released):
    codes = [code_of(k) for k in range(3)]
    kept, loaded = {}, 0
    for k in range(3 * machine_code.LIBRARIES):
        address = load_object(codes[k % 3], "field", {})
        address.library.number = k
        assert value_of(address) == k % 3
        if k % 50 == 0:
            kept[k] = copy.deepcopy([address])[0]
        loaded += 1
    del address
    gc.collect()
    assert sorted(released) == [k for k in range(loaded) if k not in kept]
    # their linkers are used no more
    assert [value_of(address) for address in kept.values()] == [k % 3 for k in kept]
    kept.clear()
    gc.collect()
    assert len(released) == loaded


def test_functions_without_use_are_bounded(monkeypatch):
    monkeypatch.setattr(model_code, "UNUSED_FUNCTIONS", 5)
    source = "def field(region, u, p, out):\n    out[0] = {}.0 + u[0]\n"
    model_code.load_function(source.format(0), "field")
    first = model_code.load_function(source.format(100), "field")
    for k in range(1, 20):
        model_code.load_function(source.format(k), "field")
        assert len(model_code._addresses) <= 5
    assert isinstance(first, Address)
    assert value_of(first) == 100.0
    again = model_code.load_function(source.format(100), "field")
    assert value_of(again) == value_of(first)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads /proc")
def test_compilation_keeps_no_memory():
    """A manager of passes for each function, which llvmlite does not release, keeps 3 MB."""
    for k in range(30):
        code_of(k)
    gc.collect()
    before = resident()
    for k in range(200):
        code_of(k)
    gc.collect()
    assert resident() - before < 1.5 * 2**20


def test_operations_are_released_with_their_last_reference():
    operations.operations_of.cache_clear()
    gc.collect()
    before = len(operations._derived)
    kept = [model_of(k).operations for k in range(2001, 2021)][:3]
    assert all(model_of(k).operations is one for k, one in enumerate(kept, 2001))
    operations.operations_of.cache_clear()
    gc.collect()
    assert len(operations._derived) <= before + len(kept)


def test_results_keep_the_code_that_they_need(monkeypatch):
    """After their models have left all caches."""
    monkeypatch.setattr(model_code, "UNUSED_FUNCTIONS", 2)
    results = [used(k) for k in (1001, 1010)]
    expected = [numbers(one) for one in results]
    for function in cleared():
        function.cache_clear()
    for k in range(2, 8):
        used(k)
    gc.collect()
    for one, before in zip(results, expected, strict=True):
        np.testing.assert_array_equal(numbers(one), before)


def cleared():
    """The caches of compiled code."""
    from fastslow.kernels import fields
    from fastslow.kernels.simd import steps
    from fastslow.kernels.taylor import series

    return fields.field_address, series._compiled, steps._compiled


def test_orbits_keep_the_code_that_they_need():
    model = fs.Model({"x": "v", "v": "mu*(1 - x**2)*v - x"}, parameters={"mu": 1})
    orbit = fs.find_orbit(model, fs.simulate(model, [2, 0], t=(0, 50)))
    before = orbit(0.0)
    model_code._addresses.clear()
    for function in cleared():
        function.cache_clear()
    gc.collect()
    for k in range(3):
        used(k)
    np.testing.assert_array_equal(orbit(0.0), before)
    assert fs.continue_orbits(orbit, "mu", over=(0.9, 1.1))
