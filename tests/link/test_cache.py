"""What is kept on disk: results come back bit for bit, and nothing outlives what it was made from."""

from __future__ import annotations

import math

import pytest

from ftcc.link import cache
from ftcc.link.cache import kept


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "folder", lambda: tmp_path)
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)


class Asked:
    """Counts how often a function is called."""

    def __init__(self, answer):
        self.answer = answer
        self.times = 0

    def __call__(self, *arguments):
        self.times += 1
        return self.answer(*arguments)


def function(asked):
    @kept
    def of_a_test(*arguments):
        return asked(*arguments)

    return of_a_test


def test_a_result_is_kept_bit_for_bit_for_its_arguments():
    asked = Asked(lambda x: [math.sin(x), 0.1 + 0.2, math.inf, 5e-324, -0.0])
    first, again = function(asked)(0.3), function(asked)(0.3)
    assert [value.hex() for value in first] == [value.hex() for value in again]
    assert asked.times == 1
    assert function(asked)(math.nextafter(0.3, 1.0))[0] != first[0], "other arguments, another result"
    assert asked.times == 2


def test_what_raises_is_asked_again():
    def refuse():
        raise ValueError("no")

    asked = Asked(refuse)
    for _ in range(2):
        with pytest.raises(ValueError, match="no"):
            function(asked)()
    assert asked.times == 2


def test_a_damaged_file_is_made_anew(tmp_path):
    asked = Asked(lambda: 1.5)
    function(asked)()
    (file,) = tmp_path.rglob("*.json")
    file.write_text("[1.0")
    assert (function(asked)(), function(asked)(), asked.times) == (1.5, 1.5, 2)


def test_plain_python_neither_keeps_nor_recalls(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    asked = Asked(lambda: 1.5)
    assert (function(asked)(), function(asked)(), asked.times) == (1.5, 1.5, 2)
    assert not list(tmp_path.iterdir())
