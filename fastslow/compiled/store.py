"""Generated source as importable modules in a per-user cache directory."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType

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
    """What compiled code depends on beside its source: Numba, LLVM and the processor."""
    import llvmlite
    import llvmlite.binding as llvm
    import numba

    return "|".join(
        (
            numba.__version__,
            llvmlite.__version__,
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

    The file name carries a hash of the source and of everything else the
    machine code depends on. Two processes may do this at once: the file is
    written aside and moved into place.

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
    digest = hashlib.sha256(f"{_platform_key()}\n{source}".encode()).hexdigest()[:24]
    name = f"fastslow_{stem}_{digest}"
    if name in _loaded:
        return _loaded[name]
    path = _writable_directory() / f"{name}.py"
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
    _loaded[name] = module
    return module
