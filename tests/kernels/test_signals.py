import contextlib
import gc
import signal
import weakref

import pytest
from numba import njit
from numba.core import event
from numba.core.compiler import Compiler
from numba.core.typing.context import BaseContext

from fastslow.kernels.compiler.loop_compiler import compiled_object, watched_passes
from fastslow.kernels.compiler.signals import deferring_signals

pytestmark = pytest.mark.slow


class Passes(event.Listener):
    """Counts the passes of Numba's compiler, and sends a signal in one of them."""

    def __init__(self, sending):
        self.sending, self.count = sending, 0

    def on_start(self, _):
        self.count += 1
        if self.count == self.sending:
            signal.raise_signal(signal.SIGINT)

    def on_end(self, _):
        pass


@pytest.fixture(autouse=True)
def handler():
    """Puts a handler in the place of that for Ctrl-C, which a shell's background ignores."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield lambda function: signal.signal(signal.SIGINT, function)
    signal.signal(signal.SIGINT, before)


def swallowing():
    try:
        signal.raise_signal(signal.SIGINT)
    except BaseException:
        return "swallowed"
    return "done"


def test_what_would_be_swallowed_is_raised():
    finished = []
    with pytest.raises(KeyboardInterrupt):
        deferring_signals(lambda: finished.append(swallowing()))
    assert finished == ["done"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_compilation_ends_at_its_next_pass_and_begins_again():
    @njit
    def squared(x):
        return x * x

    watching = Passes(sending=3)
    listening = event.install_listener("numba:run_pass", watching)
    with listening, watched_passes(), pytest.raises(KeyboardInterrupt):
        deferring_signals(squared.compile, "float64(float64)")
    assert watching.count == 3
    assert not squared.overloads
    assert deferring_signals(squared, 3.0) == 9.0


def test_an_exception_of_the_users_handler_comes_out_as_it_is(handler):
    def late(number, frame):
        raise TimeoutError("too late")

    def failing():
        signal.raise_signal(signal.SIGINT)
        raise SystemError("of the compiler")

    handler(late)
    with pytest.raises(TimeoutError, match="too late"):
        deferring_signals(failing)
    assert signal.getsignal(signal.SIGINT) is late


def test_a_handler_that_returns_changes_nothing(handler):
    called = []
    handler(lambda number, frame: called.append(number))
    assert deferring_signals(swallowing) == "done"
    assert called == [signal.SIGINT]


def test_one_compilation_within_another_is_part_of_it():
    def both():
        assert deferring_signals(swallowing) == "done"
        return "whole"

    with pytest.raises(KeyboardInterrupt):
        deferring_signals(both)
    with pytest.raises(ValueError, match="invalid literal"):
        deferring_signals(int, "x")


def test_what_an_interrupted_compilation_leaves_is_not_forgotten(monkeypatch):
    """Numba's finalisers of loops would lose an interrupt that comes while one of them runs."""
    disposed = []
    insert = BaseContext._insert_global

    def watched(self, value, kind):
        insert(self, value, kind)
        with contextlib.suppress(TypeError):
            weakref.finalize(value, disposed.append, repr(value)).atexit = False

    def stopped(self, function):
        raise KeyboardInterrupt

    monkeypatch.setattr(BaseContext, "_insert_global", watched)
    monkeypatch.setattr(Compiler, "compile_extra", stopped)
    for _ in range(3):
        with pytest.raises(KeyboardInterrupt):
            compiled_object("def tripled(slots):\n    return 3 * slots[0]\n", "tripled")
    gc.collect()
    assert disposed == []
