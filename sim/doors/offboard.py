"""A bridge between a law of ours and the offboard port of the PX4 behind a door: the law is PX4's companion computer.

It does what PX4's public sources (mavlink_receiver.cpp, Commander, px4-rc.mavlink) and its page on offboard mode ask;
of these px4_custom_mode.h alone was compared line by line. PX4's estimate, ATTITUDE_QUATERNION and LOCAL_POSITION_NED,
becomes the state that the autopilot process gets from a vehicle; the process's SET_ATTITUDE_TARGET goes to PX4. The
bridge asks for these messages, streams targets, asks for OFFBOARD, arms, and begins with the law where the launcher
ends. Simulated time paces it, because PX4's time-outs count that.
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
from ftcc.link.mavlink import LOOPBACK, SIMULATOR, Endpoint, ending_message
from ftcc.link.messages import AttitudeTarget, StateMessage
from ftcc.link.ports import PortError
from ftcc.link.timing import Timing, tick_of
from ftcc.link.wire import connect, new_wire, read_attitude_target, receive_datagram, send_state
from ftcc.sim.doors.vehicle import DoorVehicle

__all__ = ["PORT", "Offboard", "mode_name"]

PORT = 14540
"""PX4 instance n speaks to offboard programs at this port + n."""
_STREAM_US = 20_000
"""Time between two states that PX4 is asked for, and between two targets before the law's, us."""
_BEFORE_OFFBOARD_US = 500_000
"""How long targets stream before OFFBOARD is asked for, us; PX4 wants more than two in a second."""
_AGAIN_US = 500_000
"""After this time what PX4 has not done is asked for again, us; our heartbeat is twice as slow."""
_APART_US = 30_000
"""Attitude and position further apart than this are no state, us."""
_SILENCE_US = 200_000
"""The law is reported as silent after this time, us: PX4 leaves OFFBOARD after COM_OF_LOSS_T, 0.5 s or 1 s."""
_LAUNCH_THRUST = 0.6
"""Thrust of the targets on the launcher, 0..1: enough for it to launch."""
_AUTOPILOT = 1
"""PX4's component."""
_READ = 2048
_EARTH = 6_378_137.0
_OFFBOARD = 6
_MAIN = {1: "MANUAL", 2: "ALTCTL", 3: "POSCTL", 4: "AUTO", 5: "ACRO", 6: "OFFBOARD", 7: "STABILIZED", 8: "RATTITUDE"}
_AUTO = {1: "READY", 2: "TAKEOFF", 3: "LOITER", 4: "MISSION", 5: "RTL", 6: "LAND", 8: "FOLLOW_TARGET", 9: "PRECLAND"}
_ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED
_ATTITUDE, _POSITION, _ORIGIN = (
    dialect.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    dialect.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
)
_MASK = int(
    dialect.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
    | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
    | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
)


def mode_name(custom_mode: int) -> str:
    """Name PX4's flight mode in a HEARTBEAT's custom mode (px4_custom_mode.h)."""
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    name = _MAIN.get(main, f"mode {main}")
    return f"{name} {_AUTO.get(sub, sub)}" if main == 4 else name


def _name(group: str, number: int) -> str:
    entry = dialect.enums[group].get(number)
    return str(number) if entry is None else entry.name.removeprefix(f"{group}_")


