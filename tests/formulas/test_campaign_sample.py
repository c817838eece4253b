"""A sample of the campaign of random texts."""

import pytest

from tests.campaigns.text import campaign, entries

pytestmark = pytest.mark.slow


def test_every_text_has_an_answer_or_one_of_our_errors():
    report = campaign(60, seed=7, everywhere=0)
    assert not report.failures, str(report)
    assert report.calls == 240
    assert report.answered > 24
    assert set(report.refused) >= {"ArgumentError", "ModelError", "UnknownNameError"}


def test_what_is_right_is_answered(tmp_path, monkeypatch):
    """Every entry point takes some text."""
    monkeypatch.chdir(tmp_path)
    known = entries()
    good = {
        "Model rate": "-x*D",
        "Model law": "sin(t)",
        "Model slow rate": "x",
        "Model interface": "x - D",
        "Model region": "x > 0",
        "Model period": "2*pi",
        "Model name": "speed",
        "Model parameter": "speed",
        "frozen path": "2*g**2",
        "with_free": "D",
        "with_ramp": "D",
        "with_parameters": "D",
        "run.section interface": "x - D",
        "run.hits": "x - D",
        "run.at": "t",
        "diagram.at": "w",
        "overlay path": "g",
        "derive assume": "D > 0",
        "derive parameter": "D",
        "continue parameter": "D",
        "map parameters": "41.67 + a + b",
        "scale": "x",
        "section": "x*v",
        "curve": "x*p",
        "run.section": "x*v - D",
        "reduce": "-x",
        "combine": "x + v",
        "sweep section": "v",
        "compare": "k",
        "drift": "0.1 + w",
        "read_auto": "'load'",
        "read_auto names": "load",
    }
    for name, entry in known.items():
        assert entry(good.get(name, "x")) is not None, name
