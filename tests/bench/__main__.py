"""Prints what flights and their parts cost on this machine: ``python -m tests.bench [PART ...]``.

A machine that does other things, too, or that others share, is not the same machine a minute later. Therefore what is
compared is measured in turn, again and again, and medians are shown; compare numbers of one run with each other only.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ftcc.groundside.scenario.loading import load, shipped
from ftcc.groundside.scenario.mission import Mission, resolve
from ftcc.groundside.simulation import fly_in_memory, simulate
from ftcc.groundside.swarm.pace import usable_cores
from tests.bench.flight_shares import flight_shares
from tests.bench.flights import FTCC, Flight, fly
from tests.bench.stages import LAW, stage_times
from tests.bench.stubs import KINDS, StubResult, fly_stub
from tests.bench.swarms import swarm_file

Row = dict[str, Any]
"""A line of a table: texts and numbers by the headings of their columns."""

SIMULATED = 300.0
"""Longest flight in one process, s."""
FLOWN = 5.0
"""Wall time that a flight with processes is to take, s."""
SHORTEST, LONGEST = 5.0, 600.0
"""Simulated time of a flight with processes, s."""
SWARMS = (2, 8, 16, 60, 100, 200)
"""UAVs; the smallest swarm is a follower and its leader."""
MOST_UNPACKED = 100
"""UAVs of the largest swarm that also flies with two processes each."""
REAL_TIME = 60.0
"""Flight by the wall clock, s."""


def seconds(action: Callable[[], object]) -> float:
    """Wall time of an action, s."""
    begun = time.perf_counter()
    action()
    return time.perf_counter() - begun


def median(action: Callable[[], object], repeats: int) -> float:
    """Median wall time of some runs after a first one that compiles and warms up, s."""
    action()
    return statistics.median(seconds(action) for _ in range(repeats))


def laws(repeats: int, swarms: Sequence[int], folder: Path) -> list[Row]:
    """One control period of every law: inbox, reference, law, command; compiled and as plain Python."""
    code = "import sys; from tests.bench.__main__ import law_step; print(*(law_step(name) for name in sys.argv[1:]))"
    names = list(one_scenario_per_scheme())
    measured = []
    for disable in ("0", "1"):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disable}
        command = [sys.executable, "-c", code, *names]
        run = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=environment)
        measured.append([float(word) for word in run.stdout.split()])
    return [
        {"law": load(name).plan.scheme, "compiled, us": compiled, "plain Python, us": plain, "ratio": plain / compiled}
        for name, compiled, plain in zip(names, *measured, strict=True)
    ]


def law_step(scenario: str) -> float:
    """Time of one control period of a UAV amid a flight, us."""
    plain = os.environ.get("NUMBA_DISABLE_JIT") == "1"
    mission = resolve(load(scenario, duration=20.0))
    ticks = 20 if plain else 500
    times = stage_times(mission, ticks, warm_up=5)
    return sum(times[stage] for stage in LAW)


def one_scenario_per_scheme() -> dict[str, str]:
    """A shipped scenario of every law that has one: scheme by scenario."""
    found: dict[str, str] = {}
    for name in shipped():
        scheme = load(name).plan.scheme
        if scheme not in found.values() and resolve(load(name, duration=1.0)).wire:
            found[name] = scheme
    return found


def stages(repeats: int, swarms: Sequence[int], folder: Path) -> list[Row]:
    """Each stage of a tick of containment, per UAV: all vehicles and autopilots in one process, in one thread."""
    mission = resolve(load("containment", duration=30.0))
    runs = [stage_times(mission) for _ in range(repeats)]
    rows: list[Row] = [{"stage": name, "us": statistics.median(run[name] for run in runs)} for name in runs[0]]
    return [*rows, {"stage": "all", "us": statistics.median(sum(run.values()) for run in runs)}]


def shares(repeats: int, swarms: Sequence[int], folder: Path) -> list[Row]:
    """One flight of a study, of containment with 30 % loss, in memory: its parts, from loading to its verdict."""
    return flight_shares(repeats)


def in_one_process(repeats: int, swarms: Sequence[int], folder: Path) -> list[Row]:
    """Simulations of every shipped scenario, in its first form."""
    rows = []
    for name in shipped():
        length = min(SIMULATED, load(name).plan.duration)
        mission = resolve(load(name, duration=length))
        flown = median(partial(fly_in_memory, mission), repeats)
        recorded = median(partial(simulate_anew, mission, folder), repeats)
        rows.append(
            {
                "scenario": f"{name} {mission.form}",
                "vehicles": len(mission.uavs),
                "simulated, s": length,
                "s": flown,
                "x real time": length / flown,
                "recorded, s": recorded,
                "recorded, x real time": length / recorded,
            }
        )
    return rows


def simulate_anew(mission: Mission, folder: Path) -> None:
    """Simulate and record in a new folder."""
    simulate(mission, Path(tempfile.mkdtemp(dir=folder)) / "run")


def with_processes(repeats: int, swarms: Sequence[int], folder: Path) -> list[Row]:
    """Swarms in lockstep, as fast as they can, beside stubs: as many pairs that only exchange a tick's datagrams.

    Processor time is that of all processes of a kind, per pair of vehicle and autopilot and tick.
    """
    rows: list[Row] = []
    for uavs in swarms:
        scenario = swarm_file(folder, uavs, LONGEST)
        ways = [("1", "none")] if uavs <= MOST_UNPACKED else []
        ways += [("auto", "none")]
        if uavs == 8:
            ways.append(("1", "web"))
        # The first flight compiles, and tells how long a flight must be.
        lengths = [length_of(fly(scenario, uavs, *options(*way), duration=SHORTEST)) for way in ways]
        flown: list[list[Flight]] = [[] for _ in ways]
        stubs: dict[str, list[StubResult]] = {kind: [] for kind in KINDS}
        for _ in range(repeats):
            for kind, results in stubs.items():
                results.append(fly_stub(kind, uavs))
            for (pack, viewer), length, flights in zip(ways, lengths, flown, strict=True):
                flights.append(fly(scenario, uavs, *options(pack, viewer), duration=length, viewer=viewer))
        for kind, results in stubs.items():
            rows.append(stub_row(uavs, kind, results))
        reached = {kind: statistics.median(one.factor for one in results) for kind, results in stubs.items()}
        for (pack, viewer), flights in zip(ways, flown, strict=True):
            how = ("unpacked" if pack == "1" else "--pack auto") + (", web viewer" if viewer == "web" else "")
            rows.append(flight_row(uavs, how, flights, reached))
    return rows


def options(pack: str, viewer: str) -> list[str]:
    """Of ``ftcc fly``."""
    return ["--speed", "max", "--pack", pack, "--mavlink", "none"]


def length_of(tried: Flight) -> float:
    """Simulated time of a flight that is to take `FLOWN` by the wall clock, s."""
    factor = 1.0 if math.isnan(tried.factor) else tried.factor
    return round(min(LONGEST, max(SHORTEST, FLOWN * factor)))


def stub_row(uavs: int, kind: str, results: Sequence[StubResult]) -> Row:
    """What a stub reached."""
    factors = [one.factor for one in results]
    return {
        "swarm": uavs,
        "what": f"{kind} stub",
        "processes": 2 * uavs,
        "x real time": statistics.median(factors),
        "least": min(factors),
        "most": max(factors),
        "vehicle, us": statistics.median(one.vehicle_us for one in results),
        "autopilot, us": statistics.median(one.autopilot_us for one in results),
        "pair, us": statistics.median(one.pair_us for one in results),
    }


def flight_row(uavs: int, how: str, flights: Sequence[Flight], stubs: dict[str, float]) -> Row:
    """What some flights of one kind reached."""
    sound = [one for one in flights if not one.problem]
    problems = [one.problem for one in flights if one.problem]
    row: Row = {"swarm": uavs, "what": how, "processes": max(one.processes for one in flights)}
    if problems:
        row["problem"] = f"{len(problems)} of {len(flights)} flights failed: {problems[0]}"
    if not sound:
        return row
    factors = [one.factor for one in sound]
    row |= {"x real time": statistics.median(factors), "least": min(factors), "most": max(factors)}
    row |= {f"of {kind} stub": f"{row['x real time'] / factor:.0%}" for kind, factor in stubs.items()}
    measured = [one.cpu_us for one in sound if one.cpu_us]
    for kind in measured[0] if measured else ():
        used = statistics.median(one[kind] for one in measured)
        if used > 0.0:
            row[f"{kind}, us"] = used
    if measured:
        row["pair, us"] = row.get("vehicle, us", 0.0) + row.get("autopilot, us", 0.0)
    return row


def by_the_wall_clock(repeats: int, swarms: Sequence[int], folder: Path) -> list[Row]:
    """Late ticks where nobody waits for anybody, at real time."""
    rows = []
    for uavs, pack in ((16, "1"), (100, "auto")):
        scenario = swarm_file(folder, uavs, REAL_TIME)
        flags = ["--clock", "wall", "--speed", "1", "--pack", pack, "--mavlink", "none"]
        flown = [fly(scenario, uavs, *flags, duration=REAL_TIME) for _ in range(repeats)]
        row = flight_row(uavs, f"--clock wall, {'unpacked' if pack == '1' else '--pack auto'}", flown, {})
        late = [one.late for one in flown if not one.problem]
        if late:
            row |= {"late": f"{statistics.median(late):.3%}", "at worst": f"{max(late):.3%}"}
        rows.append(row)
    return rows


def start_up(repeats: int, swarms: Sequence[int], folder: Path) -> list[Row]:
    """Whole commands whose flight takes next to nothing."""
    flags = {"simulate": [], "fly": ["--speed", "max", "--viewer", "none"]}
    rows = []
    for command, more in flags.items():
        whole = [*FTCC, command, "containment", "--duration", "0.1", *more]
        rows.append({"command": f"ftcc {command} of 0.1 s", "s": median(partial(run_anew, whole, folder), repeats)})
    return rows


def run_anew(command: list[str], folder: Path) -> None:
    """Run a command with a new run folder."""
    subprocess.run([*command, "--out", f"{tempfile.mkdtemp(dir=folder)}/run"], capture_output=True, check=True)


def dashboard(repeats: int, swarms: Sequence[int], folder: Path) -> list[Row]:
    """What the ground process pays for a picture of eight UAVs, ten of which it draws in a second of wall time."""
    from ftcc.groundside.dashboard import Dashboard
    from tests.groundside.dashboard.synthetic_swarm import SUBJECT, flight

    pictures = list(flight(30.0))
    rows = []
    for viewer in ("none", "web"):
        recording = folder / f"{viewer}.rrd"
        shown = Dashboard(SUBJECT, recording=recording, viewer=viewer)  # type: ignore[arg-type]
        shown.log(pictures[0])
        time.sleep(3.0 if viewer == "web" else 0.0)
        begun = time.process_time()
        for picture in pictures[1:]:
            shown.log(picture)
            time.sleep(0.02)
        cost = (time.process_time() - begun) / (len(pictures) - 1)
        shown.close()
        size = recording.stat().st_size / len(pictures)
        rows.append(
            {
                "a picture of 8 UAVs": "recorded" + (" and in the web viewer" if viewer == "web" else ""),
                "ms": 1e3 * cost,
                "of a core at 10 Hz": f"{10.0 * cost:.1%}",
                "in the recording, kB": size / 1e3,
                "MB an hour": 10.0 * size * 3600.0 / 1e6,
            }
        )
    return rows


PARTS: dict[str, Callable[[int, Sequence[int], Path], list[Row]]] = {
    "laws": laws,
    "stages": stages,
    "shares": shares,
    "simulate": in_one_process,
    "start": start_up,
    "fly": with_processes,
    "wall": by_the_wall_clock,
    "dashboard": dashboard,
}


def shown(rows: Sequence[Row]) -> Table:
    """Rows as a table: a column for each heading that any of them has."""
    headings = list(dict.fromkeys(heading for row in rows for heading in row))
    table = Table(*headings, box=None)
    for row in rows:
        table.add_row(*(f"{v:.4g}" if isinstance(v := row.get(heading, ""), float) else str(v) for heading in headings))
    return table


def main() -> None:
    """The benchmarks that are named on the command line, or all."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__.partition("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; default: all")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each, of which medians are shown (3)")
    parser.add_argument(
        "--uavs", type=int, nargs="+", default=SWARMS, help=f"sizes of swarms to fly ({' '.join(map(str, SWARMS))})"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers there, too")
    given = parser.parse_args()
    unknown = set(given.parts) - set(PARTS)
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: must be of {', '.join(PARTS)}")
    if given.repeats < 1 or not all(2 <= uavs <= 200 for uavs in given.uavs):
        parser.error("repeats must be at least 1, and swarms have 2 to 200 UAVs")
    console = Console(width=200)
    results: dict[str, Any] = {
        "machine": {"cores": usable_cores(), "processor": platform.processor(), "python": platform.python_version()}
    }
    with tempfile.TemporaryDirectory(prefix="ftcc-bench-") as folder:
        for part in given.parts or PARTS:
            rows = PARTS[part](given.repeats, given.uavs, Path(folder))
            results[part] = rows
            console.print(f"\n[bold]{part}[/]: {' '.join(str(PARTS[part].__doc__).split())}")
            console.print(shown(rows))
            if given.json:
                given.json.write_text(json.dumps(results, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
