"""Who may import whom, what a child process loads, and that truth never reaches control."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from ftcc.airside.flight_path import Own, decode_state
from ftcc.airside.scheme import Heard, Reference
from ftcc.airside.schemes import find
from ftcc.link.mavlink import float_array
from tests.airside.autopilot_bench import Bench, forged
from tests.support.swarm import TRIM, autopilot, vehicle

REPOSITORY = Path(__file__).parents[1]

MAY_IMPORT = {
    "link": {"link"},
    "sim": {"sim", "link"},
    "airside": {"airside", "link"},
    "groundside": {"groundside", "airside", "sim", "link"},
}
"""Our folders: who may import whom."""

ONLY_ON_THE_GROUND = {"pydantic", "typer", "rich", "rerun", "matplotlib"}
"""Libraries that no child process imports, at whatever moment."""

NOT_BEFORE_THE_FORK = ONLY_ON_THE_GROUND | {"zenoh"}


def sources(folder: str) -> list[Path]:
    return sorted((REPOSITORY / folder).rglob("*.py"))


def imports(path: Path) -> Iterator[tuple[int, str]]:
    """Line and full name of every module that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: a relative import hides what is imported"
            assert node.module is not None
            yield node.lineno, node.module
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def named(path: Path) -> Iterator[tuple[int, str]]:
    """Line and name of every module of ours that a file names in a string, as `instantiate` and importlib take them."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            parts = node.value.split(".")
            if parts[0] == "ftcc" and len(parts) > 1 and parts[1] in MAY_IMPORT:
                yield node.lineno, node.value


@pytest.mark.parametrize("folder", MAY_IMPORT)
def test_import_table(folder):
    files = sources(folder)
    assert files
    broken = []
    for path in files:
        for line, name in (*imports(path), *named(path)):
            parts = name.split(".")
            if parts[0] == "tests" or parts[0] in MAY_IMPORT:
                broken.append(f"{path}:{line} imports {name}, which is not installed under that name")
            elif parts[0] == "ftcc" and (len(parts) == 1 or parts[1] not in MAY_IMPORT[folder]):
                broken.append(f"{path}:{line} imports {name}")
    assert not broken, "\n".join(broken)


@pytest.mark.parametrize("folder", ["link", "sim", "airside"])
def test_libraries_of_the_ground_stay_there(folder):
    found = [
        f"{path}:{line} imports {name}"
        for path in sources(folder)
        for line, name in imports(path)
        if name.split(".")[0] in ONLY_ON_THE_GROUND
    ]
    assert not found, "\n".join(found)


def test_two_modules_import_numba():
    """The first sets the cache folder before it does."""
    found = {
        path.relative_to(REPOSITORY).as_posix()
        for folder in MAY_IMPORT
        for path in sources(folder)
        for _, name in imports(path)
        if name.split(".")[0] == "numba"
    }
    assert found == {"link/compiled.py", "link/numba_cache.py"}


def test_what_is_forked_has_loaded_neither_mesh_nor_ground():
    """A child of a process that had opened Zenoh never sends; rerun starts threads."""
    program = (
        "import sys, threading; import ftcc.groundside.swarm.preload\n"
        f"print(*[name for name in {sorted(NOT_BEFORE_THE_FORK)!r} if name in sys.modules])\n"
        "assert threading.active_count() == 1, threading.enumerate()\n"
        "import psutil; assert not psutil.Process().net_connections(), 'a socket is open'"
    )
    finished = subprocess.run(
        [sys.executable, "-c", program],
        env={name: value for name, value in os.environ.items() if name != "FTCC_PRELOAD_SCHEME"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.split() == []


# Inside a wing.


def inner_imports(wing: str) -> dict[str, set[str]]:
    """The modules of a wing, each with those of its own wing that it imports at module level, also for types alone."""
    modules = {
        ".".join(("ftcc", *path.relative_to(REPOSITORY).with_suffix("").parts)).removesuffix(".__init__"): path
        for path in sources(wing)
    }
    imported: dict[str, set[str]] = {}
    for module, path in modules.items():
        names: set[str] = set()
        pending: list[ast.stmt] = ast.parse(path.read_text(encoding="utf-8")).body
        while pending:
            statement = pending.pop()
            if isinstance(statement, ast.If):
                pending += statement.body + statement.orelse
            elif isinstance(statement, ast.Import):
                names |= {alias.name for alias in statement.names}
            elif isinstance(statement, ast.ImportFrom) and statement.module is not None:
                # `from package import name`: the module of that name, where there is one.
                names |= {
                    full if (full := f"{statement.module}.{alias.name}") in modules else statement.module
                    for alias in statement.names
                }
        imported[module] = (names & modules.keys()) - {module}
    return imported


def circles(imported: dict[str, set[str]]) -> list[str]:
    """Take away, again and again, modules that import none of the others, or that none imports: what is left."""
    left = dict(imported)
    while True:
        used = set().union(*left.values())
        ends = [module for module, names in left.items() if module not in used or not names & left.keys()]
        if not ends:
            return sorted(left)
        for module in ends:
            del left[module]


@pytest.mark.parametrize("wing", MAY_IMPORT)
def test_imports_inside_a_wing_form_no_circle(wing):
    assert circles(inner_imports(wing)) == []


def test_a_circle_is_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}) == ["b", "c"]


COLUMNS = 3
"""A literal subscript from here on is the number of a column, which has a name: up to 2 it may be a vector's axis."""


