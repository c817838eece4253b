"""The loops that serve every model: what they call, how they are called, and where they are."""

import re
import struct
from typing import NamedTuple

import numpy as np
import pytest

import fastslow as fs
from fastslow import wheel
from fastslow.continuation.loops import LOOPS
from fastslow.kernels import loops
from fastslow.kernels.compiler import loop_target, shipped, store
from fastslow.kernels.compiler.calling import entry_source
from fastslow.kernels.compiler.decorators import kernel
from fastslow.kernels.compiler.records import Matrix, Vector, construction, leaves, type_of, zeros
from fastslow.kernels.compiler.slots import fields_of_arrays
from fastslow.kernels.loops import Loop, load_loop
from fastslow.simulation.loops import STEP_VALUES
from fastslow.simulation.stepper.event_location import EventSearch, search_for

pytestmark = pytest.mark.slow

#: What the loops may call: functions of C99, which every system has.
C_LIBRARY = {
    *("cos", "exp", "exp2", "fmod", "hypot", "log", "log10", "log2", "pow", "sin"),
    *("memcpy", "memmove", "memset"),
}

NEARBY_CHORDS = LOOPS["nearby_chords"]


def undefined(code):
    """Names that an object of ELF refers to and does not define."""
    assert code[:6] == b"\x7fELF\x02\x01"
    (begin,) = struct.unpack_from("<Q", code, 40)
    size, count = struct.unpack_from("<HH", code, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", code, begin + k * size) for k in range(count)]
    (symbols,) = (s for s in sections if s[1] == 2)
    texts = sections[symbols[6]][4]
    for place in range(symbols[4] + 24, symbols[4] + symbols[5], 24):
        name, _, _, section = struct.unpack_from("<IBBH", code, place)
        if section == 0:
            end = code.index(b"\0", texts + name)
            yield code[texts + name : end].decode()


@pytest.mark.parametrize("entry", list(wheel.entries()), ids=lambda entry: entry.function)
def test_loops_call_nothing_but_the_c_library(entry):
    """So none allocates, counts arrays or runs Python: Numba has functions for that."""
    code = loops.code_of(entry)
    if code[:4] == b"\x7fELF":
        assert set(undefined(code)) <= C_LIBRARY
    assert b"NRT_" not in code


@kernel
def allocating(n):
    return np.ones(n).sum()


def test_a_loop_that_allocates_is_not_compiled(capsys):
    from numba.core.errors import NumbaError

    with pytest.raises((NumbaError, RuntimeError), match=r"empty|NRT"):
        loops.compiled(Loop(__name__, "allocating", {"n": int}, (float,)), "for a test")
    assert capsys.readouterr().err.endswith("(for a test): not finished\n")


# how they are called


class Inner(NamedTuple):
    a: Matrix
    b: int


class Outer(NamedTuple):
    inner: Inner
    c: Vector
    d: float
    e: bool


def test_a_record_is_made_again_from_its_fields():
    search = search_for(2, 1, 3, 16)
    assert len(list(leaves("search", EventSearch))) == len(search)
    assert construction(Outer, iter("abcde")) == "Outer(Inner(a, b), c, d, e)"
    source = entry_source("somewhere", "called", {"outer": Outer, "n": int})
    assert 'slot(slots, 1, "float64", 2)'.replace('"', "'") in source
    assert source.rstrip().endswith("slot(slots, 6, 'int64', 0))")


def test_the_types_of_records_are_those_of_what_they_hold():
    from numba import typeof

    assert typeof(search_for(2, 1, 3, 16)) == type_of(EventSearch)


def test_zeros_refuse_a_missing_field():
    with pytest.raises(TypeError, match="missing 12 required"):
        zeros(EventSearch, 3, 3)


def test_zeros_by_name_are_those_in_order():
    shapes = {"on": 3, "hit": 2, "stack": (4, 5)}
    with pytest.raises(TypeError, match="missing 11 required"):
        zeros(EventSearch, **shapes)
    others = {name: 1 for name in EventSearch._fields if name not in shapes}
    made = zeros(EventSearch, **others, **shapes)
    assert made.hit.shape == (2,)
    assert made.hit.dtype == bool
    assert made.stack.shape == (4, 5)
    with pytest.raises(KeyError, match="heights"):
        zeros(EventSearch, heights=3)


def test_where_the_fields_of_arrays_begin():
    assert fields_of_arrays() == object.__basicsize__


LINE = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
ARGUMENTS = [LINE, np.ones(2), np.array([0.5, 0.1]), 0.2, np.zeros(2, dtype=int), np.zeros(2)]


def test_a_loop_takes_numbers_and_arrays():
    assert load_loop(NEARBY_CHORDS)(*ARGUMENTS) == 1
    assert ARGUMENTS[4].tolist() == [0, 0]


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


@pytest.mark.parametrize(
    ("place", "wrong", "received"),
    [
        (0, LINE[0], "with 2 axes for points; received float64 with 1 axes"),
        (1, np.ones(2, dtype=np.float32), "of float64 with 1 axes for scale; received float32"),
        (4, np.zeros(2), "of int64 with 1 axes for found; received float64"),
        (5, [0.0, 0.0], "apart; received list"),
    ],
)
def test_a_loop_takes_no_other_arrays(place, wrong, received):
    arguments = [*ARGUMENTS]
    arguments[place] = wrong
    with pytest.raises(TypeError, match=f"expected an array .*{received}"):
        load_loop(NEARBY_CHORDS)(*arguments)


def test_read_only_and_strided_arrays_are_copied():
    found, apart = np.full((2, 2), 7), np.zeros((2, 3))
    arguments = [np.asfortranarray(LINE), read_only(np.ones(2)), *ARGUMENTS[2:4]]
    assert load_loop(NEARBY_CHORDS)(*arguments, found[:, 1], apart[:, 0]) == 1
    assert found.tolist() == [[7, 0], [7, 7]]
    assert apart[:, 0].tolist() == [pytest.approx(0.1), pytest.approx(np.hypot(0.5, 0.1))]
    assert not apart[:, 1:].any()


def test_what_a_loop_only_reads_is_not_copied(monkeypatch):
    """A run's coefficients are read-only, and megabytes."""
    series, times = read_only(np.ones((2, 1, 3))), np.array([0.5, 1.5])
    starts, values = read_only(np.array([0.0, 1.0])), np.empty((1, 2))
    values_in_steps = load_loop(STEP_VALUES)
    monkeypatch.setitem(values_in_steps.__globals__, "_taken", None)
    assert values_in_steps(series, starts, 0.0, 2.0, times, values) == 0
    assert values.tolist() == [[1.75, 1.75]]


# where they come from


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """An installation with the machine code of one loop, made where no other is at hand."""
    monkeypatch.setattr(shipped, "FOLDER", tmp_path)
    monkeypatch.setattr(store, "_warned", set())
    (tmp_path / shipped.PLATFORM).write_text(loop_target.platform_name())
    file = tmp_path / f"{NEARBY_CHORDS.name}.code"
    file.write_bytes(store.wrapped(NEARBY_CHORDS.name, loops._kept(NEARBY_CHORDS)))
    file.chmod(0o644)
    return file


def test_an_installed_loop_is_read_and_not_looked_for_elsewhere(installed, monkeypatch):
    monkeypatch.setattr(store, "read", None)
    address = loops.load_address(Loop(*NEARBY_CHORDS.__dict__.values()))
    call = loops.caller(
        NEARBY_CHORDS.function, NEARBY_CHORDS.arguments, NEARBY_CHORDS.results, address
    )
    assert call(*ARGUMENTS) == 1


def test_a_damaged_object_is_not_loaded(installed):
    content = bytearray(installed.read_bytes())
    content[-100] ^= 1
    installed.write_bytes(content)
    with pytest.warns(RuntimeWarning, match=r"nearby_chords_.*is not loaded: it is damaged"):
        assert shipped.read(NEARBY_CHORDS.name) is None


def test_an_object_that_others_can_write_to_is_not_loaded(installed):
    installed.chmod(0o666)
    with pytest.warns(RuntimeWarning, match="others than the sources beside it can write to it"):
        assert shipped.read(NEARBY_CHORDS.name) is None


def test_a_link_is_not_followed(installed, tmp_path):
    other = tmp_path / "elsewhere"
    installed.rename(other)
    installed.symlink_to(other)
    assert shipped.read(NEARBY_CHORDS.name) is None


def test_sources_that_have_changed_and_other_platforms_find_nothing(installed, monkeypatch):
    assert shipped.read(NEARBY_CHORDS.name) is not None
    assert "sources" in shipped.missing()
    monkeypatch.setattr(loops, "digest_of_imports", lambda source: "another")
    assert shipped.read(NEARBY_CHORDS.name) is None
    monkeypatch.undo()
    monkeypatch.setattr(shipped, "FOLDER", installed.parent)
    monkeypatch.setattr(loops, "platform_name", lambda: "aarch64-unknown-linux-gnu-generic")
    assert shipped.read(NEARBY_CHORDS.name) is None
    (installed.parent / shipped.PLATFORM).write_text("aarch64-apple-darwin-generic\n")
    assert re.fullmatch(
        "this installation contains machine code for aarch64-apple-darwin-generic; this is .*",
        shipped.missing(),
    )
    (installed.parent / shipped.PLATFORM).unlink()
    assert shipped.missing() == "this installation contains no machine code"


def test_without_machine_code_and_numba_the_error_names_both(tmp_path, monkeypatch):
    monkeypatch.setattr(shipped, "FOLDER", tmp_path)
    monkeypatch.setattr(loops, "find_spec", lambda name: None)
    with pytest.raises(
        fs.MissingPackageError,
        match=r"contains no machine code, so that .*nearby_chords must be compiled by Numba, which",
    ):
        loops.code_of(NEARBY_CHORDS)


def test_what_is_compiled_here_has_the_bits_of_what_is_installed(tmp_path, monkeypatch, capsys):
    evaluate = LOOPS["evaluate"]
    monkeypatch.setattr(wheel, "entries", lambda: [evaluate])
    platform, file = wheel.write_objects(tmp_path)
    assert platform.read_text().strip() == loop_target.platform_name()
    monkeypatch.setattr(shipped, "FOLDER", tmp_path)
    file.chmod(0o644)
    assert shipped.read(evaluate.name) == loops.compiled(evaluate, "for a test")
    said = capsys.readouterr().err.splitlines()
    assert [re.sub(r"[\d.]+ s$", "… s", line) for line in said] == [
        "fastslow compiles fastslow.continuation.evaluation.evaluate (for a test): … s",
    ]
