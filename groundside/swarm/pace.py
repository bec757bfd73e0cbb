"""Measure how fast a swarm flies on the wall clock, what limits it, and what would help.

`PaceMeter` reads, about once per second, the processor time used by each process of the swarm and by the whole machine;
`judge` compares two such samples. It distinguishes three limits: all cores are busy, with the swarm's own processes or
with other programs; one process, or a vehicle and an autopilot process in turn, fills one core while others idle; no
core is busy, and time passes between a message and the wake-up of its receiver.
"""

from __future__ import annotations

import collections
import math
import os
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, get_args

import psutil  # type: ignore[import-untyped]

from ftcc.groundside.dashboard import Pace

__all__ = ["Kind", "Member", "PaceMeter", "Sample", "Setup", "judge", "loads", "processes_of", "usable_cores"]

Kind = Literal["vehicle", "autopilot", "ground station", "viewer"]
"""Kind of a process of a swarm."""

_WINDOW = 5.0
"""Wall time over which a factor is measured, s."""
_SHORTEST = 0.5
"""Shortest wall time over which a factor is measured, s."""
_HELD = 0.97
"""Share of the requested factor from which it counts as reached."""
_OLD = 0.1
"""Largest delay of a sample's simulated time, which comes with telemetry, wall s."""
_FULL = 0.9
"""Share of all cores from which the machine counts as full."""
_FOREIGN = 0.2
"""Share of all cores from which other programs are named as the cause."""
_SATURATED = 0.85
"""Share of one core from which a process counts as saturated."""
_IN_TURN = 1.1
"""Largest load, in cores, of a vehicle and an autopilot process that work in turn."""
_ROOM = 0.9
"""Number of idle cores from which more processes would help."""
_NOTICEABLE = 0.05
"""Share of all cores from which leaving something out helps."""

_CGROUP_LIMIT = Path("/sys/fs/cgroup/cpu.max")
_PLURAL: dict[Kind, str] = {"vehicle": "vehicles", "autopilot": "autopilots"}


class Member(NamedTuple):
    """A process of the swarm."""

    name: str
    kind: Kind

    @property
    def group(self) -> str:
        """Return the UAVs of a process, such as ``uav1-8``; a vehicle process and its autopilot process share them."""
        return self.name.removesuffix(f"-{self.kind}")


@dataclass(frozen=True)
class Sample:
    """Processor time used up to one instant."""

    wall: float
    """Monotonic wall time, s."""
    t: float
    """Simulated time, s."""
    used: Mapping[Member, float]
    """Processor time of each process since its start, s."""
    busy: float
    """Busy time of all usable cores since the machine started, s."""


@dataclass(frozen=True)
class Setup:
    """How the swarm is flown: speed, processes, cores."""

    asked: float | None
    """Requested speed, times real time; None: as fast as possible."""
    uavs: int
    pack: int
    """Vehicles per process."""
    automatic: int
    """Vehicles per process with ``--pack auto``."""
    cores: int
    """Number of cores that the swarm may use."""


def usable_cores() -> int:
    """Return the number of cores that this process may use, by its CPU affinity and the limit of its container."""
    bound = len(_allowed_cores())
    if not _CGROUP_LIMIT.exists():
        return bound
    quota, period = _CGROUP_LIMIT.read_text().split()
    return bound if quota == "max" else max(1, min(bound, round(int(quota) / int(period))))


def _allowed_cores() -> Collection[int]:
    if hasattr(os, "sched_getaffinity"):
        return os.sched_getaffinity(0)
    return range(os.cpu_count() or 1)


def processes_of(folder: Path, launcher: int) -> list[tuple[str, int, Kind]]:
    """Return name, pid and kind of the vehicle and autopilot processes of the run in ``folder``.

    They are the children of the process ``launcher`` (pid) that write logs there.
    """
    logs = {str(path): path.stem for path in (folder.resolve() / "logs").glob("*.log")}
    found: list[tuple[str, int, Kind]] = []
    for process in psutil.Process(launcher).children(recursive=True):
        try:
            names = [logs[file.path] for file in process.open_files() if file.path in logs]
        except psutil.NoSuchProcess:
            continue
        for name in names[:1]:
            found.append((name, process.pid, "vehicle" if name.endswith("-vehicle") else "autopilot"))
    return found


