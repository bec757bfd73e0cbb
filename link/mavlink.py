"""MAVLink 2 over connected UDP: one endpoint a socket, and the messages that vehicle and autopilot exchange."""

from __future__ import annotations

import math
import socket
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.link.codec import Codec, dialect

__all__ = [
    "AUTOPILOT",
    "LOOPBACK",
    "NAME_LENGTH",
    "SIMULATOR",
    "STATION",
    "Endpoint",
    "as_typed",
    "attitude_message",
    "command_message",
    "dialect",
    "ending_message",
    "ends",
    "float_array",
    "read_attitude",
    "read_command",
    "read_state",
    "read_target",
    "state_messages",
    "status_text",
    "target_message",
]

AUTOPILOT = dialect.MAV_COMP_ID_AUTOPILOT1
"""Component id of an autopilot."""
SIMULATOR = 25
"""Component id of a simulated vehicle (MAV_COMP_ID_USER1)."""
STATION = 254
"""System id of the ground station; 245 and 255 are those of other people's clients."""
NAME_LENGTH = 16
"""Characters of a parameter's name, at most."""
LOOPBACK = "127.0.0.1"

_DATAGRAMS_PER_READ = 64
_LARGEST_DATAGRAM = 4096
_LARGEST = 3.4e38
"""What float32 can hold."""
_UNUSED_CONTROLS = (0.0,) * 12
_NO_RATES = (
    dialect.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
    | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
    | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
)
_POSITION_AND_VELOCITY = (
    dialect.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)


class Endpoint:
    """One UDP socket that speaks MAVLink 2.

    Parameters
    ----------
    system, component : int
        Ids with which messages are sent.
    port : int
        Local port; 0 lets the system choose.
    peer : (host, port), optional
        With a peer the socket is connected: datagrams of others are dropped by the kernel. Without, it only receives.
    only : collection of int, optional
        Ports on loopback from which datagrams are read; those of others are dropped and counted.
    host : str
        Local address; loopback unless asked otherwise.
    """

    def __init__(
        self,
        system: int,
        component: int,
        port: int,
        peer: tuple[str, int] | None = None,
        only: Collection[int] | None = None,
        host: str = LOOPBACK,
    ) -> None:
        self.codec = Codec(system, component)
        self._only = frozenset((LOOPBACK, port) for port in only) if only is not None else None
        self.strangers = 0
        """Datagrams dropped because of where they came from."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind((host, port))
        if peer is not None:
            self._socket.connect(peer)
        self._last: bytes = b""

    def fileno(self) -> int:
        """For ``select``."""
        return self._socket.fileno()

    def close(self) -> None:
        """Free the port."""
        self._socket.close()

    def enlarge_buffer(self) -> None:
        """Give the socket room for many senders: the kernel drops what does not fit."""
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)

    def send(self, *messages: Any) -> None:
        """Send ``messages`` in one datagram.

        Raises
        ------
        ValueError
            If a float in one of them is nan, inf or beyond float32: such a value would be believed on the other side.
        """
        self._last = self.codec.pack(*messages)
        self._put(self._last)

    def send_aside(self, *messages: Any) -> None:
        """Send ``messages`` in one datagram of which `send_again` takes no notice."""
        self._put(self.codec.pack(*messages))

    def send_again(self) -> None:
        """Send the last datagram once more, e.g. because its answer is late."""
        if self._last:
            self._put(self._last)

    def _put(self, datagram: bytes) -> None:
        try:
            self._socket.send(datagram)
        except ConnectionRefusedError:
            return  # The peer is not there (yet, or any more); whoever waits for its answer notices.
        except BlockingIOError:
            return  # The buffer is full: lost, as a datagram may be.

    def receive(self, datagrams: int = _DATAGRAMS_PER_READ) -> list[Any]:
        """The messages of the next ``datagrams``, in order; bad data and non-finite values are dropped and counted."""
        messages: list[Any] = []
        for _ in range(datagrams):
            try:
                datagram, sender = self._socket.recvfrom(_LARGEST_DATAGRAM)
            except BlockingIOError:
                break
            except ConnectionRefusedError:
                continue
            if self._only is not None and sender not in self._only:
                self.strangers += 1
                continue
            messages += self.codec.parse(datagram)
        return messages


def state_messages(stamp_us: int, state: NDArray[np.float64], controls: NDArray[np.float64] | None) -> tuple[Any, ...]:
    """What a vehicle tells its autopilot at every tick: attitude and position, and what is in force.

    ``state`` (13,) holds the fields of the two state messages. ``controls`` (4,), the command in force as fractions of
    travel, is told where it is not the one that answers the last state, which the autopilot knows; otherwise None.
    """
    stamp = stamp_us // 1000
    v = state.tolist()
    attitude = dialect.MAVLink_attitude_quaternion_message(stamp, v[0], v[1], v[2], v[3], v[4], v[5], v[6])
    position = dialect.MAVLink_local_position_ned_message(stamp, v[7], v[8], v[9], v[10], v[11], v[12])
    if controls is None:
        return attitude, position
    return attitude, position, command_message(stamp_us, controls)


def read_state(messages: Sequence[Any], state: NDArray[np.float64], controls: NDArray[np.float64]) -> tuple[int, int]:
    """The inverse of `state_messages`, from the beginning of ``messages``.

    Fills ``state``, and ``controls`` where they were told.

    Returns
    -------
    stamp, used : int
        The stamp in us, or -1 if the messages do not begin with a state; the number of messages that belong to it.
    """
    if len(messages) < 2:
        return -1, 1
    a, p = messages[0], messages[1]
    if a.get_type() != "ATTITUDE_QUATERNION" or p.get_type() != "LOCAL_POSITION_NED":
        return -1, 1
    if a.time_boot_ms != p.time_boot_ms:
        return -1, 2
    state[:] = (a.q1, a.q2, a.q3, a.q4, a.rollspeed, a.pitchspeed, a.yawspeed, p.x, p.y, p.z, p.vx, p.vy, p.vz)
    stamp = int(a.time_boot_ms) * 1000
    if len(messages) > 2 and read_command(messages[2], controls) == stamp:
        return stamp, 3
    return stamp, 2


def command_message(stamp_us: int, controls: NDArray[np.float64]) -> Any:
    """Actuator command, fractions of travel in the order of ``ACTUATORS``, answering the state of that stamp."""
    return dialect.MAVLink_hil_actuator_controls_message(stamp_us, (*controls.tolist(), *_UNUSED_CONTROLS), 0, 0)


def read_command(message: Any, controls: NDArray[np.float64]) -> int:
    """The inverse of `command_message`: the stamp in us, or -1 for another message."""
    if message.get_type() != "HIL_ACTUATOR_CONTROLS":
        return -1
    controls[:] = message.controls[:4]
    return int(message.time_usec)


def target_message(system: int, target: NDArray[np.float64]) -> Any:
    """A leader's target (stamp s, x, y, z, vx, vy, vz; z up) for its reference point; z down on the wire."""
    t, x, y, z, vx, vy, vz = target.tolist()
    return dialect.MAVLink_set_position_target_local_ned_message(
        round(t * 1e3),
        system,
        SIMULATOR,
        dialect.MAV_FRAME_LOCAL_NED,
        _POSITION_AND_VELOCITY,
        x,
        y,
        -z,
        vx,
        vy,
        -vz,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )


