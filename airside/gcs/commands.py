"""Commands of the ground: what each does, and what it is answered."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from ftcc.airside.gcs.answers import ACCEPTED, DENIED, UNSUPPORTED, Answer, Request, whole
from ftcc.airside.gcs.flight_modes import set_mode
from ftcc.airside.gcs.motion import change_altitude, change_speed, reposition
from ftcc.airside.gcs.schedule import SLOWEST
from ftcc.airside.gcs.streams import requested
from ftcc.link.flight_modes import HOLD, MISSION, mode_of
from ftcc.link.mavlink import dialect

if TYPE_CHECKING:
    from ftcc.airside.gcs.gcs_link import GcsLink

__all__ = ["COMMANDS", "Command"]

_M = dialect


def _set_message_interval(link: GcsLink, request: Request) -> Answer:
    message, interval = request.parameters[0], request.parameters[1]
    places = link.streams_of(message)
    if not places:
        return Answer(UNSUPPORTED)
    if not (interval in (-1.0, 0.0) or 1.0 <= interval <= 1e6 / SLOWEST):
        return Answer(DENIED, f"interval: up to {1e6 / SLOWEST:g} us, 0 default, -1 off")
    for n in places:
        rate = link.rate(n) if interval == 0.0 else 0.0 if interval == -1.0 else 1e6 / interval
        link.schedule(request.peer).set(n, min(rate, 1e6 / link.seat.setting.timing.period_us))
    return Answer(ACCEPTED)


def _get_message_interval(link: GcsLink, request: Request) -> Answer:
    message = request.parameters[0]
    places = link.streams_of(message)
    if math.isnan(message) or not 0 <= message < 2**16:
        return Answer(DENIED)
    rate = link.schedule(request.peer).rate(places[0]) if places else 0.0
    interval = whole(1e6 / rate, 32) if rate > 0.0 else -1 if places else 0
    request.peer.send(_M.MAVLink_message_interval_message(int(message), interval))
    return Answer(ACCEPTED)


def _request_message(link: GcsLink, request: Request) -> Answer:
    number = request.parameters[0]
    messages = requested(link.seat, int(number)) if math.isfinite(number) else []
    if not messages:
        return Answer(UNSUPPORTED)
    link.after_answer = lambda: request.peer.send(*messages)
    return Answer(ACCEPTED)


def _request_this(message: int) -> Callable[[GcsLink, Request], Answer]:
    def handle(link: GcsLink, request: Request) -> Answer:
        return _request_message(link, request._replace(parameters=(float(message),) + (math.nan,) * 6))

    return handle


def _do_set_mode(link: GcsLink, request: Request) -> Answer:
    mode = mode_of(request.parameters[1], request.parameters[2])
    if mode is None:
        return Answer(DENIED, "modes: mission (4 4), hold (4 3), offboard (6)")
    return set_mode(link, mode)


def _pause_or_continue(link: GcsLink, request: Request) -> Answer:
    if request.parameters[0] not in (0.0, 1.0):
        return Answer(DENIED, "0 = hold, 1 = go on")
    return set_mode(link, MISSION if request.parameters[0] else HOLD)


def _arm(link: GcsLink, request: Request) -> Answer:
    if request.parameters[0] == 1.0:
        return Answer(ACCEPTED)
    return Answer(DENIED, "in the air: it stays armed" if request.parameters[0] == 0.0 else "1 = arm, 0 = disarm")


def _so_it_is(link: GcsLink, request: Request) -> Answer:
    return Answer(ACCEPTED)


def _never(text: str) -> Callable[[GcsLink, Request], Answer]:
    return lambda link, request: Answer(DENIED, text)


_NO_LANDING = "a swarm does not land: ftcc stop ends it"
_NOT_IN_THE_AIR = "not in the air"


class Command(NamedTuple):
    """What is done with a command."""

    handle: Callable[[Any, Request], Answer | None]
    """None as its answer: it comes later."""
    does: str
    """For people."""
    reading: bool = False
    """It changes nothing about the UAV: not worth logging, and answered for one that is lost, too."""


def _denied(text: str) -> Command:
    return Command(_never(text), f"denied: {text}")


COMMANDS: dict[int, Command] = {
    _M.MAV_CMD_COMPONENT_ARM_DISARM: Command(_arm, "1: accepted, it is armed; 0: denied in the air"),
    _M.MAV_CMD_RUN_PREARM_CHECKS: Command(_so_it_is, "accepted: it has passed them"),
    _M.MAV_CMD_NAV_TAKEOFF: Command(_so_it_is, "accepted, does nothing: it is in the air"),
    _M.MAV_CMD_DO_SET_MODE: Command(_do_set_mode, "PX4's modes mission (4 4), hold (4 3), offboard (6)"),
    _M.MAV_CMD_MISSION_START: Command(lambda link, request: set_mode(link, MISSION), "mode mission"),
    _M.MAV_CMD_DO_PAUSE_CONTINUE: Command(_pause_or_continue, "0: mode hold; 1: mode mission"),
    _M.MAV_CMD_NAV_LOITER_UNLIM: Command(lambda link, request: set_mode(link, HOLD), "mode hold"),
    _M.MAV_CMD_DO_CHANGE_ALTITUDE: Command(
        change_altitude, "altitude (m) of a leader; frame 0, 5: above sea level, 3, 6: above home"
    ),
    _M.MAV_CMD_DO_CHANGE_SPEED: Command(change_speed, "speed (m/s) of a leader; type 0 or 1"),
    _M.MAV_CMD_DO_REPOSITION: Command(
        reposition,
        "altitude and speed of a leader, frames as DO_CHANGE_ALTITUDE; no place; nothing given: mode hold",
    ),
    _M.MAV_CMD_INJECT_FAILURE: Command(
        lambda link, request: link.failures.inject(request), "see `ftcc failures`; acts at FTCC_AT, sizes from FAIL_*"
    ),
    _M.MAV_CMD_SET_MESSAGE_INTERVAL: Command(_set_message_interval, "us of simulated time; 0 default, -1 off", True),
    _M.MAV_CMD_GET_MESSAGE_INTERVAL: Command(_get_message_interval, "MESSAGE_INTERVAL", True),
    _M.MAV_CMD_REQUEST_MESSAGE: Command(_request_message, "that message once, of those that it sends", True),
    _M.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: Command(
        _request_this(_M.MAVLINK_MSG_ID_AUTOPILOT_VERSION), "AUTOPILOT_VERSION", True
    ),
    _M.MAV_CMD_GET_HOME_POSITION: Command(_request_this(_M.MAVLINK_MSG_ID_HOME_POSITION), "HOME_POSITION", True),
    _M.MAV_CMD_NAV_LAND: _denied(_NO_LANDING),
    _M.MAV_CMD_DO_LAND_START: _denied(_NO_LANDING),
    _M.MAV_CMD_NAV_RETURN_TO_LAUNCH: _denied(_NO_LANDING),
    _M.MAV_CMD_DO_FLIGHTTERMINATION: _denied("ftcc stop ends a swarm"),
    _M.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _denied(_NOT_IN_THE_AIR),
    _M.MAV_CMD_PREFLIGHT_CALIBRATION: _denied(_NOT_IN_THE_AIR),
    _M.MAV_CMD_DO_SET_MISSION_CURRENT: _denied("the scenario is the mission"),
    _M.MAV_CMD_DO_SET_HOME: _denied("home belongs to the scenario"),
}
"""What is done with a command by its number; any other is unsupported."""
