"""Exports an MCAP file with JSON messages, for Foxglove, PlotJuggler and others."""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ftcc.groundside.results.poses import Poses, poses
from ftcc.groundside.results.recording import require
from ftcc.groundside.results.rows import columns_by_uav, nanoseconds, recorded_rows
from ftcc.groundside.results.run import Run

__all__ = ["write_mcap"]

_LEVELS = {"info": 2, "warning": 3, "error": 4}
"""Level of ``foxglove.Log`` for each severity of an event."""
_FRAME = "map"
"""The local frame: east, north, up."""

_Message = tuple[int, str, dict[str, Any]]
"""Unix time (ns), topic, content."""


def write_mcap(run: Run, file: Path) -> None:
    """Write an MCAP file; times are those of the run's start plus simulated time.

    Topics: ``/uavN/recording``, a message per recorded row with the columns by their names (z up), without those that
    are no finite number; and, from the true states at up to 10 Hz, ``/uavN/position`` (``foxglove.LocationFix``),
    ``/uavN/pose`` (``foxglove.PoseInFrame``) and ``/tf`` (``foxglove.FrameTransform``), in east, north, up. Events are
    in ``/events`` (``foxglove.Log``). The scenario as flown is an attachment.

    Raises
    ------
    MissingPackageError
        If the library mcap is not installed.
    RunError
        If nothing was recorded.
    OSError
        If it cannot be written.
    """
    writer_module = require("mcap.writer", "format mcap", "--format ulog", "'ftcc-sitl[mcap]'")
    columns = columns_by_uav(run)
    # Positions first: if there are none, no file is begun.
    flights = [_flight(run, uav, poses(run, uav)) for uav in run.uavs]
    with file.open("wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start(library="ftcc-sitl")
        channels = _channels(writer, run, columns)
        for time_ns, topic, content in heapq.merge(
            _recording(run, columns), *flights, _events(run), key=lambda message: message[0]
        ):
            text = json.dumps(content, separators=(",", ":"), allow_nan=False)
            writer.add_message(channels[topic], time_ns, text.encode(), time_ns)
        mission = run.mission
        facts = {"run": run.path.resolve().name, "scenario": mission.name, "case": mission.case}
        writer.add_metadata("ftcc-sitl", {**facts, "seed": str(mission.timing.seed)})
        begun = nanoseconds(run, 0.0)
        scenario = (run.path / "scenario.toml").read_bytes()
        writer.add_attachment(begun, begun, "scenario.toml", "application/toml", scenario)
        writer.finish()


def _recording(run: Run, columns: dict[int, tuple[str, ...]]) -> Iterator[_Message]:
    for t, uav, row in recorded_rows(run, columns):
        numbers = {name: x for name, x in zip(columns[uav], row.tolist(), strict=True) if math.isfinite(x)}
        yield nanoseconds(run, t), f"/uav{uav}/recording", {"t": t, **numbers}


def _flight(run: Run, uav: int, found: Poses) -> Iterator[_Message]:
    """Yield position on earth, pose and transform of a UAV."""
    where, turned = found.position_enu.tolist(), found.attitude_enu.tolist()
    for n, time_us in enumerate(found.time_us.tolist()):
        time_ns = nanoseconds(run, time_us / 1e6)
        stamp = _stamp(time_ns)
        position = dict(zip("xyz", where[n], strict=True))
        orientation = dict(zip("xyzw", turned[n], strict=True))
        fix = {
            "timestamp": stamp,
            "frame_id": f"uav{uav}",
            "latitude": int(found.place[n, 0]) / 1e7,
            "longitude": int(found.place[n, 1]) / 1e7,
            "altitude": float(found.altitude[n]),
            "position_covariance": [0.0] * 9,
            "position_covariance_type": 0,
        }
        pose = {"timestamp": stamp, "frame_id": _FRAME, "pose": {"position": position, "orientation": orientation}}
        transform = {
            "timestamp": stamp,
            "parent_frame_id": _FRAME,
            "child_frame_id": f"uav{uav}",
            "translation": position,
            "rotation": orientation,
        }
        yield time_ns, f"/uav{uav}/position", fix
        yield time_ns, f"/uav{uav}/pose", pose
        yield time_ns, "/tf", transform


def _events(run: Run) -> Iterator[_Message]:
    for event in sorted(run.events, key=lambda event: float(event["t"])):
        time_ns = nanoseconds(run, max(0.0, float(event["t"])))
        name = "swarm" if event["uav"] is None else f"UAV {event['uav']}"
        level = _LEVELS[event["severity"]]
        log = {"timestamp": _stamp(time_ns), "level": level, "message": event["text"], "name": name}
        yield time_ns, "/events", {**log, "file": "", "line": 0}


def _stamp(time_ns: int) -> dict[str, int]:
    return {"sec": time_ns // 1_000_000_000, "nsec": time_ns % 1_000_000_000}


def _channels(writer: Any, run: Run, columns: dict[int, tuple[str, ...]]) -> dict[str, int]:
    """Register all schemas and topics; return the channels by topic."""

    def schema(name: str, properties: dict[str, Any]) -> int:
        text = json.dumps({"title": name, "type": "object", "properties": properties})
        return int(writer.register_schema(name, "jsonschema", text.encode()))

    def channel(topic: str, schema_id: int) -> int:
        return int(writer.register_channel(topic, "json", schema_id))

    fix, pose, transform, log = (schema(name, properties) for name, properties in _FOXGLOVE.items())
    channels = {"/tf": channel("/tf", transform), "/events": channel("/events", log)}
    for uav, names in columns.items():
        recorded = {
            name: {"type": "number", "description": f"{run.columns[name].meaning}, {run.columns[name].unit}"}
            for name in ("t", *names)
        }
        topics = {"recording": schema(f"ftcc.uav{uav}.Recording", recorded), "position": fix, "pose": pose}
        for topic, schema_id in topics.items():
            channels[f"/uav{uav}/{topic}"] = channel(f"/uav{uav}/{topic}", schema_id)
    return channels


_NUMBER, _INTEGER, _TEXT = {"type": "number"}, {"type": "integer"}, {"type": "string"}


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


_TIME = {**_object(sec=_INTEGER, nsec=_INTEGER), "title": "time"}
_VECTOR = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_FOXGLOVE: dict[str, dict[str, Any]] = {
    "foxglove.LocationFix": {
        "timestamp": _TIME,
        "frame_id": _TEXT,
        "latitude": _NUMBER,
        "longitude": _NUMBER,
        "altitude": _NUMBER,
        "position_covariance": {"type": "array", "items": _NUMBER, "minItems": 9, "maxItems": 9},
        "position_covariance_type": _INTEGER,
    },
    "foxglove.PoseInFrame": {
        "timestamp": _TIME,
        "frame_id": _TEXT,
        "pose": _object(position=_VECTOR, orientation=_QUATERNION),
    },
    "foxglove.FrameTransform": {
        "timestamp": _TIME,
        "parent_frame_id": _TEXT,
        "child_frame_id": _TEXT,
        "translation": _VECTOR,
        "rotation": _QUATERNION,
    },
    "foxglove.Log": {
        "timestamp": _TIME,
        "level": _INTEGER,
        "message": _TEXT,
        "name": _TEXT,
        "file": _TEXT,
        "line": _INTEGER,
    },
}
"""Foxglove's own schemas that are used: what its panels recognize by name."""
