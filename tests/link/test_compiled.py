"""Compilation: an edit anywhere takes effect at the next start, and compiled and plain Python are the same flight."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import types
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pytest

import ftcc.link
from ftcc.link import cache
from ftcc.link.compiled import (
    Room,
    Vector,
    compiled,
    copy,
    fields,
    fill,
    instantiate,
    moved,
    store,
    width,
)
from ftcc.link.numba_cache import CacheFile
from tests.support.swarm import AIRFRAME

REPOSITORY = Path(__file__).parents[2]
PACKAGES = Path(ftcc.link.__file__).parents[1]


def run(arguments: list[str], **environment: str) -> str:
    finished = subprocess.run(
        [sys.executable, *arguments],
        cwd=REPOSITORY,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout.strip()


class Package:
    """A copy of the product's sources with a caller of an element, started anew for every question."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "ftcc"
        self.cache = folder / "cache"
        for name in ("link", "sim", "airside"):
            shutil.copytree(PACKAGES / name, self.root / name, ignore=shutil.ignore_patterns("__pycache__"))
        (self.root / "airside" / "caller.py").write_text(
            "from ftcc.airside.elements.neighbours import extrapolated\n"
            "from ftcc.link.compiled import compiled\n"
            "@compiled\n"
            "def law(value, rate, age):\n"
            "    return extrapolated(value, rate, age, 0.5)\n"
        )
        self.element = self.root / "airside" / "elements" / "neighbours.py"

    def start(self) -> tuple[float, int, str]:
        """Value of the law, how often it had to be compiled, the cache folder in use."""
        program = (
            "from ftcc.airside import caller; from ftcc.link.numba_cache import cache_folder\n"
            f"assert caller.__file__.startswith({str(self.root)!r}), caller.__file__\n"
            "value = caller.law(10.0, 2.0, 0.25)\n"
            "print(value, sum(caller.law.stats.cache_misses.values()), cache_folder)"
        )
        answer = run(
            ["-c", program],
            PYTHONPATH=str(self.root.parent),
            FTCC_CACHE_DIR=str(self.cache),
            NUMBA_DISABLE_JIT="0",
            PYTHONDONTWRITEBYTECODE="1",
        ).split()
        return float(answer[0]), int(answer[1]), answer[2]


def test_an_edited_element_takes_effect_at_the_next_start(tmp_path):
    """numba's own cache would go on flying the old element: only its caller's file counts there."""
    package = Package(tmp_path)
    value, compilations, folder = package.start()
    assert (value, compilations) == (10.5, 1)
    assert package.start() == (10.5, 0, folder), "an unchanged program is not compiled again"

    source = package.element.read_text()
    edited = source.replace("return value + rate * min(age, horizon)", "return value - rate * min(age, horizon)")
    assert edited != source
    package.element.write_text(edited)
    value, compilations, other = package.start()
    assert (value, compilations) == (9.5, 1)
    assert other != folder

    package.element.write_text(source)
    assert package.start() == (10.5, 0, folder), "the way back is in the cache still"


