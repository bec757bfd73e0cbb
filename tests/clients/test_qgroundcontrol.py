"""QGroundControl's connection, as its sources have it, played against a flying UAV: nothing is left without an answer.

`docs/ground-stations.md` has the same requests in a table.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from pymavlink.dialects.v20 import development as dialect

from tests.clients.conftest import Swarm

PAGE = Path(__file__).parents[2] / "docs" / "ground-stations.md"
UAV = 2
NAN = float("nan")
PATIENCE = 15.0
"""Wall time for an answer, s; QGroundControl waits 3 s, three times. The median is some milliseconds."""
COMPONENT_INFORMATION, COMPONENT_METADATA, PROTOCOL_VERSION = 395, 397, 300
"""Messages, and a command, that not every dialect of pymavlink's has."""
REQUEST_OPERATOR_CONTROL = 32100
SETUP = {"SYS_AUTOSTART", "CAL_GYRO0_ID", "CAL_ACC0_ID", "CAL_MAG0_ID", "COM_RC_IN_MODE"}
"""What it reads of every PX4 to see whether it is set up; where one is missing it says so in a message box."""
LOITER, RETURN, MISSION = (4 << 16 | sub << 24 for sub in (3, 5, 4))
"""PX4's custom modes."""


class GroundControl:
    """What stands in for QGroundControl: its ids, its port."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._socket.settimeout(0.2)
        self._vehicles: set[tuple[str, int]] = set()
        self.send = dialect.MAVLink(self, srcSystem=255, srcComponent=190)
        self.send.robust_parsing = True
        self._heard: list[Any] = []
        self._beaten = 0.0

    def write(self, datagram: bytes) -> None:
        """To all that have been heard: it is for whom it names."""
        for address in self._vehicles:
            self._socket.sendto(datagram, address)

    def hear(self, wanted: Callable[[Any], bool], seconds: float = PATIENCE) -> Any:
        """The first message of the UAV's autopilot that is as wanted, or None."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            if time.monotonic() - self._beaten > 1.0:
                self._beaten = time.monotonic()
                kind, none = dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID
                self.send.heartbeat_send(kind, none, 192, 0, dialect.MAV_STATE_ACTIVE)
            while self._heard:
                message = self._heard.pop(0)
                ours = (message.get_srcSystem(), message.get_srcComponent()) == (UAV, 1)
                if ours and wanted(message):
                    return message
            try:
                datagram, address = self._socket.recvfrom(4096)
            except TimeoutError:
                continue
            self._vehicles.add(address)
            self._heard += self.send.parse_buffer(datagram) or []
        return None

    def close(self) -> None:
        self._socket.close()

    def hear_type(self, *names: str) -> Any:
        return self.hear(lambda message: message.get_type() in names)

    def command(self, command: int, *parameters: float) -> int:
        """Send a COMMAND_LONG; the result that it is answered with."""
        filled = [*parameters, *(0.0,) * (7 - len(parameters))]
        self.send.command_long_send(UAV, 1, command, 0, *filled)
        ack = self.hear(lambda message: message.get_type() == "COMMAND_ACK" and message.command == command)
        assert ack is not None, f"no COMMAND_ACK for command {command}"
        assert (ack.target_system, ack.target_component) == (255, 190)
        return int(ack.result)

    def request(self, number: int) -> Any:
        """REQUEST_MESSAGE: the message where it was accepted, None where it was refused."""
        result = self.command(dialect.MAV_CMD_REQUEST_MESSAGE, number)
        if result != dialect.MAV_RESULT_ACCEPTED:
            return None
        message = self.hear(lambda message: message.get_msgId() == number)
        assert message is not None, f"message {number} was accepted and did not come"
        return message

    def mode(self, custom: int) -> Any:
        """Set a mode by SET_MODE, as it does for PX4: the HEARTBEAT that has it, or the text that says why not."""
        self.send.set_mode_send(UAV, dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, custom)
        return self.hear(
            lambda message: (
                message.get_type() == "STATUSTEXT"
                or (message.get_type() == "HEARTBEAT" and message.custom_mode == custom)
            )
        )


