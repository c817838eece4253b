"""Files are written whole or not at all, whatever the disk, and only regular ones are opened."""

import ast
import errno
import os
import resource
import signal
import subprocess
import tempfile
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import fastslow as fs
from fastslow.disk import read_file, write_file, write_text
from fastslow.plot.layout.style import save
from fastslow.results.trajectory.long_time.spectrum import Spectrum

pytestmark = pytest.mark.slow

ROOT = Path(fs.__file__).parent

#: The calls of each file that open something else than a file on disk.
OTHER = {
    "results/io/npz_netcdf.py": {"archive.open"},  # a member of an archive in memory
    "plot/layout/style.py": {"figure.savefig"},  # into memory
}


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def spectrum(count=300):
    import numpy as np

    return Spectrum("x", "hann", (0.0, 1.0), np.arange(float(count)), np.arange(float(count)))


def test_one_module_writes_files():
    opening = {"open", "write_text", "write_bytes", "savefig", "mkstemp", "fdopen", "tofile"}
    for path in ROOT.rglob("*.py"):
        name = path.relative_to(ROOT).as_posix()
        if name == "disk.py" or name.startswith("kernels/"):
            continue  # the cache of compiled code has rules of its own
        text = path.read_text(encoding="utf-8")
        if not any(f"{word}(" in text for word in opening):
            continue
        calls = set()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                if node.func.attr in opening:
                    calls.add(ast.unparse(node.func))
            elif isinstance(node, ast.Call) and ast.unparse(node.func) == "open":
                calls.add("open")
        assert calls <= OTHER.get(name, set()), name


def test_new_files_and_replaced_ones(tmp_path):
    path = tmp_path / "a"
    write_text(path, "1 µm\n")
    assert path.read_bytes() == "1 µm\n".encode()
    (tmp_path / "b").write_text("")
    assert path.stat().st_mode == (tmp_path / "b").stat().st_mode
    path.chmod(0o640)
    write_file(path, b"2")
    assert read_file(path) == b"2"
    assert path.stat().st_mode & 0o777 == 0o640
    with pytest.raises(fs.FileError, match=r"a cannot be written: .*surrogates not allowed"):
        write_text(path, "\ud800")
    assert read_file(path) == b"2"
    assert names_in(tmp_path) == ["a", "b"]


def test_links_are_followed(tmp_path):
    (tmp_path / "data").mkdir()
    link, target = tmp_path / "latest.npz", tmp_path / "data" / "run.npz"
    link.symlink_to("data/run.npz")
    spectrum().save(link)  # dangling: its target is made
    assert link.is_symlink()
    assert fs.load(target).name == "x"
    before = target.read_bytes()
    chain = tmp_path / "chain.npz"
    chain.symlink_to(link)
    spectrum(400).save(chain)
    assert chain.is_symlink()
    assert link.is_symlink()
    assert target.read_bytes() != before
    assert names_in(tmp_path) == ["chain.npz", "data", "latest.npz"]
    assert names_in(tmp_path / "data") == ["run.npz"]


def test_links_that_lead_to_no_file(tmp_path):
    loop, other = tmp_path / "loop.npz", tmp_path / "other.npz"
    loop.symlink_to(other)
    other.symlink_to(loop)
    folder = tmp_path / "folder.npz"
    folder.symlink_to(tmp_path)
    gone = tmp_path / "gone.npz"
    gone.symlink_to(tmp_path / "none" / "x.npz")
    for path, message in [
        (loop, "Too many levels of symbolic links"),
        (folder, "Is a directory"),
        (gone, "No such file or directory"),
        (loop / "x.npz", "Too many levels of symbolic links"),
    ]:
        with pytest.raises(fs.FileError, match=f"{path.name} cannot be written: {message}"):
            spectrum().save(path)
        with pytest.raises(fs.FileError, match=f"{path.name} cannot be read: {message}"):
            fs.load(path)
    assert names_in(tmp_path) == ["folder.npz", "gone.npz", "loop.npz", "other.npz"]
    assert loop.is_symlink()


def test_pipes_and_devices_are_not_opened(tmp_path):
    pipe = tmp_path / "pipe.npz"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero"), Path("/dev/stdin")):
        for read in (fs.load, fs.read_auto, read_file):
            if path.exists() and not path.is_file():
                with pytest.raises(fs.FileError, match="cannot be read: It is a pipe, a socket or"):
                    read(path)
    link = tmp_path / "link.npz"
    link.symlink_to(pipe)
    for path in (pipe, link):
        with pytest.raises(fs.FileError, match="cannot be written: It is a pipe, a socket or a"):
            spectrum().save(path)
    assert pipe.is_fifo()
    for read in (fs.load, fs.read_auto):
        with pytest.raises(fs.FileError, match="cannot be read: Is a directory"):
            read(tmp_path)


def test_long_names(tmp_path):
    path = tmp_path / ("a" * 251 + ".npz")  # the longest that the file system takes
    spectrum().save(path)
    assert fs.load(path).name == "x"
    for long in (tmp_path / ("a" * 252 + ".npz"), tmp_path / "/".join(["a" * 200] * 30)):
        with pytest.raises(fs.FileError, match="cannot be written: File name too long"):
            spectrum().save(long.with_suffix(".npz"))
        with pytest.raises(fs.FileError, match="cannot be read: File name too long"):
            fs.load(long)
    assert names_in(tmp_path) == [path.name]


