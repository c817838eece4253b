"""The README's example runs, and its commands are the ones that the checks run."""

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (example,) = blocks("python")
    names = {}
    exec(compile(example, "README.md", "exec"), names)
    assert (tmp_path / "gear.pdf").stat().st_size > 10_000
    assert [point["w"] for point in names["diagram"].folds] == pytest.approx(
        [0.0894402097712473, -0.0894402097712473], abs=1e-12
    )
    assert {t.type for t in names["overlay"].transitions} == {"jump"}
    assert names["run"].regime == "bilateral"


def test_two_commands_of_one_line_each():
    commands = blocks("sh")
    assert len(commands) == 2
    for command in commands:
        assert command.count("\n") == 1
        assert command.startswith("python3 -m venv .venv && .venv/bin/pip install")


def test_the_check_script_runs_the_test_command():
    pattern = re.search(r"grep -m 1 '(.*)' README\.md", (ROOT / ".ci/run").read_text())
    found = re.search(pattern[1], README, flags=re.MULTILINE)
    assert found[0] == blocks("sh")[1].strip()


def test_the_animation_and_the_figure_are_there():
    figures = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert [Path(name).suffix for name in figures] == [".gif", ".png"]
    assert all((ROOT / name).is_file() for name in figures)