@pytest.fixture(scope="module")
def control(swarm: Swarm) -> Iterator[GroundControl]:
    one = GroundControl(swarm.station)
    assert one.hear_type("HEARTBEAT") is not None
    yield one
    one.close()


class Step(NamedTuple):
    """A request of QGroundControl's."""

    name: str
    """As the table has it."""
    play: Callable[[GroundControl], object]
    """Sends it and waits for its answer; something true if there was one."""


def _version(control: GroundControl) -> bool:
    version = control.request(dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    # Below 1.4.1 QGroundControl warns; with the fence bit set it would ask for a fence.
    return version.flight_sw_version >> 8 >= 0x010401 and bool(
        version.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )


def _modes(control: GroundControl) -> bool:
    """Where the request is accepted QGroundControl waits, without a time-out, for the last of the modes."""
    message = control.request(dialect.MAVLINK_MSG_ID_AVAILABLE_MODES)
    while message is not None and message.mode_index < message.number_modes:
        message = control.hear_type("AVAILABLE_MODES")
        assert message is not None, "not all modes came"
    return True


def _any_result(number: int) -> Callable[[GroundControl], bool]:
    def play(control: GroundControl) -> bool:
        control.request(number)
        return True

    return play


def _command(command: int, *parameters: float) -> Callable[[GroundControl], bool]:
    """Any definite result will do."""
    final = {
        dialect.MAV_RESULT_ACCEPTED,
        dialect.MAV_RESULT_DENIED,
        dialect.MAV_RESULT_UNSUPPORTED,
        dialect.MAV_RESULT_TEMPORARILY_REJECTED,
        dialect.MAV_RESULT_FAILED,
    }
    return lambda control: control.command(command, *parameters) in final


def _accepted(command: int, *parameters: float) -> Callable[[GroundControl], bool]:
    return lambda control: control.command(command, *parameters) == dialect.MAV_RESULT_ACCEPTED


def _denied(command: int, *parameters: float) -> Callable[[GroundControl], bool]:
    return lambda control: control.command(command, *parameters) == dialect.MAV_RESULT_DENIED


def _hash(control: GroundControl) -> Any:
    control.send.param_request_read_send(UAV, 1, b"_HASH_CHECK", -1)
    return control.hear_type("PARAM_VALUE", "PARAM_ERROR")


def _file(opcode: int, path: bytes) -> Callable[[GroundControl], bool]:
    def play(control: GroundControl) -> bool:
        payload = [7, 0, 0, opcode, len(path), 0, 0, 0, 0, 0, 0, 0, *path]
        control.send.file_transfer_protocol_send(0, UAV, 1, payload + [0] * (251 - len(payload)))
        answer = control.hear_type("FILE_TRANSFER_PROTOCOL")
        # An answer counts the request's number on and names its opcode.
        assert answer is not None, "no answer"
        return answer.payload[3] in (128, 129) and answer.payload[0] == 8 and answer.payload[5] == opcode

    return play


def _parameters(control: GroundControl) -> bool:
    """The whole list: QGroundControl asks again, by index, for what is missing."""
    control.send.param_request_list_send(UAV, 0)
    names: dict[int, str] = {}
    while True:
        message = control.hear_type("PARAM_VALUE")
        assert message is not None, f"{len(names)} parameters came"
        names[message.param_index] = message.param_id
        if len(names) == message.param_count:
            return len(set(names.values())) == len(names) and set(names.values()) >= SETUP


def _parameter(control: GroundControl) -> bool:
    control.send.param_request_read_send(UAV, 1, b"", 3)
    message = control.hear_type("PARAM_VALUE")
    return message is not None and message.param_index == 3


def _set(control: GroundControl) -> bool:
    control.send.param_set_send(UAV, 1, b"COM_OF_LOSS_T", 2.0, dialect.MAV_PARAM_TYPE_REAL32)
    message = control.hear_type("PARAM_VALUE")
    return message is not None and (message.param_id, message.param_value) == ("COM_OF_LOSS_T", 2.0)


def _time(control: GroundControl) -> Any:
    """Needs no answer, and does no harm."""
    for _ in range(2):
        control.send.system_time_send(int(time.time() * 1e6), 0)
    return control.hear_type("HEARTBEAT")


def _plan(kind: int) -> Callable[[GroundControl], bool]:
    def play(control: GroundControl) -> bool:
        control.send.mission_request_list_send(UAV, 1, kind)
        count = control.hear(lambda message: message.get_type() == "MISSION_COUNT" and message.mission_type == kind)
        assert count is not None, f"no MISSION_COUNT for type {kind}"
        control.send.mission_ack_send(UAV, 1, dialect.MAV_MISSION_ACCEPTED, kind)
        return bool(count.count == 0)

    return play


def _upload(control: GroundControl) -> Any:
    control.send.mission_count_send(UAV, 1, 3, 0)
    return control.hear_type("MISSION_ACK")


def _clear(control: GroundControl) -> Any:
    control.send.mission_clear_all_send(UAV, 1, 0)
    return control.hear_type("MISSION_ACK")


def _logs(control: GroundControl) -> Any:
    control.send.log_request_list_send(UAV, 1, 0, 0xFFFF)
    return control.hear_type("LOG_ENTRY")


def _ping(control: GroundControl) -> bool:
    control.send.ping_send(1_000_000, 5, 0, 0)
    answer = control.hear_type("PING")
    return answer is not None and (answer.time_usec, answer.seq, answer.target_system) == (1_000_000, 5, 255)


def _pause(control: GroundControl) -> bool:
    """The button: everything not given but the wish to change the mode."""
    nothing = (-1.0, dialect.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0.0, NAN, NAN, NAN, NAN)
    paused = control.command(dialect.MAV_CMD_DO_REPOSITION, *nothing) == dialect.MAV_RESULT_ACCEPTED
    return paused and control.hear(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode == LOITER) is not None


def _mode(custom: int, kind: str) -> Callable[[GroundControl], bool]:
    def play(control: GroundControl) -> bool:
        answer = control.mode(custom)
        return answer is not None and answer.get_type() == kind

    return play


_M = dialect
CONNECTION = (
    Step("AUTOPILOT_VERSION", _version),
    Step("PROTOCOL_VERSION", _any_result(PROTOCOL_VERSION)),
    Step("REQUEST_PROTOCOL_VERSION", _command(_M.MAV_CMD_REQUEST_PROTOCOL_VERSION, 1)),
    Step("AVAILABLE_MODES", _modes),
    Step("COMPONENT_METADATA", _any_result(COMPONENT_METADATA)),
    Step("COMPONENT_INFORMATION", _any_result(COMPONENT_INFORMATION)),
    Step("CAMERA_INFORMATION", _any_result(_M.MAVLINK_MSG_ID_CAMERA_INFORMATION)),
    Step("REQUEST_CAMERA_INFORMATION", _command(_M.MAV_CMD_REQUEST_CAMERA_INFORMATION, 1)),
    Step("_HASH_CHECK", _hash),
    Step("FILE_TRANSFER_PROTOCOL", _file(4, b"@PARAM/param.pck?withdefaults=1")),
    Step("PARAM_REQUEST_LIST", _parameters),
    Step("PARAM_REQUEST_READ", _parameter),
    Step("SYSTEM_TIME", _time),
    *(Step("MISSION_REQUEST_LIST", _plan(kind)) for kind in (0, 1, 2)),
    Step("GIMBAL_MANAGER_INFORMATION", _any_result(_M.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION)),
)
"""In the order in which QGroundControl goes on from answer to answer."""

PAGES = (
    Step("PARAM_SET", _set),
    Step("MISSION_COUNT", _upload),
    Step("MISSION_CLEAR_ALL", _clear),
    Step("LOG_REQUEST_LIST", _logs),
    Step("FILE_TRANSFER_PROTOCOL", _file(3, b"/")),
    Step("FILE_TRANSFER_PROTOCOL", _file(2, b"")),
    Step("MESSAGE_INTERVAL", _any_result(_M.MAVLINK_MSG_ID_MESSAGE_INTERVAL)),
    Step("SET_MESSAGE_INTERVAL", _accepted(_M.MAV_CMD_SET_MESSAGE_INTERVAL, _M.MAVLINK_MSG_ID_ATTITUDE, 100_000)),
    Step("RUN_PREARM_CHECKS", _command(_M.MAV_CMD_RUN_PREARM_CHECKS)),
    Step("LOGGING_START", _command(_M.MAV_CMD_LOGGING_START)),
    Step("PREFLIGHT_STORAGE", _command(_M.MAV_CMD_PREFLIGHT_STORAGE, 2)),
    Step("PREFLIGHT_CALIBRATION", _denied(_M.MAV_CMD_PREFLIGHT_CALIBRATION, 1)),
    Step("PREFLIGHT_REBOOT_SHUTDOWN", _denied(_M.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)),
    Step("PING", _ping),
)
"""What its pages ask for."""

BUTTONS = (
    Step("COMPONENT_ARM_DISARM", _accepted(_M.MAV_CMD_COMPONENT_ARM_DISARM, 1)),
    Step("COMPONENT_ARM_DISARM", _accepted(_M.MAV_CMD_COMPONENT_ARM_DISARM, 1, 2989)),
    Step("COMPONENT_ARM_DISARM", _denied(_M.MAV_CMD_COMPONENT_ARM_DISARM, 0)),
    Step("COMPONENT_ARM_DISARM", _denied(_M.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196)),
    Step("NAV_TAKEOFF", _accepted(_M.MAV_CMD_NAV_TAKEOFF, -1, 0, 0, NAN, NAN, NAN, 1500)),
    Step("SET_MODE", _mode(LOITER, "HEARTBEAT")),
    Step("SET_MODE", _mode(MISSION, "HEARTBEAT")),
    Step("SET_MODE", _mode(RETURN, "STATUSTEXT")),
    Step("DO_REPOSITION", _pause),
    Step("SET_MODE", _mode(MISSION, "HEARTBEAT")),
    Step("DO_REPOSITION", _denied(_M.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, NAN, NAN, 1500)),
    Step("DO_REPOSITION", _denied(_M.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, 47.0, 8.0, 1500)),
    Step("DO_CHANGE_SPEED", _denied(_M.MAV_CMD_DO_CHANGE_SPEED, 0, 25, -1, 0, NAN, NAN, NAN)),
    Step("DO_ORBIT", _command(_M.MAV_CMD_DO_ORBIT, 100, NAN, 0, NAN, 47, 8, 1500)),
    Step("DO_SET_HOME", _denied(_M.MAV_CMD_DO_SET_HOME, 0, 0, 0, NAN, 47, 8, 400)),
    Step("DO_SET_MISSION_CURRENT", _command(_M.MAV_CMD_DO_SET_MISSION_CURRENT, 0)),
    Step("REQUEST_OPERATOR_CONTROL", _command(REQUEST_OPERATOR_CONTROL, 0, 1, 0, 10)),
)
"""What its users press. The UAV is a follower: altitudes and speeds are its leaders'."""

STEPS = [pytest.param(step, id=f"{n}-{step.name}") for n, step in enumerate((*CONNECTION, *PAGES, *BUTTONS))]


@pytest.mark.parametrize("step", STEPS)
def test_it_is_answered(step: Step, control: GroundControl) -> None:
    assert step.play(control)


def test_the_page_on_ground_stations_has_every_one() -> None:
    page = PAGE.read_text(encoding="utf-8")
    missing = {step.name for step in (*CONNECTION, *PAGES, *BUTTONS) if f"`{step.name}`" not in page}
    assert not missing
