"""The hook that makes machine code when the package is installed, tried with two short loops."""

import importlib.util
import sys
import types
from pathlib import Path

import pytest

import fastslow.wheel
from fastslow.continuation.loops import LOOPS
from fastslow.kernels import loops
from fastslow.kernels.compiler import shipped, store

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
TWO = [LOOPS["value_at"], LOOPS["eigenvalues_of_2x2"]]


@pytest.fixture(scope="module")
def code():
    """Machine code of the two loops by their names, made here."""
    return {loop.name: loops.compiled(loop, "for a test") for loop in TWO}


@pytest.fixture
def hook(monkeypatch, tmp_path):
    pytest.importorskip("hatchling")
    path = ROOT / "fastslow" / "kernels" / "compiler" / "build.py"
    spec = importlib.util.spec_from_file_location("build_of_the_wheel", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    said = []
    app = types.SimpleNamespace(display_info=said.append, display_warning=said.append)
    made = object.__new__(module.CompiledLoops)
    (tmp_path / "fastslow" / "kernels").mkdir(parents=True)
    monkeypatch.setattr(module.CompiledLoops, "app", app, raising=False)
    monkeypatch.setattr(module.CompiledLoops, "root", str(tmp_path), raising=False)
    monkeypatch.setattr(module.CompiledLoops, "target_name", "wheel", raising=False)
    monkeypatch.delenv("FASTSLOW_BUILD", raising=False)
    monkeypatch.setattr(fastslow.wheel, "entries", lambda: iter(TWO))
    objects = tmp_path / "fastslow" / "kernels" / "objects"
    return types.SimpleNamespace(run=made.initialize, objects=objects, said=said)


@pytest.fixture
def files(hook, code):
    """Files of the two loops, as an earlier run of the hook left them."""
    hook.objects.mkdir()
    found = []
    for name, content in code.items():
        found.append(hook.objects / f"{name}{store.SUFFIX}")
        found[-1].write_bytes(store.wrapped(name, content))
    return found


def data():
    return {"force_include": {}, "pure_python": True, "tag": None}


def test_objects_are_made_and_go_into_the_wheel(hook, code):
    before = list(sys.path)
    build = data()
    hook.run("standard", build)
    assert sys.path == before
    assert not build["pure_python"]
    assert build["tag"].startswith("py3-none-")
    names = {f"{name}{store.SUFFIX}" for name in code} | {shipped.PLATFORM}
    inside = {str(hook.objects / name): f"fastslow/kernels/objects/{name}" for name in names}
    assert build["force_include"] == inside
    for name in code:
        content = (hook.objects / f"{name}{store.SUFFIX}").read_bytes()
        assert store.unwrapped(name, content) == code[name]


@pytest.mark.usefixtures("files")
def test_an_editable_installation_finds_the_objects_in_the_checkout(hook, code, monkeypatch):
    build = data()
    hook.run("editable", build)
    assert build == data()
    monkeypatch.setattr(shipped, "FOLDER", hook.objects)
    for name in code:
        assert shipped.read(name) == code[name]
    assert (hook.objects / shipped.PLATFORM).exists()


def test_objects_are_made_again_only_where_they_do_not_fit(hook, files):
    whole, damaged = files
    content, when = damaged.read_bytes(), whole.stat().st_mtime_ns
    damaged.write_bytes(content[:-1])
    of_other_sources = hook.objects / f"pairs_0123{store.SUFFIX}"
    of_other_sources.write_bytes(content)
    hook.run("editable", data())
    assert whole.stat().st_mtime_ns == when
    assert damaged.read_bytes() == content
    assert not of_other_sources.exists()


def test_no_machine_code_is_made_where_it_is_not_wanted(hook, monkeypatch):
    monkeypatch.setenv("FASTSLOW_BUILD", "none")
    build = data()
    hook.run("standard", build)
    assert build == data()
    assert not hook.objects.exists()


def test_a_build_that_fails_makes_a_wheel_without_machine_code(hook, monkeypatch):
    def failing():
        raise ImportError("no module named numba")

    monkeypatch.setattr(fastslow.wheel, "entries", failing)
    build = data()
    hook.run("standard", build)
    assert build == data()
    assert any("holds no machine code" in text for text in hook.said)
