"""The offboard side of the player of PX4: modes, arming, message rates, targets and what happens without them.

After PX4's public sources, of which px4_custom_mode.h alone was compared line by line: px4-rc.mavlink (port 14580 + n
towards 14540 + n), mavlink_receiver.cpp (SET_ATTITUDE_TARGET, COMMAND_LONG), and the page "Offboard Mode" of its
guide: OFFBOARD needs a stream above 2 Hz before it is entered, and is left COM_OF_LOSS_T after the last target, on
PX4's clock.
"""

from __future__ import annotations

import math
import socket
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

from tests.support.px4_player import Player

OFFBOARD, LOITER, MANUAL = 6 << 16, 4 << 16 | 3 << 24, 1 << 16
LOSS_US = 500_000
"""COM_OF_LOSS_T, us."""
_ACCEPTED, _TEMPORARILY, _UNSUPPORTED = 0, 1, 3
_EARTH = 6_378_137.0


class OffboardPlayer(Player):
    """A player that flies attitude targets.

    Parameters
    ----------
    door : TCP port of the door.
    own, other : UDP ports of its offboard link: its own, and that to which it sends.
    leave_at : simulated time at which a pilot takes over by MANUAL, s.
    """

    def __init__(self, door: int, own: int, other: int, leave_at: float = math.inf) -> None:
        super().__init__(door, arm_at=math.inf)
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.bind(("127.0.0.1", own))
        self.link.setblocking(False)
        self.other, self.leave_at = ("127.0.0.1", other), leave_at
        self.out = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self.into = mavlink.MAVLink(None)
        self.into.robust_parsing = True
        self.mode, self.is_armed = LOITER, False
        self.intervals: dict[int, int] = {}
        self.next: dict[int, int] = {}
        self.target: Any = None
        self.heard: list[int] = []
        """Times of the last targets, us."""
        self.origin: tuple[int, int, int] | None = None

    def answer(self) -> None:
        """The step of all modules: the offboard link, the commander, the attitude loop."""
        truth = self.truth
        if self.origin is None:
            # The estimator's origin is where it was aligned.
            self.origin = truth.lat, truth.lon, truth.alt
        self.listen()
        if self.mode == OFFBOARD and self.clock - self.heard[-1] > LOSS_US:
            self.mode = LOITER
        if self.clock / 1e6 > self.leave_at and self.mode == OFFBOARD:
            self.mode = MANUAL
        self.stream()
        self.arm_at = 0.0 if self.is_armed else math.inf
        super().answer()

    def listen(self) -> None:
        while True:
            try:
                data, _ = self.link.recvfrom(2048)
            except (BlockingIOError, ConnectionRefusedError):
                return
            for message in self.into.parse_buffer(data) or ():
                kind = message.get_type()
                if kind == "SET_ATTITUDE_TARGET" and message.target_system == 1:
                    # Attitude counts, rates do not.
                    assert message.type_mask == 7
                    self.target = message
                    self.heard = [*self.heard[-10:], self.clock]
                elif kind == "COMMAND_LONG" and message.target_system == 1:
                    self.send(mavlink.MAVLink_command_ack_message(message.command, self.command(message)))

    def command(self, message: Any) -> int:
        if message.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.intervals[int(message.param1)] = int(message.param2)
        elif message.command == mavlink.MAV_CMD_DO_SET_MODE and int(message.param2) == 6:
            recent = [stamp for stamp in self.heard if self.clock - stamp <= LOSS_US]
            if message.param1 != 1 or len(recent) < 2:
                return _TEMPORARILY
            self.mode = OFFBOARD
        elif message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self.is_armed = message.param1 == 1
        else:
            return _UNSUPPORTED
        return _ACCEPTED

    def send(self, message: Any) -> None:
        self.link.sendto(message.pack(self.out), self.other)

    def due(self, number: int, interval: int) -> bool:
        if self.clock < self.next.get(number, 0):
            return False
        self.next[number] = self.clock + interval
        return True

    def stream(self) -> None:
        truth, stamp = self.truth, self.clock // 1000
        assert self.origin is not None
        if self.due(0, 1_000_000):
            armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.is_armed else 0
            self.send(mavlink.MAVLink_heartbeat_message(1, mavlink.MAV_AUTOPILOT_PX4, 1 | armed, self.mode, 4, 3))
        for number, interval in self.intervals.items():
            if not self.due(number, interval):
                continue
            if number == mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION:
                rates = truth.rollspeed, truth.pitchspeed, truth.yawspeed
                self.send(mavlink.MAVLink_attitude_quaternion_message(stamp, *truth.attitude_quaternion, *rates))
            elif number == mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
                latitude, longitude, altitude = self.origin
                north = math.radians((truth.lat - latitude) / 1e7) * _EARTH
                scale = _EARTH * math.cos(math.radians(latitude / 1e7))
                east = math.radians((truth.lon - longitude) / 1e7) * scale
                self.send(
                    mavlink.MAVLink_local_position_ned_message(
                        stamp, north, east, (altitude - truth.alt) / 1e3, truth.vx / 1e2, truth.vy / 1e2, truth.vz / 1e2
                    )
                )
            elif number == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN:
                self.send(mavlink.MAVLink_gps_global_origin_message(*self.origin))

    def hold(self, controls: list[float]) -> None:
        """Fly roll and pitch of the target in OFFBOARD, as fw_att_control does; otherwise level flight."""
        if self.mode != OFFBOARD:
            super().hold(controls)
            return
        roll, pitch = angles(self.truth.attitude_quaternion)
        wanted_roll, wanted_pitch = angles(self.target.q)
        aileron = 1.2 * (wanted_roll - roll) - 0.2 * self.truth.rollspeed
        elevator = 0.8 * (wanted_pitch - pitch) - 0.2 * self.truth.pitchspeed + 0.1
        controls[2] = -0.1 * self.truth.yawspeed
        controls[4] = max(0.0, min(1.0, self.target.thrust))
        controls[5], controls[6] = -aileron, aileron
        controls[7] = elevator


def angles(q: Any) -> tuple[float, float]:
    """Roll and pitch, rad."""
    w, x, y, z = q
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll, math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))


if __name__ == "__main__":
    import sys

    OffboardPlayer(*map(int, sys.argv[1:4]), *map(float, sys.argv[4:])).run()
