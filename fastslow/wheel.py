"""The loops of this package as objects, for its wheel."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fastslow.compiled import shipped, store
from fastslow.compiled.generic import Entry, compiled
from fastslow.compiled.loop_target import platform_name
from fastslow.disk import write_file, write_text


def entries() -> Iterator[Entry]:
    """Everything that is compiled once for all models."""
    from fastslow.continuation import loops as continuation
    from fastslow.passage import loops as passage
    from fastslow.simulation import loops as simulation

    yield from continuation.LOOPS.values()
    yield from simulation.LOOPS
    yield from passage.LOOPS


def write_objects(folder: Path) -> list[Path]:
    """Compile everything into the files of a folder."""
    files = [folder / shipped.PLATFORM]
    write_text(files[0], platform_name() + "\n")
    for entry in entries():
        file = folder / f"{entry.name}{store.SUFFIX}"
        write_file(file, store.wrapped(entry.name, compiled(entry, "for the wheel")))
        files.append(file)
    return files