def attitude_message(stamp_us: int, system: int, target: NDArray[np.float64]) -> Any:
    """An attitude target, see `attitude_target`, answering the state of that stamp."""
    q1, q2, q3, q4, thrust = target.tolist()
    return dialect.MAVLink_set_attitude_target_message(
        stamp_us // 1000, system, SIMULATOR, _NO_RATES, (q1, q2, q3, q4), 0.0, 0.0, 0.0, thrust
    )


def read_attitude(message: Any, target: NDArray[np.float64]) -> int:
    """The inverse of `attitude_message`: the stamp in us, or -1 for another message."""
    if message.get_type() != "SET_ATTITUDE_TARGET":
        return -1
    target[:] = (*message.q, message.thrust)
    return int(message.time_boot_ms) * 1000


def read_target(message: Any, target: NDArray[np.float64]) -> int:
    """The inverse of `target_message`: the stamp in us, or -1 for another message."""
    if message.get_type() != "SET_POSITION_TARGET_LOCAL_NED":
        return -1
    m = message
    target[:] = (m.time_boot_ms / 1e3, m.x, m.y, -m.z, m.vx, m.vy, -m.vz)
    return int(m.time_boot_ms) * 1000


def ending_message() -> Any:
    """HEARTBEAT by which vehicle and autopilot tell each other that their UAV ends here."""
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_FIXED_WING,
        dialect.MAV_AUTOPILOT_INVALID,
        0,
        0,
        dialect.MAV_STATE_FLIGHT_TERMINATION,
        3,
    )


def ends(message: Any) -> bool:
    """Whether this is an `ending_message`."""
    return bool(message.get_type() == "HEARTBEAT" and message.system_status == dialect.MAV_STATE_FLIGHT_TERMINATION)


def float_array(stamp_us: int, name: str, values: Sequence[float]) -> Any:
    """Up to 58 numbers as DEBUG_FLOAT_ARRAY; what no message may carry (nan, beyond float32) is sent as 0."""
    data = [value if abs(value) < _LARGEST else 0.0 for value in values]
    return dialect.MAVLink_debug_float_array_message(stamp_us, name.encode(), 0, data + [0.0] * (58 - len(data)))


def as_typed(value: float) -> float:
    """The shortest decimal number that float32 stores as ``value``: 0.7 for what arrives as 0.699999988."""
    return float(str(np.float32(value))) if math.isfinite(value) else value


def status_text(severity: int, text: str) -> Any:
    """STATUSTEXT, cut to the 50 characters that it holds."""
    return dialect.MAVLink_statustext_message(severity, text.encode("ascii", "replace")[:50])
