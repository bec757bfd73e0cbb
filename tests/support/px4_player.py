"""A player of PX4's end of the simulator protocol: no autopilot, but it speaks as PX4's software in the loop does.

Written from PX4's public sources: src/modules/simulation/simulator_mavlink/SimulatorMavlink.cpp (who connects, what is
sent first, that the clock is set by HIL_SENSOR.time_usec, how controls are built), ROMFS/px4fmu_common/init.d-posix/
px4-rc.mavlinksim (ports), airframes/1036_jsbsim_malolo (channels). It holds attitude and height by the ground truth of
HIL_STATE_QUATERNION, so that the aircraft stays in the air.

    python -m tests.support.px4_player --port 4561 --arm-at 1.0
"""

from __future__ import annotations

import argparse
import math
import socket
import time
from typing import Any

from pymavlink.dialects.v20 import common as mavlink

UP_AT = 0.2
"""The player's modules are up, and answer, from this simulated time on, s."""


class Player:
    """One instance.

    Parameters
    ----------
    arm_at : simulated time at which it arms and gives thrust, s.
    die_at : simulated time at which it closes its connection, s.
    junk : whether it sends bytes between its messages that are no MAVLink.
    own_clock : whether answers are stamped since the first sample (main), or with the sample's time (2021): in lockstep
        platforms/posix/src/px4/common/drv_hrt.cpp counts from the first time that is set, and 2021 adds it again.
    """

    def __init__(
        self, port: int, arm_at: float = 1.0, die_at: float = math.inf, junk: bool = False, own_clock: bool = False
    ) -> None:
        self.port, self.arm_at, self.die_at, self.junk, self.own_clock = port, arm_at, die_at, junk, own_clock
        self.mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self.mav.robust_parsing = True
        self.clock = 0
        """us, set by HIL_SENSOR alone."""
        self.began = 0
        """Its first value."""
        self.truth: Any = None
        self.height: float | None = None
        self.samples = self.fixes = 0

    def run(self) -> None:
        """Connect, and answer until the simulator closes the connection or ``die_at``."""
        self.connection = self.connect()
        interval = mavlink.MAVLink_command_long_message(0, 0, 511, 0, 115, 5000, 0, 0, 0, 0, 0)
        self.connection.sendall(interval.pack(self.mav))
        self.connection.sendall(mavlink.MAVLink_heartbeat_message(0, 12, 0, 0, 0, 3).pack(self.mav))
        while self.clock / 1e6 < self.die_at:
            try:
                data = self.connection.recv(65536)
            except ConnectionResetError:
                break
            if not data:
                break
            for message in self.mav.parse_buffer(data) or ():
                self.take(message)
        self.connection.close()

    def connect(self) -> socket.socket:
        """Try every half a millisecond until it is accepted."""
        while True:
            connection = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                connection.connect(("127.0.0.1", self.port))
            except OSError:
                connection.close()
                time.sleep(0.0005)
            else:
                return connection

    def take(self, message: Any) -> None:
        """Read a message; a sample of the sensors lets a step pass."""
        kind = message.get_type()
        if kind == "HIL_STATE_QUATERNION":
            self.truth = message
        elif kind == "HIL_GPS":
            self.fixes += 1
        elif kind == "HIL_SENSOR":
            assert message.time_usec > self.clock, "the clock must not stand or go back"
            assert message.fields_updated & 0x1FFF == 0x1FFF
            self.clock = message.time_usec
            self.began = self.began or self.clock
            self.samples += 1
            if self.clock / 1e6 >= UP_AT:
                self.answer()

    def answer(self) -> None:
        """Send one HIL_ACTUATOR_CONTROLS."""
        armed = self.clock / 1e6 >= self.arm_at
        controls = [0.0] * 16
        if armed:
            self.hold(controls)
        message = mavlink.MAVLink_hil_actuator_controls_message(
            self.clock - (self.began if self.own_clock else 0), controls, 1 | (128 if armed else 0), 1
        )
        if self.junk:
            self.connection.sendall(b"\xfd\x00junk\xfe")
        try:
            self.connection.sendall(message.pack(self.mav))
        except OSError:
            self.die_at = 0.0

    def hold(self, controls: list[float]) -> None:
        """Level wings and the height of the launch: proportional to angles and rates, with positive moments."""
        truth = self.truth
        w, x, y, z = truth.attitude_quaternion
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
        if self.height is None:
            self.height = truth.alt / 1e3
        climb = max(-0.1, min(0.1, 0.01 * (self.height - truth.alt / 1e3) + 0.02 * truth.vz / 1e2))
        aileron = -0.4 * roll - 0.1 * truth.rollspeed
        elevator = 0.8 * (0.06 + climb - pitch) - 0.2 * truth.pitchspeed + 0.1
        rudder = -0.1 * truth.yawspeed
        controls[2] = rudder
        controls[4] = max(0.0, min(1.0, 0.25 + 0.1 * (30.0 - truth.true_airspeed / 1e2)))
        controls[5], controls[6] = -aileron, aileron
        controls[7] = elevator


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--arm-at", type=float, default=1.0)
    parser.add_argument("--die-at", type=float, default=math.inf)
    parser.add_argument("--junk", action="store_true")
    parser.add_argument("--own-clock", action="store_true")
    options = parser.parse_args()
    Player(options.port, options.arm_at, options.die_at, options.junk, options.own_clock).run()


if __name__ == "__main__":
    main()
