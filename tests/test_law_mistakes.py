"""Mistakes in a law of one's own: each is met by one sentence with file and line, without a traceback."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from ftcc.airside import schemes
from ftcc.airside.autopilots import build
from ftcc.airside.compiled_stages import placeholder, stages_of
from ftcc.airside.flight_path import Own
from ftcc.airside.law_errors import describe_error
from ftcc.airside.model import Model
from ftcc.airside.scheme import Heard, Reference
from ftcc.groundside import ScenarioError, load, resolve
from ftcc.groundside.cli import main
from ftcc.link.timing import Timing
from tests.support.guests import EXAMPLE, forget_schemes, install

SCENARIO = EXAMPLE / "consensus.toml"
LAW = (EXAMPLE / "altitude_consensus.py").read_text().replace("from typing", "import numpy as np\n\nfrom typing", 1)
BEFORE = "    h = gains.k_I * dt\n"
"""A line of ``step``, before which mistakes are put."""


def law(*changes: tuple[str, str]) -> tuple[str, int]:
    """The example with changes, and the line of the last one."""
    text = LAW
    for old, new in changes:
        assert text.count(old) == 1, old
        unchanged, text = text, text.replace(old, new)
        at = next(n for n, (a, b) in enumerate(zip(unchanged.splitlines(), text.splitlines()), 1) if a != b)
    return text, at


def before(line: str) -> tuple[str, int]:
    return law((BEFORE, f"    {line}\n{BEFORE}"))


SEEN_BEFORE = {
    "short_signature": (
        law(("def step(s, own, heard, reference, model, gains, dt)", "def step(s, own, heard, model, gains, dt)")),
        "step(s, own, heard, model, gains, dt) takes 6 arguments; it is called as "
        "step(state, own, heard, reference, model, gains, dt)",
    ),
    "three_commands": (
        law(('COMMANDS = ("thrust", "elevator")', 'COMMANDS = ("thrust", "elevator", "rudder")')),
        "Output must begin with the commands thrust, elevator, rudder, as COMMANDS lists them; "
        "it has thrust, elevator, S1, S2",
    ),
    "one_command": (
        law(("Output(thrust, elevator, S1, S2)", "Output(thrust, S1, S2)")),
        "in step: Output is made of 3 values; it has 4: thrust, elevator, S1, S2 (the commands thrust, elevator first)",
    ),
    "no_actuator": (
        law(('COMMANDS = ("thrust", "elevator")', 'COMMANDS = ("thrust", "elevater")')),
        "COMMANDS names elevater, which is no actuator; did you mean elevator?",
    ),
    "only_output": (
        law(("return trim, Output(thrust, elevator, S1, S2)", "return Output(thrust, elevator, S1, S2)")),
        "step returns Output alone; it must return the next State and the Output (State, Output)",
    ),
    "shares_two": (
        law(("return (state.z_r,)", "return (state.z_r, 0.0)")),
        'share returns 2 values; it must return the values of SHARED["follower"] (z_r)',
    ),
    "misspelt_gain": (
        law(("gains.k_theta *", "gains.k_thet *")),
        "in step: gains.k_thet is no gain; did you mean k_theta?",
    ),
    "misspelt_switch": (law(('{"k_I": 0.0}', '{"k_i": 0.0}')), "names k_i, which is no gain; did you mean k_I?"),
    "misspelt_own": (law(("own.V - reference.V", "own.v - reference.V")), "own.v is no field of Own; did you mean V?"),
    "no_python": (before("h ="), "invalid syntax"),
    "no_module": (law(("from typing import", "import nothing_there\nfrom typing import")), "No module named"),
}
"""Found before anything is compiled or flown."""

RAISED = {
    "raises": (
        before('if own.t > 0.5 and own.y < -50.0: raise ValueError("far out")'),
        r"in step: far out \(UAV 2, t = 0\.51 s\)",
    ),
    "no_such_name": (before("h = delta"), r"in step: name 'delta' is not defined \(UAV 1, t = 0 s\)"),
    "beyond_the_end": (before("h = heard.values[7, 0]"), r"in step: index 7 is out of bounds .*\(UAV 1, t = 0 s\)"),
}
"""Found in flight; plain Python shows them as compiled code does, but for the last, which that does not notice."""

DIVERGES = {
    "gives_nan": (
        before('if own.t > 0.5 and own.y < -70.0: elevator = float("nan")'),
        (3, 0.51, "command elevator = nan"),
    ),
    "blows_up": (
        law(("s.thrust_0 - h * 10.0", "s.thrust_0 + 60.0 * dt * s.thrust_0 - h * 10.0")),
        (1, 0.52, "state thrust_0 = 1.4e[+]12"),
    ),
}

NOT_COMPILED = {
    "makes_array": (
        before("h = np.zeros(3)[0]"),
        "zeros(3) makes an array, which compiled code may not",
    ),
    "helper": (
        law(
            ("@compiled\ndef start", "def half(x):\n    return x / 2.0\n\n\n@compiled\ndef start"),
            (BEFORE, "    h = half(dt)\n"),
        ),
        "half is not @compiled, so compiled code cannot call it",
    ),
    "forgotten": (law(("@compiled\ndef step", "def step")), "step is without @compiled; put it"),
}
"""These laws fly as plain Python."""

ALL = {name: source for group in (SEEN_BEFORE, RAISED, DIVERGES, NOT_COMPILED) for name, (source, _) in group.items()}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder on the path with a package of all these laws."""
    target = tmp_path_factory.mktemp("site")
    install(EXAMPLE, target, {name: text for name, (text, _) in ALL.items()})
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(target))
        forget_schemes()
        yield target
    forget_schemes()


