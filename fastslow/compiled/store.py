"""Generated source as importable modules in a per-user cache directory."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import pickletools
import platform
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType

from fastslow.compiled.closure import digest_of_imports

_loaded: dict[str, ModuleType] = {}


def cache_directory() -> Path:
    """Where compiled code is kept: ``FASTSLOW_CACHE``, else the user's cache directory."""
    chosen = os.environ.get("FASTSLOW_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return base / "fastslow"


@cache
def _platform_key() -> str:
    """What compiled code depends on beside its source: versions and the processor."""
    import llvmlite
    import llvmlite.binding as llvm
    import numba
    import numpy as np
    import scipy

    return "|".join(
        (
            numba.__version__,
            llvmlite.__version__,
            np.__version__,
            scipy.__version__,
            platform.python_version(),
            llvm.get_host_cpu_name(),
            llvm.get_host_cpu_features().flatten(),
        )
    )


@cache
def _writable_directory() -> Path:
    """The cache directory, or one of this process alone where it cannot be written."""
    directory = cache_directory()
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return directory
    except OSError:
        return Path(tempfile.mkdtemp(prefix="fastslow-"))


def load_generated(source: str, stem: str) -> ModuleType:
    """Import generated source as a module kept on disk, so that Numba keeps its code too.

    The file name carries a hash of the source, of the modules that it imports and of
    everything else the machine code depends on, so that another version of Numba or
    another processor never meets code that is not its own. Two processes may do this at
    once: files are written aside and moved into place. Code that was cut short
    is built again; a directory that cannot be written is read all the same.

    Parameters
    ----------
    source : str
        Python source.
    stem : str
        Beginning of the file name, for a person who looks into the directory.

    Returns
    -------
    module
    """
    key = f"{_platform_key()}\n{digest_of_imports(source)}\n{source}"
    digest = hashlib.sha256(key.encode()).hexdigest()[:24]
    name = f"fastslow_{stem}_{digest}"
    if name not in _loaded:
        from fastslow.compiled.signals import deferring_signals

        _loaded[name] = deferring_signals(_load, name, source)
    return _loaded[name]


def _load(name: str, source: str) -> ModuleType:
    """Write a module if it is not there yet, and import it."""
    directory = _writable_directory()
    path = directory / f"{name}.py"
    if directory != cache_directory():
        _copy(name, cache_directory(), directory)
    _sweep(name, directory)
    if not path.exists() or path.read_text(encoding="utf-8") != source:
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(source)
        Path(temporary).replace(path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def _stored(name: str, directory: Path) -> list[Path]:
    """What Numba keeps for a module."""
    return sorted((directory / "__pycache__").glob(f"{name}.*.nb[ci]"))


def _copy(name: str, origin: Path, target: Path) -> None:
    """Take what a read-only directory holds of a module, with its times, by which it is known."""
    source = origin / f"{name}.py"
    if (target / source.name).exists() or not source.exists():
        return
    (target / "__pycache__").mkdir(exist_ok=True)
    for file in _stored(name, origin):
        shutil.copy2(file, target / "__pycache__" / file.name)
    shutil.copy2(source, target / source.name)


def _sweep(name: str, directory: Path) -> None:
    """Remove the machine code of a module if one of its files is not whole."""
    files = _stored(name, directory)
    if not all(map(_whole, files)):
        for file in files:
            file.unlink(missing_ok=True)


def _whole(file: Path) -> bool:
    """Whether a file is a sequence of complete pickles; nothing in it is executed."""
    try:
        with file.open("rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            if size == 0:
                return False
            while stream.tell() < size:
                for _ in pickletools.genops(stream):
                    pass
    except OSError:
        return True  # another process has just replaced it
    except Exception:
        # whatever the reader of opcodes stumbles over
        return False
    return True
