"""The wire between vehicles and autopilots: the sockets of a process, and a tick's messages as datagrams.

A vehicle sends its state: ATTITUDE_QUATERNION and LOCAL_POSITION_NED, and HIL_ACTUATOR_CONTROLS unless the command in
force is the one that answers the last state. The autopilot answers with HIL_ACTUATOR_CONTROLS, with
SET_ATTITUDE_TARGET, or, for a leader, with SET_POSITION_TARGET_LOCAL_NED. Compiled code packs and reads them, see
`frames`; their columns are those of `messages`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import ACTUATORS as ACTUATOR_NAMES
from ftcc.link.codec import Codec, dialect
from ftcc.link.compiled import compiled, compiled_apart, fields, store
from ftcc.link.frames import (
    ACTUATORS,
    ATTITUDE,
    ATTITUDE_TARGET,
    LARGEST_FRAME,
    POSITION,
    POSITION_TARGET,
    Payload,
    clear,
    new_payload,
    place,
    read_frame,
    write_frame,
)
from ftcc.link.mavlink import Endpoint
from ftcc.link.messages import AttitudeTarget, PositionTarget, StateMessage
from ftcc.link.system_calls import READABLE, receive, send

__all__ = [
    "BY_ACTUATORS",
    "BY_ATTITUDE",
    "BY_POSITION",
    "Wire",
    "connect",
    "is_readable",
    "keep_sent",
    "new_wire",
    "read_attitude_target",
    "read_command",
    "read_position_target",
    "read_state",
    "receive_datagram",
    "send_again",
    "send_attitude_target",
    "send_command",
    "send_position_target",
    "send_state",
    "split",
]

BY_ACTUATORS, BY_ATTITUDE, BY_POSITION = range(3)
"""How commands travel to a vehicle: as actuator commands, as attitude targets, or, a leader's, as position targets."""

_LARGEST_DATAGRAM = 4096
_COMMANDS = len(ACTUATOR_NAMES)
_STATE_WIDTH = len(StateMessage._fields)
_POSITION_AT = StateMessage._fields.index("x")
"""Where the fields of LOCAL_POSITION_NED begin in a `StateMessage`."""
_TARGET_THRUST = AttitudeTarget._fields.index("thrust")

# Where the fields stand; those of one group follow each other.
_Q1 = place(dialect.MAVLink_attitude_quaternion_message, "q1")
_X = place(dialect.MAVLink_local_position_ned_message, "x")
_CONTROLS = place(dialect.MAVLink_hil_actuator_controls_message, "controls")
_TARGET_Q = place(dialect.MAVLink_set_attitude_target_message, "q")
_THRUST = place(dialect.MAVLink_set_attitude_target_message, "thrust")
_ATTITUDE_SYSTEM = place(dialect.MAVLink_set_attitude_target_message, "target_system")
_ATTITUDE_COMPONENT = place(dialect.MAVLink_set_attitude_target_message, "target_component")
_ATTITUDE_MASK = place(dialect.MAVLink_set_attitude_target_message, "type_mask")
_TARGET_X = place(dialect.MAVLink_set_position_target_local_ned_message, "x")
_TARGET_VX = place(dialect.MAVLink_set_position_target_local_ned_message, "vx")
_POSITION_SYSTEM = place(dialect.MAVLink_set_position_target_local_ned_message, "target_system")
_POSITION_COMPONENT = place(dialect.MAVLink_set_position_target_local_ned_message, "target_component")
_POSITION_MASK = place(dialect.MAVLink_set_position_target_local_ned_message, "type_mask")
_FRAME = place(dialect.MAVLink_set_position_target_local_ned_message, "coordinate_frame")

_LOCAL_NED = int(dialect.MAV_FRAME_LOCAL_NED)
_NO_RATES = int(
    dialect.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
    | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
    | dialect.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
)
_POSITION_AND_VELOCITY = int(
    dialect.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    | dialect.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
)
_STATE_NUMBERS = (POSITION.number, ACTUATORS.number)
"""What may follow ATTITUDE_QUATERNION in a state."""
_NUMBERS = frozenset(shape.number for shape in (ATTITUDE, POSITION, ACTUATORS, ATTITUDE_TARGET, POSITION_TARGET))
_SIMULATOR = 25
"""Component that targets are for, see ``mavlink.SIMULATOR``."""


