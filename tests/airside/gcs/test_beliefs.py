"""What ground stations see of a UAV's beliefs: health bits, the array "beliefs", texts, and settings by name."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from ftcc.airside.diagnosis.beliefs import FAULTY, LOSS, MOST_CLIMB, Belief, Health
from ftcc.airside.diagnosis.gains import DiagnosisGains, diagnosis_gains
from ftcc.airside.gcs.parameters import diagnosis_parameter
from ftcc.airside.gcs.streams import BELIEF_FIELDS
from ftcc.airside.schemes import find, names
from ftcc.airside.spec import DiagnosisSpec
from ftcc.groundside.swarm.conversation import RefusedError
from ftcc.groundside.swarm.station import Station
from ftcc.link.actuators import ELEVATOR
from tests.airside.autopilot_bench import Bench
from tests.airside.gcs.in_flight import LEVEL, M, flying, said

ON = DiagnosisSpec(
    on=True, gains=tuple(diagnosis_gains({})), actuators=("thrust", "elevator"), lag=(0.0, 20.0, 0.0, 5.0)
)
OUTPUTS, READY = M.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS, M.MAV_SYS_STATUS_PREARM_CHECK


@pytest.fixture
def pair(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Bench, Station]]:
    with flying(tmp_path, monkeypatch, diagnosis=ON) as both:
        yield both


def believe_in_a_loss(bench: Bench) -> None:
    row = bench.process.group.autopilots.diagnosis.belief[0, ELEVATOR]
    row[:] = Belief(*row.tolist())._replace(state=FAULTY, kind=LOSS, effectiveness=0.42, effectiveness_sd=0.05)


def array(station: Station, name: str) -> list[float]:
    """The DEBUG_FLOAT_ARRAY of that name, among those that come when it is asked for."""
    kind = M.MAVLINK_MSG_ID_DEBUG_FLOAT_ARRAY
    question = M.MAVLink_command_long_message(1, 1, M.MAV_CMD_REQUEST_MESSAGE, 0, kind, 0, 0, 0, 0, 0, 0)
    message = station._ask(1, [question], lambda m: m.get_type() == "DEBUG_FLOAT_ARRAY" and m.name == name, name)
    return [round(value, 6) for value in message.data]


def test_an_actuator_that_is_believed_faulty_is_unhealthy(pair: tuple[Bench, Station]) -> None:
    bench, station = pair
    before = station.request(1, M.MAVLINK_MSG_ID_SYS_STATUS)
    assert before.onboard_control_sensors_present & before.onboard_control_sensors_enabled & OUTPUTS
    assert before.onboard_control_sensors_health & OUTPUTS
    assert before.onboard_control_sensors_health & READY
    believe_in_a_loss(bench)
    after = station.request(1, M.MAVLINK_MSG_ID_SYS_STATUS)
    assert before.onboard_control_sensors_health ^ after.onboard_control_sensors_health == OUTPUTS | READY
    assert after.onboard_control_sensors_enabled == before.onboard_control_sensors_enabled


def test_without_diagnosis_nothing_is_said_of_outputs(station: Station) -> None:
    status = station.request(1, M.MAVLINK_MSG_ID_SYS_STATUS)
    assert not (status.onboard_control_sensors_present | status.onboard_control_sensors_health) & OUTPUTS
    assert not [name for name in station.parameters(1) if name.startswith("FDI_") or name == "SR_BELIEFS"]


def test_beliefs_travel_by_slot(pair: tuple[Bench, Station]) -> None:
    bench, station = pair
    believe_in_a_loss(bench)
    values = array(station, "beliefs")
    aileron, elevator, rudder, thrust = (dict(zip(BELIEF_FIELDS, values[7 * n :], strict=False)) for n in range(4))
    assert (elevator["state"], elevator["kind"], elevator["effectiveness"]) == (FAULTY, LOSS, 0.42)
    assert (aileron["state"], rudder["state"], thrust["state"]) == (-1.0, -1.0, 0.0)
    assert Health(*values[28:32])._replace(state=0.0) == Health(0.0, 1.0, MOST_CLIMB, 1.0)


def test_a_change_of_belief_is_logged_and_shown(pair: tuple[Bench, Station]) -> None:
    bench, station = pair
    station.request(1, M.MAVLINK_MSG_ID_HEARTBEAT)
    believe_in_a_loss(bench)
    bench.answer(1, LEVEL, np.zeros(4))
    (event,) = [report for report in said(bench) if "faulty" in report.text]
    assert (event.severity, event.uav, event.at_us) == ("warning", 1, 10_000)
    assert event.text.startswith("elevator faulty: loss, effectiveness ")
    until = time.monotonic() + 2.0
    shown = []
    while not shown and time.monotonic() < until:
        shown = [m for m in station.receive(1, until) if m.get_type() == "STATUSTEXT"]
    assert (shown[0].severity, shown[0].text) == (M.MAV_SEVERITY_WARNING, event.text[:50])


def test_settings_are_parameters_with_their_ranges(pair: tuple[Bench, Station]) -> None:
    bench, station = pair
    values = station.parameters(1)
    for name, value in diagnosis_gains({})._asdict().items():
        assert values[diagnosis_parameter(name)] == value
    gains = bench.process.group.autopilots.diagnosis.gains[0]
    assert station.set(1, "FDI_LIMIT_ELE", 0.02) == 0.02
    assert gains[DiagnosisGains._fields.index("limit_elevator")] == 0.02
    for refused in (-1.0, 0.0):
        with pytest.raises(RefusedError):
            station.set(1, "FDI_LIMIT_ELE", refused)
    with pytest.raises(RefusedError):
        station.set(1, "FDI_LEAST", 1.5)
    assert gains[DiagnosisGains._fields.index("limit_elevator")] == 0.02


def test_a_leader_has_the_settings_that_it_makes_room_by(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with flying(tmp_path, monkeypatch, uav=7, diagnosis=ON) as (_, station):
        own = {name for name in station.parameters(7) if name.startswith("FDI_")}
    assert own == {"FDI_FRESH", "FDI_SILENT", "FDI_ROOM", "FDI_ROOM_PACE"}


def test_names_are_short_enough_and_belong_to_one_setting_only() -> None:
    short = [diagnosis_parameter(name) for name in DiagnosisGains._fields]
    assert max(map(len, short)) <= 16
    gains = {gain.upper() for scheme in names() for gain in find(scheme).gains_type._fields}
    assert len({*short} - gains) == len(DiagnosisGains._fields)
