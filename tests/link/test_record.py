"""The record on the mesh: every bit of what is shared arrives, and nothing else is believed."""

from __future__ import annotations

import math
import struct

import pytest

from ftcc.link.record import RECORD_VERSION, Record, RecordError


@pytest.mark.parametrize(
    "record",
    [
        Record(1, 0, 0, ()),
        Record(200, 2**32 - 1, 400_000_000, (1000.1, -1.97), radio_on=False),
        Record(7, 12, 600_000, (math.pi, 5e-324, -1.7976931348623157e308, -0.0), heard=11),
        Record(3, 5, 250_000, (), last=True),
    ],
)
def test_a_record_arrives_bit_for_bit(record):
    arrived = Record.unpack(record.pack())
    assert arrived == record
    assert struct.pack(f"{len(record.values)}d", *arrived.values) == struct.pack(
        f"{len(record.values)}d", *record.values
    )


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_never_enters_the_mesh(value):
    with pytest.raises(RecordError, match="UAV 4 would share a value that is not finite"):
        Record(4, 0, 0, (1.0, value)).pack()


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_value_that_is_not_finite_is_not_believed_either(value):
    data = Record(4, 0, 0, (1.0, 2.0)).pack()
    with pytest.raises(RecordError, match="UAV 4 shared a value that is not finite"):
        Record.unpack(data[:-8] + struct.pack("<d", value))


def test_another_version_is_refused_with_both_versions_named():
    data = Record(4, 0, 0, (1.0,)).pack()
    with pytest.raises(RecordError, match=f"record version {RECORD_VERSION + 1}, this program speaks {RECORD_VERSION}"):
        Record.unpack(bytes([RECORD_VERSION + 1]) + data[1:])


def test_every_cut_and_every_excess_is_refused():
    data = Record(4, 9, 450_000, (1.0, 2.0)).pack()
    for length in range(len(data)):
        with pytest.raises(RecordError):
            Record.unpack(data[:length])
    with pytest.raises(RecordError, match="does not hold 2 values"):
        Record.unpack(data + b"\0")