class Offboard:
    """The bridge of one aircraft.

    `serve` does everything, without waiting; it is called after every step and when one of ``sockets`` is readable.

    Parameters
    ----------
    vehicle : the aircraft behind the door, whose clock PX4 has.
    timing : of the scenario: the law's period.
    datum : altitude from which that in the autopilot process's states counts, m.
    px4_port : UDP port on loopback to which PX4 sends, see `PORT`.
    port, autopilot_port : UDP ports on loopback of this bridge and of the autopilot process.
    report : called with what the user should know.

    Raises
    ------
    PortError
        If a port is in use.
    """

    def __init__(
        self,
        vehicle: DoorVehicle,
        timing: Timing,
        datum: float,
        px4_port: int,
        port: int,
        autopilot_port: int,
        report: Callable[[str], None],
    ) -> None:
        self.vehicle = vehicle
        self.mode: int | None = None
        """PX4's custom mode; None before its first heartbeat."""
        self.armed = False
        self.states = self.targets = 0
        """States that went to the law, and targets of the law that went to PX4."""
        self._timing, self._datum, self._report = timing, datum, report
        self._codec = Codec(vehicle.uav, dialect.MAV_COMP_ID_ONBOARD_COMPUTER)
        self._peer: tuple[str, int] | None = None
        self._attitude: Any = None
        self._position: Any = None
        self._origin: tuple[float, float, float] | None = None
        """PX4's local origin: north, east, up from home, m."""
        self._due: dict[str, int] = {}
        """When what is done again and again is due, simulated us."""
        self._streaming_since: int | None = None
        self._tick = -1
        """Of the last state that went to the law."""
        self._target_us = 0
        """When the law's last target came, or its first state went out, simulated us."""
        self._silent = self._left = self._unanswered = False
        self._refused: set[tuple[int, int]] = set()
        self._state: NDArray[np.float64] = np.zeros(len(StateMessage._fields))
        self._target: NDArray[np.float64] = np.zeros(len(AttitudeTarget._fields))
        self._px4 = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._px4.bind((LOOPBACK, px4_port))
            self._law = Endpoint(vehicle.uav, SIMULATOR, port, (LOOPBACK, autopilot_port))
        except OSError as error:
            self._px4.close()
            raise PortError(f"port {px4_port} or {port}: {error.strerror or error}") from None
        self._px4.setblocking(False)
        self._wire = new_wire([vehicle.uav], SIMULATOR)
        # Compiled here: PX4 does not wait for it in flight.
        read_attitude_target(self._wire, self._target)
        send_state(self._wire, 0, 0, np.full(len(StateMessage._fields), math.nan), np.zeros(4), False)
        connect(self._wire, [self._law], -1)

    @property
    def sockets(self) -> tuple[Any, ...]:
        """For ``select``."""
        return self._px4, self._law

    @property
    def offboard(self) -> bool:
        """Whether PX4 is in OFFBOARD."""
        return self.mode is not None and self.mode >> 16 & 0xFF == _OFFBOARD

    @property
    def waiting(self) -> bool:
        """Whether the law has not answered the last state yet; false once it is silent."""
        return self._unanswered and not self._silent

    def serve(self) -> None:
        """Take in what has come from both sides, and send what is due."""
        self._read_px4()
        if self._peer is None:
            return
        now = self.vehicle.now_us
        if self._is_due("heartbeat", now, 2 * _AGAIN_US):
            self._send(dialect.MAVLink_heartbeat_message(18, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3))
        if self._attitude is None or self._position is None or self._origin is None:
            if self._is_due("streams", now, _AGAIN_US):
                for message, every in ((_ATTITUDE, _STREAM_US), (_POSITION, _STREAM_US), (_ORIGIN, 1_000_000)):
                    self._command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, message, every)
            return
        self._begin(now)
        if self.vehicle.flying:
            self._send_state()
        self._read_law(now)
        if self.targets == 0 and self._is_due("target", now, _STREAM_US):
            self._send_target(self._at_launch())
            if self._streaming_since is None:
                self._streaming_since = now
        if self.states and now - self._target_us > _SILENCE_US and not self._silent:
            self._silent = True
            self._report(
                f"no target of the law for {_SILENCE_US / 1e6:g} s"
                + (": PX4 will leave OFFBOARD" if self.targets else "")
            )

    def _begin(self, now: int) -> None:
        """Ask for OFFBOARD and arm, until the launch; afterwards whoever changes that has the aircraft."""
        if self.vehicle.launched_us is not None or self._streaming_since is None:
            return
        if now - self._streaming_since < _BEFORE_OFFBOARD_US or not self._is_due("begin", now, _AGAIN_US):
            return
        if not self.offboard:
            self._command(dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, _OFFBOARD)
        elif not self.armed:
            self._command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def _is_due(self, what: str, now: int, every: int) -> bool:
        if now < self._due.get(what, 0):
            return False
        self._due[what] = now + every
        return True

    # PX4's side.

    def _read_px4(self) -> None:
        while True:
            try:
                data, sender = self._px4.recvfrom(_READ)
            except BlockingIOError:
                return
            except OSError:
                continue  # what was sent before found nobody
            for message in self._codec.parse(data):
                if message.get_srcSystem() == self.vehicle.uav and message.get_srcComponent() == _AUTOPILOT:
                    self._peer = sender
                    self._take(message)

    def _take(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "ATTITUDE_QUATERNION":
            self._attitude = message
        elif kind == "LOCAL_POSITION_NED":
            self._position = message
        elif kind == "GPS_GLOBAL_ORIGIN":
            self._origin = self._from_home(message)
        elif kind == "HEARTBEAT":
            self._take_mode(message)
        elif kind == "COMMAND_ACK" and message.result not in (
            dialect.MAV_RESULT_ACCEPTED,
            dialect.MAV_RESULT_IN_PROGRESS,
        ):
            refusal = (message.command, message.result)
            if refusal not in self._refused:
                self._refused.add(refusal)
                command = _name("MAV_CMD", message.command)
                self._report(f"PX4 refuses {command}: {_name('MAV_RESULT', message.result)}")

    def _take_mode(self, message: Any) -> None:
        """Report by name when PX4 leaves OFFBOARD and comes back. It is not asked to: a pilot may have taken over."""
        was = self.offboard
        self.mode, self.armed = message.custom_mode, bool(message.base_mode & _ARMED)
        if was and not self.offboard:
            self._left = True
            self._report(
                f"PX4 left OFFBOARD for {mode_name(self.mode)}; the law's targets go on, PX4 does not fly them"
            )
        elif self.offboard and not was:
            self._report("PX4 is in OFFBOARD again" if self._left else "PX4 is in OFFBOARD")

    def _from_home(self, origin: Any) -> tuple[float, float, float]:
        home = self.vehicle.home
        north = math.radians(origin.latitude / 1e7 - home.latitude) * _EARTH
        east = math.radians(origin.longitude / 1e7 - home.longitude) * _EARTH * math.cos(math.radians(home.latitude))
        return north, east, origin.altitude / 1e3 - home.altitude

    def _command(self, command: int, *parameters: float) -> None:
        seven = (*parameters, *(0.0,) * (7 - len(parameters)))
        self._send(dialect.MAVLink_command_long_message(self.vehicle.uav, _AUTOPILOT, command, 0, *seven))

    def _at_launch(self) -> NDArray[np.float64]:
        """Level wings, pitch and heading of the launcher."""
        q = self._attitude
        return np.array([q.q1, q.q2, q.q3, q.q4, _LAUNCH_THRUST])

    def _send_target(self, target: NDArray[np.float64]) -> None:
        q1, q2, q3, q4, thrust = target.tolist()
        self._send(
            dialect.MAVLink_set_attitude_target_message(
                self._attitude.time_boot_ms, self.vehicle.uav, _AUTOPILOT, _MASK, [q1, q2, q3, q4], 0, 0, 0, thrust
            )
        )

    def _send(self, message: Any) -> None:
        assert self._peer is not None
        with contextlib.suppress(OSError):  # full, or gone: everything is sent again
            self._px4.sendto(self._codec.pack(message), self._peer)

    # The law's side.

    def _send_state(self) -> None:
        """Send the estimate at hand, if it is of a later tick: at the tick's time, both messages with its stamp.

        The position is moved along its velocity to that time; the attitude is the estimate as it is.
        """
        assert self._origin is not None
        # PX4's clock is ours: in lockstep it is set by our samples, of which the first has time 0.
        began = self.vehicle.now_us - self.vehicle.flown_us
        attitude_us, position_us = (1000 * message.time_boot_ms for message in (self._attitude, self._position))
        period = self._timing.period_us
        # Half a step of the door more: stamps are whole ms, and PX4's clock may begin 1 us earlier.
        tick = (attitude_us - began + self.vehicle.period_us // 2) // period
        if tick <= self._tick or abs(attitude_us - position_us) > _APART_US:
            return
        q, p = self._attitude, self._position
        north, east, up = self._origin
        later = (began + tick * period - position_us) / 1e6
        self._state[:] = StateMessage(
            q.q1, q.q2, q.q3, q.q4, q.rollspeed, q.pitchspeed, q.yawspeed,
            p.x + p.vx * later + north, p.y + p.vy * later + east, p.z + p.vz * later - up + self._datum,
            p.vx, p.vy, p.vz,
        )  # fmt: skip
        if send_state(self._wire, 0, tick * period, self._state, np.zeros(4), False):
            self._tick = int(tick)
            if self.states == 0:
                self._target_us = self.vehicle.now_us
            self.states += 1
            self._unanswered = True

    def _read_law(self, now: int) -> None:
        """Pass the law's targets on; only the newest counts."""
        came = False
        while receive_datagram(self._wire, 0):
            stamp = read_attitude_target(self._wire, self._target)
            came = came or stamp >= 0
            if tick_of(stamp, self._timing.period_us) == self._tick:
                self._unanswered = False
        if not came:
            return
        if self._silent:
            self._silent = False
            self._report("the law's targets come again")
        self._target_us = now
        self.targets += 1
        self._send_target(self._target)

    def close(self) -> None:
        """Tell the law that its aircraft has ended, and free the ports."""
        with contextlib.suppress(OSError):
            self._law.send(ending_message())
        self._law.close()
        self._px4.close()
