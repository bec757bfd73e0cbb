"""What leaves the station: a value that no message can carry is refused before it is sent, and none is rounded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.groundside.swarm.conversation import RefusedError, StationError
from tests.airside.gcs.in_flight import LEVEL, M, said


@pytest.mark.parametrize(
    ("name", "value", "why"),
    [
        ("FTCC_AT", 2147483648, "FTCC_AT = 2147483648: must be a whole number from -2147483648 to 2147483647"),
        ("FTCC_AT", 1e30, "must be a whole number"),
        ("FTCC_AT", 1.5, "must be a whole number"),
        ("FTCC_AT", math.nan, "must be a whole number"),
        ("FTCC_AT", math.inf, "must be a whole number"),
        ("K11", 1e39, r"K11 = 1e\+39: must be a finite number, at most 3.402823e\+38"),
        ("K11", math.nan, "must be a finite number"),
        ("K11", -math.inf, "must be a finite number"),
    ],
)
def test_a_parameter_that_no_message_carries(station, name, value, why):
    before = station.get(1, name)
    with pytest.raises(StationError, match=why) as refusal:
        station.set(1, name, value)
    assert not isinstance(refusal.value, RefusedError), "the UAV has never heard of it"
    assert station.get(1, name) == before


@pytest.mark.parametrize("at", [math.nan, math.inf, -0.1, -math.inf, 2147483.648, 1e39])
def test_a_time_that_no_message_carries(station, at):
    for what in (
        lambda: station.fault(1, "elevator", at=at, eff=0.5),
        lambda: station.inject(1, "radio", "off", 2, at=at),
        lambda: station.repair(1, "elevator", at=at),
        lambda: station.lead(1, altitude=1000.0, at=at),
    ):
        with pytest.raises(StationError, match=r"at = .*: must be a simulated time from 0 to 2147483.647 s"):
            what()
    assert station.get(1, "FTCC_AT") == 0
    assert station.get(1, "FAIL_EFF") == 0.5, "nothing has been set on the way"


def test_a_fraction_of_a_millisecond_is_refused(station):
    with pytest.raises(StationError, match="whole number of ms"):
        station.inject(1, "radio", "off", 2, at=0.0125)


@pytest.mark.parametrize("value", [math.inf, 1e39, -1e39])
def test_a_number_of_a_command_that_no_message_carries(station, value):
    with pytest.raises(StationError, match=r"parameter 1 = .*: must be a finite number"):
        station.command(1, M.MAV_CMD_DO_CHANGE_ALTITUDE, value, 3)
    with pytest.raises(StationError, match=r"FAIL_BIAS = .*: must be a finite number"):
        station.fault(1, "elevator", eff=0.25, bias=value)
    assert station.get(1, "FAIL_EFF") == 0.5, "nothing has been set on the way"


def test_times_beyond_float32_are_exact(station):
    """16 777 217 ms, 4.7 h, is the first that float32 does not know."""
    for ms in (16_777_216, 16_777_217, 2**31 - 1, 0):
        assert station.set(1, "FTCC_AT", ms) == ms
        assert station.get(1, "FTCC_AT") == ms


def test_the_log_rounds_no_time(bench, station):
    station.set(1, "FTCC_AT", 16_777_217)
    station.set(1, "FTCC_AT", 0)
    assert [event.text for event in said(bench) if "FTCC_AT" in event.text] == [
        "parameter FTCC_AT = 16777217 (was 0)",
        "parameter FTCC_AT = 0 (was 16777217)",
    ]
    bench.answer(1, LEVEL, np.zeros(4))
    station.inject(1, "radio", "off", 2, at=9.87)
    armed = [event.text for event in said(bench) if event.outcome == "armed"]
    assert armed == ["link from UAV 2 off at t = 9.87 s"]