class Wire(NamedTuple):
    """One end of the wire, for the k UAVs of a process."""

    socket: NDArray[np.int64]
    """(k,): descriptors."""
    system: NDArray[np.int64]
    """(k,): MAVLink system that sends."""
    component: NDArray[np.int64]
    """(k,): and component."""
    sequence: NDArray[np.int64]
    """(k,): sequence number of the next message."""
    sent: NDArray[np.uint8]
    """(k, n): the last datagram, to be sent again where there is no answer."""
    sent_length: NDArray[np.int64]
    """(k,): its bytes; 0 before the first."""
    payload: Payload
    """Of the message at hand."""
    datagram: NDArray[np.uint8]
    """(n,): the one that was received last."""
    length: NDArray[np.int64]
    """(1,): its bytes."""
    whose: NDArray[np.int64]
    """(1,): index of the UAV for which it is."""
    polled: NDArray[np.int32]
    """(k + 2, 2): the descriptors to wait for, see `system_calls.wait`: the sockets, others, and the mesh."""


def new_wire(systems: Sequence[int], component: int) -> Wire:
    """One end of the wire for UAVs that send as these MAVLink systems; `connect` gives it its sockets."""
    k = len(systems)
    polled = np.zeros((k + 2, 2), np.int32)
    polled[:, 0] = -1
    polled[:, 1] = READABLE
    return Wire(
        socket=np.full(k, -1, np.int64),
        system=np.array(systems, np.int64),
        component=np.full(k, component, np.int64),
        sequence=np.zeros(k, np.int64),
        sent=np.zeros((k, 4 * LARGEST_FRAME), np.uint8),
        sent_length=np.zeros(k, np.int64),
        payload=new_payload(),
        datagram=np.zeros(_LARGEST_DATAGRAM, np.uint8),
        length=np.zeros(1, np.int64),
        whose=np.zeros(1, np.int64),
        polled=polled,
    )


def connect(wire: Wire, endpoints: Sequence[Endpoint], others: int, mesh: int = -1) -> None:
    """Give the wire its sockets.

    Parameters
    ----------
    endpoints : in the order of the UAVs. They share the sequence numbers of this wire.
    others : descriptor for everything else that wakes the process up.
    mesh : descriptor of the mesh; -1: none.
    """
    wire.polled[:, 0] = [*(endpoint.fileno() for endpoint in endpoints), others, mesh]
    for i, endpoint in enumerate(endpoints):
        wire.socket[i] = endpoint.fileno()
        endpoint.sequence = wire.sequence[i : i + 1]


def keep_sent(wire: Wire, i: int, datagram: bytes) -> None:
    """Make ``datagram`` the one that `send_again` sends for UAV ``i``."""
    wire.sent[i, : len(datagram)] = np.frombuffer(datagram, np.uint8)
    wire.sent_length[i] = len(datagram)


def split(wire: Wire, codec: Codec) -> Iterator[Any]:
    """Let pymavlink read the datagram at hand, message by message.

    None stands for messages of a tick: they are then the datagram at hand, as if they had arrived alone.
    """
    messages = codec.parse(wire.datagram[: wire.length[0]].tobytes())
    while messages:
        run = [messages.pop(0)]
        if run[0].get_msgId() not in _NUMBERS:
            yield run[0]
            continue
        for expected in _STATE_NUMBERS:
            if run[0].get_msgId() == ATTITUDE.number and messages and messages[0].get_msgId() == expected:
                run.append(messages.pop(0))
        datagram = Codec(0, 0).pack(*run)
        wire.datagram[: len(datagram)] = np.frombuffer(datagram, np.uint8)
        wire.length[0] = len(datagram)
        yield None


