"""The emulated radio channel, and the inbox behind it: which records a receiver gets of each in-neighbour, and when.

All times are simulated, in whole microseconds. A record stamped t may be used from the first tick >= t + L + d on: L is
the link latency of the scenario, d the channel's delay and jitter for that record. The newest stamp wins, an age is
never negative. The functions are compiled and work on plain arrays, so that the autopilot process and the
single-process simulation run the same code.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.compiled import compiled, copy, fields, fill, store
from ftcc.link.philox import CHANNEL, philox, uniform

__all__ = ["LINK_REPORT", "SLOTS", "Channel", "Edge", "Inbox", "deliver", "hear", "new_inbox", "report_link"]

SLOTS = 32
"""Records that can be under way on one edge at a time."""

_SENDERS = 65536
"""More than there are ids of UAVs: sender and receiver make one number, which keys the random draws of their edge."""


class LinkReport(NamedTuple):
    """What `report_link` writes about an in-edge: counts since the start, ages since the last report."""

    sent: float
    """Records that the sender sent."""
    received: float
    """Records that passed the channel."""
    lost: float
    """Records that the channel lost."""
    age: float
    """Mean age at the ticks, s; nan where nothing was heard."""
    oldest: float
    """Greatest age, s; nan where nothing was heard."""


LINK_REPORT = LinkReport._fields
"""Columns of a link report."""


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


class Ages(NamedTuple):
    """Columns of ``Inbox.ages``: the ages of an in-edge at the ticks since the last report."""

    total: float
    """s."""
    ticks: float
    greatest: float
    """s."""


_SENDER, _RECEIVER, _BURST, _NEXT, _RECEIVED, _LOST, _WAITING = range(len(Edge._fields))


class Inbox(NamedTuple):
    """What the k UAVs of a process receive: first axis the UAV, second its in-edges (at most n); m shared values."""

    degree: NDArray[np.int64]
    """(k,): number of in-edges of each UAV."""
    edges: NDArray[np.int64]
    """(k, n, 7), see `Edge`."""
    quality: NDArray[np.float64]
    """(k, n, 7), see `Channel`; link events change it."""
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
    """(k, n, 3), see `Ages`."""


def new_inbox(senders: list[list[int]], receivers: list[int], values: int, channel: Channel) -> Inbox:
    """An empty inbox for ``receivers`` (ids), each with its list of ``senders``; records carry ``values`` numbers."""
    k, n = len(receivers), max(1, *(len(row) for row in senders))
    edges = np.zeros((k, n, len(Edge._fields)), np.int64)
    for i, row in enumerate(senders):
        edges[i, : len(row), _SENDER] = row
        edges[i, :, _RECEIVER] = receivers[i]
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
        ages=np.zeros((k, n, len(Ages._fields))),
    )


@compiled
def _take(inbox, i, edge, stamp, values):
    if stamp > inbox.stamp[i, edge]:
        inbox.stamp[i, edge] = stamp
        copy(values, inbox.values[i, edge])


@compiled
def _pass_records(state, channel, sequence, seed):
    """Step an edge's burst chain up to record ``sequence``; returns its draws for loss and jitter, each in (0, 1)."""
    u_loss, u_jitter = 1.0, 0.0
    if channel.burst_start > 0.0 or channel.loss > 0.0 or channel.jitter > 0.0:
        link = state[_SENDER] * _SENDERS + state[_RECEIVER]
        first = state[_NEXT] if channel.burst_start > 0.0 else sequence
        for n in range(first, sequence + 1):
            w0, w1, w2, _ = philox(seed, n & 0xFFFFFFFF, link, CHANNEL, 0)
            u_loss = uniform(w0)
            u_jitter = uniform(w1)
            if channel.burst_start > 0.0:
                change = channel.burst_end if state[_BURST] == 1 else channel.burst_start
                if uniform(w2) < change:
                    state[_BURST] = 1 - state[_BURST]
    state[_NEXT] = sequence + 1
    return u_loss, u_jitter


@compiled
def _keep_under_way(inbox, i, edge, slot, stamp, usable, values):
    """Keep a record until ``usable`` (us); one that still stands in this slot is overwritten."""
    if inbox.slot_stamp[i, edge, slot] < 0:
        inbox.edges[i, edge, _WAITING] += 1
    inbox.slot_stamp[i, edge, slot] = stamp
    inbox.slot_usable[i, edge, slot] = usable
    copy(values, inbox.slot_values[i, edge, slot])


@compiled
def deliver(inbox, i, edge, sequence, stamp, radio_on, values, latency, now, seed):
    """Pass one record through the channel of in-edge ``edge`` of UAV ``i`` (indices) and, if it survives, keep it.

    Call it in order of sequence, at the first tick ``now`` >= stamp + latency (all in us). ``radio_on`` is false where
    the sender's or the receiver's radio is off. The burst chain also steps for records that this edge never got.
    """
    state = inbox.edges[i, edge]
    channel = fields(Channel, inbox.quality[i, edge])
    if sequence < state[_NEXT]:
        return
    u_loss, u_jitter = _pass_records(state, channel, sequence, seed)
    threshold = channel.burst_loss if (state[_BURST] == 1 and channel.burst_start > 0.0) else channel.loss
    if channel.blocked > 0.0 or not radio_on or u_loss < threshold:
        state[_LOST] += 1
        return
    state[_RECEIVED] += 1
    usable = stamp + latency + int((channel.delay + channel.jitter * u_jitter) * 1e6)
    if usable <= now:
        _take(inbox, i, edge, stamp, values)
    else:
        _keep_under_way(inbox, i, edge, sequence % SLOTS, stamp, usable, values)


@compiled
def hear(inbox, i, now):
    """Take from UAV ``i``'s inbox what can be used at ``now`` (us); set validity and age of its in-edges."""
    for edge in range(inbox.degree[i]):
        if inbox.edges[i, edge, _WAITING] > 0:
            for slot in range(SLOTS):
                stamp = inbox.slot_stamp[i, edge, slot]
                if stamp >= 0 and inbox.slot_usable[i, edge, slot] <= now:
                    inbox.slot_stamp[i, edge, slot] = -1
                    inbox.edges[i, edge, _WAITING] -= 1
                    _take(inbox, i, edge, stamp, inbox.slot_values[i, edge, slot])
        if inbox.stamp[i, edge] >= 0:
            inbox.valid[i, edge] = 1.0
        if inbox.valid[i, edge] > 0.0:
            # Values that were there before any record belong to t = 0.
            age = max(0, now - max(0, inbox.stamp[i, edge])) / 1e6
            inbox.age[i, edge] = age
            ages = fields(Ages, inbox.ages[i, edge])
            store(Ages(ages.total + age, ages.ticks + 1.0, max(ages.greatest, age)), inbox.ages[i, edge])


@compiled
def report_link(inbox, i, edge, out):
    """Write the `LinkReport` of an in-edge of UAV ``i`` into ``out`` (5,), and begin a new one."""
    state = inbox.edges[i, edge]
    sent, received, lost = float(state[_NEXT]), float(state[_RECEIVED]), float(state[_LOST])
    ages = fields(Ages, inbox.ages[i, edge])
    age = ages.total / ages.ticks if ages.ticks > 0.0 else math.nan
    oldest = ages.greatest if ages.ticks > 0.0 else math.nan
    store(LinkReport(sent, received, lost, age, oldest), out)
    fill(inbox.ages[i, edge], 0.0)
