"""Commands of the ground: what each does, and how it is answered."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from ftcc.airside.gcs.answers import ACCEPTED, DENIED, UNSUPPORTED, Answer, Request, whole
from ftcc.airside.gcs.flight_modes import set_mode
from ftcc.airside.gcs.motion import altitude_above_home, command_leader
from ftcc.airside.gcs.schedule import SLOWEST
from ftcc.airside.gcs.services import Services
from ftcc.airside.gcs.streams import places_of, requested
from ftcc.link.flight_modes import HOLD, MISSION, mode_of
from ftcc.link.mavlink import as_typed, dialect

__all__ = ["COMMANDS", "Command", "carry_out"]

_M = dialect
_ONLY = "only altitude and speed can be changed"


def _set_message_interval(services: Services, request: Request) -> Answer:
    message, interval = request.parameters[0], request.parameters[1]
    places = places_of(services.view, message)
    if not places:
        return Answer(UNSUPPORTED)
    if not (interval in (-1.0, 0.0) or 1.0 <= interval <= 1e6 / SLOWEST):
        return Answer(DENIED, f"interval: up to {1e6 / SLOWEST:g} us, 0 default, -1 off")
    for n in places:
        rate = services.telemetry.default_rate(n) if interval == 0.0 else 0.0 if interval == -1.0 else 1e6 / interval
        services.telemetry.schedule(request.peer).set(n, min(rate, 1e6 / services.view.setting.timing.period_us))
    return Answer(ACCEPTED)


def _get_message_interval(services: Services, request: Request) -> Answer:
    message = request.parameters[0]
    places = places_of(services.view, message)
    if math.isnan(message) or not 0 <= message < 2**16:
        return Answer(DENIED)
    rate = services.telemetry.schedule(request.peer).rate(places[0]) if places else 0.0
    interval = whole(1e6 / rate, 32) if rate > 0.0 else -1 if places else 0
    request.peer.send(_M.MAVLink_message_interval_message(int(message), interval))
    return Answer(ACCEPTED)


def _request_message(services: Services, request: Request) -> Answer:
    number = request.parameters[0]
    messages = requested(services.view, int(number)) if math.isfinite(number) else []
    if not messages:
        return Answer(UNSUPPORTED)
    return Answer(ACCEPTED, messages=tuple(messages))


def _request_this(message: int) -> Callable[[Services, Request], Answer]:
    def handle(services: Services, request: Request) -> Answer:
        return _request_message(services, request._replace(parameters=(float(message),) + (math.nan,) * 6))

    return handle


def _do_set_mode(services: Services, request: Request) -> Answer:
    mode = mode_of(request.parameters[1], request.parameters[2])
    if mode is None:
        return Answer(DENIED, "modes: mission (4 4), hold (4 3), offboard (6)")
    return set_mode(services, mode)


def _pause_or_continue(services: Services, request: Request) -> Answer:
    if request.parameters[0] not in (0.0, 1.0):
        return Answer(DENIED, "0 = hold, 1 = go on")
    return set_mode(services, MISSION if request.parameters[0] else HOLD)


def _arm(services: Services, request: Request) -> Answer:
    if request.parameters[0] == 1.0:
        return Answer(ACCEPTED)
    return Answer(DENIED, "in the air: it stays armed" if request.parameters[0] == 0.0 else "1 = arm, 0 = disarm")


def _accept(services: Services, request: Request) -> Answer:
    return Answer(ACCEPTED)


def _deny(text: str) -> Callable[[Services, Request], Answer]:
    return lambda services, request: Answer(DENIED, text)


def _change_altitude(services: Services, request: Request) -> Answer:
    """DO_CHANGE_ALTITUDE; its frame is its second parameter, also in a COMMAND_INT."""
    altitude, frame = request.parameters[:2]
    if not math.isfinite(altitude):
        return Answer(DENIED, "altitude: must be finite")
    altitude, why = altitude_above_home(services.view, altitude, frame)
    return Answer(DENIED, why) if why else command_leader(services.view, altitude, None)


def _change_speed(services: Services, request: Request) -> Answer:
    """DO_CHANGE_SPEED."""
    kind, speed = request.parameters[0], as_typed(request.parameters[1])
    if kind not in (0.0, 1.0):
        return Answer(DENIED, "speed type: 0 airspeed, 1 ground speed")
    if not math.isfinite(speed):
        return Answer(DENIED, "speed: must be finite")
    return command_leader(services.view, None, speed)


def _reposition(services: Services, request: Request) -> Answer:
    """DO_REPOSITION, the way in which QGroundControl changes an altitude, and, where nothing is given, pauses."""
    speed, flags, radius, yaw, latitude, longitude, altitude = request.parameters
    if any(map(math.isinf, request.parameters)):
        return Answer(DENIED, "a number is infinite")
    flags = 0.0 if math.isnan(flags) else flags
    # Zeros are what a client leaves where it fills nothing in; a negative speed is the default one.
    if any(value != 0.0 and not math.isnan(value) for value in (latitude, longitude, radius, yaw)):
        return Answer(DENIED, _ONLY)
    if math.isnan(altitude) and not speed > 0.0:
        if int(flags) & _M.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE:
            return set_mode(services, HOLD)
        return Answer(DENIED, "neither an altitude nor a speed is given")
    wanted = None
    if not math.isnan(altitude):
        wanted, why = altitude_above_home(services.view, altitude, request.frame)
        if why:
            return Answer(DENIED, why)
    faster = as_typed(speed) if speed > 0.0 else None
    return command_leader(services.view, wanted, faster)


_NO_LANDING = "a swarm does not land: ftcc stop ends it"
_NOT_IN_THE_AIR = "not in the air"


class Command(NamedTuple):
    """What is done with a command."""

    handle: Callable[[Services, Request], Answer | None]
    """None as its answer: it comes later."""
    does: str
    """For people."""
    read_only: bool = False
    """It changes nothing about the UAV: not worth logging, and answered for one that is lost, too."""


def _denied(text: str) -> Command:
    return Command(_deny(text), f"denied: {text}")


COMMANDS: dict[int, Command] = {
    _M.MAV_CMD_COMPONENT_ARM_DISARM: Command(_arm, "1: accepted, it is armed; 0: denied in the air"),
    _M.MAV_CMD_RUN_PREARM_CHECKS: Command(_accept, "accepted: it has passed them"),
    _M.MAV_CMD_NAV_TAKEOFF: Command(_accept, "accepted, does nothing: it is in the air"),
    _M.MAV_CMD_DO_SET_MODE: Command(_do_set_mode, "PX4's modes mission (4 4), hold (4 3), offboard (6)"),
    _M.MAV_CMD_MISSION_START: Command(lambda services, request: set_mode(services, MISSION), "mode mission"),
    _M.MAV_CMD_DO_PAUSE_CONTINUE: Command(_pause_or_continue, "0: mode hold; 1: mode mission"),
    _M.MAV_CMD_NAV_LOITER_UNLIM: Command(lambda services, request: set_mode(services, HOLD), "mode hold"),
    _M.MAV_CMD_DO_CHANGE_ALTITUDE: Command(
        _change_altitude, "altitude (m) of a leader; frame 0, 5: above sea level, 3, 6: above home"
    ),
    _M.MAV_CMD_DO_CHANGE_SPEED: Command(_change_speed, "speed (m/s) of a leader; type 0 or 1"),
    _M.MAV_CMD_DO_REPOSITION: Command(
        _reposition,
        "altitude and speed of a leader, frames as DO_CHANGE_ALTITUDE; no place; nothing given: mode hold",
    ),
    _M.MAV_CMD_INJECT_FAILURE: Command(
        lambda services, request: services.failures.inject(request),
        "see `ftcc failures`; acts at FTCC_AT, sizes from FAIL_*, of lies from ATK_*",
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


def carry_out(services: Services, request: Request, repeated: bool) -> None:
    """Carry out a command and answer it; a repetition of one that was answered is answered likewise."""
    if repeated and services.outbox.answer_again(request):
        return
    command = COMMANDS.get(request.command)
    if command is None:
        services.outbox.answer(request, Answer(UNSUPPORTED))
        return
    answer: Answer | None = Answer(DENIED, "this UAV is lost")
    if services.view.alive or command.read_only:
        answer = command.handle(services, request)
    if answer is not None:
        services.outbox.answer(request, answer, command.read_only)
