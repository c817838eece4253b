"""Tests with the oldest versions that are declared: ``python -m tests.floor FOLDER [tests]``.

Every requirement of pyproject.toml, extras and tests included, is installed in exactly the
version of its lower bound, into an environment in FOLDER; what is not declared is as new as these
allow. SALib requires a newer NumPy, so that its tests are skipped. Then pytest runs there, with a
cache of compiled code of its own. Without tests it runs all.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent


def declared(settings):
    """Every requirement, once, of the package, its extras and the group of the tests."""
    project, groups = settings["project"], settings["dependency-groups"]

    def of_group(name):
        for entry in groups[name]:
            if isinstance(entry, dict):
                yield from of_group(entry["include-group"])
            else:
                yield entry

    extras = [entry for part in project["optional-dependencies"].values() for entry in part]
    return list(dict.fromkeys([*project["dependencies"], *extras, *of_group("test")]))


def floors(settings):
    """The version of each requirement by name.

    Raises
    ------
    ValueError
        For a requirement without one lower bound.
    """
    found = {}
    for entry in declared(settings):
        parts = re.fullmatch(r"([\w-]+)(?:\[[\w,]+\])?>=([\d.]+)", entry)
        if parts is None:
            raise ValueError(f"{entry}: expected name>=version")
        found[parts[1]] = parts[2]
    return found


def main(arguments):
    """Make the environment, say what is in it, and run the tests; the status is pytest's."""
    if not arguments:
        print(__doc__)
        return 2
    folder, tests = Path(arguments[0]).absolute(), arguments[1:]
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    pins = [f"{name}=={version}" for name, version in floors(settings).items()]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "floors.txt").write_text("\n".join(pins) + "\n", encoding="utf-8")
    python = folder / "venv" / "bin" / "python"

    def pip(*words):
        subprocess.run([python, "-m", "pip", "install", "-q", *words], check=True, cwd=ROOT)

    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True)
        pip("-U", "pip")
    wanted = [entry for entry in declared(settings) if not entry.startswith("SALib")]
    pip("-e", ".", *wanted, "-c", str(folder / "floors.txt"))
    print(f"Python {sys.version.split()[0]}, {', '.join(pins)}", flush=True)
    done = subprocess.run(
        # old versions use what newer ones of their own requirements deprecate
        [python, "-m", "pytest", "-W", "ignore::DeprecationWarning", *tests],
        check=False,
        cwd=ROOT,
        env={**os.environ, "FASTSLOW_CACHE": str(folder / "cache")},
    )
    return done.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
