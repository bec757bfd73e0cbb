"""Exports ULog files, the logs of PX4: one per UAV, for PlotJuggler, pyulog's tools and others.

pyulog can only write a log that it has read; here its log object is filled directly.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.groundside.results.poses import poses
from ftcc.groundside.results.run import Run

__all__ = ["write_ulogs"]

_TYPES = {"uint64_t": "<u8", "int32_t": "<i4", "uint8_t": "u1", "float": "<f4", "double": "<f8"}
_LEVELS = {"error": ord("3"), "warning": ord("4"), "info": ord("6")}
"""ULog's log level for each severity of an event."""
_FIX_3D = 3

_Columns = Sequence[tuple[str, str, NDArray[Any]]]
"""Name, ULog type and values of each field except the time."""


def write_ulogs(run: Run, folder: Path) -> list[Path]:
    """Write ``uavN.ulg`` of every UAV into ``folder``; times are simulated, us.

    Topics: ``ftcc_recording``, the columns of the recording by their names and in their units (z up); and from the true
    states ``vehicle_attitude``, ``vehicle_local_position`` (z down), ``vehicle_global_position`` and
    ``vehicle_gps_position``, which has the UTC time; in still air their velocities are those over ground. Gains are
    parameters, events messages.

    Raises
    ------
    RunError
        If nothing was recorded.
    OSError
        If they cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for uav in run.uavs:
        file = folder / f"uav{uav}.ulg"
        _log_of(run, uav).write_ulog(str(file))
        files.append(file)
    return files


def _log_of(run: Run, uav: int) -> Any:
    from pyulog import ULog

    log = ULog(None)
    stamps = np.rint(run.column("t", uav) * 1e6).astype(np.uint64)
    recorded = {name: run.column(name, uav) for name in run.names if name not in ("t", "uav")}
    columns = {name: values for name, values in recorded.items() if not np.isnan(values).all()}
    _add(log, "ftcc_recording", stamps, [(name, "double", values) for name, values in columns.items()])
    _add_flight(log, run, uav)
    scheme = run.mission.scheme
    for spec in run.mission.autopilots:
        if spec.uav == uav and spec.role == "follower":
            log.initial_parameters.update(zip(scheme.gains_type._fields, map(float, spec.gains), strict=True))
    for event in run.events:
        if event["uav"] in (None, uav):
            log.logged_messages.append(
                SimpleNamespace(
                    log_level=_LEVELS[event["severity"]],
                    timestamp=max(0, round(float(event["t"]) * 1e6)),
                    message=event["text"],
                )
            )
    return log


def _add_flight(log: Any, run: Run, uav: int) -> None:
    """Add PX4's topics of attitude and position, from the recorded true states."""
    found = poses(run, uav)
    t = found.time_us
    if not len(t):
        return
    motion = np.column_stack([found.position, found.velocity])
    _add(log, "vehicle_attitude", t, [(f"q[{n}]", "float", found.attitude[:, n]) for n in range(4)])
    _add(
        log,
        "vehicle_local_position",
        t,
        [
            *((name, "float", motion[:, n]) for n, name in enumerate(("x", "y", "z", "vx", "vy", "vz"))),
            ("heading", "float", found.heading),
        ],
    )
    _add(
        log,
        "vehicle_global_position",
        t,
        [
            ("lat", "double", found.place[:, 0] / 1e7),
            ("lon", "double", found.place[:, 1] / 1e7),
            ("alt", "float", found.altitude),
        ],
    )
    _add(
        log,
        "vehicle_gps_position",
        t,
        [
            ("time_utc_usec", "uint64_t", t + np.uint64(round(run.started * 1e6))),
            ("lat", "int32_t", found.place[:, 0]),
            ("lon", "int32_t", found.place[:, 1]),
            ("alt", "int32_t", np.rint(found.altitude * 1e3)),
            ("fix_type", "uint8_t", np.full(len(t), _FIX_3D)),
        ],
    )


def _add(log: Any, topic: str, stamps: NDArray[np.uint64], columns: _Columns) -> None:
    """Add a topic with its data; ``q[0]`` to ``q[3]`` are one field, ``q``."""
    from pyulog import ULog

    fields = [("timestamp", "uint64_t", stamps), *columns]
    kinds: dict[str, str] = {}
    for name, kind, _ in fields:
        base, bracket, _ = name.partition("[")
        size = sum(other.partition("[")[0] == base for other, _, _ in fields)
        kinds[base] = f"{kind}[{size}]" if bracket else kind
    text = f"{topic}:" + "".join(f"{kind} {name};" for name, kind in kinds.items())
    log.message_formats[topic] = ULog.MessageFormat(text.encode("ascii"), None)
    buffer = np.empty(len(stamps), [(name, _TYPES[kind]) for name, kind, _ in fields])
    for name, _, values in fields:
        buffer[name] = values
    log.data_list.append(
        ULog.Data(
            SimpleNamespace(
                multi_id=0,
                msg_id=len(log.data_list),
                message_name=topic,
                field_data=[SimpleNamespace(field_name=name, type_str=kind) for name, kind, _ in fields],
                timestamp_idx=0,
                buffer=buffer.tobytes(),
                dtype=buffer.dtype,
            )
        )
    )
