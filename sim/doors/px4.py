"""The door for PX4: the aircraft is the simulator to which PX4's software in the loop connects.

Written from PX4's public sources (modules simulator and simulator_mavlink, start scripts rcS and px4-rc.*) and the
MAVLink definitions. PX4 connects to our TCP port and is silent; its clock is set by HIL_SENSOR.time_usec alone. It
answers a sample with HIL_ACTUATOR_CONTROLS once it is up.
"""

from __future__ import annotations

import contextlib
import math
import socket
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.link.codec import Codec, dialect
from ftcc.link.mavlink import LOOPBACK, SIMULATOR
from ftcc.link.ports import PortError
from ftcc.sim.doors.channels import Channels, checked, fractions
from ftcc.sim.doors.sensors import Fix, Readings, height_of
from ftcc.sim.doors.vehicle import DoorVehicle

__all__ = ["PERIOD_US", "PORT", "Px4Door"]

PORT = 4560
"""PX4 instance n connects to this port + n."""
PERIOD_US = 4000
"""Time between two HIL_SENSOR, us: the 250 Hz for which PX4's start scripts set IMU_INTEG_RATE."""
_FIRST_US = 1
"""First time_usec, us. For PX4 0 is no time. Its own clock, which stamps its answers, begins at 0 (drv_hrt.cpp): an
answer has the stamp of its sample, or less by this; releases differ in that."""
_CHANNELS = 16
_ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED
_LOCKSTEP = 1
"""Bit of HIL_ACTUATOR_CONTROLS.flags: PX4 is built for lockstep."""
_ACCELERATION, _RATES, _FIELD, _DIFFERENTIAL, _PRESSURE = 0x7, 0x38, 0x1C0, 0x400, 0x1A00
"""Groups of HIL_SENSOR.fields_updated; PX4 reads a group if all its bits are set."""
_ALL = _ACCELERATION | _RATES | _FIELD | _DIFFERENTIAL | _PRESSURE
_READ = 1 << 16
_G = 9.80665
_UNKNOWN_COURSE = 65535
_STILL = 0.5
"""Below this speed a receiver knows no course, m/s."""


class Px4Door:
    """One aircraft and the PX4 that flies it.

    Parameters
    ----------
    vehicle : the aircraft.
    port : TCP port on loopback at which PX4 is awaited.
    table : the tasks of its channels.
    report : called with what the user should know.

    Raises
    ------
    PortError
        If the port is in use.
    ChannelError
        If the table cannot be used.
    """

    autopilot = "PX4"

    def __init__(self, vehicle: DoorVehicle, port: int, table: Channels, report: Callable[[str], None]) -> None:
        self.vehicle, self.port = vehicle, port
        self.controls: NDArray[np.float64] = np.zeros(4)
        """Fractions of travel."""
        self.armed = False
        self.gone = ""
        """Why the connection is lost; empty: it is not."""
        self._table, self._report = checked(table, _CHANNELS), report
        self._lockstep: bool | None = None
        """Whether PX4 answers every sample; None before its first answer."""
        self._sent = self._answered = -1
        """Times of the last sample sent, and stamp of the newest answer, us."""
        self._rest = b""
        """What PX4 has not taken yet of the last sample."""
        self._codec = Codec(vehicle.uav, SIMULATOR)
        self._stream = _Stream()
        vehicle.set_period(PERIOD_US, exactly=True)
        self._connection: socket.socket | None = None
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listener.bind((LOOPBACK, port))
        except OSError as error:
            self._listener.close()
            raise PortError(f"port {port}: {error.strerror or error}") from None
        self._listener.listen(1)
        self._listener.setblocking(False)

    def fileno(self) -> int:
        """For ``select``."""
        return (self._connection or self._listener).fileno()

    @property
    def bad(self) -> int:
        """Bytes that PX4 sent and that were not valid MAVLink."""
        return self._stream.bad

    @property
    def connected(self) -> bool:
        """Whether PX4 has connected."""
        return self._connection is not None

    @property
    def running_free(self) -> bool:
        """Whether samples go out by the clock: PX4 is not up yet, or not built for lockstep."""
        return not self._lockstep

    @property
    def answered(self) -> bool:
        """Whether the next step may be taken."""
        self._flush()
        # An answer to the sample before is a whole period older, see _FIRST_US.
        return not self._rest and (self.running_free or self._answered > self._sent - PERIOD_US)

    def read(self) -> None:
        """Take in what PX4 did: connect, send, close."""
        if self._connection is None:
            with contextlib.suppress(BlockingIOError):
                self._connection, _ = self._listener.accept()
                self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._connection.setblocking(False)
                self._listener.close()
            return
        try:
            data = self._connection.recv(_READ)
        except BlockingIOError:
            return
        except OSError as error:
            self.gone = f"the connection broke: {error.strerror or error}"
            return
        if not data:
            self.gone = "PX4 closed the connection"
            return
        for message in self._stream.take(data):
            if message.get_type() == "HIL_ACTUATOR_CONTROLS":
                self._take(message)

    def _take(self, message: Any) -> None:
        """Put controls into force; those of an older sample than the last one are controls, but no answer."""
        if self._lockstep is None:
            self._lockstep = bool(message.flags & _LOCKSTEP)
            if not self._lockstep:
                self._report("this PX4 is not built for lockstep: it is sent samples by the clock")
        self._answered = max(self._answered, int(message.time_usec))
        self.armed = bool(message.mode & _ARMED)
        fractions(self._table, message.controls, self.controls)

    def send(self) -> None:
        """Send the sample at hand."""
        vehicle = self.vehicle
        stamp = vehicle.now_us + _FIRST_US
        readings = vehicle.read_sensors()
        messages = [self._state(stamp)]
        if readings.fix is not None:
            messages.append(_position(stamp, readings.fix))
        # Last, because it alone lets PX4's time pass.
        messages.append(_sample(stamp, readings))
        self._rest = self._codec.pack(*messages)
        self._sent = stamp
        self._flush()

    def _flush(self) -> None:
        """Send what PX4 takes: one that stands still must not hold the others, nor the end of the flight."""
        if self._connection is None or not self._rest or self.gone:
            return
        try:
            self._rest = self._rest[self._connection.send(self._rest) :]
        except BlockingIOError:
            return
        except OSError as error:
            self.gone = f"the connection broke: {error.strerror or error}"

    def _state(self, stamp: int) -> Any:
        """The truth, for PX4's log."""
        motion, home = self.vehicle.motion, self.vehicle.home
        latitude, longitude = home.place(motion.position[0], motion.position[1])
        return dialect.MAVLink_hil_state_quaternion_message(
            stamp,
            list(motion.quaternion),
            *motion.rates,
            latitude,
            longitude,
            round(1e3 * (home.altitude + motion.position[2])),
            *(_short(1e2 * v) for v in motion.velocity),
            *(min(65535, round(1e2 * motion.airspeed)),) * 2,
            *(_short(1e3 * f / _G) for f in motion.force),
        )

    def close(self) -> None:
        """Free the port; PX4 sees its connection close."""
        self._listener.close()
        if self._connection is not None:
            self._connection.close()


