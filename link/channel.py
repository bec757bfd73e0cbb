"""The emulated radio channel and the inbox behind it: what a receiver hears of each neighbour, and when.

All times are simulated, in whole microseconds. A record stamped t may be used from the first tick >= t + L + d on: L is
the link latency of the scenario, d the channel's delay and jitter for that record. The newest stamp wins, an age is
never negative. The functions are compiled and work on plain arrays, so that the autopilot process and the
single-process simulation run the very same code.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import compiled, copy
from ftcc.link.philox import CHANNEL, philox, uniform

__all__ = ["LINK_REPORT", "SLOTS", "Channel", "Edge", "Inbox", "deliver", "hear", "new_inbox", "report_link"]

SLOTS = 32
"""Records that can be under way on one edge at a time."""


LINK_REPORT = ("sent", "received", "lost", "age", "oldest")
"""What `report_link` tells of an in-edge: records that the sender sent, that came and that the channel lost since the
start; mean and greatest age, s, since the last report (nan where nothing was heard)."""


class Channel(NamedTuple):
    """Quality of one directed edge."""

    loss: float = 0.0
    """Probability that a record is lost in the good state, 0..1."""
    burst_start: float = 0.0
    """Gilbert-Elliott: probability per record of passing from the good to the bad state."""
    burst_end: float = 1.0
    """Probability per record of passing back."""
    burst_loss: float = 1.0
    """Probability that a record is lost in the bad state."""
    delay: float = 0.0
    """Delay beyond the link latency, s."""
    jitter: float = 0.0
    """Further delay, uniform in [0, jitter], s."""
    blocked: float = 0.0
    """1: nothing arrives (blackout)."""


class Edge(NamedTuple):
    """Columns of ``Inbox.edges`` (integers)."""

    sender: int
    receiver: int
    burst: int
    """1 while the burst-loss chain is in its bad state."""
    next_sequence: int
    """Sequence number that the channel expects next."""
    received: int
    """Records that passed the channel."""
    lost: int
    """Records that the channel lost."""
    waiting: int
    """Records under way."""


class Inbox(NamedTuple):
    """What the k UAVs of a process receive: first axis the UAV, second its in-edges (n at most), m shared values."""

    degree: NDArray[np.int64]
    """(k,): number of in-edges of each UAV."""
    edges: NDArray[np.int64]
    """(k, n, 7), see `Edge`."""
    quality: NDArray[np.float64]
    """(k, n, 7), see `Channel`; changed by link events."""
    slot_stamp: NDArray[np.int64]
    """(k, n, SLOTS): stamp of a record under way, us; -1 = free."""
    slot_usable: NDArray[np.int64]
    """(k, n, SLOTS): time from which it can be used, us."""
    slot_values: NDArray[np.float64]
    """(k, n, SLOTS, m)."""
    stamp: NDArray[np.int64]
    """(k, n): stamp of the newest record heard, us; -1 = never heard."""
    values: NDArray[np.float64]
    """(k, n, m): its values."""
    age: NDArray[np.float64]
    """(k, n): its age at the present tick, s."""
    valid: NDArray[np.float64]
    """(k, n): 1 once the neighbour has been heard."""
    ages: NDArray[np.float64]
    """(k, n, 3): sum, number and greatest of the ages since the last report."""


def new_inbox(senders: list[list[int]], receivers: list[int], values: int, channel: Channel) -> Inbox:
    """An empty inbox for ``receivers`` (ids), each with its list of ``senders``; records carry ``values`` numbers."""
    k, n = len(receivers), max(1, *(len(row) for row in senders))
    edges = np.zeros((k, n, len(Edge._fields)), np.int64)
    for i, row in enumerate(senders):
        edges[i, : len(row), 0] = row
        edges[i, :, 1] = receivers[i]
    return Inbox(
        degree=np.array([len(row) for row in senders], np.int64),
        edges=edges,
        quality=np.tile(np.array(channel, np.float64), (k, n, 1)),
        slot_stamp=np.full((k, n, SLOTS), -1, np.int64),
        slot_usable=np.zeros((k, n, SLOTS), np.int64),
        slot_values=np.zeros((k, n, SLOTS, values)),
        stamp=np.full((k, n), -1, np.int64),
        values=np.zeros((k, n, values)),
        age=np.zeros((k, n)),
        valid=np.zeros((k, n)),
        ages=np.zeros((k, n, 3)),
    )


@compiled
def _take(inbox, i, edge, stamp, values):
    if stamp > inbox.stamp[i, edge]:
        inbox.stamp[i, edge] = stamp
        copy(values, inbox.values[i, edge])


@compiled
def deliver(inbox, i, edge, sequence, stamp, radio_on, values, latency, now, seed):
    """Pass one record through the channel of in-edge ``edge`` of UAV ``i`` (indices) and, if it survives, keep it.

    To be called in order of sequence, at the first tick ``now`` >= stamp + latency (all in us). ``radio_on`` is false
    where the sender's or the receiver's radio is off. The burst chain also steps for the records that were skipped.
    """
    state = inbox.edges[i, edge]
    loss, burst_start, burst_end, burst_loss, delay, jitter, blocked = (
        inbox.quality[i, edge, 0],
        inbox.quality[i, edge, 1],
        inbox.quality[i, edge, 2],
        inbox.quality[i, edge, 3],
        inbox.quality[i, edge, 4],
        inbox.quality[i, edge, 5],
        inbox.quality[i, edge, 6],
    )
    if sequence < state[3]:
        return
    link = state[0] * 65536 + state[1]
    u_loss = 1.0
    u_jitter = 0.0
    if burst_start > 0.0 or loss > 0.0 or jitter > 0.0:
        first = state[3] if burst_start > 0.0 else sequence
        for n in range(first, sequence + 1):
            w0, w1, w2, _ = philox(seed, n & 0xFFFFFFFF, link, CHANNEL, 0)
            u_loss = uniform(w0)
            u_jitter = uniform(w1)
            if burst_start > 0.0:
                change = burst_end if state[2] == 1 else burst_start
                if uniform(w2) < change:
                    state[2] = 1 - state[2]
    state[3] = sequence + 1
    threshold = burst_loss if (state[2] == 1 and burst_start > 0.0) else loss
    if blocked > 0.0 or not radio_on or u_loss < threshold:
        state[5] += 1
        return
    state[4] += 1
    usable = stamp + latency + int((delay + jitter * u_jitter) * 1e6)
    if usable <= now:
        _take(inbox, i, edge, stamp, values)
        return
    slot = sequence % SLOTS
    state[6] += 1 if inbox.slot_stamp[i, edge, slot] < 0 else 0
    inbox.slot_stamp[i, edge, slot] = stamp
    inbox.slot_usable[i, edge, slot] = usable
    copy(values, inbox.slot_values[i, edge, slot])


@compiled
def hear(inbox, i, now):
    """Take from UAV ``i``'s inbox what can be used at ``now`` (us); set validity and age of its in-edges."""
    for edge in range(inbox.degree[i]):
        if inbox.edges[i, edge, 6] > 0:
            for slot in range(SLOTS):
                stamp = inbox.slot_stamp[i, edge, slot]
                if stamp >= 0 and inbox.slot_usable[i, edge, slot] <= now:
                    inbox.slot_stamp[i, edge, slot] = -1
                    inbox.edges[i, edge, 6] -= 1
                    _take(inbox, i, edge, stamp, inbox.slot_values[i, edge, slot])
        if inbox.stamp[i, edge] >= 0:
            inbox.valid[i, edge] = 1.0
        if inbox.valid[i, edge] > 0.0:
            # Values that were there before any record belong to t = 0.
            age = max(0, now - max(0, inbox.stamp[i, edge])) / 1e6
            inbox.age[i, edge] = age
            inbox.ages[i, edge, 0] += age
            inbox.ages[i, edge, 1] += 1.0
            inbox.ages[i, edge, 2] = max(inbox.ages[i, edge, 2], age)


@compiled
def report_link(inbox, i, edge, out):
    """Write what `LINK_REPORT` names of an in-edge of UAV ``i`` into ``out``, and begin a new report."""
    ages = inbox.ages[i, edge]
    out[0] = float(inbox.edges[i, edge, 3])
    out[1] = float(inbox.edges[i, edge, 4])
    out[2] = float(inbox.edges[i, edge, 5])
    out[3] = ages[0] / ages[1] if ages[1] > 0.0 else math.nan
    out[4] = ages[2] if ages[1] > 0.0 else math.nan
    for n in range(3):
        ages[n] = 0.0
