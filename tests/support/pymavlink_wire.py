"""The messages of a tick as pymavlink makes and reads them: what the compiled wire is measured against.

Tests that play a vehicle or an autopilot speak so, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ftcc.link.mavlink import SIMULATOR, dialect

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