def place(site: Path, name: str) -> str:
    """File and line of a mistake."""
    return f"{site / name}.py:{ALL[name][1]}"


def ftcc(site: Path, tmp_path: Path, command: str, name: str) -> tuple[int, str]:
    """Exit code and output of ``ftcc simulate`` or ``ftcc fly`` without compilation."""
    options = ["--duration", "1", "--out", str(tmp_path / "run")]
    if command == "fly":
        options += ["--speed", "max", "--viewer", "none", "--mavlink", "none"]
    finished = subprocess.run(
        [sys.executable, "-m", "ftcc.groundside.cli", command, str(SCENARIO), "--set", f"scheme={name}", *options],
        env={**os.environ, "PYTHONPATH": str(site), "FTCC_RUNTIME_DIR": str(tmp_path), "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    text = finished.stdout + finished.stderr
    assert "Traceback" not in text, text
    return finished.returncode, text


@pytest.mark.parametrize("command", ["check", "simulate", "fly"])
@pytest.mark.parametrize("name", SEEN_BEFORE)
def test_what_is_seen_in_the_file_is_refused_before_anything_starts(
    name: str,
    command: str,
    site: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = () if command == "check" else ("--out", str(tmp_path / "run"))
    monkeypatch.setattr(sys, "argv", ["ftcc", command, str(SCENARIO), "--set", f"scheme={name}", *out])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr().err
    assert ended.value.code == 2
    assert len(said.strip().splitlines()) == 1
    assert f"{place(site, name)}: " in said
    assert SEEN_BEFORE[name][1] in said
    assert not (tmp_path / "run").exists()


def test_a_misspelt_gain_in_the_scenario_is_refused_with_the_near_one(site: Path) -> None:
    with pytest.raises(ScenarioError, match=r"gains.* has no gain 'k_thet'; did you mean k_theta\?"):
        resolve(load(SCENARIO, settings=["gains.k_thet=2.0"]))


@pytest.mark.parametrize("name", RAISED)
def test_an_error_in_the_law_ends_a_flight_in_one_process(name: str, site: Path, tmp_path: Path) -> None:
    code, said = ftcc(site, tmp_path, "simulate", name)
    assert code == 2
    assert re.fullmatch(rf"ftcc: {re.escape(place(site, name))}: {RAISED[name][1]}", said.strip())
    assert not (tmp_path / "run").exists()


def test_an_error_in_the_law_ends_a_swarm(site: Path, tmp_path: Path) -> None:
    code, said = ftcc(site, tmp_path, "fly", "raises")
    assert code == 2
    # Whose autopilot comes to this instant first is not determined.
    found = re.findall(rf"0.51 s  {re.escape(place(site, 'raises'))}: in step: far out \(UAV [23], t = 0.51 s\)", said)
    assert len(found) == 1
    assert "died" not in said


@pytest.mark.parametrize("command", ["simulate", "fly"])
@pytest.mark.parametrize("name", DIVERGES)
def test_what_is_not_finite_is_named_with_its_uav_and_time(name: str, command: str, site: Path, tmp_path: Path) -> None:
    code, said = ftcc(site, tmp_path, command, name)
    uav, t, what = DIVERGES[name][1]
    step = next(n for n, line in enumerate(ALL[name][0].splitlines(), 1) if line.startswith("def step"))
    assert code == 1, "a lost UAV is a result: the others have flown on, and it is recorded"
    said_of = rf"{t:.2f} s  UAV {uav}: {re.escape(str(site / name))}\.py:{step}: step gave no finite number: {what}"
    assert len(re.findall(said_of, said)) == 1, said


@pytest.mark.parametrize("name", NOT_COMPILED)
def test_why_a_law_is_not_compiled_is_said_with_its_line(name: str, site: Path) -> None:
    said = stages_of(name).REFUSAL
    assert said.startswith(f"scheme {name} flies as plain Python")
    found = re.search(r"(\w+\.py):(\d+): (.*)", said)
    assert found is not None
    assert (found[1], int(found[2])) == (f"{name}.py", ALL[name][1])
    assert NOT_COMPILED[name][1] in found[3]


def test_compiled_code_leaves_the_line_of_an_error_too(site: Path) -> None:
    scheme = schemes.find("raises")
    module, zeros = scheme.module, np.zeros
    autopilots, _ = build([placeholder("raises")], Timing(1, 1, 1, 1, 1, 1, 1))
    own = Own(*(0.0,) * len(Own._fields))._replace(t=1.0, V=30.0, y=-60.0)
    autopilots.own[0] = own
    arguments = (
        module.State(*(0.0,) * 4),
        own,
        Heard(zeros((1, 1)), zeros(1), zeros(1), zeros(1), zeros((1, 1))),
        Reference(*(1.0,) * len(Reference._fields)),
        Model(*(1.0,) * len(Model._fields)),
        scheme.gains("flight", {}),
        0.01,
    )
    with pytest.raises(ValueError, match="far out") as raised:
        module.step(*arguments)
    said = describe_error(raised.value, scheme, autopilots, [placeholder("raises")])
    assert said == f"{place(site, 'raises')}: in step: far out (UAV 1, t = 1 s)"
    with pytest.raises(ZeroDivisionError) as other:
        _ = 1 / 0
    assert describe_error(other.value, scheme, autopilots, [placeholder("raises")]) == "", "not the law's"
