"""Count the files that a flight with processes opens, and raise the system's limit before it starts.

The numbers were counted on Linux: a constant per process, rounded up, and a number per UAV.
"""

from __future__ import annotations

import resource
from typing import TYPE_CHECKING

from ftcc.groundside.errors import UserError

if TYPE_CHECKING:
    from ftcc.groundside.scenario import Mission

__all__ = ["TooFewFilesError", "files_needed", "provide_files"]

_LAUNCHER, _PER_PROCESS = 40, 3
"""Station, log, viewer, control and feed sockets; per process a pipe, a sentinel and a pipe of the fork server."""
_VEHICLE, _PER_VEHICLE = 16, 3
"""Pipes, log, libraries; per UAV the sockets to autopilot and station, and a part of the recording."""
_AUTOPILOT, _PER_AUTOPILOT = 26, 5
"""As a vehicle process, and the mesh; per UAV the sockets to vehicle, station and clients, and two parts."""


class TooFewFilesError(UserError):
    """The system allows a process fewer open files than a flight needs."""


def files_needed(mission: Mission, pack: int, listeners: int) -> int:
    """Return the largest number of files that one process of a flight opens.

    Parameters
    ----------
    mission : Mission
    pack : int
        Vehicles per process.
    listeners : int
        Number of ground stations that receive telemetry.
    """
    uavs = [spec.uav for spec in mission.vehicles]
    group = {uav: n // pack for n, uav in enumerate(uavs)}
    links = {(group[spec.uav], group[other.uav]) for spec in mission.autopilots for other in spec.neighbours}
    peers = [len({b if a == n else a for a, b in links if n in (a, b)} - {n}) for n in set(group.values())]
    launcher = _LAUNCHER + _PER_PROCESS * 2 * len(peers)
    k = min(pack, len(uavs))
    return max(launcher, _VEHICLE + _PER_VEHICLE * k, _AUTOPILOT + max(peers) + (_PER_AUTOPILOT + listeners) * k)


def provide_files(mission: Mission, pack: int, listeners: int) -> None:
    """Allow this process and its children as many open files as a flight needs; arguments as `files_needed`.

    Raises
    ------
    TooFewFilesError
        If the system does not allow it.
    """
    needed = files_needed(mission, pack, listeners)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
    except (ValueError, OSError):
        packs = {n: files_needed(mission, n, listeners) for n in range(1, len(mission.vehicles) + 1)}
        best = min(packs, key=lambda n: packs[n])
        instead = f", or fly with --pack {best}, which needs {packs[best]}" if packs[best] <= hard else ""
        raise TooFewFilesError(
            f"a process of this flight opens up to {needed} files, {hard} are allowed: set `ulimit -n {needed}` "
            f"(as root, or in /etc/security/limits.conf){instead}"
        ) from None
