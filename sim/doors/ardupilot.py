"""The door for ArduPilot: its JSON interface, by which an outside program is the physics of its software in the loop.

Written from ArduPilot's public description (libraries/SITL/examples/JSON/readme.md) and SIM_JSON.cpp. ArduPilot sends a
frame of servo pulses by UDP and waits for one line of JSON; a frame without an answer it sends again, with the same
number. It makes its own sensor readings of the state that it gets, so here the state is true and without noise.
"""

from __future__ import annotations

import contextlib
import json
import socket
import struct
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.mavlink import LOOPBACK
from ftcc.link.ports import PortError
from ftcc.sim.doors.channels import Channels, by_pwm, checked
from ftcc.sim.doors.vehicle import DoorVehicle

__all__ = ["PORT", "ArduPilotDoor", "Frame", "read_frame"]

PORT = 9002
"""ArduPilot instance n sends to this port + 10 n."""
_FEW, _MANY = 16, 32
_MAGIC = {18458: struct.Struct(f"<HHI{_FEW}H"), 29569: struct.Struct(f"<HHI{_MANY}H")}
"""First number of a frame, and its layout: magic, frame rate (Hz), frame count, pulses (us)."""
_LONGEST_US = 20_000
"""Longest step, us, whatever frame rate is asked for."""
_READ = 2048


class Frame(NamedTuple):
    """What ArduPilot sends."""

    rate: int
    """Steps that it asks for, Hz."""
    number: int
    """Grows by one with every answer; begins again when ArduPilot does."""
    pulses: tuple[int, ...]
    """us."""


def read_frame(data: bytes) -> Frame | None:
    """Read a datagram; None if it is no frame of 16 or 32 channels."""
    layout = _MAGIC.get(int.from_bytes(data[:2], "little"))
    if layout is None or len(data) != layout.size:
        return None
    _, rate, number, *pulses = layout.unpack(data)
    return Frame(rate, number, tuple(pulses))


class ArduPilotDoor:
    """One aircraft and the ArduPilot that flies it.

    Parameters
    ----------
    vehicle : the aircraft.
    port : UDP port on loopback to which ArduPilot sends.
    table : the tasks of its channels.
    report : called with what the user should know.

    Raises
    ------
    PortError
        If the port is in use.
    ChannelError
        If the table cannot be used.
    """

    autopilot = "ArduPilot"
    armed = True
    """A frame does not say whether ArduPilot is armed: the throttle does, which is idle as long as it is not."""
    running_free = False

    def __init__(self, vehicle: DoorVehicle, port: int, table: Channels, report: Callable[[str], None]) -> None:
        self.vehicle, self.port = vehicle, port
        self.controls: NDArray[np.float64] = np.zeros(4)
        """Fractions of travel."""
        self.gone = ""
        self.bad = 0
        """Datagrams that were no frames, or came from a stranger."""
        self.missed = 0
        """Frames that never arrived."""
        self._table, self._report = checked(table, _FEW), report
        self._peer: tuple[str, int] | None = None
        self._frame: Frame | None = None
        """The newest one."""
        self._answer, self._answered = b"", -1
        """The last answer, and the number of the frame that it answers."""
        self._began_us = 0
        """When this ArduPilot's time began, us."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((LOOPBACK, port))
        except OSError as error:
            self._socket.close()
            raise PortError(f"port {port}: {error.strerror or error}") from None
        self._socket.setblocking(False)

    def fileno(self) -> int:
        """For ``select``."""
        return self._socket.fileno()

    @property
    def connected(self) -> bool:
        """Whether ArduPilot has sent a frame."""
        return self._frame is not None

    @property
    def answered(self) -> bool:
        """Whether the next step may be taken: ArduPilot has sent the frame after the last answer."""
        return self._frame is not None and self._frame.number > self._answered

    def read(self) -> None:
        """Take in the frames at hand; only the newest counts, and one that has been answered is answered again."""
        newest: Frame | None = None
        while True:
            try:
                data, sender = self._socket.recvfrom(_READ)
            except BlockingIOError:
                break
            except OSError:
                continue  # a port to which an answer went is closed
            frame = read_frame(data)
            if frame is None:
                self.bad += 1
            elif self._frame is None or self._is_anew(frame, self._frame, sender):
                self._begin(frame, sender)
                newest = frame
            elif sender == self._peer:
                self.missed += max(0, frame.number - self._frame.number - 1)
                self._frame = newest = frame
            else:
                self.bad += 1
        if newest is None:
            return
        by_pwm(self._table, newest.pulses, self.controls)
        if newest.number == self._answered:
            self._transmit()

    def _is_anew(self, frame: Frame, before: Frame, sender: tuple[str, int]) -> bool:
        """Whether ArduPilot was started again."""
        return frame.number < before.number or (frame.number == 0 and sender != self._peer)

    def _begin(self, frame: Frame, sender: tuple[str, int]) -> None:
        """Begin with an ArduPilot: the first one, or one that was started again."""
        if self._frame is not None and self.vehicle.launched_us is not None:
            self.gone = "ArduPilot was started again in flight"
            return
        if self._frame is not None:
            self._report("ArduPilot was started again")
        self._peer, self._frame = sender, frame
        self._answered, self._began_us = -1, self.vehicle.now_us
        wanted = min(_LONGEST_US, round(1e6 / max(frame.rate, 1)))
        self.vehicle.set_period(wanted, exactly=False)

    def send(self) -> None:
        """Answer the frame at hand with the state."""
        assert self._frame is not None
        motion = self.vehicle.motion
        north, east, up = motion.position
        state = {
            # From one period on, so that the first step takes time too.
            "timestamp": (self.vehicle.now_us - self._began_us + self.vehicle.period_us) / 1e6,
            "imu": {"gyro": motion.rates, "accel_body": motion.force},
            "position": (north, east, -up),
            "quaternion": motion.quaternion,
            "velocity": motion.velocity,
            "airspeed": motion.airspeed,
        }
        # ArduPilot's reader finds a value right behind the colon, and the line between two line ends.
        self._answer = b"\n" + json.dumps(state, separators=(",", ":")).encode() + b"\n"
        self._answered = self._frame.number
        self._transmit()

    def _transmit(self) -> None:
        assert self._peer is not None
        with contextlib.suppress(OSError):  # full, or gone: ArduPilot asks again
            self._socket.sendto(self._answer, self._peer)

    def close(self) -> None:
        """Free the port."""
        self._socket.close()