def loads(earlier: Sample, later: Sample) -> dict[Member, float]:
    """Return the mean load, in cores, of each process that is in both samples."""
    wall = later.wall - earlier.wall
    return {one: (used - earlier.used[one]) / wall for one, used in later.used.items() if one in earlier.used}


def judge(earlier: Sample, later: Sample, setup: Setup) -> Pace:
    """Return the pace between two samples, and what limited it."""
    wall = later.wall - earlier.wall
    factor = (later.t - earlier.t) / wall
    if setup.asked is not None and factor * wall >= _HELD * setup.asked * (wall - _OLD):
        return Pace(factor, setup.asked)
    load_of = loads(earlier, later)
    by_kind = {kind: sum(load for member, load in load_of.items() if member.kind == kind) for kind in get_args(Kind)}
    total = (later.busy - earlier.busy) / wall
    foreign = max(0.0, total - sum(by_kind.values()))
    if total >= _FULL * setup.cores:
        limit, advice = _limit_of_full_machine(by_kind, foreign, setup)
    else:
        limit, advice = _limit_of_one_core(load_of, total, setup) or _limit_of_waiting(by_kind, total, setup)
    if setup.asked is not None:
        advice = [*advice, f"--speed {_rounded(0.9 * factor)}"]
    return Pace(factor, setup.asked, limit, " or ".join(advice))


def _limit_of_full_machine(by_kind: Mapping[Kind, float], foreign: float, setup: Setup) -> tuple[str, list[str]]:
    """Return limit and advice if all cores are busy."""
    full = f"all {setup.cores} cores are busy" if setup.cores > 1 else "the only core is busy"
    if foreign >= _FOREIGN * setup.cores:
        advice = ["fewer other programs (a browser that shows the dashboard is one of them)"]
        return f"{full}, other programs take {foreign:.1f}", [*advice, *_advice_to_save(by_kind, setup)]
    most, *others = sorted(by_kind, key=lambda kind: -by_kind[kind])
    rest = ", ".join(f"{_PLURAL.get(kind, kind)} {by_kind[kind]:.1f}" for kind in others if by_kind[kind] >= 0.05)
    limit = f"{full}, most with {_PLURAL.get(most, f'the {most}')}: {by_kind[most]:.1f}" + (f"; {rest}" if rest else "")
    return limit, _advice_to_save(by_kind, setup) or ["fewer UAVs, or more cores"]


def _advice_to_save(by_kind: Mapping[Kind, float], setup: Setup) -> list[str]:
    """Return options that make the same flight cheaper."""
    advice = []
    if setup.pack < setup.automatic:
        advice.append("--pack auto")
    if by_kind["viewer"] >= _NOTICEABLE * setup.cores:
        advice.append("--viewer none")
    return advice


def _limit_of_one_core(load_of: Mapping[Member, float], total: float, setup: Setup) -> tuple[str, list[str]] | None:
    """Return limit and advice if one process, or the two of one group in turn, fill a core; else None."""
    flying = {member: load for member, load in load_of.items() if member.kind in ("vehicle", "autopilot")}
    if not flying:
        return None
    idle = setup.cores - total
    idling = f"while {idle:.1f} of {setup.cores} cores idle"
    busiest = max(flying, key=lambda member: flying[member])
    groups: dict[str, float] = {}
    for member, load in flying.items():
        groups[member.group] = groups.get(member.group, 0.0) + load
    fullest = max(groups, key=lambda group: groups[group])
    if flying[busiest] >= _SATURATED:
        limit = f"{busiest.name} alone fills a core ({flying[busiest]:.0%}) {idling}"
    elif setup.pack > 1 and _SATURATED <= groups[fullest] <= _IN_TURN:
        limit = f"vehicles and autopilots of {fullest} take turns on one core ({groups[fullest]:.0%}) {idling}"
    else:
        return None
    if setup.pack == 1:
        return limit, ["a faster core: one UAV cannot be spread over several"]
    if idle < _ROOM:
        return limit, []
    return limit, [f"--pack {setup.pack // 2}: smaller packs use more cores"]


