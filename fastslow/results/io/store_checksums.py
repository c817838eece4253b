"""Checksums of Zarr stores: of the metadata, and of the files of each task.

The codec of Zarr verifies each file by itself. These checksums also depend on the places of the
files, so that deleted, exchanged and outdated files are detected.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from fastslow.disk import write_text
from fastslow.errors import FileError

#: The file with the metadata of a group or an array.
METADATA = "zarr.json"


def write_group(path: Path, attributes: Mapping[str, Any], names: Iterable[str]) -> None:
    """Write the metadata of a group atomically.

    Parameters
    ----------
    path : Path
        A directory that exists.
    attributes : mapping
    names : iterable of str
        Arrays whose metadata are copied into those of the group, where xarray reads them.
    """
    document: dict[str, Any] = {
        "attributes": dict(attributes),
        "zarr_format": 3,
        "consolidated_metadata": {
            "kind": "inline",
            "must_understand": False,
            "metadata": {name: _metadata(path / name) for name in sorted(names)},
        },
        "node_type": "group",
    }
    document["attributes"]["checksum"] = _checksum(document)
    write_text(path / METADATA, json.dumps(document, indent=2))


def read_attributes(path: Path) -> dict[str, Any]:
    """Return the attributes of a group, which are not verified."""
    found = _metadata(path)["attributes"]
    return found if isinstance(found, dict) else {}


def verified_arrays(path: Path) -> frozenset[str]:
    """Return the names of the arrays of a group whose metadata are unchanged.

    Raises
    ------
    FileError
        If the metadata of the group, or of one of these arrays, have changed.
    """
    document = _metadata(path)
    if document["attributes"].pop("checksum", None) != _checksum(document):
        raise FileError(f"{path} is damaged: {METADATA} differs from its checksum")
    arrays = document["consolidated_metadata"]["metadata"]
    for name, expected in arrays.items():
        if not (path / name / METADATA).exists():
            raise FileError(f"{path} is damaged: {name}/{METADATA} is missing")
        if _metadata(path / name) != expected:
            raise FileError(f"{path} is damaged: {name}/{METADATA} differs from {METADATA}")
    return frozenset(arrays)


def checksum_of_files(path: Path, names: Iterable[str], mark: int = 0) -> int:
    """Return a checksum of the names and contents of those files that exist, and of a mark."""
    total = hashlib.blake2b(b"%d" % mark, digest_size=8)
    for name in names:
        try:
            content = (path / name).read_bytes()
        except FileNotFoundError:
            continue
        total.update(f"\n{name} {len(content)}\n".encode() + content)
    return int.from_bytes(total.digest(), "little")


def _metadata(path: Path) -> Any:
    return json.loads((path / METADATA).read_bytes())


def _checksum(document: Any) -> str:
    """Return the checksum of a document, which does not depend on its spaces."""
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()
