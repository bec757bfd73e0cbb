"""Exports a rosbag2, a folder that ROS 2 plays back; standard message types only."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ftcc.groundside.results.folders import RunError
from ftcc.groundside.results.poses import Poses, poses
from ftcc.groundside.results.recording import require
from ftcc.groundside.results.rows import columns_by_uav, nanoseconds, recorded_rows
from ftcc.groundside.results.run import Run

__all__ = ["write_rosbag2"]

_VERSION = 8
"""Of the bag's format; ROS 2 Humble and later read it."""
_FRAME = "map"
"""The local frame: east, north, up."""

_TYPES = {
    "columns": "std_msgs/msg/String",
    "recording": "std_msgs/msg/Float64MultiArray",
    "odometry": "nav_msgs/msg/Odometry",
    "fix": "sensor_msgs/msg/NavSatFix",
}
"""Type of each topic of a UAV."""

_Message = tuple[int, str, Any]
"""Unix time (ns), topic, content."""


def write_rosbag2(run: Run, folder: Path) -> list[Path]:
    """Write a rosbag2 (SQLite) into ``folder``, which must not exist; times are the run's start plus simulated time.

    Topics: ``/uavN/columns`` (names, once) and ``/uavN/recording`` (their values, a message per recorded row, z up);
    from the true states at up to 10 Hz ``/uavN/odometry`` (pose in east, north, up; twist along the body's axes
    forward, left, up) and ``/uavN/fix``. Events are in ``/rosout``.

    Raises
    ------
    MissingPackageError
        If the library rosbags is not installed.
    RunError
        If nothing was recorded, or the folder exists.
    OSError
        If it cannot be written.
    """
    rosbag2 = require("rosbags.rosbag2", "format rosbag2", "--format mcap", "'ftcc-sitl[rosbag2]'")
    from rosbags.typesys import Stores, get_typestore

    if folder.exists():
        raise RunError(f"{folder}: exists; a rosbag2 needs a folder of its own, which does not exist yet")
    store: Any = get_typestore(Stores.ROS2_HUMBLE)
    columns = columns_by_uav(run)
    # Positions first: if there are none, no bag is begun.
    flights = [_flight(run, uav, poses(run, uav), store) for uav in run.uavs]
    folder.parent.mkdir(parents=True, exist_ok=True)
    with rosbag2.Writer(folder, version=_VERSION) as bag:
        topics = {f"/uav{uav}/{name}": kind for uav in columns for name, kind in _TYPES.items()}
        topics["/rosout"] = "rcl_interfaces/msg/Log"
        kinds = {topic: (bag.add_connection(topic, kind, typestore=store), kind) for topic, kind in topics.items()}
        for time_ns, topic, content in heapq.merge(
            _recording(run, columns, store), *flights, _events(run, store), key=lambda message: message[0]
        ):
            connection, kind = kinds[topic]
            bag.write(connection, time_ns, store.serialize_cdr(content, kind))
    return sorted(folder.iterdir())


def _recording(run: Run, columns: dict[int, tuple[str, ...]], store: Any) -> Iterator[_Message]:
    string, array, layout = (
        store.types[f"std_msgs/msg/{name}"] for name in ("String", "Float64MultiArray", "MultiArrayLayout")
    )
    for uav, names in columns.items():
        yield nanoseconds(run, 0.0), f"/uav{uav}/columns", string(",".join(("t", *names)))
    plain = layout([], 0)
    for t, uav, row in recorded_rows(run, columns):
        yield nanoseconds(run, t), f"/uav{uav}/recording", array(plain, np.concatenate(([t], row)))


def _flight(run: Run, uav: int, found: Poses, store: Any) -> Iterator[_Message]:
    """Yield odometry and position on earth of a UAV."""
    types = store.types
    odometry, fix, status = (
        types[name] for name in ("nav_msgs/msg/Odometry", "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/NavSatStatus")
    )
    point, vector, quaternion, pose, twist, with_pose, with_twist = (
        types[f"geometry_msgs/msg/{name}"]
        for name in ("Point", "Vector3", "Quaternion", "Pose", "Twist", "PoseWithCovariance", "TwistWithCovariance")
    )
    where, turned = found.position_enu.tolist(), found.attitude_enu.tolist()
    velocity, rates = found.velocity_body.tolist(), found.rates_body.tolist()
    for n, time_us in enumerate(found.time_us.tolist()):
        time_ns = nanoseconds(run, time_us / 1e6)
        moved = odometry(
            _header(store, time_ns, _FRAME),
            f"uav{uav}",
            with_pose(pose(point(*where[n]), quaternion(*turned[n])), np.zeros(36)),
            with_twist(twist(vector(*velocity[n]), vector(*rates[n])), np.zeros(36)),
        )
        at = fix(
            _header(store, time_ns, f"uav{uav}"),
            status(status.STATUS_FIX, status.SERVICE_GPS),
            int(found.place[n, 0]) / 1e7,
            int(found.place[n, 1]) / 1e7,
            float(found.altitude[n]),
            np.zeros(9),
            fix.COVARIANCE_TYPE_UNKNOWN,
        )
        yield time_ns, f"/uav{uav}/odometry", moved
        yield time_ns, f"/uav{uav}/fix", at


def _events(run: Run, store: Any) -> Iterator[_Message]:
    log = store.types["rcl_interfaces/msg/Log"]
    levels = {"info": log.INFO, "warning": log.WARN, "error": log.ERROR}
    for event in sorted(run.events, key=lambda event: float(event["t"])):
        time_ns = nanoseconds(run, max(0.0, float(event["t"])))
        name = "swarm" if event["uav"] is None else f"uav{event['uav']}"
        stamp = _header(store, time_ns, "").stamp
        yield time_ns, "/rosout", log(stamp, levels[event["severity"]], name, event["text"], "", "", 0)


def _header(store: Any, time_ns: int, frame: str) -> Any:
    stamp = store.types["builtin_interfaces/msg/Time"](time_ns // 1_000_000_000, time_ns % 1_000_000_000)
    return store.types["std_msgs/msg/Header"](stamp, frame)
