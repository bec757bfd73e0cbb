"""The table of failures: what MAV_CMD_INJECT_FAILURE means, and how an autopilot passes it on to its vehicle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.link.codec import Codec, dialect
from ftcc.link.failures import (
    AIRFRAME_SIZES,
    FAILURES,
    KINDS,
    SIZES,
    UNITS,
    failure_messages,
    meaning_of,
    parameter_of,
    parts_of,
    read_failure,
)
from ftcc.link.mavlink import as_typed


def test_every_entry_is_found_by_the_codes_of_mavlink():
    for one in FAILURES:
        assert meaning_of(one.unit.code, KINDS[one.kind], 1) == one


def test_names_of_sizes_fit_a_parameter_and_defaults_lie_in_their_range():
    for size in SIZES:
        assert parameter_of(size.keyword) == parameter_of(size.name.removeprefix("FAIL_").lower()) == size.name
        assert len(size.name) <= 16
        assert size.low <= size.default <= size.high


def test_every_size_that_a_failure_has_is_a_parameter():
    assert {name for one in FAILURES for name in one.sizes} == {size.name for size in SIZES}


@pytest.mark.parametrize(
    "asked",
    [
        (dialect.FAILURE_UNIT_SYSTEM_BATTERY, dialect.FAILURE_TYPE_OFF, 1),
        (dialect.FAILURE_UNIT_SYSTEM_SERVO, dialect.FAILURE_TYPE_GARBAGE, 2),
        (dialect.FAILURE_UNIT_SYSTEM_SERVO, dialect.FAILURE_TYPE_OFF, 4),
        (dialect.FAILURE_UNIT_SYSTEM_SERVO, dialect.FAILURE_TYPE_OFF, -1),
        (dialect.FAILURE_UNIT_SYSTEM_SERVO, dialect.FAILURE_TYPE_OFF, 1.5),
        (math.nan, dialect.FAILURE_TYPE_OFF, 1),
        (dialect.FAILURE_UNIT_SYSTEM_SERVO, math.inf, 1),
        (dialect.FAILURE_UNIT_SYSTEM_SERVO, dialect.FAILURE_TYPE_OFF, math.nan),
    ],
)
def test_anything_else_is_unsupported(asked):
    assert meaning_of(*asked) is None


def test_what_was_typed_is_what_the_other_side_gets():
    for typed in (0.7, 0.35, -0.2, 1e-3, 0.1, 2.0, 123.456):
        assert as_typed(float(np.float32(typed))) == typed


def test_a_failure_reaches_the_vehicle_with_its_sizes_and_its_time():
    meaning = meaning_of(UNITS["servo"].code, KINDS["wrong"], 2)
    assert meaning is not None
    sizes = [0.7 if size.name == "FAIL_EFF" else 0.35 if size.name == "FAIL_BIAS" else 0.1 for size in AIRFRAME_SIZES]
    datagram = Codec(1, 1).pack(*failure_messages(1, meaning, 2, 40_123_000, sizes))
    failure, at_us = read_failure(Codec(1, 25).parse(datagram))
    assert failure is not None
    assert (failure.meaning, failure.instance, at_us) == (meaning, 2, 40_123_000)
    assert list(failure.sizes.values()) == sizes


def test_other_messages_are_no_failure():
    other = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    assert read_failure([]) == (None, 0)
    assert read_failure([other, other]) == (None, 0)


@pytest.mark.parametrize(
    ("actuators", "servos"),
    [
        (("thrust", "elevator"), {2: "elevator"}),
        (("thrust", "elevator", "aileron", "rudder"), {1: "aileron", 2: "elevator", 3: "rudder"}),
        (("thrust", "load_factor", "bank"), {1: "bank", 2: "load_factor"}),
        (("elevator",), {2: "elevator"}),
    ],
)
def test_an_aircraft_has_the_parts_that_it_is_steered_by(actuators, servos):
    assert parts_of(UNITS["servo"], actuators) == servos
    assert parts_of(UNITS["motor"], actuators) == ({1: "thrust"} if "thrust" in actuators else {})
    assert parts_of(UNITS["gps"], actuators) == {}


def test_a_size_that_does_not_exist_is_refused_with_those_that_do():
    with pytest.raises(LookupError, match=r"efficiency: no such size; there are effectiveness, bias, "):
        parameter_of("efficiency")
