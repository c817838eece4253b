"""The hook that puts machine code into a wheel, without the compilation, which takes minutes."""

import importlib.util
import sys
import types
from pathlib import Path

import pytest

import fastslow.wheel
from fastslow.compiled import shipped, store

ROOT = Path(__file__).parents[2]


@pytest.fixture
def hook(monkeypatch):
    pytest.importorskip("hatchling")
    path = ROOT / "fastslow" / "compiled" / "build.py"
    spec = importlib.util.spec_from_file_location("build_of_the_wheel", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    said = []
    app = types.SimpleNamespace(display_info=said.append, display_warning=said.append)
    made = object.__new__(module.CompiledLoops)
    monkeypatch.setattr(module.CompiledLoops, "app", app, raising=False)
    monkeypatch.setattr(module.CompiledLoops, "root", str(ROOT), raising=False)
    monkeypatch.setattr(module.CompiledLoops, "target_name", "wheel", raising=False)
    return types.SimpleNamespace(run=made.initialize, finish=made.finalize, said=said)


def data():
    return {"force_include": {}, "pure_python": True, "tag": None}


def test_objects_go_into_the_wheel(hook, monkeypatch):
    monkeypatch.delenv("FASTSLOW_BUILD", raising=False)
    monkeypatch.setattr(fastslow.wheel, "compiled", lambda entry, _: entry.name.encode())
    before = list(sys.path)
    build = data()
    hook.run("standard", build)
    assert sys.path == before
    assert not build["pure_python"]
    assert build["tag"].startswith("py3-none-")
    names = {Path(inside).name for inside in build["force_include"].values()}
    wanted = {f"{entry.name}{store.SUFFIX}" for entry in fastslow.wheel.entries()}
    assert names == {*wanted, shipped.PLATFORM}
    for file, inside in build["force_include"].items():
        assert Path(inside).parent == Path("fastslow/compiled/objects")
        if Path(file).name != shipped.PLATFORM:
            content = store.unwrapped(Path(file).stem, Path(file).read_bytes())
            assert content == Path(file).stem.encode()
    hook.finish("standard", build, "")
    assert not any(Path(file).exists() for file in build["force_include"])


@pytest.mark.parametrize(("version", "variable"), [("editable", ""), ("standard", "none")])
def test_a_wheel_without_machine_code(hook, monkeypatch, version, variable):
    monkeypatch.setenv("FASTSLOW_BUILD", variable)
    build = data()
    hook.run(version, build)
    assert build == data()


def test_a_build_that_fails_makes_a_wheel_without_machine_code(hook, monkeypatch):
    def failing(entry, reason):
        raise ImportError("no module named numba")

    monkeypatch.delenv("FASTSLOW_BUILD", raising=False)
    monkeypatch.setattr(fastslow.wheel, "compiled", failing)
    build = data()
    hook.run("standard", build)
    assert build == data()
    assert any("holds no machine code" in text for text in hook.said)