def test_processes_that_compile_one_function_for_other_types_at_once_each_find_their_own_code(tmp_path):
    """In numba's own way one overwrites what another has just written, or leaves an index that names it."""
    program = (
        "import sys\n"
        "from ftcc.link.numba_cache import CacheFile\n"
        f"file = CacheFile({str(tmp_path)!r}, 'law-1.py', (0.0, 0))\n"
        "print('ready', flush=True)\n"
        "sys.stdin.readline()\n"
        "for n in range(30):\n"
        "    file.save((sys.argv[1], n), f'code of {sys.argv[1]}, {n}')\n"
    )
    environment = {**os.environ, "FTCC_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, "-c", program]
    others = [
        subprocess.Popen(
            [*command, str(who)], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for who in range(3)
    ]
    assert [other.stdout.readline() for other in others] == ["ready\n"] * 3
    for other in others:
        other.stdin.write("go\n")
        other.stdin.flush()
    assert [other.wait(60.0) for other in others] == [0, 0, 0]
    file = CacheFile(str(tmp_path), "law-1.py", (0.0, 0))
    for who in range(3):
        for n in range(30):
            assert file.load((str(who), n)) == f"code of {who}, {n}"


def test_of_processes_that_need_the_same_function_at_once_one_compiles_it(tmp_path):
    (tmp_path / "own.py").write_text(
        "import sys\n"
        "import numpy as np\n"
        "from ftcc.link.compiled import compiled, copy\n"
        "@compiled\ndef both(values):\n    copy(values, values)\n    copy(values, values[1:])\n"
        "print('ready', flush=True)\n"
        "sys.stdin.readline()\n"
        "both(np.zeros(3))\n"
        "print(*(sum(one.stats.cache_misses.values()) for one in (both, copy.within)))\n"
    )
    environment = {**os.environ, "FTCC_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0"}
    command = [sys.executable, str(tmp_path / "own.py")]
    others = [
        subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    assert [other.stdout.readline() for other in others] == ["ready\n"] * 3
    for other in others:
        other.stdin.write("go\n")
        other.stdin.flush()
    compiled_here = [other.communicate(timeout=120.0)[0].split() for other in others]
    assert sorted(compiled_here) == [["0", "0"], ["0", "0"], ["1", "1"]]


def test_what_somebody_compiles_with_numba_itself_is_kept_there_too(tmp_path):
    (tmp_path / "own.py").write_text(
        "import ftcc.link.compiled\nimport numba\n"
        "@numba.njit('int64(int64)', cache=True)\ndef successor(n):\n    return n + 1\n"
        "print(successor(3), sum(successor.stats.cache_hits.values()))\n"
    )
    for hits in (0, 1):
        assert run([str(tmp_path / "own.py")], FTCC_CACHE_DIR=str(tmp_path / "cache")) == f"4 {hits}"


def test_a_cache_that_another_process_holds_for_ever_costs_the_kept_code_alone(tmp_path, monkeypatch):
    def never(place):
        raise cache.CacheBusyError("process 7 has held it")

    monkeypatch.setattr(cache, "alone", never)
    file = CacheFile(str(tmp_path), "law-1.py", (0.0, 0))
    with pytest.warns(RuntimeWarning, match=r"compiled code cannot be kept.*: process 7 has held it"):
        file.save(("key", 1), "code")
    assert file.load(("key", 1)) is None


@compiled
def shifted(values, by):
    return values[0] + by


@compiled
def shifted_twice(values, by):
    return shifted(values, by) + shifted(values, by)


def test_only_what_python_calls_gets_what_unpacks_its_objects():
    values = np.array([1.0])
    assert shifted_twice(values, 2.0) == 6.0
    if isinstance(shifted, types.FunctionType):
        pytest.skip("plain Python has no such functions")
    assert shifted.signatures == []
    assert shifted(values, 2.0) == 3.0  # a call from Python compiles it for Python
    for function, unpacks in ((shifted.within, False), (shifted, True)):
        (made,) = function.overloads.values()
        unpacking = made.library.get_pointer_to_function(made.fndesc.llvm_cpython_wrapper_name)
        assert bool(unpacking) is unpacks


def test_what_need_not_be_compiled_is_known_before_it_is_called(tmp_path):
    """As of the vehicles' flight, which the launcher compiles beside the autopilots' where it has to."""
    asked = (
        "import numpy as np\n"
        "from ftcc.link.compiled import copy, is_kept\n"
        "print(is_kept(copy), is_kept(len))\n"
        "copy(np.zeros(1), np.zeros(1))\n"
    )
    environment = {"FTCC_CACHE_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "0"}
    assert [run(["-c", asked], **environment) for _ in range(2)] == ["False True", "True True"]


def test_damaged_code_is_compiled_again(tmp_path):
    file = CacheFile(str(tmp_path), "law-1.py", (0.0, 0))
    file.save("key", "code")
    for path in tmp_path.glob("law-1.py.*"):
        whole = path.read_bytes()
        path.write_bytes(whole[:-5])
        assert file.load("key") is None
        file.save("key", "code")
        assert (file.load("key"), path.read_bytes()) == ("code", whole)


def test_old_caches_are_cleared_away(tmp_path):
    base = tmp_path / "compiled"
    for n in range(9):
        (base / f"old{n}").mkdir(parents=True)
        os.utime(base / f"old{n}", (n, n))
    run(["-c", "import ftcc.link.compiled"], FTCC_CACHE_DIR=str(tmp_path))
    assert len(list(base.iterdir())) == 6
    assert not (base / "old3").exists()
    assert (base / "old8").exists()


@pytest.mark.parametrize(("form", "seconds"), [("flight", 1.5), ("monograph", 0.2)])
def test_a_flight_in_plain_python_has_the_same_bits(form, seconds):
    """Law, plant, channel, noise and both codecs, of eight UAVs amid loss, noise, a cut, a fault and disturbances."""
    flight = ["-m", "tests.support.swarm", form, str(seconds)]
    assert run(flight, NUMBA_DISABLE_JIT="1") == run(flight, NUMBA_DISABLE_JIT="0")


def test_a_template_gives_instances_of_its_own(tmp_path, monkeypatch):
    (tmp_path / "template_of_a_test.py").write_text(
        "from ftcc.link.compiled import compiled\n"
        "element = globals()['element']\n"
        "@compiled\n"
        "def twice(x):\n"
        "    return element(x) + element(x)\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))

    @compiled
    def half(x):
        return 0.5 * x

    @compiled
    def square(x):
        return x * x

    first = instantiate("template_of_a_test", "half", element=half)
    second = instantiate("template_of_a_test", "square", element=square)
    assert first is not second
    assert (first.twice(3.0), second.twice(3.0)) == (3.0, 18.0)
    assert instantiate("template_of_a_test", "half", element=square) is first, "a name stands for one instance"


@pytest.mark.parametrize(
    "template", ["ftcc.airside.stages", "ftcc.sim.cycle", "ftcc.groundside.simulation.flight_loop"]
)
def test_a_template_says_what_it_is_when_imported_plainly(template):
    with pytest.raises(ImportError, match="is a template: use"):
        __import__(template)


def test_a_template_that_does_not_exist_is_named():
    with pytest.raises(ImportError, match="no_such_template"):
        instantiate("no_such_template", "x")


def test_records_and_vectors_are_inverse_to_each_other():
    vector = np.zeros(len(AIRFRAME) + 4)
    store(AIRFRAME, vector)
    assert fields(type(AIRFRAME), vector) == AIRFRAME
    assert not vector[len(AIRFRAME) :].any()


def test_copy_and_fill():
    target = np.zeros(5)
    copy(np.array([1.0, 2.0, 3.0]), target)
    assert target.tolist() == [1.0, 2.0, 3.0, 0.0, 0.0]
    fill(target, 7.0)
    assert (target == 7.0).all()


class Plane(NamedTuple):
    x: float
    z: float


@compiled
def _moved(values):
    state = fields(Plane, values)
    store(moved(state, 0.5, (state.z, 3.0)), values)


@pytest.mark.parametrize("function", [_moved, getattr(_moved, "py_func", _moved)], ids=["compiled", "plain"])
def test_a_record_moves_along_its_rates(function):
    values = np.array([1.0, 2.0])
    function(values)
    assert values.tolist() == [2.0, 3.5]


class Mixed(NamedTuple):
    """A record of everything that `fields` knows."""

    a: float
    v: Vector
    table: Annotated[np.ndarray, Room((2, 3))]
    b: Annotated[float, "with a note"]
    row: Annotated[np.ndarray, Room((2,))]


@compiled
def _turned(values):
    before = fields(Mixed, values)
    before.table[1, 2] += before.v[1]
    store(Mixed(before.b, (before.v[2], before.v[0], before.v[1]), before.table, before.a, before.row), values)


@pytest.mark.parametrize("function", [_turned, getattr(_turned, "py_func", _turned)], ids=["compiled", "plain"])
def test_records_of_floats_vectors_and_arrays_lie_in_one_vector(function):
    assert width(Mixed) == 13
    values = np.arange(13.0)
    function(values)
    assert values.tolist() == [10, 3, 1, 2, 4, 5, 6, 7, 8, 9 + 2, 0, 11, 12]


@compiled
def _begun(values):
    store(Mixed(1.0, (2.0, 3.0, 4.0), 0.0, 5.0, 6.0), values)


@pytest.mark.parametrize("function", [_begun, getattr(_begun, "py_func", _begun)], ids=["compiled", "plain"])
def test_a_number_in_the_place_of_an_array_fills_it(function):
    values = np.full(14, -1.0)
    function(values)
    assert values.tolist() == [1, 2, 3, 4, 0, 0, 0, 0, 0, 0, 5, 6, 6, -1]
