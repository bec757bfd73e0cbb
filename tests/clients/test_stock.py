"""Programs as users write them, all at once against one swarm; `stock/README.md` says what they are."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.clients.conftest import Swarm
from tests.support.ports import free_port

STOCK = Path(__file__).parent / "stock"
TOOLS = Path(sys.executable).parent
"""Where pip puts pymavlink's own programs."""
AT_ONCE = 4
PATIENCE = 100.0
"""Wall time for one program, s: the slowest takes 12 s on two busy cores."""


@dataclass(frozen=True)
class Program:
    """A program, whom it speaks with, and what it must print."""

    path: str
    """Below ``stock/``, or the name of a program of pymavlink's."""
    uav: int | None
    """Whose own port it calls; None: it listens, and hears all."""
    expected: tuple[str, ...]
    """Patterns, each in a line, in this order."""

    def __str__(self) -> str:
        return self.path


# A UAV whose mode changes is one program's alone. No two programs listen on the same port.
PROGRAMS = (
    Program("mavsdk/telemetry.py", None, (r"GPS info: .*fix_type=3", r"Position: .*latitude_deg=47\.")),
    Program(
        "mavsdk/armed_in_air_mode.py",
        3,
        ("Position estimate OK", "Is armed: True", "Is in air: True", "FlightMode: (MISSION|HOLD)", "Home: 47.3977 "),
    ),
    Program(
        "mavsdk/takeoff_and_land.py",
        2,
        (
            "-- Global position estimate OK",
            "-- Arming",
            "-- Taking off",
            r"-- Flying at (9|10)\d\d\.\d m",
            "-- Landing",
            "-- Not landed: COMMAND_DENIED",
        ),
    ),
    Program(
        "mavsdk/offboard_attitude.py",
        1,
        ("-- Arming", "-- Starting offboard", "-- Roll 8 degrees more", r"-- Rolled to \d", "-- Stopping offboard"),
    ),
    Program(
        "mavsdk/params.py",
        3,
        (r"FTCC_AT: 0", "COM_OF_LOSS_T is now 2.5", "SYS_FAILURE_EN is now 1", "NO_SUCH_PARAM: DOES_NOT_EXIST"),
    ),
    Program(
        "mavsdk/failure_injection.py",
        2,
        ("-- Injecting GPS failure", "-- Repairing it", "-- Injecting a battery", "-- Refused: UNSUPPORTED"),
    ),
    Program("mavsdk/mission.py", 3, ("-- Downloaded 0 items", "-- Mode HOLD", "-- Mode MISSION")),
    Program("mavsdk/info.py", 4, ("System id: 4", r"Version: 1\.15\.0", "Identification: 4")),
    Program("mavsdk/ftp_list.py", 2, (r"(No files: (?!TIMEOUT)|Files: \[\])",)),
    Program("mavsdk/mavlink_direct.py", 4, (r"ATTITUDE_QUATERNION from 4: \{.*\"q1\":",)),
    Program("pymavlink/heartbeat.py", None, ("Heartbeat from system [1-4]", "Armed: True", "MAV_TYPE_FIXED_WING")),
    Program(
        "pymavlink/messages.py",
        None,
        (
            "ATTITUDE {",
            "GLOBAL_POSITION_INT {",
            "VFR_HUD {",
            "GPS_RAW_INT {",
            "SYS_STATUS {",
            "SET_MESSAGE_INTERVAL: MAV_RESULT_ACCEPTED",
            "5 quaternions",
        ),
    ),
    Program(
        "pymavlink/arm_disarm.py",
        4,
        ("Arm: MAV_RESULT_ACCEPTED", "Armed!", "Disarm: MAV_RESULT_DENIED", "Vehicle says: .+"),
    ),
    Program("pymavlink/set_mode.py", 4, ("'LOITER', .*'MISSION'", "Mode: LOITER", "Mode: LOITER", "Mode: MISSION")),
    Program(
        "pymavlink/parameters.py",
        4,
        (r"(\d+) of \1 parameters", r"COM_OF_LOSS_T\tvalue: 1\.0", r"value: 3\.5", r"COM_OF_LOSS_T\tvalue: 3\.5"),
    ),
    Program(
        "pymavlink/mission.py",
        None,
        ("Downloaded 0 waypoints", "Type 1: 0 items", "Type 2: 0 items", "Upload: MAV_MISSION_UNSUPPORTED"),
    ),
    Program("pymavlink/ping_and_time.py", 3, ("Connected to system 3", "Version: 1 15", r"Time of the vehicle: \d")),
    Program("pymavlink/record.py", None, (r"\d\d+ messages",)),
)

AFTERWARDS = (
    Program("mavlogdump.py", None, (r"ATTITUDE {time_boot_ms",)),
    Program("mavtogpx.py", None, (r"Created .* with [1-9]\d* points",)),
    Program("mavloss.py", None, (r"Total: \d+ packets, 0 lost",)),
    Program("mavsummarize.py", None, (r"Num Flights : 1",)),
)
"""Programs that pip installs with pymavlink, as they are, with the log of ``record.py``."""


