"""A player of ArduPilot's end of the JSON interface: no autopilot, but it speaks as ArduPilot's simulation does.

Written from ArduPilot's public sources: libraries/SITL/examples/JSON/readme.md and libraries/SITL/SIM_JSON.cpp and .h
(layout of a frame, its count, frames sent again, and a reader of JSON that looks for keys and takes no space behind a
colon). It holds attitude and height by the state that it is sent, so that the aircraft stays in the air.

    python -m tests.support.ardupilot_player --port 9002
"""

from __future__ import annotations

import argparse
import math
import re
import socket
import struct

FRAME = struct.Struct("<HHI16H")
MAGIC = 18458
REQUIRED = {"timestamp": 1, "gyro": 3, "accel_body": 3, "position": 3, "quaternion": 4, "velocity": 3, "airspeed": 1}
"""Keys, and how many numbers each has."""
_NUMBER = rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"


def read_state(data: bytes) -> dict[str, tuple[float, ...]]:
    """Read a line as SIM_JSON does: framed by two line ends; the first place of a key counts, no space behind it."""
    lines = data.split(b"\n")
    assert (lines[0], lines[-1]) == (b"", b""), "a line must stand between two line ends"
    line = lines[-2]
    state = {}
    for key, count in REQUIRED.items():
        at = line.index(b'"' + key.encode() + b'"') + len(key) + 3
        numbers = rb",\s*".join([b"(" + _NUMBER + b")"] * count)
        found = re.compile(rb"\[" + numbers + rb"\]" if count > 1 else numbers).match(line, at)
        assert found, f"{key}: not readable in {line[at : at + 60]!r}"
        state[key] = tuple(float(one) for one in found.groups())
    return state


class Player:
    """One instance.

    Parameters
    ----------
    rate : frames per simulated second that it asks for, Hz (SIM_RATE_HZ).
    throttle_at : simulated time from which on it gives thrust, s.
    """

    def __init__(self, port: int, rate: int = 1200, throttle_at: float = 1.0) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.settimeout(1.0)
        self.peer = ("127.0.0.1", port)
        self.rate, self.throttle_at = rate, throttle_at
        self.count = 0
        self.resent = 0
        self.time = 0.0
        self.state: dict[str, tuple[float, ...]] = {}
        self.height: float | None = None

    def frame(self) -> bytes:
        """The frame of the present count."""
        return FRAME.pack(MAGIC, self.rate, self.count, *self.pulses())

    def step(self) -> None:
        """Send a frame and read its answer; send it again after every second without one."""
        while True:
            self.socket.sendto(self.frame(), self.peer)
            try:
                data = self.socket.recv(65536)
            except TimeoutError:
                self.resent += 1
                continue
            self.state = read_state(data)
            assert self.state["timestamp"][0] >= self.time, "physics time must not go back"
            self.time = self.state["timestamp"][0]
            self.count += 1
            return

    def pulses(self) -> list[int]:
        """Servo pulses, us: SERVO1 aileron, SERVO2 elevator, SERVO3 throttle, SERVO4 rudder; the rest without."""
        if not self.state or self.time < self.throttle_at:
            return [1500, 1500, 1000, 1500] + [0] * 12
        w, x, y, z = self.state["quaternion"]
        roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
        pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
        p, q, r = self.state["gyro"]
        up = -self.state["position"][2]
        if self.height is None:
            self.height = up
        climb = max(-0.1, min(0.1, 0.01 * (self.height - up) + 0.02 * self.state["velocity"][2]))
        aileron = -0.4 * roll - 0.1 * p
        elevator = 0.8 * (0.06 + climb - pitch) - 0.2 * q + 0.1
        throttle = max(0.0, min(1.0, 0.25 + 0.1 * (30.0 - self.state["airspeed"][0])))
        signals = (aileron, elevator, 2.0 * throttle - 1.0, -0.1 * r)
        return [round(1500 + 500 * max(-1.0, min(1.0, signal))) for signal in signals] + [0] * 12

    def run(self) -> None:
        """Fly until this process is ended."""
        while True:
            self.step()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--rate", type=int, default=1200)
    options = parser.parse_args()
    Player(options.port, options.rate).run()


if __name__ == "__main__":
    main()
