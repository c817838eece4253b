"""What is compiled ahead is not compiled again."""

import os
import subprocess
import sys

import pytest

import fastslow as fs
from fastslow.kernels.compiler import store

pytestmark = pytest.mark.slow

MODEL = """
import sympy as sp, fastslow as fs
x, v, t, w, D = sp.symbols("x v t w D")
gap = sp.Piecewise((x - D, x > D), (0, True))
model = fs.Model({x: v, v: w - v - gap}, forcing={w: sp.sin(t)}, parameters={D: 0.25})
"""

#: Of the frozen model the load has no value.
AHEAD = MODEL + "print(fs.precompile(model, model.frozen()))"
USE = MODEL + (
    "other = model.with_parameters(D=0.5);"
    "fs.simulate(other, [0, 0], periods=1);"
    "fs.simulate(other.frozen().with_parameters(w=0.1), [0, 0], t=(0, 1));"
    "fs.continue_equilibria(other.frozen(), 'w', (-1, 1))"
)


def test_a_precompiled_model_is_compiled_once(tmp_path):
    environment = {**os.environ, "FASTSLOW_CACHE": str(tmp_path)}

    def run(program):
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    assert run(AHEAD) == str(tmp_path)
    before = {p.name for p in tmp_path.rglob("*.code")}
    assert any("series" in name for name in before)
    assert any("field" in name for name in before)
    run(USE)
    assert {p.name for p in tmp_path.rglob("*.code")} == before


def test_where_nothing_can_be_kept_there_is_nothing_to_compile_ahead(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("FASTSLOW_CACHE", str(tmp_path / "file"))
    monkeypatch.setattr(store, "_own_directory", lambda: None)
    monkeypatch.setattr(store, "_warned", set())
    with (
        pytest.warns(RuntimeWarning, match="kept in memory alone"),
        pytest.raises(fs.FileError, match="name one by the environment variable FASTSLOW_CACHE"),
    ):
        fs.precompile()