@cache
def decay():
    import sympy as sp

    x = sp.Symbol("x")
    return fs.Model({x: -x})


def write_all():
    """One writer of each kind, by name."""
    figure = Figure()
    figure.add_subplot().plot([0, 1], [0, 1])
    return {
        "a.npz": spectrum().save,
        "a.nc": spectrum().save,
        "a.pdf": lambda path: save(figure, path),
        "a.png": lambda path: save(figure, path, 50),
        "a.svg": lambda path: save(figure, path),
        "a.html": lambda path: write_text(path, "<html>" * 1000),
        "S1.ode": lambda path: fs.export(decay(), "xpp", path.parent),
        "S1.py": lambda path: fs.export(decay(), "numpy", path.parent),
    }


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_every_writer_reports_a_failing_disk(tmp_path, monkeypatch, call):
    writers = write_all()
    for name in writers:
        (tmp_path / name).write_text("old")

    def fail(*arguments, **more):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(*((os, "fsync") if call == "fsync" else (Path, "replace")), fail)
    for name, write in writers.items():
        with pytest.raises(fs.FileError, match=rf"{name} cannot be written: Input/output error"):
            write(tmp_path / name)
        assert (tmp_path / name).read_text() == "old"
    assert names_in(tmp_path) == sorted(writers)


def test_an_interrupt_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    spectrum().save(path)
    before = path.read_bytes()

    def interrupt(handle):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        spectrum(400).save(path)
    assert path.read_bytes() == before
    assert names_in(tmp_path) == ["a.npz"]


@pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="signals of POSIX")
def test_an_exception_of_a_handler_is_no_failure_of_the_disk(tmp_path, monkeypatch):
    """A TimeoutError is an OSError, as those of the disk are."""

    def late(number, frame):
        raise TimeoutError("the user's own")

    write_file(tmp_path / "a", b"old")
    monkeypatch.setattr(os, "fsync", lambda handle: signal.raise_signal(signal.SIGUSR1))
    before = signal.signal(signal.SIGUSR1, late)
    try:
        with pytest.raises(TimeoutError, match="the user's own"):
            write_file(tmp_path / "a", b"new")
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert (tmp_path / "a").read_bytes() == b"old"
    assert names_in(tmp_path) == ["a"]


@contextmanager
def largest_file(size):
    """The system refuses more than so many bytes of a file."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_disks_that_are_full_after_any_number_of_bytes(tmp_path):
    writers = write_all()
    for name, write in writers.items():
        path = tmp_path / name
        write(path)
        size = path.stat().st_size
        path.write_text("old")
        # the others are made anew each time
        many = 30 if name in ("a.npz", "a.nc", "a.html") else 3
        for limit in sorted({0, 1, size - 1, *range(0, size, size // many + 1)}):
            refused = pytest.raises(fs.FileError, match=f"{name} cannot be written: File too large")
            with largest_file(limit), refused:
                write(path)
            assert path.read_text() == "old"
            assert set(names_in(tmp_path)) <= set(writers)
        write(path)
        assert path.stat().st_size == size


def test_a_disk_that_is_really_full(tmp_path):
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=256k", "none", str(tmp_path)],
        capture_output=True,
        check=False,
    )
    if mounted.returncode:
        pytest.skip("only root can mount a small disk")
    writers = write_all()
    try:
        for name in ("a.npz", "a.nc"):
            path, filler = tmp_path / name, tmp_path / "filler"
            path.write_text("old")
            with filler.open("wb", buffering=0) as file, suppress(OSError):
                while True:
                    file.write(bytes(4096))
            with pytest.raises(fs.FileError, match="No space left on device"):
                writers[name](path)
            assert path.read_text() == "old"
            assert names_in(tmp_path) == [name, "filler"]
            filler.unlink()
            path.unlink()
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)


@contextmanager
def another_user():
    """A user who may not write everywhere, if this is root."""
    before = os.geteuid()
    if before == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(before)


def test_files_that_may_not_be_written():
    # where another user finds it too
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        folder = Path(name)
        folder.chmod(0o755)
        for part, mode in [("folder", 0o555), ("mine", 0o777)]:
            (folder / part).mkdir()
            (folder / part).chmod(mode)
        (folder / "file.npz").write_text("old")
        (folder / "file.npz").chmod(0o444)
        spectrum().save(folder / "mine" / "b.npz")  # imports what this user alone may read
        (folder / "mine" / "b.npz").unlink()
        with another_user():
            for refused in ("file.npz", "folder/a.npz"):
                with pytest.raises(fs.FileError, match="Permission denied"):
                    spectrum().save(folder / refused)
            spectrum().save(folder / "mine" / "a.npz")
        assert (folder / "file.npz").read_text() == "old"
        assert sorted(p.name for p in folder.rglob("*")) == ["a.npz", "file.npz", "folder", "mine"]
        (folder / "folder").chmod(0o755)
