"""Real signals, sent to a process that computes: a sample of the campaign of the same name."""

import os
import signal
import time

import pytest

import fastslow as fs
from tests.campaigns.interrupts import campaign

pytestmark = pytest.mark.slow

#: What is computed with code that other tests compile as well.
KINDS = [
    "long_run_with_series",
    "ensemble_on_threads",
    "refined_map",
    "file",
]


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="needs POSIX signals")
def test_an_interrupt_comes_out_of_any_call():
    report = campaign(4, 5, KINDS)
    assert len(report.rows) == 4
    assert not report.failures, str(report)


@pytest.fixture
def too_late():
    """Calls a function; TimeoutError is raised in it after a tenth of a second."""

    def handler(number, frame):
        raise TimeoutError("too late")

    before = signal.signal(signal.SIGALRM, handler)

    def called(function, *arguments):
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        function(*arguments)

    yield called
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


ENDLESS = fs.Integration(max_steps=10**9, max_crossings=10**9)


def simulated(until):
    gear = fs.systems.harmonic_gear()
    fs.simulate(gear, [0, 0], t=(0, until), dense=False, integration=ENDLESS)


def mapped(until):
    def end(x, y):
        time.sleep(1e-6 * until)
        return x > y

    fs.refined_map(end, {"x": (0, 1), "y": (0, 1)}, refinement=fs.Refinement(levels=1))


def on_threads(until):
    gear = fs.systems.harmonic_gear()
    fs.simulate_many(
        gear, [[0, 0], [1, 0]], t=(0, until), execution=fs.Execution(threads=2), integration=ENDLESS
    )


@pytest.mark.parametrize("call", [simulated, mapped, on_threads])
def test_what_the_handler_of_a_signal_raises_comes_out_as_it_is(call, too_late):
    # what is imported meanwhile may take an OSError for one of its own
    call(1.0)
    with pytest.raises(TimeoutError, match="too late"):
        too_late(call, 1e9)


def test_a_file_is_whole_or_what_it_was(tmp_path, monkeypatch, too_late):
    """TimeoutError is an OSError, of which the others are told as FileError."""
    trajectory = fs.simulate(fs.systems.harmonic_gear(), [0, 0], periods=1)
    target = tmp_path / "run.npz"
    trajectory.save(target)
    before = target.read_bytes()

    def slow(handle):
        time.sleep(5)

    monkeypatch.setattr(os, "fsync", slow)
    with pytest.raises(TimeoutError, match="too late"):
        too_late(trajectory.save, target)
    assert target.read_bytes() == before
    assert list(tmp_path.iterdir()) == [target]
