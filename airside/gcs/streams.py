"""Telemetry: the messages that an autopilot sends of itself, each with its rate, and what it sends when asked."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ftcc.airside.defence.arrays import Edge as Standing
from ftcc.airside.diagnosis.beliefs import SENSOR, UNDETERMINED, Belief, new_health
from ftcc.airside.flight_path import Own
from ftcc.airside.gcs.answers import whole
from ftcc.airside.gcs.autopilot_view import AutopilotView
from ftcc.airside.references.attitude import Reference as AttitudeReference
from ftcc.link.actuators import ACTUATORS, THRUST
from ftcc.link.channel import Channel, Edge
from ftcc.link.compiled import fields
from ftcc.link.flight_modes import custom_mode
from ftcc.link.mavlink import dialect, float_array
from ftcc.link.messages import StateMessage
from ftcc.link.rotation import body_attitude

__all__ = [
    "BELIEF_FIELDS",
    "LINK_FIELDS",
    "LOGGED",
    "ON_REQUEST",
    "STREAMS",
    "Stream",
    "heartbeat",
    "places_of",
    "rates_of",
    "requested",
]

LINK_FIELDS = ("sender", "age", "received", "lost", "cut")
"""Numbers per in-edge in the DEBUG_FLOAT_ARRAY "links"; age -1 = never heard."""

BELIEF_FIELDS = Belief._fields[: Belief._fields.index("suspected_at")]
"""Numbers per slot of an actuator in the DEBUG_FLOAT_ARRAY "beliefs"; state -1 = no such actuator. `Health` follows."""

_M = dialect
_RATES, _POSITION = (StateMessage._fields.index(name) for name in ("rollspeed", "x"))
_RECEIVED, _LOST = (Edge._fields.index(name) for name in ("received", "lost"))
_SENDER = Edge._fields.index("sender")
_STANDING = Standing._fields.index("standing")
_MOST_TRUSTS = 29
"""Pairs of sender and trust in an array."""
_BLOCKED = Channel._fields.index("blocked")


def heartbeat(view: AutopilotView, alive: bool = True) -> Any:
    """HEARTBEAT: a fixed-wing aircraft with PX4's modes, armed, in the air."""
    flags = (
        _M.MAV_MODE_FLAG_SAFETY_ARMED
        | _M.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        | _M.MAV_MODE_FLAG_AUTO_ENABLED
        | _M.MAV_MODE_FLAG_GUIDED_ENABLED
        | _M.MAV_MODE_FLAG_STABILIZE_ENABLED
    )
    status = _M.MAV_STATE_ACTIVE if alive else _M.MAV_STATE_EMERGENCY
    mode = custom_mode(int(view.autopilots.mode[view.i]))
    return _M.MAVLink_heartbeat_message(_M.MAV_TYPE_FIXED_WING, _M.MAV_AUTOPILOT_PX4, flags, mode, status, 3)


def _stamp(view: AutopilotView) -> int:
    """time_boot_ms: simulated time; a uint32, it begins anew after 49.7 days."""
    return view.now_us // 1000 % 2**32


def _attitude(view: AutopilotView) -> Any:
    q0, q1, q2, q3, p, q, r = view.state[:_POSITION].tolist()
    roll = math.atan2(2.0 * (q0 * q1 + q2 * q3), 1.0 - 2.0 * (q1 * q1 + q2 * q2))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (q0 * q2 - q3 * q1))))
    return _M.MAVLink_attitude_message(_stamp(view), roll, pitch, _yaw(q0, q1, q2, q3), p, q, r)


def _yaw(q0: float, q1: float, q2: float, q3: float) -> float:
    return math.atan2(2.0 * (q0 * q3 + q1 * q2), 1.0 - 2.0 * (q2 * q2 + q3 * q3))


def _attitude_quaternion(view: AutopilotView) -> Any:
    return _M.MAVLink_attitude_quaternion_message(_stamp(view), *view.state[:_POSITION].tolist())


def _local_position(view: AutopilotView) -> Any:
    return _M.MAVLink_local_position_ned_message(_stamp(view), *view.state[_POSITION:].tolist())


def _heading(view: AutopilotView) -> float:
    """Degrees, 0..360."""
    return math.degrees(_yaw(*view.state[:_RATES].tolist())) % 360.0


def _global_position(view: AutopilotView) -> Any:
    x, y, z, vx, vy, vz = view.state[_POSITION:].tolist()
    latitude, longitude = view.home.place(x, y)
    return _M.MAVLink_global_position_int_message(
        _stamp(view),
        latitude,
        longitude,
        whole((view.home.altitude - z) * 1e3, 32),
        whole(-z * 1e3, 32),
        whole(vx * 1e2, 16),
        whole(vy * 1e2, 16),
        whole(vz * 1e2, 16),
        int(_heading(view) * 1e2) % 36000,
    )


