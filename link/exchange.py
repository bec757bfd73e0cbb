"""The exchange of records between UAVs: the last records of each sender, when they are due, and how they travel.

Once in an exchange period each UAV sends its out-neighbours a record: a few shared numbers with a stamp. A process
keeps the last records of its own UAVs and of their in-neighbours. A record waits there until its latency has passed,
then it goes through the emulated channel of each edge (`channel`). The records of a process's UAVs at one instant are
one transmission on the mesh. The functions are compiled: the autopilot process and the single-process simulation run
the same code.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.channel import Edge, deliver
from ftcc.link.compiled import compiled, copy, fields, store

__all__ = [
    "VERSION",
    "Exchange",
    "Header",
    "Transmission",
    "append",
    "begin",
    "deliver_due",
    "due_sequence",
    "new_exchange",
    "new_transmission",
    "newest_slot",
    "octets_of",
    "post",
    "problem_text",
    "senders_in",
    "slot_of",
    "take_in",
]

VERSION = 2
"""Version of transmissions."""

_HISTORY = 64
"""Records kept of each sender."""

_NEXT = Edge._fields.index("next_sequence")


class Exchange(NamedTuple):
    """The last records of s senders: the k UAVs of a process and their in-neighbours."""

    sender: NDArray[np.int64]
    """(k, n): the row below of the UAV behind each in-edge."""
    row_of: NDArray[np.int64]
    """(256,): the row of each UAV by its id; -1 where no UAV of this process hears it."""
    next_sequence: NDArray[np.int64]
    """(s,): sequence number that the next record of a sender would have."""
    sequence: NDArray[np.int64]
    """(s, HISTORY): sequence number of each record kept; -1 = none."""
    stamp: NDArray[np.int64]
    """(s, HISTORY): simulated time for which its values hold, us."""
    radio_on: NDArray[np.int64]
    """(s, HISTORY)."""
    values: NDArray[np.float64]
    """(s, HISTORY, m)."""


def new_exchange(own: Sequence[int], senders: Sequence[Sequence[int]], edges: int, values: int) -> Exchange:
    """An exchange without records.

    Parameters
    ----------
    own : ids of the process's UAVs: the first rows, in this order.
    senders : for each of them the ids of its in-neighbours.
    edges : largest number of in-edges of a UAV, see ``Inbox``.
    values : numbers in a record.
    """
    everybody = [*own, *sorted({uav for row in senders for uav in row} - set(own))]
    row_of = np.full(256, -1, np.int64)
    row_of[everybody] = np.arange(len(everybody))
    sender = np.zeros((len(own), edges), np.int64)
    for i, row in enumerate(senders):
        sender[i, : len(row)] = row_of[list(row)]
    s = len(everybody)
    return Exchange(
        sender=sender,
        row_of=row_of,
        next_sequence=np.zeros(s, np.int64),
        sequence=np.full((s, _HISTORY), -1, np.int64),
        stamp=np.zeros((s, _HISTORY), np.int64),
        radio_on=np.zeros((s, _HISTORY), np.int64),
        values=np.zeros((s, _HISTORY, values)),
    )


@compiled
def post(exchange, row, sequence, stamp_us, radio_on, values):
    """Keep a record of the sender in ``row``; one that is not newer than the last is dropped."""
    if sequence < exchange.next_sequence[row]:
        return
    slot = sequence % _HISTORY
    exchange.sequence[row, slot] = sequence
    exchange.stamp[row, slot] = stamp_us
    exchange.radio_on[row, slot] = radio_on
    for m in range(exchange.values.shape[2]):
        exchange.values[row, slot, m] = values[m]
    exchange.next_sequence[row] = sequence + 1


@compiled
def newest_slot(exchange, row):
    """Where the last record of the sender in ``row`` stands in the arrays of records."""
    return (exchange.next_sequence[row] - 1) % _HISTORY


@compiled
def slot_of(sequence):
    """Where the record of this sequence number stands, if it is kept."""
    return sequence % _HISTORY


@compiled
def due_sequence(exchange, inbox, i, edge, now_us, latency_us):
    """Sequence number of the next record on in-edge ``edge`` of UAV ``i`` (indices) if it is due; -1: none is."""
    row = exchange.sender[i, edge]
    count = exchange.next_sequence[row]
    for sequence in range(max(inbox.edges[i, edge, _NEXT], count - _HISTORY), count):
        slot = slot_of(sequence)
        if exchange.sequence[row, slot] == sequence:
            return sequence if exchange.stamp[row, slot] + latency_us <= now_us else -1
    return -1


@compiled
def deliver_due(exchange, inbox, radio_on, i, now_us, latency_us, seed):
    """Deliver the records that are due for UAV ``i`` (index) at ``now_us`` through the channels of its in-edges.

    ``radio_on`` is 1 while its own radio is on; a radio that is off neither receives nor sends. Times are in us.
    """
    for edge in range(inbox.degree[i]):
        row = exchange.sender[i, edge]
        while True:
            sequence = due_sequence(exchange, inbox, i, edge, now_us, latency_us)
            if sequence < 0:
                break
            slot = slot_of(sequence)
            both_on = exchange.radio_on[row, slot] == 1 and radio_on == 1
            values, stamp = exchange.values[row, slot], exchange.stamp[row, slot]
            deliver(inbox, i, edge, sequence, stamp, both_on, values, latency_us, now_us, seed)


class Header(NamedTuple):
    """The words with which a transmission begins."""

    version: int
    number: int
    """Lockstep: number of the exchange."""
    heard: int
    """Lockstep: the sender has the transmissions up to this number of all processes that it waits for."""
    last: int
    """1: nothing will follow."""
    records: int
    """How many are in it."""
    values: int
    """Numbers in each record."""


class RecordHeader(NamedTuple):
    """The words of a record before its values."""

    uav: int
    sequence: int
    stamp_us: int
    """Simulated time for which its values hold, us."""
    radio_on: int
    """1 where the sender's radio is on."""


