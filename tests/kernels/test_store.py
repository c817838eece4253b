"""Compiled code on disk: whose is loaded, where it is kept, and who compiles it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="users and forks of POSIX"),
]
as_root = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="other users are played by root"
)
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def found():
    """What the scenarios found."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.kernels.store_scenarios"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def check(result, *, compiled, said=(), value=1.0):
    """A child lived, had the right value, and said one sentence for each that is expected."""
    assert result.get("error") is None, result["error"]
    assert result["signal"] == 0
    assert (result["value"], result["compiled"]) == (value, compiled)
    assert len(result["said"]) == len(said), result["said"]
    for sentence, parts in zip(result["said"], said, strict=True):
        for part in parts:
            assert part in sentence


MEMORY = "kept in memory alone, and every process compiles its own"


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("umask", "directory", "file"), [("002", 755, 644), ("022", 755, 644), ("077", 700, 600)]
)
def test_files_are_for_others_to_read_as_the_umask_says(found, umask, directory, file):
    first, again, folder, files = found[f"umask {umask}"]
    check(first, compiled=1)
    check(again, compiled=0)
    assert folder == f"0o{directory}"
    assert [mode for mode, _ in files.values()] == [f"0o{file}"]


def test_one_of_four_processes_compiles_and_the_others_wait(found):
    assert sorted(child["compiled"] for child in found["at_once"]) == [0, 0, 0, 1]
    for child in found["at_once"]:
        check(child, compiled=child["compiled"])


def test_the_lock_ends_with_the_process(found):
    check(found["killed_while_compiling"], compiled=1)


def test_who_waits_can_be_interrupted(found):
    check(found["interrupted_while_waiting"], compiled=0, value="interrupted")


def test_nobody_waits_for_ever(found):
    check(found["waited_for_too_long"], compiled=1, said=[["compiled here too: another process"]])


def test_without_locks_everybody_compiles(found):
    check(found["no_locks"], compiled=1)


@as_root
def test_others_load_what_root_has_compiled(found):
    loaded, missing, again, homeless, hidden = found["shared"]
    check(loaded, compiled=0)
    lacks = ["shared takes no compiled code (Permission denied)"]
    check(missing, compiled=1, value=[1.0, 2.0], said=[[*lacks, "home/.cache/fastslow does"]])
    check(again, compiled=0, value=[1.0, 2.0])
    check(homeless, compiled=1, value=[1.0, 2.0], said=[[*lacks, MEMORY]])
    check(hidden, compiled=1, said=[["is not loaded (Permission denied)"], [*lacks, MEMORY]])


@as_root
@pytest.mark.parametrize(
    ("how", "why"),
    [
        ("belongs_to_stranger", "the directory belongs to the user of number 65534"),
        ("file_of_stranger", "the file belongs to the user of number 65534"),
        ("open_to_all", "the directory can be written by others (chmod go-w)"),
        ("file_open_to_group", "the file can be written by others (chmod go-w)"),
        ("link", "symbolic link"),
    ],
)
def test_planted_code_is_not_run(found, how, why):
    result, trace = found["planted"][how]
    check(result, compiled=1, said=[[f"{how}/", why]])
    assert not trace


@as_root
def test_the_planted_code_would_be_run_from_an_own_file(found):
    assert found["planted"]["own"][1]


def test_a_pipe_in_the_place_of_a_file_does_not_block(found):
    result, replaced = found["pipe"]
    check(result, compiled=1, said=[["is not loaded (it is not a file)"]])
    assert replaced


@as_root
def test_directories_that_are_unset_empty_or_relative(found):
    empty, relative, given, empty_home, no_home, kept = found["locations"]
    # nothing is written where the process runs
    check(empty, compiled=1, value=[1.0, []])
    check(relative, compiled=0, value=[1.0, []])
    check(given, compiled=1, value=[1.0, []])
    assert kept == [["home/.cache/fastslow", "xdg/fastslow"]]
    for result in (empty_home, no_home):
        said = ["there is no home directory, and FASTSLOW_CACHE is not set", MEMORY]
        check(result, compiled=1, value=[1.0, []], said=[said])


def test_a_full_disk_means_memory(found):
    result, left = found["full_disk"]
    check(result, compiled=2, value=[1.0, 2.0], said=[["File too large", MEMORY]])
    assert left == ["lock"]


def test_a_file_in_the_place_of_the_directory(found):
    homeless, at_home = found["no_directory"]
    check(homeless, compiled=1, said=[["no_directory/file", MEMORY]])
    check(at_home, compiled=1, said=[["no_directory/file", "home/.cache/fastslow is used"]])


def test_what_was_not_used_for_long_is_removed(found):
    result, by_age, by_size = found["sweep"]
    check(result, compiled=1)
    assert by_age == ["fasts", "forei", "lock", "old", "used"]
    # where there is too little space for anything, nothing but foreign files is kept
    assert by_size == ["forei", "lock"]


def test_the_last_use_is_marked(found):
    result, marked = found["touched"]
    check(result, compiled=0)
    assert marked


def test_damaged_files_are_built_again():
    done = subprocess.run(
        [sys.executable, "-m", "tests.campaigns", "cache", "20", "1"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