def _gps_raw(view: AutopilotView) -> Any:
    x, y, z, vx, vy, vz = view.state[_POSITION:].tolist()
    latitude, longitude = view.home.place(x, y)
    course = math.degrees(math.atan2(vy, vx)) % 360.0
    return _M.MAVLink_gps_raw_int_message(
        view.now_us,
        _M.GPS_FIX_TYPE_3D_FIX,
        latitude,
        longitude,
        whole((view.home.altitude - z) * 1e3, 32),
        100,
        100,
        whole(math.sqrt(vx * vx + vy * vy + vz * vz) * 1e2, 16, signed=False),
        int(course * 1e2) % 36000,
        12,
    )


def _vfr_hud(view: AutopilotView) -> Any:
    _, _, z, vx, vy, vz = view.state[_POSITION:].tolist()
    ground = math.sqrt(vx * vx + vy * vy)
    throttle = whole(100.0 * float(view.controls[THRUST]), 16, signed=False)
    altitude = view.home.altitude - z
    # Still air: airspeed is speed.
    airspeed = math.sqrt(ground * ground + vz * vz)
    return _M.MAVLink_vfr_hud_message(airspeed, ground, int(_heading(view)), throttle, altitude, -vz)


_SENSORS = (
    _M.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | _M.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | _M.MAV_SYS_STATUS_SENSOR_3D_MAG
    | _M.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | _M.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE
    | _M.MAV_SYS_STATUS_SENSOR_GPS
    | _M.MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL
    | _M.MAV_SYS_STATUS_SENSOR_ATTITUDE_STABILIZATION
    | _M.MAV_SYS_STATUS_AHRS
    | _M.MAV_SYS_STATUS_PREARM_CHECK
)


def _knows_of_a_fault(view: AutopilotView) -> bool:
    """Whether the UAV believes that something is wrong with an actuator."""
    diagnosis = view.autopilots.diagnosis
    if diagnosis is None:
        return False
    states, kinds = (diagnosis.belief[view.i, :, BELIEF_FIELDS.index(name)] for name in ("state", "kind"))
    return bool(((states >= UNDETERMINED) & (kinds < SENSOR)).any())


def _sys_status(view: AutopilotView) -> Any:
    lost = int(view.inbox.edges[view.i, : view.inbox.degree[view.i], _LOST].sum())
    received = int(view.inbox.edges[view.i, : view.inbox.degree[view.i], _RECEIVED].sum())
    share = round(1e4 * lost / max(1, lost + received))
    # No battery is modelled: unknown voltage and current, 100 % so that no client raises an alarm.
    # There is no fence; one that does not count as healthy is announced as breached.
    healthy = _SENSORS | _M.MAV_SYS_STATUS_GEOFENCE
    present = _SENSORS
    if view.diagnosed:
        present |= _M.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        healthy |= _M.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        if _knows_of_a_fault(view):
            # Clients that know no outputs, such as MAVSDK, read the check before arming: nobody would take off so.
            healthy &= ~(_M.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS | _M.MAV_SYS_STATUS_PREARM_CHECK)
    return _M.MAVLink_sys_status_message(
        present, present, healthy, 0, 65535, -1, 100, share, min(65535, lost), 0, 0, 0, 0
    )


def _extended_state(view: AutopilotView) -> Any:
    return _M.MAVLink_extended_sys_state_message(_M.MAV_VTOL_STATE_UNDEFINED, _M.MAV_LANDED_STATE_IN_AIR)


def _system_time(view: AutopilotView) -> Any:
    """The Unix time of the simulated time: that of the swarm's start, and what has been simulated since."""
    return _M.MAVLink_system_time_message(view.setting.epoch_us + view.now_us, _stamp(view))


def _servos(view: AutopilotView) -> Any:
    pulses = [whole(1500.0 + 500.0 * fraction, 16, signed=False) for fraction in view.controls.tolist()]
    pulses[THRUST] = whole(1000.0 + 1000.0 * float(view.controls[THRUST]), 16, signed=False)
    return _M.MAVLink_servo_output_raw_message(view.now_us % 2**32, 0, *pulses, 0, 0, 0, 0)


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def _signal(view: AutopilotView, *names: str) -> float | None:
    """The first of the signals that the scheme has."""
    for n, quantity in enumerate(view.scheme.signals):
        if quantity.name in names:
            return float(view.autopilots.signals[view.i, n])
    return None