@compiled
def is_readable(wire, n):
    """Whether row ``n`` of ``polled`` is readable, or has an error that reading clears."""
    return wire.polled[n, 1] >> 16 != 0


@compiled
def receive_datagram(wire, i):
    """Receive the next datagram for UAV ``i``; False if there is none."""
    wire.whose[0] = i
    wire.length[0] = receive(wire.socket[i], wire.datagram)
    return wire.length[0] >= 0


@compiled
def send_again(wire, i):
    """Send the last datagram of UAV ``i`` once more."""
    if wire.sent_length[i] > 0:
        send(wire.socket[i], wire.sent[i], wire.sent_length[i])


@compiled
def _append(wire, i, shape, at):
    """Append the message at hand to UAV ``i``'s datagram; returns where it ends, -1 if it cannot be sent."""
    end = write_frame(wire.payload, shape, wire.system[i], wire.component[i], wire.sequence[i], wire.sent[i], at)
    wire.sequence[i] = wire.sequence[i] + 1 & 0xFF
    return end


@compiled
def _send(wire, i, end):
    """Send UAV ``i``'s datagram of ``end`` bytes; False, and nothing is sent, where ``end`` is negative."""
    if end < 0:
        wire.sent_length[i] = 0
        return False
    wire.sent_length[i] = end
    send(wire.socket[i], wire.sent[i], end)
    return True


@compiled
def _put_command(wire, stamp_us, controls):
    clear(wire.payload)
    wire.payload.longs[0] = stamp_us
    for n in range(_COMMANDS):
        wire.payload.floats[_CONTROLS + n] = controls[n]


@compiled_apart
def send_state(wire, i, stamp_us, state, controls, with_controls):
    """Send a `StateMessage` (13,) and, where wanted, the command in force (4,), as fractions of travel.

    Returns False, and sends nothing, where a value is not finite or too large for float32; so do the other functions.
    """
    payload = wire.payload
    clear(payload)
    payload.words[0] = stamp_us // 1000
    for n in range(_POSITION_AT):
        payload.floats[_Q1 + n] = state[n]
    end = _append(wire, i, ATTITUDE, 0)
    if end < 0:
        return _send(wire, i, end)
    clear(payload)
    payload.words[0] = stamp_us // 1000
    for n in range(_STATE_WIDTH - _POSITION_AT):
        payload.floats[_X + n] = state[_POSITION_AT + n]
    end = _append(wire, i, POSITION, end)
    if with_controls and end > 0:
        _put_command(wire, stamp_us, controls)
        end = _append(wire, i, ACTUATORS, end)
    return _send(wire, i, end)


@compiled_apart
def send_command(wire, i, stamp_us, controls):
    """Send an actuator command (4,), as fractions of travel, that answers the state of that stamp (us)."""
    _put_command(wire, stamp_us, controls)
    return _send(wire, i, _append(wire, i, ACTUATORS, 0))


@compiled_apart
def send_attitude_target(wire, i, stamp_us, target):
    """Send an `AttitudeTarget` (5,) that answers the state of that stamp (us)."""
    payload = wire.payload
    clear(payload)
    payload.words[0] = stamp_us // 1000
    for n in range(_TARGET_THRUST):
        payload.floats[_TARGET_Q + n] = target[n]
    payload.floats[_THRUST] = target[_TARGET_THRUST]
    payload.octets[_ATTITUDE_SYSTEM] = wire.system[i]
    payload.octets[_ATTITUDE_COMPONENT] = _SIMULATOR
    payload.octets[_ATTITUDE_MASK] = _NO_RATES
    return _send(wire, i, _append(wire, i, ATTITUDE_TARGET, 0))