class _Stream:
    """Messages in a stream of bytes. What only looks like the head of one takes no real message with it: in lockstep
    a lost answer would never be sent again."""

    def __init__(self) -> None:
        self.bad = 0
        """Bytes that belonged to no message."""
        self._mav = dialect.MAVLink(None)
        self._bytes = bytearray()

    def take(self, data: bytes) -> list[Any]:
        """Return the messages that ``data`` completes."""
        self._bytes += data
        messages: list[Any] = []
        at = end = 0
        """Where to look, and where the last message ended."""
        first: int | None = None
        """Where one begins that is not complete."""
        while at < len(self._bytes):
            size = self._size(at)
            if size > 0 and at + size <= len(self._bytes):
                message = self._read(at, size)
                if message is not None:
                    messages.append(message)
                    self.bad += at - end
                    at = end = at + size
                    first = None
                    continue
            elif size > 0 and first is None:
                first = at
            at += 1
        kept = at if first is None else first
        self.bad += kept - end
        del self._bytes[:kept]
        return messages

    def _read(self, at: int, size: int) -> Any:
        """The message there; None if the checksum is wrong, or its kind unknown, so that there is none to tell."""
        try:
            message = self._mav.decode(self._bytes[at : at + size])
        except dialect.MAVError:
            return None
        return message if message.get_msgId() in dialect.mavlink_map else None

    def _size(self, at: int) -> int:
        """Bytes of the message that may begin there; 0: none does."""
        head = self._bytes[at : at + 3]
        if head[0] == dialect.PROTOCOL_MARKER_V1:
            return 8 + (head[1] if len(head) > 1 else 0)
        if head[0] != dialect.PROTOCOL_MARKER_V2:
            return 0
        if len(head) < 3:
            return 12
        return 12 + head[1] + (13 if head[2] & dialect.MAVLINK_IFLAG_SIGNED else 0)


def _short(value: float) -> int:
    return max(-32768, min(32767, round(value)))


def _position(stamp: int, fix: Fix) -> Any:
    north, east, down = fix.velocity
    ground = math.hypot(north, east)
    course = round(math.degrees(math.atan2(east, north)) % 360.0 * 1e2) % 36000
    return dialect.MAVLink_hil_gps_message(
        stamp,
        3,  # a fix in three dimensions
        fix.latitude,
        fix.longitude,
        round(1e3 * fix.altitude),
        90,  # eph and epv, cm
        150,
        min(65534, round(1e2 * math.hypot(ground, down))),
        *(_short(1e2 * v) for v in fix.velocity),
        course if ground > _STILL else _UNKNOWN_COURSE,
        10,  # satellites
    )


def _sample(stamp: int, readings: Readings) -> Any:
    return dialect.MAVLink_hil_sensor_message(
        stamp,
        *readings.force,
        *readings.rates,
        *readings.field,
        1e-2 * readings.pressure,  # hPa
        1e-2 * readings.differential,
        height_of(readings.pressure),
        readings.temperature,
        _ALL,
    )