def _attitude_target(view: AutopilotView) -> Any:
    own = fields(Own, view.autopilots.own[view.i])
    if view.scheme.plant == "attitude" and not view.leader:
        wanted = fields(AttitudeReference, view.autopilots.reference[view.i])
        rates = 0b111
        attitude = body_attitude(own.chi, own.gamma, wanted.mu, wanted.alpha, wanted.beta)
        return _M.MAVLink_attitude_target_message(_stamp(view), rates, attitude, 0.0, 0.0, 0.0, 0.0)
    pitch = own.theta if view.leader else _signal(view, "theta_d")
    rate = 0.0 if view.leader else _signal(view, "q_d")
    ignored = _M.ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE | _M.ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE
    if pitch is None:
        ignored |= _M.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
    if rate is None:
        ignored |= _M.ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
    thrust = max(0.0, min(1.0, float(view.controls[THRUST])))
    return _M.MAVLink_attitude_target_message(
        _stamp(view), ignored, _quaternion(0.0, _finite(pitch), own.chi), 0.0, _finite(rate), 0.0, thrust
    )


def _finite(value: float | None) -> float:
    return value if value is not None and math.isfinite(value) else 0.0


_NOTHING = 0b1111_1111_1111
"""POSITION_TARGET_TYPEMASK: everything ignored."""


