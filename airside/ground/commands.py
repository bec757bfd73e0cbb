"""Commands of the ground: what each does, and what it is answered."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from ftcc.airside.ground.streams import requested
from ftcc.airside.references.profiles import climb_of_step, command_from_ground, release_from_ground
from ftcc.link.mavlink import as_typed, dialect
from ftcc.link.modes import HOLD, MISSION, NAMES, OFFBOARD, mode_of

if TYPE_CHECKING:
    from ftcc.airside.ground.link import GroundLink
    from ftcc.link.ground import Peer

__all__ = ["COMMANDS", "READING", "Answer", "Request", "lead", "read_request", "set_mode"]

_M = dialect
ACCEPTED = _M.MAV_RESULT_ACCEPTED
DENIED = _M.MAV_RESULT_DENIED
BUSY = _M.MAV_RESULT_TEMPORARILY_REJECTED
UNSUPPORTED = _M.MAV_RESULT_UNSUPPORTED


class Request(NamedTuple):
    """A command as it came, by COMMAND_LONG or COMMAND_INT."""

    command: int
    parameters: tuple[float, ...]
    """Seven; nan = not given. Latitude and longitude in degrees."""
    system: int
    component: int
    """Of the sender."""
    peer: Peer

    @property
    def who(self) -> str:
        """The sender, for the log."""
        return f"{self.system}/{self.component}"


class Answer(NamedTuple):
    """What COMMAND_ACK says."""

    result: int
    text: str = ""
    """Why, for people: sent as STATUSTEXT where the result is not good."""
    event: str = ""
    """What was done, for the log; empty: nothing worth logging."""
    detail: int = 0
    """result_param2."""


def read_request(message: Any, peer: Peer) -> Request:
    """A COMMAND_LONG or COMMAND_INT."""
    given = [message.param1, message.param2, message.param3, message.param4]
    if message.get_type() == "COMMAND_LONG":
        given += [message.param5, message.param6, message.param7]
    else:
        given += [message.x / 1e7, message.y / 1e7, message.z]
    return Request(int(message.command), tuple(given), message.get_srcSystem(), message.get_srcComponent(), peer)


def _set_message_interval(link: GroundLink, request: Request) -> Answer:
    message, interval = request.parameters[0], request.parameters[1]
    places = link.streams_of(message)
    if not places:
        return Answer(UNSUPPORTED)
    if math.isnan(interval) or (interval < 0.0 and interval != -1.0) or math.isinf(interval):
        return Answer(DENIED, "interval: us, 0 = default, -1 = off")
    for n in places:
        rate = link.rate(n) if interval == 0.0 else 0.0 if interval == -1.0 else 1e6 / interval
        link.schedule(request.peer).set(n, min(rate, 1e6 / link.seat.setting.timing.period_us))
    return Answer(ACCEPTED)


def _get_message_interval(link: GroundLink, request: Request) -> Answer:
    message = request.parameters[0]
    places = link.streams_of(message)
    if math.isnan(message) or not 0 <= message < 2**16:
        return Answer(DENIED)
    rate = link.schedule(request.peer).rate(places[0]) if places else 0.0
    interval = round(1e6 / rate) if rate > 0.0 else -1 if places else 0
    request.peer.send(_M.MAVLink_message_interval_message(int(message), interval))
    return Answer(ACCEPTED)


def _request_message(link: GroundLink, request: Request) -> Answer:
    number = request.parameters[0]
    messages = requested(link.seat, int(number)) if math.isfinite(number) else []
    if not messages:
        return Answer(UNSUPPORTED)
    link.after_answer = lambda: request.peer.send(*messages)
    return Answer(ACCEPTED)


def _request_this(message: int) -> Callable[[GroundLink, Request], Answer]:
    def handle(link: GroundLink, request: Request) -> Answer:
        return _request_message(link, request._replace(parameters=(float(message),) + (math.nan,) * 6))

    return handle


def set_mode(link: GroundLink, mode: int) -> Answer:
    """Change the mode."""
    seat = link.seat
    if mode == OFFBOARD:
        why = link.offboard.refused()
        if why:
            return Answer(DENIED, why)
        if not link.offboard.fresh():
            return Answer(BUSY, link.offboard.refused_target or "offboard: send targets first")
    if mode == MISSION and seat.leader:
        release_from_ground(seat.autopilots.profile_commands[seat.i])
    if mode == MISSION:
        link.offboard.release()
    before = int(seat.autopilots.mode[seat.i])
    seat.autopilots.mode[seat.i] = mode
    return Answer(ACCEPTED, event="" if before == mode else f"mode {NAMES[mode]}")


def _do_set_mode(link: GroundLink, request: Request) -> Answer:
    mode = mode_of(request.parameters[1], request.parameters[2])
    if mode is None:
        return Answer(DENIED, "modes: mission (4 4), hold (4 3), offboard (6)")
    return set_mode(link, mode)


def _pause_or_continue(link: GroundLink, request: Request) -> Answer:
    if request.parameters[0] not in (0.0, 1.0):
        return Answer(DENIED, "0 = hold, 1 = go on")
    return set_mode(link, MISSION if request.parameters[0] else HOLD)


def lead(link: GroundLink, altitude: float | None, speed: float | None) -> Answer:
    """Give a leader another altitude (m, z) or speed (m/s), at FTCC_AT."""
    seat = link.seat
    if not seat.leader or seat.spec.profile is None:
        return Answer(DENIED, "a follower follows: command its leaders")
    if seat.autopilots.mode[seat.i] == HOLD:
        return Answer(BUSY, "in hold: set mode mission first")
    at_us, why = link.failures.time()
    if why:
        return Answer(DENIED, why)
    why = _cannot_be_followed(link, altitude, speed)
    if why:
        return Answer(DENIED, why)
    held = seat.autopilots.held_us[seat.i]
    i = seat.i
    commands, triggers = seat.autopilots.profile_commands[i], seat.autopilots.profile_triggers[i]
    state = seat.autopilots.profile_state[i]
    now, at = (float((t - held) / 1e6) for t in (seat.next_us, at_us))
    if not command_from_ground(commands, triggers, state, now, at, altitude, speed):
        return Answer(BUSY, "too many commands are waiting")
    asked = [f"{altitude:g} m"] if altitude is not None else []
    asked += [f"{speed:g} m/s"] if speed is not None else []
    return Answer(ACCEPTED, event=f"leader commanded to {', '.join(asked)}{link.failures.later(at_us)}")


def _cannot_be_followed(link: GroundLink, altitude: float | None, speed: float | None) -> str:
    """Why the scheme's conditions forbid a leader's command; empty if they do not."""
    seat = link.seat
    profile, flight = seat.spec.profile, seat.spec.flight
    assert profile is not None
    if speed is not None and not 0.0 < speed < 1e3:
        return f"speed {speed:g} m/s: must be positive"
    if altitude is not None and not abs(altitude) < 1e5:
        return f"altitude {altitude:g} m: beyond 100 km"
    if flight is None:
        return ""
    climb, varies = flight.leader_climb, flight.leader_speed_varies
    if altitude is not None:
        step = altitude - float(seat.autopilots.profile_state[seat.i, 1])
        limit = profile.climb_limit if step > 0.0 else profile.sink_limit
        climb = max(climb, min(limit, climb_of_step(profile.altitude_filter, step)))
    if speed is not None:
        varies = varies or speed != float(seat.autopilots.profile_state[seat.i, 3])
    asked = dataclasses.replace(flight, leader_climb=climb, leader_speed_varies=varies)
    gains = seat.scheme.gains_type(*seat.spec.gains)
    before = {problem.text for problem in seat.scheme.check(gains, flight) if problem.fatal}
    fatal = [p.text for p in seat.scheme.check(gains, asked) if p.fatal and p.text not in before]
    return fatal[0] if fatal else ""


def _change_altitude(link: GroundLink, request: Request) -> Answer:
    altitude, frame = as_typed(request.parameters[0]), request.parameters[1]
    if not math.isfinite(altitude):
        return Answer(DENIED, "altitude: must be finite")
    if frame in (_M.MAV_FRAME_GLOBAL, _M.MAV_FRAME_GLOBAL_INT):
        altitude -= link.seat.home.altitude
    elif frame not in (_M.MAV_FRAME_GLOBAL_RELATIVE_ALT, _M.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT):
        return Answer(DENIED, "frame: global or global relative altitude")
    return lead(link, altitude, None)


def _change_speed(link: GroundLink, request: Request) -> Answer:
    kind, speed = request.parameters[0], as_typed(request.parameters[1])
    if kind not in (0.0, 1.0):
        return Answer(DENIED, "speed type: 0 airspeed, 1 ground speed")
    if not math.isfinite(speed):
        return Answer(DENIED, "speed: must be finite")
    return lead(link, None, speed)


def _reposition(link: GroundLink, request: Request) -> Answer:
    """The way in which QGroundControl changes an altitude."""
    *_, latitude, longitude, altitude = request.parameters
    if math.isfinite(latitude) and math.isfinite(longitude) and (latitude, longitude) != (0.0, 0.0):
        return Answer(DENIED, "only altitude and speed can be changed")
    if not math.isfinite(altitude):
        return Answer(DENIED, "altitude: must be finite")
    speed = request.parameters[0]
    asked = as_typed(speed) if math.isfinite(speed) and speed > 0.0 else None
    return lead(link, as_typed(altitude) - link.seat.home.altitude, asked)


def _never(text: str) -> Callable[[GroundLink, Request], Answer]:
    return lambda link, request: Answer(DENIED, text)


def _inject(link: GroundLink, request: Request) -> Answer | None:
    return link.failures.inject(request)


COMMANDS: dict[int, Callable[[Any, Request], Answer | None]] = {
    _M.MAV_CMD_SET_MESSAGE_INTERVAL: _set_message_interval,
    _M.MAV_CMD_GET_MESSAGE_INTERVAL: _get_message_interval,
    _M.MAV_CMD_REQUEST_MESSAGE: _request_message,
    _M.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _request_this(_M.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
    _M.MAV_CMD_GET_HOME_POSITION: _request_this(_M.MAVLINK_MSG_ID_HOME_POSITION),
    _M.MAV_CMD_DO_SET_MODE: _do_set_mode,
    _M.MAV_CMD_DO_PAUSE_CONTINUE: _pause_or_continue,
    _M.MAV_CMD_MISSION_START: lambda link, request: set_mode(link, MISSION),
    _M.MAV_CMD_NAV_LOITER_UNLIM: lambda link, request: set_mode(link, HOLD),
    _M.MAV_CMD_INJECT_FAILURE: _inject,
    _M.MAV_CMD_DO_CHANGE_ALTITUDE: _change_altitude,
    _M.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
    _M.MAV_CMD_DO_REPOSITION: _reposition,
    _M.MAV_CMD_COMPONENT_ARM_DISARM: _never("always armed: the swarm is in the air"),
    _M.MAV_CMD_RUN_PREARM_CHECKS: _never("always armed: the swarm is in the air"),
    _M.MAV_CMD_NAV_TAKEOFF: _never("in the air already"),
    _M.MAV_CMD_NAV_LAND: _never("a swarm does not land: ftcc stop ends it"),
    _M.MAV_CMD_DO_LAND_START: _never("a swarm does not land: ftcc stop ends it"),
    _M.MAV_CMD_NAV_RETURN_TO_LAUNCH: _never("a swarm does not land: ftcc stop ends it"),
    _M.MAV_CMD_DO_FLIGHTTERMINATION: _never("ftcc stop ends a swarm"),
    _M.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _never("not in the air"),
    _M.MAV_CMD_PREFLIGHT_CALIBRATION: _never("not in the air"),
    _M.MAV_CMD_DO_SET_HOME: _never("home belongs to the scenario"),
}
"""What is done with a command; None as an answer: it comes later. Any other command is unsupported."""

READING = frozenset(
    {
        _M.MAV_CMD_SET_MESSAGE_INTERVAL,
        _M.MAV_CMD_GET_MESSAGE_INTERVAL,
        _M.MAV_CMD_REQUEST_MESSAGE,
        _M.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
        _M.MAV_CMD_GET_HOME_POSITION,
    }
)
"""Those that change nothing about the UAV: not worth logging, and answered for one that is lost, too."""
