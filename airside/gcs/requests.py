"""What a ground station sends beside commands: parameters, an empty mission, time; each answered or refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from ftcc.airside.gcs.answers import ACCEPTED, read_request
from ftcc.airside.gcs.commands import carry_out
from ftcc.airside.gcs.flight_modes import set_mode
from ftcc.airside.gcs.parameters import RefusedError
from ftcc.airside.gcs.services import Services
from ftcc.link.flight_modes import mode_of
from ftcc.link.gcs_sockets import Peer
from ftcc.link.mavlink import dialect

__all__ = ["MESSAGES", "Message"]

_M = dialect
_FTP_SEQUENCE, _FTP_SESSION, _FTP_OPCODE, _FTP_SIZE, _FTP_REQUEST, _FTP_DATA = 0, 2, 3, 4, 5, 12
"""Where the fields of its payload begin."""
_FTP_ANSWER, _FTP_NAK = 128, 129
_FTP_END_OF_FILE, _FTP_UNKNOWN_COMMAND, _FTP_NOT_FOUND = 6, 7, 10
_FTP_ERRORS = {3: _FTP_END_OF_FILE, 4: _FTP_NOT_FOUND, 14: _FTP_NOT_FOUND, 15: _FTP_NOT_FOUND}
"""By request: a folder is listed to its end, a file to be read is not found; all others are unknown."""


def _parameter_list(services: Services, peer: Peer, message: Any) -> None:
    peer.send(*(services.parameters.message(n) for n in range(len(services.parameters))))


def _not_there(peer: Peer, message: Any) -> None:
    error = _M.MAV_PARAM_ERROR_DOES_NOT_EXIST
    index = getattr(message, "param_index", -1)
    peer.send(
        _M.MAVLink_param_error_message(
            message.get_srcSystem(), message.get_srcComponent(), message.param_id.encode(), index, error
        )
    )


def _parameter_read(services: Services, peer: Peer, message: Any) -> None:
    n = services.parameters.find(message.param_id, message.param_index)
    if n is None:
        _not_there(peer, message)
    else:
        peer.send(services.parameters.message(n))


def _parameter_set(services: Services, peer: Peer, message: Any) -> None:
    """Answered with the value in force, whatever becomes of the one asked for."""
    n = services.parameters.find(message.param_id, -1)
    who = f"{message.get_srcSystem()}/{message.get_srcComponent()}"
    if n is None:
        _not_there(peer, message)
        return
    name, before = services.parameters.name(n), services.parameters.value(n)
    try:
        changed = services.parameters.set(n, message.param_value, message.param_type)
    except RefusedError as refusal:
        services.outbox.send_text(_M.MAV_SEVERITY_WARNING, str(refusal), peer)
        services.view.log(f"parameter {name} refused: {refusal}", "warning", who, "denied")
        peer.send(services.parameters.message(n))
        return
    if changed:
        text = f"parameter {name} = {services.parameters.value(n):.10g} (was {before:.10g})"
        services.view.log(text, "info", who, "accepted")
    answer = services.parameters.message(n)
    for other in services.outbox.peers:
        if changed or other is peer:
            other.send(answer)
    if peer not in services.outbox.peers:
        peer.send(answer)


def _command(services: Services, peer: Peer, message: Any) -> None:
    confirmation = getattr(message, "confirmation", 0)
    carry_out(services, read_request(message, peer), repeated=confirmation > 0)


def _set_mode(services: Services, peer: Peer, message: Any) -> None:
    """SET_MODE, which nothing answers but the next HEARTBEAT."""
    mode = mode_of(message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24)
    if mode is None:
        services.outbox.send_text(_M.MAV_SEVERITY_WARNING, "modes: mission, hold, offboard", peer)
        return
    answer = set_mode(services, mode)
    if answer.result != ACCEPTED:
        services.outbox.send_text(_M.MAV_SEVERITY_WARNING, answer.text, peer)
    elif answer.event:
        services.view.log(answer.event, "info", f"{message.get_srcSystem()}/{message.get_srcComponent()}", "accepted")


def _mission_list(services: Services, peer: Peer, message: Any) -> None:
    kind = message.mission_type
    peer.send(_M.MAVLink_mission_count_message(message.get_srcSystem(), message.get_srcComponent(), 0, kind))


def _mission_answer(result: int) -> Callable[[Services, Peer, Any], None]:
    def handle(services: Services, peer: Peer, message: Any) -> None:
        kind = getattr(message, "mission_type", _M.MAV_MISSION_TYPE_MISSION)
        peer.send(_M.MAVLink_mission_ack_message(message.get_srcSystem(), message.get_srcComponent(), result, kind))

    return handle


def _mission_upload(services: Services, peer: Peer, message: Any) -> None:
    """An empty mission is what we have; any other is refused: the scenario is the mission."""
    result = _M.MAV_MISSION_ACCEPTED if message.count == 0 else _M.MAV_MISSION_UNSUPPORTED
    _mission_answer(result)(services, peer, message)


def _timesync(services: Services, peer: Peer, message: Any) -> None:
    """Answered with the simulated time of the last tick, by which all other messages are stamped, too."""
    if message.tc1 == 0:
        # An answer of 0 would be a question.
        peer.send(_M.MAVLink_timesync_message(max(1, services.view.now_us * 1000), message.ts1))


def _ping(services: Services, peer: Peer, message: Any) -> None:
    if message.target_system == 0:
        sender = message.get_srcSystem(), message.get_srcComponent()
        peer.send(_M.MAVLink_ping_message(message.time_usec, message.seq, *sender))


def _files(services: Services, peer: Peer, message: Any) -> None:
    """MAVLink FTP of a vehicle without files; answers to somebody else's questions are left alone."""
    payload = list(message.payload)
    asked = payload[_FTP_OPCODE]
    if asked >= _FTP_ANSWER:
        return
    answer = [0] * 251
    sequence = (payload[_FTP_SEQUENCE] | payload[_FTP_SEQUENCE + 1] << 8) + 1
    answer[_FTP_SEQUENCE], answer[_FTP_SEQUENCE + 1] = sequence & 0xFF, sequence >> 8 & 0xFF
    answer[_FTP_SESSION] = payload[_FTP_SESSION]
    answer[_FTP_OPCODE], answer[_FTP_SIZE], answer[_FTP_REQUEST] = _FTP_NAK, 1, asked
    answer[_FTP_DATA] = _FTP_ERRORS.get(asked, _FTP_UNKNOWN_COMMAND)
    peer.send(_M.MAVLink_file_transfer_protocol_message(0, message.get_srcSystem(), message.get_srcComponent(), answer))