def _limit_of_waiting(by_kind: Mapping[Kind, float], total: float, setup: Setup) -> tuple[str, list[str]]:
    """Return limit and advice if no core is full."""
    own = sum(by_kind.values())
    limit = f"processes wait for each other's messages: the swarm uses {own:.1f} of {setup.cores} cores"
    return limit, ["--pack auto: fewer processes wait for each other"] if setup.pack < setup.automatic else []


def _rounded(factor: float) -> str:
    """Round down to two significant digits."""
    if factor <= 0.0:
        return "lower"
    unit = 10.0 ** (math.floor(math.log10(factor)) - 1)
    return f"{math.floor(factor / unit + 1e-9) * unit:.6g}"


class PaceMeter:
    """Measures the pace of a flying swarm, about once per second.

    Parameters
    ----------
    setup : how the swarm is flown; when the speed changes, replace it and call `restart`.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self._samples: collections.deque[Sample] = collections.deque()
        self._processes: dict[int, psutil.Process] = {}
        self._cores = frozenset(_allowed_cores())

    def restart(self) -> None:
        """Discard all samples, after a pause, a step, or a change of speed."""
        self._samples.clear()

    def measure(
        self, wall: float, t: float, processes: Iterable[tuple[str, int, Kind]], viewers: Iterable[int], own: int
    ) -> Pace:
        """Return the pace over the last 5 s of wall time; its factor is nan during the first half second.

        Below real time it is taken over two simulated seconds, because telemetry reports time in steps of 0.1 s.

        Parameters
        ----------
        wall, t : current monotonic and simulated time, s.
        processes : name, pid and kind of each living process of vehicles and autopilots.
        viewers : pids of the dashboard's viewer, if this flight started one.
        own : pid of the ground station.
        """
        asked = self.setup.asked
        slow = 2.0 / asked if asked is not None and asked < 1.0 else 0.0
        self._samples.append(self.sample(wall, t, processes, viewers, own))
        while len(self._samples) > 2 and self._samples[1].wall <= wall - max(_WINDOW, slow):
            self._samples.popleft()
        earliest, latest = self._samples[0], self._samples[-1]
        if latest.wall - earliest.wall < max(_SHORTEST, slow):
            return Pace(math.nan, self.setup.asked)
        return judge(earliest, latest, self.setup)

    def sample(
        self, wall: float, t: float, processes: Iterable[tuple[str, int, Kind]], viewers: Iterable[int], own: int
    ) -> Sample:
        """Return the processor time used so far; arguments as for `measure`."""
        members: list[tuple[str, int, Kind]] = [*processes, ("ground station", own, "ground station")]
        members += [(f"viewer {pid}", pid, "viewer") for pid in viewers]
        used = {}
        for name, pid, kind in members:
            seconds = self._used(pid)
            if seconds is not None:
                used[Member(name, kind)] = seconds
        return Sample(wall, t, used, self._busy())

    def _used(self, pid: int) -> float | None:
        """Return the processor time of a process, s; None if it has ended."""
        try:
            if pid not in self._processes:
                self._processes[pid] = psutil.Process(pid)
            times = self._processes[pid].cpu_times()
        except psutil.NoSuchProcess:
            return None
        return float(times.user + times.system)

    def _busy(self) -> float:
        """Return the busy time of all cores that the swarm may use, s."""
        total = 0.0
        for core, times in enumerate(psutil.cpu_times(percpu=True)):
            if core in self._cores:
                # Linux counts guest time also as user time; waiting for a disk is idle time.
                idle = times.idle + getattr(times, "iowait", 0.0)
                guests = getattr(times, "guest", 0.0) + getattr(times, "guest_nice", 0.0)
                total += sum(times) - idle - guests
        return total
