"""Numba's compiler, with what it makes kept on disk."""

from __future__ import annotations

import hashlib
import pickle
from contextlib import AbstractContextManager
from typing import Any

from numba.core import event
from numba.core.compiler import Compiler, CompileResult
from numba.core.serialize import dumps

from fastslow.compiled import store
from fastslow.compiled.signals import between_passes

#: What Numba announces before and after each pass of its compiler.
_PASS = "numba:run_pass"


class _Passes(event.Listener):
    """Handles signals between Numba's passes."""

    def on_start(self, _: Any) -> None:
        between_passes()

    def on_end(self, _: Any) -> None:
        pass


def watched_passes() -> AbstractContextManager[None]:
    """Let what Numba compiles meanwhile be interrupted between its passes."""
    return event.install_listener(_PASS, _Passes())


class KeptCompiler(Compiler):
    """Compiles a function, or reads it from the disk.

    Of the function, only the name of its module and its own count: together they must say
    everything that it depends on. Numba has a cache too, in files without checksums, under a
    key that does not see what is imported.
    """

    def compile_extra(self, func: Any) -> Any:
        """Compile a function for the types that this was made for."""
        name = self._name(func)
        found = store.read(name)
        if found is None:
            with store.alone(name, between_passes):
                # by now another process may have compiled it
                found = store.read(name)
                if found is None:
                    with watched_passes():
                        result = super().compile_extra(func)
                    # addresses mean nothing to another process
                    if not result.library.has_dynamic_globals:
                        store.write(name, dumps(result._reduce()))
                    return result
        context = self.state.targetctx
        context.refresh()
        return CompileResult._rebuild(context, *pickle.loads(found))

    def _name(self, func: Any) -> str:
        types = f"{func.__qualname__} {self.state.args} {self.state.return_type}"
        return f"{func.__module__}_{hashlib.sha256(types.encode()).hexdigest()[:12]}"
