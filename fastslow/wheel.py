"""The loops of this package as objects, for an installation."""

from __future__ import annotations

import gc
import multiprocessing
import os
from collections.abc import Iterator
from pathlib import Path

from fastslow.disk import write_file, write_text
from fastslow.kernels.compiler import shipped, store
from fastslow.kernels.compiler.loop_compiler import compiled_object
from fastslow.kernels.compiler.loop_target import platform_name
from fastslow.kernels.loops import Entry


def entries() -> Iterator[Entry]:
    """Everything that is compiled once for all models."""
    from fastslow.certification import loops as certification
    from fastslow.continuation import loops as continuation
    from fastslow.orbits import loops as orbits
    from fastslow.passage import loops as passage
    from fastslow.simulation import loops as simulation

    # those that take longest to compile come first
    yield from simulation.LOOPS
    yield from passage.LOOPS
    yield from orbits.LOOPS
    yield from continuation.LOOPS.values()
    yield from certification.LOOPS


def write_objects(folder: Path) -> list[Path]:
    """Compile everything into the files of a folder, and remove what is for other sources.

    Files that are whole stay as they are. The others are made by as many processes as there are
    processors.
    """
    folder.mkdir(exist_ok=True)
    (folder / shipped.PLATFORM).unlink(missing_ok=True)
    files = {entry.name: folder / f"{entry.name}{store.SUFFIX}" for entry in entries()}
    for file in folder.glob(f"*{store.SUFFIX}"):
        if file.stem not in files or store.unwrapped(file.stem, file.read_bytes()) is None:
            file.unlink()
    missing = [(name, file) for name, file in files.items() if not file.exists()]
    if missing:
        context = multiprocessing.get_context("spawn")
        # garbage collection would take a tenth of the time
        with context.Pool(min(os.cpu_count() or 1, len(missing)), gc.disable) as pool:
            pool.starmap(_write_object, missing, chunksize=1)
    write_text(folder / shipped.PLATFORM, platform_name() + "\n")
    return [folder / shipped.PLATFORM, *files.values()]


def _write_object(name: str, file: Path) -> None:
    (entry,) = (entry for entry in entries() if entry.name == name)
    write_file(file, store.wrapped(name, compiled_object(entry.source, entry.function)))
