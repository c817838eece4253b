"""Machine code of models, from generated source to an address, without Numba.

Every function has the arguments described in `fastslow.kernels.compiler.pointers`. Code is cached
on disk under a name that contains a digest of all it depends on, and is released when nothing
refers to its `Address`.
"""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from functools import cache, partial

from llvmlite import ir

from fastslow.kernels.compiler import store
from fastslow.kernels.compiler.digest import digest_of_imports
from fastslow.kernels.compiler.machine_code import Address, load_object, object_code, platform_key
from fastslow.kernels.compiler.native import translate
from fastslow.kernels.compiler.signals import between_passes, deferring_signals

#: Where everything is that code is made by.
_MAKERS = """\
from fastslow.kernels import special
from fastslow.kernels.compiler import model_code
from fastslow.kernels.simd import lane_steps
"""

#: Number of functions that remain loaded without being used.
UNUSED_FUNCTIONS = 256

#: Addresses by the name of the function, the last used one last.
_addresses: OrderedDict[str, Address] = OrderedDict()
_lock = threading.RLock()


def load_function(source: str, function: str) -> Address:
    """Address of the function of a generated source.

    Parameters
    ----------
    source : str
        One function, in the subset of Python that `fastslow.kernels.compiler.native` translates.
    function : str
        Its name.
    """
    if "special." not in source:
        return load_built(source, function, lambda module: translate(source, module))
    # SciPy is imported only if it is used
    from fastslow.kernels import special

    def build(module: ir.Module) -> None:
        translate(source, module, special.names())

    return load_built(source, function, build, special.addresses)


def load_built(
    text: str,
    function: str,
    build: Callable[[ir.Module], None],
    symbols: Callable[[], Mapping[str, int]] = dict,
    *,
    passes: bool = True,
) -> Address:
    """Address of a function, built if its code is not cached.

    Parameters
    ----------
    text : str
        Everything that determines the code besides the sources of this package.
    function : str
        Its name.
    build : callable
        Fills a module.
    symbols : callable, optional
        Returns the addresses of the functions it calls.
    passes : bool
        Whether to run the optimisation passes of LLVM.
    """
    key = f"{platform_key()}\n{_digest_of_makers()}\n{text}"
    name = f"fastslow_{function}_{hashlib.sha256(key.encode()).hexdigest()[:24]}"
    with _lock:
        if name not in _addresses:
            # an exception raised by a signal handler in a finaliser would be lost
            _addresses[name] = deferring_signals(
                _load, name, function, partial(object_code, build, passes=passes), symbols
            )
        _addresses.move_to_end(name)
        while len(_addresses) > UNUSED_FUNCTIONS:
            _addresses.popitem(last=False)
        return _addresses[name]


def _load(
    name: str,
    function: str,
    compiled: Callable[[], bytes],
    symbols: Callable[[], Mapping[str, int]],
) -> Address:
    return load_object(_code(name, compiled), function, symbols())


def _code(name: str, compiled: Callable[[], bytes]) -> bytes:
    code = store.read(name)
    if code is None:
        with store.exclusively(name, between_passes):
            # another process may have compiled it meanwhile
            code = store.read(name)
            if code is None:
                code = compiled()
                store.write(name, code)
    return code


@cache
def _digest_of_makers() -> str:
    return digest_of_imports(_MAKERS)
