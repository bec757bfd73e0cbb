"""What is kept on disk: results come back bit for bit, and nothing outlives what it was made from."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading

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


def test_an_edit_of_its_own_file_makes_a_result_anew(tmp_path):
    """Also of a file that is not among the sources which name the folder."""
    file = tmp_path / "of_a_test.py"
    source = "from ftcc.link.cache import kept\n@kept\ndef answer(x):\n    return x + 1\n"
    for text, expected in ((source, 2), (source.replace("+ 1", "+ 2"), 3), (source, 2)):
        file.write_text(text)
        module: dict[str, object] = {}
        exec(compile(text, str(file), "exec"), module)
        assert module["answer"](1) == expected
    assert len(list(tmp_path.rglob("*.json"))) == 2


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


# Several processes at one folder.

HOLD = """
import sys, time
from pathlib import Path
from ftcc.link.cache import alone
with alone(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60.0)
"""


@pytest.fixture
def holder(tmp_path):
    """A process that holds the folder, and would do so for a minute."""
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()


def test_who_is_killed_while_it_writes_holds_nobody_up(tmp_path, holder):
    entered = threading.Event()

    def write():
        with cache.alone(tmp_path):
            entered.set()

    writer = threading.Thread(target=write)
    writer.start()
    assert not entered.wait(0.3), "one at a time"
    holder.send_signal(signal.SIGKILL)
    writer.join(20.0)
    assert entered.is_set()


def test_who_waits_says_for_whom(tmp_path, holder, monkeypatch, capsys):
    monkeypatch.setattr(cache, "_SILENT", 0.1)
    monkeypatch.setattr(cache, "_TIMEOUT", 0.3)
    with pytest.raises(cache.CacheBusyError, match=f"process {holder.pid} has held"), cache.alone(tmp_path):
        pass
    said = capsys.readouterr().err
    assert said.count(f"waiting for process {holder.pid}") == 1


def test_what_is_done_alone_may_fail_and_lets_go(tmp_path):
    with pytest.raises(ZeroDivisionError), cache.alone(tmp_path):
        raise ZeroDivisionError
    with cache.alone(tmp_path):
        assert (tmp_path / ".writing").read_text() == str(os.getpid())


@pytest.mark.parametrize("stopped", [True, False], ids=["stopped", "no folder"])
def test_nobody_waits_for_ever_for_a_turn(tmp_path, monkeypatch, stopped):
    """Where another process is stopped, or no file can be made, the same is made twice."""
    monkeypatch.setattr(cache, "_LONGEST_TURN", 0.1)
    place = tmp_path / "function.turn" if stopped else tmp_path / "file" / "function.turn"
    (tmp_path / "file").write_text("not a folder")
    done = []
    with cache.in_turn(place), cache.in_turn(place):
        done.append("both")
    assert done == ["both"]


def test_a_result_that_cannot_be_kept_is_given_all_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "_warned", set())
    (tmp_path / "kept").write_text("a file where a folder should be: nothing can be written below it")
    asked = Asked(lambda: 1.5)
    with pytest.warns(RuntimeWarning, match="Not a directory; set FTCC_CACHE_DIR") as told:
        assert (function(asked)(), function(asked)(), asked.times) == (1.5, 1.5, 2)
    assert len(told) == 1