@compiled_apart
def send_position_target(wire, i, target):
    """Send a leader's `PositionTarget` (7,) to its reference point; on the wire z is down."""
    sent = fields(PositionTarget, target)
    payload = wire.payload
    clear(payload)
    payload.words[0] = round(sent.time * 1e6) // 1000
    payload.floats[_TARGET_X] = sent.x
    payload.floats[_TARGET_X + 1] = sent.y
    payload.floats[_TARGET_X + 2] = -sent.z
    payload.floats[_TARGET_VX] = sent.vx
    payload.floats[_TARGET_VX + 1] = sent.vy
    payload.floats[_TARGET_VX + 2] = -sent.vz
    payload.octets[_POSITION_SYSTEM] = wire.system[i]
    payload.octets[_POSITION_COMPONENT] = _SIMULATOR
    payload.octets[_FRAME] = _LOCAL_NED
    payload.shorts[_POSITION_MASK] = _POSITION_AND_VELOCITY
    return _send(wire, i, _append(wire, i, POSITION_TARGET, 0))


@compiled_apart
def read_state(wire, state, controls):
    """Read the state in the datagram at hand into ``state`` (13,), a `StateMessage`, and ``controls`` (4,).

    Returns
    -------
    stamp, with_controls : int
        Its stamp in us, rounded down to whole ms (see ``timing.tick_of``), and 1 where the command in force came with
        it; (-1, 0) if the datagram is anything but one state.
    """
    payload, end = wire.payload, wire.length[0]
    number, at = read_frame(wire.datagram, 0, end, payload)
    if number != ATTITUDE.number:
        return -1, 0
    milliseconds = np.int64(payload.words[0])
    for n in range(_POSITION_AT):
        state[n] = payload.floats[_Q1 + n]
    number, at = read_frame(wire.datagram, at, end, payload)
    if number != POSITION.number or payload.words[0] != milliseconds:
        return -1, 0
    for n in range(_STATE_WIDTH - _POSITION_AT):
        state[_POSITION_AT + n] = payload.floats[_X + n]
    stamp = milliseconds * 1000
    if at == end:
        return stamp, 0
    number, at = read_frame(wire.datagram, at, end, payload)
    if number != ACTUATORS.number or payload.longs[0] // 1000 != milliseconds or at != end:
        return -1, 0
    for n in range(_COMMANDS):
        controls[n] = payload.floats[_CONTROLS + n]
    return stamp, 1


@compiled
def _read_alone(wire, shape):
    """Whether the datagram at hand is one message with the layout ``shape``, which then is in ``payload``."""
    number, at = read_frame(wire.datagram, 0, wire.length[0], wire.payload)
    return number == shape.number and at == wire.length[0]


@compiled_apart
def read_command(wire, controls):
    """Read an actuator command into ``controls`` (4,), fractions of travel: its stamp in us, -1 if it is none."""
    if not _read_alone(wire, ACTUATORS):
        return -1
    for n in range(_COMMANDS):
        controls[n] = wire.payload.floats[_CONTROLS + n]
    return wire.payload.longs[0]


@compiled_apart
def read_attitude_target(wire, target):
    """Read an `AttitudeTarget` into ``target`` (5,): its stamp in us (whole ms), -1 if it is none."""
    if not _read_alone(wire, ATTITUDE_TARGET):
        return -1
    for n in range(_TARGET_THRUST):
        target[n] = wire.payload.floats[_TARGET_Q + n]
    target[_TARGET_THRUST] = wire.payload.floats[_THRUST]
    return np.int64(wire.payload.words[0]) * 1000


@compiled_apart
def read_position_target(wire, target):
    """Read a leader's `PositionTarget` into ``target`` (7,): its stamp in us (whole ms), -1 if it is none."""
    if not _read_alone(wire, POSITION_TARGET):
        return -1
    payload = wire.payload
    received = PositionTarget(
        time=np.int64(payload.words[0]) / 1e3,
        x=np.float64(payload.floats[_TARGET_X]),
        y=np.float64(payload.floats[_TARGET_X + 1]),
        z=np.float64(-payload.floats[_TARGET_X + 2]),
        vx=np.float64(payload.floats[_TARGET_VX]),
        vy=np.float64(payload.floats[_TARGET_VX + 1]),
        vz=np.float64(-payload.floats[_TARGET_VX + 2]),
    )
    store(received, target)
    return np.int64(payload.words[0]) * 1000
