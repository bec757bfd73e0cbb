"""What is expected of any command line: help with examples, versions, completion, colours, narrow terminals."""

from __future__ import annotations

import importlib.metadata
import json
import os
import pty
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from ftcc.groundside import Run
from ftcc.groundside.cli import app, common, main

FTCC = [sys.executable, "-m", "ftcc.groundside.cli"]
COLOUR = re.compile(r"\x1b\[(\d+;)*(3[0-8]|4[0-8]|9\d|10[0-7])(;\d+)*m")
"""SGR with a colour of letters or ground."""
Outcome = tuple[int, str, str]


@pytest.fixture
def ftcc(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    """Run a command in this process: exit code, standard output, standard error."""

    def run(*arguments: str) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["ftcc", *arguments])
        code = 0
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def commands(command: Any, path: tuple[str, ...] = ("ftcc",)) -> Iterator[tuple[tuple[str, ...], Any]]:
    yield path, command
    for name, one in getattr(command, "commands", {}).items():
        yield from commands(one, (*path, name))


ALL = dict(commands(typer.main.get_command(app)))


@pytest.mark.parametrize("path", ALL, ids=" ".join)
def test_help_fits_and_ends_with_an_example_that_the_parser_takes(
    path: tuple[str, ...], ftcc: Callable[..., Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = ftcc(*path[1:], "--help")
    assert code == 0
    assert max(map(len, out.splitlines())) <= 80
    title, example = out.splitlines()[-2:]
    assert title == "Example:"
    words = shlex.split(example)
    assert tuple(words[: len(path)]) == path

    whole = typer.main.get_command(app)
    context = whole.make_context("ftcc", words[1:])
    command, rest = whole, words[1:]
    while getattr(command, "commands", None):
        name, command, rest = command.resolve_command(context, rest)
        context = command.make_context(name, rest, parent=context)
        rest = [*getattr(context, "_protected_args", ()), *context.args]
    assert rest == [], f"{example}: not taken: {rest}"


def test_an_example_with_an_option_that_does_not_exist_would_be_noticed() -> None:
    with pytest.raises(Exception, match="--loudly"):
        ALL["ftcc", "fly"].make_context("fly", ["demo", "--loudly"])


def test_version_tells_what_matters_for_people_and_for_machines(ftcc: Callable[..., Outcome]) -> None:
    code, out, _ = ftcc("--version", "--json")
    assert code == 0
    told = json.loads(out)
    for name in ("ftcc-sitl", "pymavlink", "numba", "numpy", "scipy", "eclipse-zenoh", "rerun-sdk"):
        assert told[name] == importlib.metadata.version(name)
    assert told["python"] == ".".join(map(str, sys.version_info[:3]))
    assert sys.platform in told["platform"].lower()
    code, out, _ = ftcc("--version")
    assert code == 0
    assert out.splitlines() == [f"{name} {version}" for name, version in told.items()]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--json"], "--version"),
        (["--version", "list"], "takes no command"),
        (["--no-color"], "no command given"),
    ],
)
def test_what_makes_no_sense_before_a_command_is_refused(
    arguments: list[str], why: str, ftcc: Callable[..., Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NO_COLOR", "")
    code, out, err = ftcc(*arguments)
    assert (code, out) == (2, "")
    assert why in err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("ftcc fl", {"fly"}),
        ("ftcc link c", {"cut"}),
        ("ftcc fly --clo", {"--clock"}),
        ("ftcc simulate fire", {"fire_monitoring", "fire_monitoring_sixdof"}),
    ],
)
def test_the_shell_completes_commands_options_and_scenarios(words: str, expected: set[str]) -> None:
    asked = {"COMP_WORDS": words, "COMP_CWORD": str(words.count(" ")), "_FTCC_COMPLETE": "complete_bash"}
    program = "import sys; sys.argv = ['ftcc']; from ftcc.groundside.cli import main; main()"
    answered = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, **asked}, capture_output=True, text=True, check=False
    )
    assert set(answered.stdout.split()) == expected


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_is_told_how_to_complete(shell: str) -> None:
    program = "import sys; sys.argv = ['ftcc']; from ftcc.groundside.cli import main; main()"
    environment = {**os.environ, "_FTCC_COMPLETE": f"source_{shell}"}
    told = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    ).stdout
    assert f"_FTCC_COMPLETE=complete_{shell}" in told


