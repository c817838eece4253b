"""What becomes of compiled code in many circumstances, each in a process of its own.

Run as ``python -m tests.kernels.store_scenarios``: prints what each scenario found, as JSON.
"""

import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

from fastslow.kernels.compiler import model_code, store
from tests.kernels.forks import Child, counted, prepare, run, use

STRANGER, NOBODY = 65534, 54321  # the second is in no table of users


def files(folder):
    return {
        path.name: (oct(path.stat().st_mode & 0o777), path.read_bytes()[:23].decode())
        for path in sorted(Path(folder).glob("*.code"))
    }


def modes(folder, umask):
    place = folder / oct(umask)
    first = run(use, umask=umask, FASTSLOW_CACHE=place)
    again = run(use, umask=umask, FASTSLOW_CACHE=place)
    return first, again, oct(place.stat().st_mode & 0o777), files(place)


def slowly(build, **options):
    time.sleep(0.5)
    return counted(build, **options)


def use_slowly():
    model_code.object_code = slowly
    return use()


def at_once(folder):
    children = [Child(use_slowly, FASTSLOW_CACHE=folder) for _ in range(4)]
    return [child.result() for child in children]


def hold(name, folder):
    """Keep the lock until the process is killed."""
    with store.exclusively(name, lambda: None):
        (folder / "held").touch()
        time.sleep(60)


def holding(folder):
    run(use, FASTSLOW_CACHE=folder)
    (file,) = folder.glob("*.code")
    file.unlink()
    child = Child(hold, file.stem, folder, FASTSLOW_CACHE=folder)
    while not (folder / "held").exists():
        time.sleep(0.01)
    return child


def killed_while_compiling(folder):
    holder = holding(folder)
    waiting = Child(use, FASTSLOW_CACHE=folder)
    time.sleep(0.3)
    os.kill(holder.process, signal.SIGKILL)
    holder.result()
    return waiting.result()


def interrupted_use():
    signal.signal(signal.SIGINT, signal.default_int_handler)
    began = time.monotonic()
    try:
        use()
    except KeyboardInterrupt:
        return "interrupted" if time.monotonic() - began < 5 else "late"
    return "not interrupted"


def interrupted_while_waiting(folder):
    holder = holding(folder)
    waiting = Child(interrupted_use, FASTSLOW_CACHE=folder)
    time.sleep(0.5)
    os.kill(waiting.process, signal.SIGINT)
    result = waiting.result()
    os.kill(holder.process, signal.SIGKILL)
    holder.result()
    return result


def impatient_use():
    store.COMPILATION_WAIT = 0.1
    return use()


def waited_for_too_long(folder):
    holder = holding(folder)
    result = run(impatient_use, FASTSLOW_CACHE=folder)
    os.kill(holder.process, signal.SIGKILL)
    holder.result()
    return result


def use_without_locks():
    def refused(*_):
        raise OSError(37, "No locks available")

    store.fcntl.lockf = refused
    return use()


def no_locks(folder):
    return run(use_without_locks, FASTSLOW_CACHE=folder)


def use_two():
    return [use(1), use(2)]


def shared(folder):
    """What root has filled; then a user with a home, one without, and one who may not read it."""
    place, home = folder / "shared", folder / "home"
    run(use, FASTSLOW_CACHE=place)
    home.mkdir()
    os.chown(home, STRANGER, STRANGER)
    loaded = run(use, uid=STRANGER, FASTSLOW_CACHE=place, HOME=home)
    missing = run(use_two, uid=STRANGER, FASTSLOW_CACHE=place, HOME=home)
    again = run(use_two, uid=STRANGER, FASTSLOW_CACHE=place, HOME=home)
    homeless = run(use_two, uid=NOBODY, FASTSLOW_CACHE=place)
    (file,) = place.glob("*.code")
    file.chmod(0o600)
    hidden = run(use, uid=NOBODY, FASTSLOW_CACHE=place)
    return [loaded, missing, again, homeless, hidden]


def plant(folder, spoil):
    """A directory with a file of the right name and checksum, of another function."""
    elsewhere = folder.parent / "elsewhere"
    run(use, 41, FASTSLOW_CACHE=elsewhere)
    run(use, FASTSLOW_CACHE=folder)
    (file,), (other,) = folder.glob("*.code"), elsewhere.glob("*.code")
    content = store.unwrapped(other.stem, other.read_bytes())
    file.write_bytes(store.wrapped(file.stem, content))
    spoil(folder, file)
    result = run(use, FASTSLOW_CACHE=folder, HOME=folder.parent)
    return result, result.get("value") == 41.0