def _logs(services: Services, peer: Peer, message: Any) -> None:
    peer.send(_M.MAVLink_log_entry_message(0, 0, 0, 0, 0))


def _target(services: Services, peer: Peer, message: Any) -> None:
    services.offboard.take_target(message)


class Message(NamedTuple):
    """What is done with a message."""

    handle: Callable[[Services, Peer, Any], None]
    does: str
    """For people."""
    changing: bool = False
    """It may change the state of the UAV, and is no target, which is out of date in a moment."""


_NO_MISSION = "MISSION_ACK: the scenario is the mission"
_TARGET = "offboard: {}; refused with a text where it asks for more"

MESSAGES: dict[str, Message] = {
    "COMMAND_LONG": Message(_command, "COMMAND_ACK, to who asked", True),
    "COMMAND_INT": Message(_command, "COMMAND_ACK; INT32_MAX and nan are not given", True),
    "PARAM_REQUEST_LIST": Message(_parameter_list, "PARAM_VALUE of all parameters"),
    "PARAM_REQUEST_READ": Message(_parameter_read, "PARAM_VALUE, or PARAM_ERROR"),
    "PARAM_SET": Message(_parameter_set, "PARAM_VALUE with the value in force", True),
    "SET_MODE": Message(_set_mode, "the mode in HEARTBEAT, or a text", True),
    "MISSION_REQUEST_LIST": Message(_mission_list, "MISSION_COUNT 0: the scenario is the mission"),
    "MISSION_REQUEST": Message(_mission_answer(_M.MAV_MISSION_INVALID_SEQUENCE), _NO_MISSION),
    "MISSION_REQUEST_INT": Message(_mission_answer(_M.MAV_MISSION_INVALID_SEQUENCE), _NO_MISSION),
    "MISSION_COUNT": Message(_mission_upload, "MISSION_ACK: unsupported, but for an empty mission"),
    "MISSION_ITEM": Message(_mission_answer(_M.MAV_MISSION_UNSUPPORTED), _NO_MISSION),
    "MISSION_ITEM_INT": Message(_mission_answer(_M.MAV_MISSION_UNSUPPORTED), _NO_MISSION),
    "MISSION_WRITE_PARTIAL_LIST": Message(_mission_answer(_M.MAV_MISSION_UNSUPPORTED), _NO_MISSION),
    "MISSION_SET_CURRENT": Message(_mission_answer(_M.MAV_MISSION_INVALID_SEQUENCE), _NO_MISSION),
    "MISSION_REQUEST_PARTIAL_LIST": Message(_mission_answer(_M.MAV_MISSION_INVALID_SEQUENCE), _NO_MISSION),
    "MISSION_CLEAR_ALL": Message(_mission_answer(_M.MAV_MISSION_ACCEPTED), "MISSION_ACK: it is empty"),
    "TIMESYNC": Message(_timesync, "TIMESYNC on the simulated clock"),
    "PING": Message(_ping, "PING, to who asked"),
    "FILE_TRANSFER_PROTOCOL": Message(_files, "there are no files: lists are empty, nothing is found"),
    "LOG_REQUEST_LIST": Message(_logs, "LOG_ENTRY: no logs; the run's folder has them"),
    "SET_ATTITUDE_TARGET": Message(_target, _TARGET.format("an attitude of a follower that refers to one")),
    "SET_POSITION_TARGET_LOCAL_NED": Message(_target, _TARGET.format("altitude and forward speed of a leader")),
    "SET_POSITION_TARGET_GLOBAL_INT": Message(_target, _TARGET.format("altitude and forward speed of a leader")),
}
"""What is done with a message by its name; any other is for somebody else."""