def on_a_terminal(arguments: list[str], **environment: str) -> str:
    """What a command prints on a terminal of 80 columns."""
    child, terminal = pty.fork()
    if child == 0:
        os.environ.pop("NO_COLOR", None)
        os.environ |= {"TERM": "xterm-256color", "COLUMNS": "80", **environment}
        os.execv(FTCC[0], [*FTCC, *arguments])
    said = b""
    try:
        while read := os.read(terminal, 65536):
            said += read
    except OSError:
        pass  # How a terminal ends on Linux.
    os.waitpid(child, 0)
    return said.decode()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="terminals end otherwise elsewhere")
def test_colours_are_left_out_where_they_are_not_wanted(demo_run: Run) -> None:
    for command in (["report", str(demo_run.path), "--no-page"], ["check", "nowhere"]):
        assert COLOUR.search(on_a_terminal(command))
        assert not COLOUR.search(on_a_terminal(["--no-color", *command]))
        assert not COLOUR.search(on_a_terminal(command, NO_COLOR="1"))


@pytest.mark.skipif(sys.platform != "linux", reason="terminals end otherwise elsewhere")
def test_progress_has_no_colours_either(tmp_path: Path) -> None:
    flown = ["simulate", "demo", "--duration", "2", "--out", str(tmp_path / "run")]
    said = on_a_terminal(["--no-color", *flown])
    assert "simulating demo" in said
    assert not COLOUR.search(said)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ["list"],
        ["airframe"],
        ["failures"],
        ["failures", "fire_monitoring"],
        ["commands"],
        ["report", "RUN", "--no-page"],
        ["compare", "RUN", "RUN", "--out", "OUT"],
    ],
    ids=lambda command: command[0],
)
def test_no_word_is_cut_and_no_digit_lost_on_a_narrow_terminal(
    command: list[str],
    ftcc: Callable[..., Outcome],
    demo_run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    arguments = [{"RUN": str(demo_run.path), "OUT": str(tmp_path)}.get(word, word) for word in command]
    _, wide, _ = ftcc(*arguments)

    def words(text: str) -> set[str]:
        return set(re.findall(r"[^\s┃│━┡╇┩└┴┘┏┳┓─┠╂┨:·]+", text))

    for columns in (80, 60):
        monkeypatch.setattr(common, "_PIPE_WIDTH", columns)
        _, narrow, _ = ftcc(*arguments)
        # Headings of first columns are not repeated where each row is a paragraph.
        assert words(wide) - words(narrow) <= {"scenario", "claim", "plant", "MAV_CMD", "message"}
        lines = narrow.splitlines()
        tables = [line for line in lines if not line.startswith(("verdict", "  "))]
        assert max(map(len, tables)) <= columns


def test_failures_tells_what_the_aircraft_of_a_scenario_have(ftcc: Callable[..., Outcome]) -> None:
    _, whole, _ = ftcc("failures")
    assert "102 SYSTEM_SERVO: 1 aileron, 2 elevator, 3 rudder; 0 all" in whole
    rows = {line.split()[0]: line for line in whole.splitlines() if line[:1].isalpha()}
    assert re.search(r"longitudinal +- +elevator +- +thrust +active, containment, demo", rows["longitudinal"])
    assert re.search(r"position +bank +load factor +- +thrust +fire_monitoring", rows["position"])
    for arguments, servos in (
        (["containment"], "2 elevator; 0 all"),
        (["containment", "--variant", "sixdof"], "1 aileron, 2 elevator, 3 rudder; 0 all"),
        (["fire_monitoring"], "1 bank, 2 load factor; 0 all"),
    ):
        code, out, _ = ftcc("failures", *arguments)
        assert code == 0
        assert f"102 SYSTEM_SERVO: {servos}\n" in out
        assert "Actuators of each kind" not in out
    code, _, err = ftcc("failures", "--variant", "off")
    assert code == 2
    assert "need a scenario" in err
    code, _, err = ftcc("failures", "nowhere")
    assert code == 2
    assert "nowhere" in err
