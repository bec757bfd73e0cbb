"""Records between UAVs, kept, due and delivered; and transmissions, of which nothing unsound is believed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ftcc.link.channel import Channel, Inbox, hear, new_inbox
from ftcc.link.exchange import (
    VERSION,
    Exchange,
    Header,
    Transmission,
    append,
    begin,
    deliver_due,
    new_exchange,
    new_transmission,
    octets_of,
    post,
    problem_text,
    take_in,
)

MS = 1000
LATENCY = 50 * MS
EDGES = [[2, 3], [1]]
"""UAV 1 hears 2 and 3, UAV 2 hears 1; 3 flies elsewhere."""


def ends(channel: Channel | None = None) -> tuple[Exchange, Inbox]:
    """UAVs 1 and 2 of a process."""
    inbox = new_inbox(EDGES, [1, 2], 2, channel or Channel())
    return new_exchange([1, 2], EDGES, inbox.valid.shape[1], 2), inbox


def say(exchange: Exchange, uav: int, sequence: int, value: float, radio_on: int = 1) -> None:
    stamp = sequence * LATENCY
    post(exchange, exchange.row_of[uav], sequence, stamp, radio_on, np.array([value, -value]))


def heard(exchange: Exchange, inbox: Inbox, now_us: int, radio_on: int = 1) -> list[float]:
    """What UAV 1 hears of 2 and 3: the first of their values; nan where it never heard them."""
    deliver_due(exchange, inbox, radio_on, 0, now_us, LATENCY, 1)
    hear(inbox, 0, now_us)
    return [float(v) if valid else math.nan for v, valid in zip(inbox.values[0, :, 0], inbox.valid[0], strict=True)]


def test_a_record_is_due_a_latency_after_its_stamp_and_the_newest_counts() -> None:
    exchange, inbox = ends()
    say(exchange, 2, 0, 10.0)
    say(exchange, 3, 0, 20.0)
    say(exchange, 2, 1, 11.0)
    assert np.isnan(heard(exchange, inbox, LATENCY - 1)).all()
    assert heard(exchange, inbox, LATENCY) == [10.0, 20.0]
    assert heard(exchange, inbox, 2 * LATENCY) == [11.0, 20.0]
    assert inbox.age[0].tolist() == pytest.approx([0.05, 0.1])


def test_a_record_that_is_not_newer_changes_nothing() -> None:
    exchange, inbox = ends()
    say(exchange, 2, 4, 10.0)
    for sequence in (4, 3, 0):
        say(exchange, 2, sequence, 99.0)
    assert heard(exchange, inbox, 10 * LATENCY)[0] == 10.0


def test_records_that_never_came_leave_gaps_and_nothing_else() -> None:
    """In real time a reader that was held up misses some."""
    exchange, inbox = ends()
    for sequence in (0, 3, 70, 71):
        say(exchange, 2, sequence, float(sequence))
    assert heard(exchange, inbox, 100 * LATENCY)[0] == 71.0
    assert inbox.edges[0, 0, 4] == 2, "those that were overwritten count for nothing"


@pytest.mark.parametrize(("senders", "receivers"), [(0, 1), (1, 0), (0, 0)])
def test_a_radio_that_is_off_neither_hears_nor_is_heard(senders: int, receivers: int) -> None:
    exchange, inbox = ends()
    say(exchange, 2, 0, 10.0, senders)
    assert math.isnan(heard(exchange, inbox, LATENCY, receivers)[0])
    say(exchange, 2, 1, 11.0)
    assert heard(exchange, inbox, 2 * LATENCY)[0] == 11.0


def test_losses_are_those_of_the_sequence_numbers_whoever_misses_some() -> None:
    """A burst moves on with the records that never came: each draw belongs to its number."""
    channel = Channel(loss=0.2, burst_start=0.2, burst_end=0.3)
    every, some = ends(channel), ends(channel)
    lost: list[list[int]] = [[], []]
    for sequence in range(200):
        for n, (exchange, inbox) in enumerate((every, some)):
            if n == 0 or sequence % 3 == 0:
                before = int(inbox.edges[0, 0, 5])
                say(exchange, 2, sequence, 1.0)
                heard(exchange, inbox, (sequence + 1) * LATENCY)
                lost[n] += [sequence] * (int(inbox.edges[0, 0, 5]) - before)
    assert lost[1] == [sequence for sequence in lost[0] if sequence % 3 == 0]
    assert lost[1]


# Transmissions.

VALUES = np.array([math.pi, -0.0, 5e-324, -1.7976931348623157e308])


def transmission(records: int = 2, values: np.ndarray = VALUES) -> Transmission:
    """Of UAVs 3, 4, ..., number 9, that has heard up to 8."""
    sent = new_transmission(records, len(values))
    begin(sent, 9, 8, 0, len(values))
    for n in range(records):
        assert append(sent, 3 + n, 9, 450_000, 1, values if n == 0 else values + n)
    return sent


def received(data: bytes, exchange: Exchange) -> tuple[int, Transmission]:
    incoming = new_transmission(16, 4)
    incoming.words[: len(data) // 8] = np.frombuffer(data, np.int64)
    incoming.used[0] = len(data) // 8
    return take_in(incoming, exchange), incoming


def listener() -> Exchange:
    """UAV 1 hears 3, and nobody else."""
    return new_exchange([1], [[3]], 1, len(VALUES))


def test_a_transmission_arrives_bit_for_bit_and_strangers_are_skipped() -> None:
    exchange = listener()
    code, incoming = received(octets_of(transmission()), exchange)
    assert code == 0
    assert Header(*incoming.words[: len(Header._fields)].tolist()) == Header(VERSION, 9, 8, 0, 2, 4)
    row = exchange.row_of[3]
    assert exchange.next_sequence.tolist() == [0, 10]
    assert exchange.values[row, 9].tobytes() == VALUES.tobytes()
    assert (exchange.stamp[row, 9], exchange.radio_on[row, 9]) == (450_000, 1)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_neither_enters_the_mesh_nor_is_believed(value: float) -> None:
    sent = new_transmission(1, 4)
    begin(sent, 0, -1, 0, 4)
    used = int(sent.used[0])
    assert not append(sent, 3, 0, 0, 1, np.array([1.0, value, 1.0, 1.0]))
    assert sent.used[0] == used
    forged, exchange = transmission(), listener()
    forged.floats[int(forged.used[0]) - 1] = value
    code, incoming = received(octets_of(forged), exchange)
    assert "not finite" in problem_text(code, incoming)
    assert not exchange.next_sequence.any(), "nothing of it is kept"


def test_another_version_is_refused_with_both_versions_named() -> None:
    data = bytearray(octets_of(transmission()))
    data[0] += 1
    code, incoming = received(bytes(data), listener())
    assert problem_text(code, incoming) == f"transmission version {VERSION + 1}, this program speaks {VERSION}"


def test_every_cut_and_every_excess_is_refused() -> None:
    data, exchange = octets_of(transmission()), listener()
    for length in range(0, len(data), 8):
        code, incoming = received(data[:length], exchange)
        assert problem_text(code, incoming)
    code, incoming = received(data + bytes(8), exchange)
    assert "does not hold 2 records of 4 values" in problem_text(code, incoming)
    assert not exchange.next_sequence.any()


@pytest.mark.parametrize("records", [-1, 2**62, 3, 0])
def test_a_number_of_records_that_is_not_true_is_refused(records: int) -> None:
    forged = transmission()
    forged.words[Header._fields.index("records")] = records
    assert received(octets_of(forged), listener())[0] != 0


@pytest.mark.parametrize("uav", [-1, 256, 2**62, 2])
def test_records_of_uavs_that_nobody_hears_are_skipped(uav: int) -> None:
    forged, exchange = transmission(1), listener()
    forged.words[len(Header._fields)] = uav
    assert received(octets_of(forged), exchange)[0] == 0
    assert not exchange.next_sequence.any()