def column_numbers(text: str) -> Iterator[tuple[int, int]]:
    """Line and value of every literal subscript, or bound of a slice, that is a number of a column."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Subscript):
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            for part in parts:
                bounds = [part.lower, part.upper] if isinstance(part, ast.Slice) else [part]
                for bound in bounds:
                    number = bound.operand if isinstance(bound, ast.UnaryOp) else bound
                    if isinstance(number, ast.Constant) and type(number.value) is int and number.value >= COLUMNS:
                        yield node.lineno, number.value


@pytest.mark.parametrize("wing", ["link", "sim", "airside"])
def test_columns_are_read_by_their_names(wing):
    """By `fields`, or by constants made of ``_fields``: a field that moves must not make another number fly."""
    found = [
        f"{path}:{line} has the literal subscript {number}"
        for path in sources(wing)
        for line, number in column_numbers(path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(found)


MOST_POSITIONS = 6
"""Fields that a record of a law may be given by position; an order error of more is a silent error of physics."""


def given_by_position(text: str) -> Iterator[tuple[int, str]]:
    """Line and name of every `State` or `Output` that is made by position, or that is cut into slices."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("State", "Output"):
            starred = any(isinstance(argument, ast.Starred) for argument in node.args)
            if starred or len(node.args) > MOST_POSITIONS:
                yield node.lineno, node.func.id
        sliced = isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice)
        if sliced and isinstance(node.value, ast.Name) and node.value.id in ("state", "s", "output", "law"):
            yield node.lineno, node.value.id


def test_laws_name_their_states_and_outputs():
    found = [
        f"{path}:{line}: {name} by position"
        for path in sources("airside/schemes")
        for line, name in given_by_position(path.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(found)


def test_a_state_by_position_is_found():
    text = "State(*a, b)\nOutput(1, 2, 3, 4, 5, 6, 7)\nstate[4:14]\nState(x=1, y=2)\nOutput(1, 2)\nheard[1:]"
    assert [line for line, _ in given_by_position(text)] == [1, 2, 3]


def test_a_column_number_is_found():
    text = "a[3] + b[i, 4] + c[2] + d[5:] + e[:-6] + f['7'] + g[i + 8]"
    assert sorted(number for _, number in column_numbers(text)) == [3, 4, 5, 6]


# Truth never reaches control.


def test_nothing_on_board_names_the_simulator():
    """It neither imports it, nor names a module of it in a string, nor knows the name of its message to the station."""
    for path in sources("airside"):
        assert not any(name.split(".")[:2] == ["ftcc", "sim"] for _, name in (*imports(path), *named(path))), path
        assert not any(
            isinstance(node, ast.Constant) and node.value == "truth"
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        ), f"{path} names the message that carries the truth to the station"


@pytest.fixture
def runtime(tmp_path, monkeypatch):
    monkeypatch.setenv("FTCC_RUNTIME_DIR", str(tmp_path / "runtime"))


def test_an_autopilot_acts_on_the_messages_and_on_nothing_else(tmp_path, runtime):
    """Forged states, in which no equation of motion holds, are answered by exactly the law applied to them."""
    scheme, spec = find("containment"), autopilot(1)
    law, gains, mission = scheme.module, scheme.gains("flight", {}), Reference(*spec.reference.initial)
    random = np.random.default_rng(1)
    nobody = Heard(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    travel = np.array(vehicle().travel)
    state = None
    with closing(Bench(tmp_path, 19)) as alone, alone as bench:
        for tick in range(20):
            drawn = random.uniform([995.0, 26.0, -0.1, -0.1, -0.3], [1005.0, 34.0, 0.1, 0.2, 0.3])
            message, controls = forged(*drawn), np.float32(random.uniform(-0.5, 0.5, 4)).astype(np.float64)
            answered = bench.answer(tick, message, controls)

            seen = np.zeros(len(Own._fields))
            decode_state(message, tick / 100, controls * travel, seen)
            own = Own(*seen.tolist())
            assert (own.z, own.V) == pytest.approx((drawn[0], drawn[1]), abs=1e-3)
            state = state or law.start(own, nobody, mission, spec.model, gains)
            state, shown = law.step(state, own, nobody, mission, spec.model, gains, 0.01)
            expected = np.float32([0.0, shown.elevator / 0.7, 0.0, shown.thrust / 40.0])
            assert np.array_equal(answered, expected), tick


def test_truth_sent_to_an_autopilot_by_mistake_changes_nothing(tmp_path, runtime):
    level = forged(1000.0, 30.0, 0.0, 0.0322, 0.0)
    force = np.array(TRIM) / np.array([1.0, 0.7, 1.0, 40.0])

    def answers(folder: str, *more: object) -> list[list[float]]:
        with closing(Bench(tmp_path / folder, 9)) as alone, alone as bench:
            return [bench.answer(tick, level, force, *more).tolist() for tick in range(10)]

    assert answers("with", float_array(0, "truth", [1.0] * 40)) == answers("without")