def _position_target(view: AutopilotView) -> Any:
    mask = _NOTHING
    x = y = z = vx = vz = 0.0
    if view.leader:
        _, x, y, z, vx, _, vz = view.autopilots.target[view.i].tolist()
        mask &= ~0b111_111
    else:
        tracked = _signal(view, "z_r", "zhat", "z_d")
        if tracked is not None and math.isfinite(tracked):
            z = tracked
            mask &= ~_M.POSITION_TARGET_TYPEMASK_Z_IGNORE
    return _M.MAVLink_position_target_local_ned_message(
        _stamp(view), _M.MAV_FRAME_LOCAL_NED, mask, x, y, -z, vx, 0.0, -vz, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def _signals(view: AutopilotView) -> Any:
    return float_array(view.now_us, "signals", view.autopilots.signals[view.i].tolist())


def _beliefs(view: AutopilotView) -> Any:
    diagnosis, i = view.autopilots.diagnosis, view.i
    rows = np.zeros((len(ACTUATORS), len(BELIEF_FIELDS)))
    rows[:, BELIEF_FIELDS.index("state")] = -1.0
    if diagnosis is None:
        return float_array(view.now_us, "beliefs", [*rows.ravel().tolist(), *new_health(1).ravel().tolist()])
    has = diagnosis.has[i] == 1
    rows[has] = diagnosis.belief[i, has, : len(BELIEF_FIELDS)]
    return float_array(view.now_us, "beliefs", rows.ravel().tolist() + diagnosis.health[i].tolist())


def _links(view: AutopilotView) -> Any:
    inbox, i = view.inbox, view.i
    values: list[float] = []
    for edge in range(int(inbox.degree[i])):
        at = fields(Edge, inbox.edges[i, edge])
        cut = inbox.quality[i, edge, _BLOCKED] > 0.0 or not view.link_events.radio_on[i]
        age = float(inbox.age[i, edge]) if inbox.valid[i, edge] else -1.0
        values += [at.sender, age, at.received, at.lost, float(cut)]
    return float_array(view.now_us, "links", values)


def _trust(view: AutopilotView) -> Any:
    defence, inbox, i = view.autopilots.defence, view.inbox, view.i
    values: list[float] = []
    for edge in range(min(int(inbox.degree[i]), _MOST_TRUSTS)):
        values += [float(inbox.edges[i, edge, _SENDER]), float(defence.edges[i, edge, _STANDING])]
    return float_array(view.now_us, "trust", values)


def _home_position(view: AutopilotView) -> Any:
    latitude, longitude = view.home.place(0.0, 0.0)
    altitude = whole(view.home.altitude * 1e3, 32)
    return _M.MAVLink_home_position_message(
        latitude, longitude, altitude, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, view.now_us
    )


class Stream(NamedTuple):
    """A message that is sent again and again."""

    name: str
    """Of its parameter, behind SR_."""
    message: int
    rate: float
    """Hz of simulated time, towards a ground station, unless asked otherwise; 0 = only when asked."""
    to_station: float
    """Hz towards the swarm's own station, which logs everything."""
    make: Callable[[AutopilotView], Any]
    followers_only: bool = False
    diagnosed_only: bool = False
    """Only of UAVs that diagnose their actuators."""
    logged: float = 0.0
    """Hz of simulated time that the station has at least, also where the swarm flies faster than the clock."""

    defended_only: bool = False
    """Only of UAVs that defend themselves against what neighbours tell."""

    def of(self, view: AutopilotView) -> bool:
        """Whether a UAV has it."""
        return not (self.followers_only and view.leader) and self.known_to(view)

    def known_to(self, view: AutopilotView) -> bool:
        """Whether a UAV of this kind of swarm can have it."""
        return (view.diagnosed or not self.diagnosed_only) and (view.defended or not self.defended_only)


STREAMS = (
    Stream("ATTITUDE", _M.MAVLINK_MSG_ID_ATTITUDE, 10.0, 5.0, _attitude),
    Stream("ATT_QUAT", _M.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, 0.0, 0.0, _attitude_quaternion),
    Stream("LOCAL_POS", _M.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 10.0, 2.0, _local_position),
    Stream("GPS_RAW", _M.MAVLINK_MSG_ID_GPS_RAW_INT, 2.0, 1.0, _gps_raw),
    Stream("GLOBAL_POS", _M.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0, 5.0, _global_position, logged=1.0),
    Stream("VFR_HUD", _M.MAVLINK_MSG_ID_VFR_HUD, 5.0, 2.0, _vfr_hud),
    Stream("SYS_STATUS", _M.MAVLINK_MSG_ID_SYS_STATUS, 1.0, 1.0, _sys_status),
    Stream("EXT_STATE", _M.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 1.0, 0.0, _extended_state),
    Stream("SYS_TIME", _M.MAVLINK_MSG_ID_SYSTEM_TIME, 1.0, 0.0, _system_time),
    Stream("SERVOS", _M.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW, 2.0, 2.0, _servos),
    Stream("ATT_TARGET", _M.MAVLINK_MSG_ID_ATTITUDE_TARGET, 2.0, 0.0, _attitude_target),
    Stream("POS_TARGET", _M.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, 2.0, 0.0, _position_target),
    Stream("SIGNALS", _M.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY, 2.0, 10.0, _signals, followers_only=True),
    Stream("BELIEFS", _M.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY, 2.0, 0.0, _beliefs, diagnosed_only=True),
    Stream("LINKS", _M.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY, 1.0, 10.0, _links),
    Stream("TRUST", _M.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY, 1.0, 2.0, _trust, defended_only=True),
    Stream("HOME", _M.MAVLINK_MSG_ID_HOME_POSITION, 0.5, 0.0, _home_position),
)
"""Everything that flows of itself, beside HEARTBEAT, in the order in which it is sent: a fix before positions."""


LOGGED = tuple(stream.logged for stream in STREAMS)
"""Least rates towards the station in the order of `STREAMS`, Hz."""


def rates_of(view: AutopilotView, station: bool) -> list[float]:
    """Rates in the order of `STREAMS`, Hz, towards a ground station or the swarm's own."""
    return [(stream.to_station if station else stream.rate) if stream.of(view) else 0.0 for stream in STREAMS]


def places_of(view: AutopilotView, message: float) -> list[int]:
    """Places in `STREAMS` of a message, by its number, that this UAV has."""
    return [n for n, stream in enumerate(STREAMS) if stream.message == message and stream.of(view)]


def _autopilot_version(view: AutopilotView) -> Any:
    capabilities = (
        _M.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | _M.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | _M.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | _M.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        | _M.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
        | _M.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        | _M.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    # The version of the interface that is spoken, PX4 1.15: what clients decide by is what such an autopilot does.
    version = 1 << 24 | 15 << 16 | 255
    nothing = (0,) * 8
    return _M.MAVLink_autopilot_version_message(
        capabilities, version, 0, 0, 0, nothing, nothing, nothing, 0, 0, view.setting.system(view.spec.uav)
    )


ON_REQUEST: dict[int, Callable[[AutopilotView], Any]] = {
    _M.MAVLINK_MSG_ID_AUTOPILOT_VERSION: _autopilot_version,
    _M.MAVLINK_MSG_ID_HOME_POSITION: _home_position,
    _M.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    _M.MAVLINK_MSG_ID_MISSION_CURRENT: lambda view: _M.MAVLink_mission_current_message(0),
}
"""Messages that come when they are asked for, beside those of `STREAMS`."""


def requested(view: AutopilotView, message: int) -> list[Any]:
    """What REQUEST_MESSAGE brings; nothing where the message is unknown here."""
    if message in ON_REQUEST:
        return [ON_REQUEST[message](view)]
    return [STREAMS[n].make(view) for n in places_of(view, message)]
