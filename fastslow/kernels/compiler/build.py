"""Hatchling build hook that compiles the loops of this package at installation.

A wheel is specific to a platform and a class of processors. The names of its objects contain a
digest of their sources, and loops without a matching object are compiled at run time
(`fastslow.kernels.loops`). If they cannot be compiled, or the environment variable
FASTSLOW_BUILD is ``none``, the wheel contains no machine code and is platform-independent. The
objects remain in the checkout, for editable installations and for running from the sources.
"""

from __future__ import annotations

import os
import platform
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

#: The oldest GNU C library whose functions the loops call: those of C99 and no others.
_GLIBC = "manylinux_2_17"


class CompiledLoops(BuildHookInterface[Any]):
    """Compile the objects and add them to a wheel."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if self.target_name != "wheel":
            return
        if os.environ.get("FASTSLOW_BUILD") == "none":
            self.app.display_info("FASTSLOW_BUILD=none: the wheel holds no machine code")
            return
        inside = "fastslow/kernels/objects"
        # the project root is not always on the module search path
        sys.path.insert(0, self.root)
        try:
            from fastslow.wheel import write_objects

            files = write_objects(Path(self.root, inside))
        except Exception as error:
            self.app.display_warning(f"the wheel holds no machine code: {error!r}")
            return
        finally:
            sys.path.remove(self.root)
        if version == "editable":
            return
        build_data["force_include"].update({str(file): f"{inside}/{file.name}" for file in files})
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{_platform()}"


def _platform() -> str:
    """Platform tag of a wheel."""
    name = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    if name.startswith("linux") and platform.libc_ver()[0] == "glibc":
        return name.replace("linux", _GLIBC, 1)
    return name
