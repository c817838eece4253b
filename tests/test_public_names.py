"""What `dir` shows of the public modules."""

import pytest

import fastslow as fs


@pytest.mark.parametrize("module", [fs, fs.plot, fs.systems], ids=lambda m: m.__name__)
def test_dir_shows_public_names_only(module):
    assert dir(module) == sorted(module.__all__)
    assert all(hasattr(module, name) for name in module.__all__)
