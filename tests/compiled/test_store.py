"""Compiled code on disk: shared, cut short, read-only, and warmed."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from fastslow.compiled.store import _whole

PROGRAM = """
import sympy as sp, fastslow as fs
from fastslow.compiled import store
x = sp.Symbol("x")
run = fs.simulate(fs.Model({x: -x}), [1.0], t=(0, 1))
print(repr(float(run.end[1])), store._writable_directory())
"""

EXPECTED = 0.36787944117144233


def start(cache, program=PROGRAM):
    environment = {**os.environ, "FASTSLOW_CACHE": str(cache)}
    return subprocess.Popen(
        [sys.executable, "-c", program],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process):
    out, error = process.communicate(timeout=300)
    assert process.returncode == 0, error
    value, directory = out.split()
    return float(value), Path(directory)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A directory that two processes have filled at the same time."""
    directory = tmp_path_factory.mktemp("cache")
    for process in [start(directory), start(directory)]:
        assert finish(process)[0] == pytest.approx(EXPECTED, rel=1e-9)
    return directory


def stored(cache):
    return sorted(p for p in cache.rglob("*") if p.suffix in (".nbi", ".nbc"))


def test_two_processes_at_once_leave_whole_files_only(cache):
    assert len(stored(cache)) >= 4
    assert not list(cache.rglob("*.tmp*"))
    before = {p: p.stat().st_mtime_ns for p in stored(cache)}
    assert finish(start(cache))[0] == pytest.approx(EXPECTED, rel=1e-9)
    # the third compiled nothing
    assert {p: p.stat().st_mtime_ns for p in stored(cache)} == before


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_files_cut_short_are_built_again(cache, suffix):
    broken = [p for p in stored(cache) if p.suffix == suffix and "series" in p.name]
    assert broken
    for k, path in enumerate(broken):
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 2] if k % 2 == 0 else b"")
        assert finish(start(cache))[0] == pytest.approx(EXPECTED, rel=1e-9)
        assert path.stat().st_size > 0


@pytest.mark.parametrize("junk", [b"garbage", b"", b"\x80\x04K\x01"])
def test_foreign_or_unfinished_bytes_are_not_whole(tmp_path, junk):
    path = tmp_path / "code.nbi"
    path.write_bytes(junk)
    assert not _whole(path)


def test_two_pickles_in_a_row_are_whole(tmp_path):
    path = tmp_path / "code.nbi"
    path.write_bytes(pickle.dumps("version") + pickle.dumps({"a": b"." * 1000}))
    assert _whole(path)
    path.write_bytes(path.read_bytes()[:-1])
    assert not _whole(path)


@pytest.mark.skipif(sys.platform == "win32", reason="permissions of directories differ")
def test_a_read_only_directory_is_used_without_compiling_again(cache, tmp_path):
    if os.geteuid() == 0:
        # root may write everywhere: a file in the place of the probe stands for the refusal
        program = PROGRAM.replace(
            "x = sp.Symbol",
            "import tempfile\n"
            "real = tempfile.TemporaryFile\n"
            "def refuse(*a, dir=None, **k):\n"
            "    if str(dir) == str(store.cache_directory()):\n"
            "        raise PermissionError('read-only')\n"
            "    return real(*a, dir=dir, **k)\n"
            "tempfile.TemporaryFile = refuse\n"
            "x = sp.Symbol",
        )
    else:
        program = PROGRAM
        cache.chmod(0o555)
    try:
        value, directory = finish(start(cache, program))
    finally:
        cache.chmod(0o755)
    assert value == pytest.approx(EXPECTED, rel=1e-9)
    assert directory != cache
    names = {p.name: p.stat().st_mtime_ns for p in stored(directory)}
    kept = {p.name: p.stat().st_mtime_ns for p in stored(cache)}
    assert names
    assert all(kept[name] == time for name, time in names.items())


def test_code_with_special_functions_is_found_by_another_process(cache):
    program = """
import sympy as sp, fastslow as fs
from fastslow.compiled import store
x, t = sp.symbols("x t")
run = fs.simulate(fs.Model({x: sp.besselj(0, t) - sp.airyai(x) * x}), [1.0], t=(0, 1))
print(repr(float(run.end[1])), store._writable_directory())
"""
    first = finish(start(cache, program))[0]
    before = {p: p.stat().st_mtime_ns for p in stored(cache)}
    assert finish(start(cache, program))[0] == first
    assert {p: p.stat().st_mtime_ns for p in stored(cache)} == before