_HEADER = len(Header._fields)
_PREFIX = len(RecordHeader._fields)
_VERSION, _NUMBER, _HEARD, _LAST, _COUNT, _VALUES = range(_HEADER)


class Transmission(NamedTuple):
    """Room for a transmission, as integers and as floats, both of 8 bytes."""

    words: NDArray[np.int64]
    floats: NDArray[np.float64]
    used: NDArray[np.int64]
    """(1,): words in use."""


def new_transmission(records: int, values: int) -> Transmission:
    """Room for this number of records."""
    words = np.zeros(_HEADER + records * (_PREFIX + values), np.int64)
    return Transmission(words, words.view(np.float64), np.zeros(1, np.int64))


def octets_of(transmission: Transmission) -> bytes:
    """A transmission as it travels: little-endian words."""
    return transmission.words[: transmission.used[0]].astype("<i8", copy=False).tobytes()


@compiled
def begin(transmission, number, heard, last, values):
    """Begin a transmission without records, see `Header`."""
    words = transmission.words
    words[_VERSION], words[_NUMBER], words[_HEARD] = VERSION, number, heard
    words[_LAST], words[_COUNT], words[_VALUES] = last, 0, values
    transmission.used[0] = _HEADER


@compiled
def append(transmission, uav, sequence, stamp_us, radio_on, values):
    """Append a record; False, and nothing is appended, where a value is not finite."""
    for m in range(transmission.words[_VALUES]):
        if not np.isfinite(values[m]):
            return False
    at = transmission.used[0]
    words = transmission.words
    store(RecordHeader(uav, sequence, stamp_us, radio_on), words[at:])
    copy(values[: words[_VALUES]], transmission.floats[at + _PREFIX :])
    words[_COUNT] += 1
    transmission.used[0] = at + _PREFIX + words[_VALUES]
    return True


_GOOD, _SHORT, _OTHER_VERSION, _WRONG_LENGTH, _NOT_FINITE = range(5)


@compiled
def take_in(transmission, exchange):
    """Keep the records of a transmission from the mesh whose senders a UAV of this process hears.

    Returns a code for `problem_text`: 0, or why the transmission is not valid; then nothing is kept.
    """
    words, floats, used = transmission.words, transmission.floats, transmission.used[0]
    if used < _HEADER:
        return _SHORT
    if words[_VERSION] != VERSION:
        return _OTHER_VERSION
    width = _PREFIX + words[_VALUES]
    if words[_VALUES] != exchange.values.shape[2] or words[_COUNT] < 0 or used != _HEADER + words[_COUNT] * width:
        return _WRONG_LENGTH
    for n in range(words[_COUNT]):
        at = _HEADER + n * width
        for m in range(_PREFIX, width):
            if not np.isfinite(floats[at + m]):
                return _NOT_FINITE
    for n in range(words[_COUNT]):
        at = _HEADER + n * width
        record = fields(RecordHeader, words[at:])
        if 0 <= record.uav < exchange.row_of.shape[0] and exchange.row_of[record.uav] >= 0:
            values = floats[at + _PREFIX : at + width]
            post(exchange, exchange.row_of[record.uav], record.sequence, record.stamp_us, record.radio_on, values)
    return _GOOD


def senders_in(transmission: Transmission) -> list[int]:
    """Ids of the UAVs whose records stand in a transmission; empty where it is too short for what it says."""
    used, (_, _, _, _, records, values) = int(transmission.used[0]), transmission.words[:_HEADER].tolist()
    width = _PREFIX + values
    if records < 0 or values < 0 or used < _HEADER + records * width:
        return []
    return transmission.words[_HEADER : _HEADER + records * width : width].tolist()  # type: ignore[no-any-return]


def problem_text(code: int, transmission: Transmission) -> str:
    """A text for a code of `take_in` that is not 0."""
    header = transmission.words[:_HEADER].tolist()
    return {
        _SHORT: f"a transmission of {8 * int(transmission.used[0])} bytes is too short",
        _OTHER_VERSION: f"transmission version {header[_VERSION]}, this program speaks {VERSION}",
        _WRONG_LENGTH: (
            f"a transmission of {8 * int(transmission.used[0])} bytes does not hold {header[_COUNT]} records "
            f"of {header[_VALUES]} values"
        ),
        _NOT_FINITE: "a UAV shared a value that is not finite",
    }[code]