PUBLISHED = os.environ.get("FTCC_MAVSDK_EXAMPLES", "")
"""A folder with MAVSDK's own examples."""
PUBLISHED_PROGRAMS = (
    (["params.py", "URL", "get_all"], 0, ("Discovered autopilot", "SYS_FAILURE_EN: 1", r"COM_OF_LOSS_T: \d")),
    (["params.py", "URL", "get", "SYS_FAILURE_EN"], 0, ("Wrong type", "Ok", "SYS_FAILURE_EN: 1")),
    (["params.py", "URL", "set", "COM_OF_LOSS_T", "1.5"], 0, ("Setting 1.5 as float...Ok",)),
    (
        ["telemetry.py"],
        1,
        (
            "Found valid autopilot system",
            "Arming...",
            "Taking off...",
            r"Position update: Lat=47\.\d+, Lon=8\.\d+",
            "Current position",
            "Landing...",
        ),
    ),
)
"""Its arguments, its exit code, and what it prints: the last one ends where it wants to land."""


_MAVSDK_ENDING = "Resource deadlock avoided"


def run(command: list[str], code: int = 0) -> str:
    """What a program prints, if it ends with this exit code."""
    done = subprocess.run(
        [sys.executable, "-u", *command],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
        env={**os.environ, "MAVLINK20": "1"},
    )
    if done.returncode == -signal.SIGABRT and _MAVSDK_ENDING in done.stderr:
        # MAVSDK's own threads, as the program ends, once in a hundred runs on a busy computer: all was said before.
        return done.stdout
    assert done.returncode == code, f"{command} ended with {done.returncode}:\n{done.stdout}\n{done.stderr}"
    return done.stdout


def assert_printed(patterns: tuple[str, ...], output: str) -> None:
    """Each pattern in what was printed, one behind the other."""
    at = 0
    for pattern in patterns:
        found = re.search(pattern, output[at:])
        assert found, f"no {pattern!r} in\n{output[at:]}"
        at += found.end()


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("record") / "mav.tlog"


LISTENERS = {program.path: free_port() for program in PROGRAMS if program.uav is None} | {PUBLISHED: free_port()}


@pytest.fixture(scope="module")
def listeners() -> tuple[int, ...]:
    """A port for each program that listens."""
    return tuple(LISTENERS.values())


@pytest.fixture(scope="module")
def outcomes(swarm: Swarm, record: Path) -> Iterator[dict[str, Future[str]]]:
    """All programs, some at a time."""
    ports = swarm.ports()

    def start(program: Program) -> Future[str]:
        scheme = ("udpin" if program.uav is None else "udpout") + ("://" if "mavsdk/" in program.path else ":")
        port = LISTENERS[program.path] if program.uav is None else ports[program.uav]
        more = [str(record)] if program.path.endswith("record.py") else []
        return pool.submit(run, [str(STOCK / program.path), f"{scheme}127.0.0.1:{port}", *more])

    with ThreadPoolExecutor(AT_ONCE) as pool:
        yield {program.path: start(program) for program in PROGRAMS}


@pytest.mark.parametrize("program", PROGRAMS, ids=str)
def test_a_users_program_works(program: Program, outcomes: dict[str, Future[str]]) -> None:
    if program.path.startswith("mavsdk/"):
        pytest.importorskip("mavsdk", reason="MAVSDK is not installed (extra dev)")
    assert_printed(program.expected, outcomes[program.path].result())


@pytest.mark.parametrize("program", AFTERWARDS, ids=str)
def test_a_tool_of_pymavlink_reads_what_was_recorded(
    program: Program, outcomes: dict[str, Future[str]], record: Path
) -> None:
    outcomes["pymavlink/record.py"].result()
    assert_printed(program.expected, run([str(TOOLS / program.path), str(record)]))


@pytest.mark.skipif(not PUBLISHED, reason="FTCC_MAVSDK_EXAMPLES names no folder with MAVSDK's published examples")
@pytest.mark.parametrize(
    ("command", "code", "expected"), PUBLISHED_PROGRAMS, ids=[" ".join(one[0]) for one in PUBLISHED_PROGRAMS]
)
def test_a_published_example_works(
    command: list[str], code: int, expected: tuple[str, ...], outcomes: dict[str, Future[str]], tmp_path: Path
) -> None:
    """Nothing but the address is changed."""
    url = f"udpin://127.0.0.1:{LISTENERS[PUBLISHED]}"
    name, *arguments = command
    program = tmp_path / name
    program.write_text((Path(PUBLISHED) / name).read_text(encoding="utf-8").replace("udpin://0.0.0.0:14540", url))
    assert_printed(expected, run([str(program), *(url if one == "URL" else one for one in arguments)], code))