def planted(folder):
    def belongs_to_stranger(place, file):
        os.chown(place, STRANGER, STRANGER)

    def file_of_stranger(place, file):
        os.chown(file, STRANGER, STRANGER)

    def open_to_all(place, file):
        place.chmod(0o777)

    def file_open_to_group(place, file):
        file.chmod(0o664)

    def link(place, file):
        elsewhere = folder / "elsewhere.code"
        file.rename(elsewhere)
        file.symlink_to(elsewhere)

    found = {}
    for spoil in (belongs_to_stranger, file_of_stranger, open_to_all, file_open_to_group, link):
        place = folder / spoil.__name__ / "cache"
        place.parent.mkdir()
        found[spoil.__name__] = plant(place, spoil)
    place = folder / "own" / "cache"
    place.parent.mkdir()
    found["own"] = plant(place, lambda *_: None)
    return found


def pipe(folder):
    """A pipe in the place of the file blocks whoever opens it in the usual way."""
    run(use, FASTSLOW_CACHE=folder)
    (file,) = folder.glob("*.code")
    file.unlink()
    os.mkfifo(file, 0o644)
    return run(use, FASTSLOW_CACHE=folder), file.is_file()


def in_an_empty_folder(function, folder):
    os.chdir(folder)
    return [function(), sorted(path.name for path in folder.rglob("*"))]


def locations(folder):
    here, home = folder / "here", folder / "home"
    here.mkdir()
    home.mkdir()
    empty = run(in_an_empty_folder, use, here, HOME=home, XDG_CACHE_HOME="")
    relative = run(in_an_empty_folder, use, here, HOME=home, XDG_CACHE_HOME="here")
    given = run(in_an_empty_folder, use, here, HOME=home, XDG_CACHE_HOME=folder / "xdg")
    kept = [sorted(str(p.parent.relative_to(folder)) for p in folder.rglob("*.code"))]
    empty_home = run(in_an_empty_folder, use, here, HOME="")
    no_home = run(in_an_empty_folder, use, here, uid=NOBODY)
    return [empty, relative, given, empty_home, no_home, kept]


def use_on_full_disk():
    # a file may not grow beyond this; Python ignores the signal
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
    return [use(1), use(2)]


def full_disk(folder):
    return run(use_on_full_disk, FASTSLOW_CACHE=folder), sorted(
        path.name for path in folder.iterdir()
    )


def no_directory(folder):
    file = folder / "file"
    file.touch()
    return run(use, FASTSLOW_CACHE=file, HOME=""), run(
        use, FASTSLOW_CACHE=file, HOME=folder / "home"
    )


def sweep(folder):
    names = ["old", "older", "used", "half"]
    for name, days in zip(names, [80, 100, 100, 2], strict=True):
        file = folder / f"{name}.{'tmp' if name == 'half' else 'code'}"
        file.write_bytes(b"." * 1000)
        ago = time.time() - days * 86400
        os.utime(file, (time.time() if name == "used" else ago, ago))
    (folder / "foreign").touch()
    os.utime(folder / "foreign", (0, 0))
    result = run(use, FASTSLOW_CACHE=folder)
    by_age = sorted(path.stem[:5] for path in folder.iterdir())
    run(use_in_little_space, FASTSLOW_CACHE=folder)
    return result, by_age, sorted(path.stem[:5] for path in folder.iterdir())


def use_in_little_space():
    store.KEPT_BYTES = 100
    return use(2)


def touched(folder):
    """The last use of a file is marked once a day."""
    run(use, FASTSLOW_CACHE=folder)
    (file,) = folder.glob("*.code")
    os.utime(file, (0, 0))
    result = run(use, FASTSLOW_CACHE=folder)
    return result, time.time() - file.stat().st_mtime < 3600


EVERYWHERE = [at_once, killed_while_compiling, interrupted_while_waiting, waited_for_too_long]
EVERYWHERE += [no_locks, pipe, full_disk, no_directory, sweep, touched]
AS_ROOT = [shared, planted, locations]


def main():
    """Print what the scenarios found."""
    prepare()
    base = Path(tempfile.mkdtemp(prefix="fastslow-"))
    base.chmod(0o755)
    found = {}
    try:
        for scenario in [*EVERYWHERE, *(AS_ROOT if os.geteuid() == 0 else [])]:
            folder = base / scenario.__name__
            folder.mkdir()
            folder.chmod(0o755)
            found[scenario.__name__] = scenario(folder)
        for umask in (0o002, 0o022, 0o077):
            found[f"umask {umask:03o}"] = modes(base, umask)
    finally:
        shutil.rmtree(base)
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
