"""What an autopilot tells the ground."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.autopilots import Autopilots, LinkEvents
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.channel import Inbox
from ftcc.link.mavlink import AUTOPILOT, LOOPBACK, Endpoint, dialect, float_array

__all__ = ["LINK_FIELDS", "Reporter"]

LINK_FIELDS = ("sender", "age", "received", "lost", "cut")
"""Numbers per in-edge in the DEBUG_FLOAT_ARRAY "links"; age -1 = never heard."""


class Reporter:
    """The ground link of one autopilot."""

    def __init__(self, spec: AutopilotSpec, port: int, station: int) -> None:
        self._spec = spec
        self._endpoint = Endpoint(spec.uav, AUTOPILOT, port, (LOOPBACK, station))

    def fileno(self) -> int:
        """For ``select``."""
        return self._endpoint.fileno()

    def close(self) -> None:
        self._endpoint.close()

    def heartbeat(self) -> None:
        """HEARTBEAT, once a second of wall time."""
        self._endpoint.send(
            dialect.MAVLink_heartbeat_message(
                dialect.MAV_TYPE_FIXED_WING,
                dialect.MAV_AUTOPILOT_PX4,
                dialect.MAV_MODE_FLAG_SAFETY_ARMED | dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
                0,
                dialect.MAV_STATE_ACTIVE,
                3,
            )
        )

    def report(
        self,
        now_us: int,
        state: NDArray[np.float64],
        autopilots: Autopilots,
        inbox: Inbox,
        events: LinkEvents,
        i: int,
    ) -> None:
        """Attitude and position as the vehicle told them (``state``), the scheme's signals, the state of the links."""
        stamp = now_us // 1000
        q0, q1, q2, q3, p, q, r, x, y, z, vx, vy, vz = state.tolist()
        roll = math.atan2(2.0 * (q0 * q1 + q2 * q3), 1.0 - 2.0 * (q1 * q1 + q2 * q2))
        pitch = math.asin(max(-1.0, min(1.0, 2.0 * (q0 * q2 - q3 * q1))))
        yaw = math.atan2(2.0 * (q0 * q3 + q1 * q2), 1.0 - 2.0 * (q2 * q2 + q3 * q3))
        messages = [
            dialect.MAVLink_attitude_message(stamp, roll, pitch, yaw, p, q, r),
            dialect.MAVLink_local_position_ned_message(stamp, x, y, z, vx, vy, vz),
            float_array(now_us, "links", self._links(inbox, events, i)),
        ]
        if self._spec.role == "follower":
            messages.append(float_array(now_us, "signals", autopilots.signals[i].tolist()))
        self._endpoint.send(*messages)

    @staticmethod
    def _links(inbox: Inbox, events: LinkEvents, i: int) -> list[float]:
        values: list[float] = []
        for edge in range(int(inbox.degree[i])):
            sender, _, _, _, received, lost, _ = inbox.edges[i, edge].tolist()
            cut = inbox.quality[i, edge, 6] > 0.0 or not events.radio_on[i]
            age = float(inbox.age[i, edge]) if inbox.valid[i, edge] else -1.0
            values += [sender, age, received, lost, float(cut)]
        return values
