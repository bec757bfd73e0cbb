"""A whole flight in one process, tick by tick: what the processes do, in the same order, through the same functions.

A template, see `link.compiled`: the free names are ``tick``, the tick of the scheme, and ``cycle``, the flight
of the plant. `simulate.loop_of` fills them in.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.autopilots import lead, sense
from ftcc.airside.link_events import set_links
from ftcc.link.actuators import as_sent, decode_command, encode_command
from ftcc.link.attitude_target import decode_target, encode_target
from ftcc.link.channel import admit, hear, report_link
from ftcc.link.compiled import compiled, copy, fill
from ftcc.sim.navigation import navigate
from ftcc.sim.obstacles import watch
from ftcc.sim.plant import DIVERGED, X, Z, latch
from ftcc.sim.sensors import encode_state

__all__ = ["HISTORY", "Ether", "Recording", "fly"]

if "tick" not in globals() or "cycle" not in globals():
    raise ImportError("ftcc.groundside.flight_loop is a template: use ftcc.groundside.simulate.loop_of")

tick: Any = globals()["tick"]
cycle: Any = globals()["cycle"]

_announce = tick.announce
_anticipate = tick.anticipate
_control = tick.control
_SWEEPS = tick.SWEEPS
_refer = tick.refer
_actuate = cycle.actuate
_truth = cycle.truth
_measure = cycle.measure
_advance = cycle.advance
_conditions = cycle.conditions

HISTORY = 64
"""Records kept of each sender."""

_SETTLED = 1e-6
"""Exchanges of one instant end when no shared value moves by more, in its unit."""


class Ether(NamedTuple):
    """What stands in for the mesh: the last records of every UAV."""

    sender: NDArray[np.int64]
    """(k, n): index of the UAV behind each in-edge."""
    sent: NDArray[np.int64]
    """(k,): records sent."""
    stamp: NDArray[np.int64]
    """(k, HISTORY): us."""
    radio_on: NDArray[np.int64]
    """(k, HISTORY)."""
    values: NDArray[np.float64]
    """(k, HISTORY, m)."""


class Recording(NamedTuple):
    """Rows of the recording, time first, then UAV; nan after a UAV was lost."""

    truth: NDArray[np.float64]
    """(n, k, 13)."""
    command: NDArray[np.float64]
    """(n, k, 4): in force."""
    acting: NDArray[np.float64]
    """(n, k, 4)."""
    conditions: NDArray[np.float64]
    """(n, k, c): what only the simulator knows, see ``sim.plants.conditions_of``."""
    signals: NDArray[np.float64]
    """(n, k, s)."""
    links: NDArray[np.float64]
    """(m, k, e, 5): of each in-edge, see ``link.channel.LINK_REPORT``; nan where there is none."""
    lost: NDArray[np.int64]
    """(k,): why a UAV was lost, 0 = it was not."""
    lost_us: NDArray[np.int64]
    """(k,): when."""


class Scratch(NamedTuple):
    """Room for one tick's work."""

    true: NDArray[np.float64]
    """(k, 13)."""
    seen: NDArray[np.float64]
    """(13,)."""
    message: NDArray[np.float64]
    """(13,)."""
    controls: NDArray[np.float64]
    """(4,)."""
    target: NDArray[np.float64]
    """(5,): see ``link.attitude_target.TARGET``."""


@compiled
def _send(ether, autopilots, events, i, now):
    slot = ether.sent[i] % HISTORY
    ether.stamp[i, slot] = now
    ether.radio_on[i, slot] = events.radio_on[i]
    copy(autopilots.shared[i], ether.values[i, slot])
    ether.sent[i] += 1


@compiled
def _receive(ether, inbox, events, i, now, latency, seed):
    for edge in range(inbox.degree[i]):
        sender = ether.sender[i, edge]
        while inbox.edges[i, edge, 3] < ether.sent[sender]:
            sequence = inbox.edges[i, edge, 3]
            slot = sequence % HISTORY
            stamp = ether.stamp[sender, slot]
            if stamp + latency > now:
                break
            radio_on = ether.radio_on[sender, slot] == 1 and events.radio_on[i] == 1
            admit(inbox, i, edge, sequence, stamp, radio_on, ether.values[sender, slot], latency, now, seed)
    hear(inbox, i, now)


@compiled
def _settle(ether, autopilots, inbox, lost, now, dt):
    """Repeat the ideal exchange of this instant until the shared values have settled, all at once each time.

    For a law whose shared values depend on what it hears of the same instant: an algebraic loop around the graph.
    """
    for _ in range(_SWEEPS - 1):
        moved = 0.0
        for i in range(lost.shape[0]):
            if lost[i] == 0 and autopilots.leader[i] == 0:
                _anticipate(autopilots, inbox, i, dt)
                last = ether.values[i, (ether.sent[i] - 1) % HISTORY]
                for m in range(last.shape[0]):
                    moved = max(moved, abs(autopilots.shared[i, m] - last[m]))
                copy(autopilots.shared[i], last)
        for i in range(lost.shape[0]):
            for edge in range(inbox.degree[i]):
                if inbox.stamp[i, edge] == now:
                    sender = ether.sender[i, edge]
                    copy(ether.values[sender, (ether.sent[sender] - 1) % HISTORY], inbox.values[i, edge])
        if moved <= _SETTLED:
            break


@compiled
def _latch(fleet, autopilots, i, wire, buffer, target):
    """Bring the last command into force."""
    if autopilots.leader[i] == 1:
        copy(autopilots.target[i], fleet.target[i])
        if wire:
            as_sent(fleet.target[i, 1:])
    elif wire and fleet.code[i, 0] > 0.0:
        own = autopilots.own[i]
        V, gamma, chi = own[4], own[5], own[6]
        encode_target(autopilots.command[i], V, gamma, chi, autopilots.travel[i], autopilots.code[i], target)
        decode_target(target, V, gamma, chi, fleet.travel[i], fleet.code[i], buffer)
        latch(fleet, i, buffer)
    elif wire:
        encode_command(autopilots.command[i], autopilots.travel[i], buffer)
        decode_command(buffer, fleet.travel[i], buffer)
        latch(fleet, i, buffer)
    else:
        latch(fleet, i, autopilots.command[i])


@compiled
def fly(
    fleet,
    autopilots,
    inbox,
    events,
    ether,
    recording,
    scratch,
    period,
    exchange,
    latency,
    step,
    every,
    report_every,
    seed,
    wire,
    first,
    last,
):
    """Fly the ticks first..last-1.

    Periods are in us, ``every`` is the number of ticks between recorded rows, ``report_every`` between those on
    the links. With ``wire``, states and commands pass
    through the messages' float32 and a command acts one sample after its measurement, as between processes; without,
    the exchange is ideal: all share, then all step, and the command acts at once.
    """
    k = fleet.state.shape[0]
    true, seen, message, buffer = scratch.true, scratch.seen, scratch.message, scratch.controls
    for n in range(first, last):
        now = n * period
        set_links(events, inbox, now)
        for i in range(k):
            if recording.lost[i] > 0:
                continue
            if wire:
                if n > 0:
                    _latch(fleet, autopilots, i, wire, buffer, scratch.target)
                _actuate(fleet, i, now / 1e6)
            _truth(fleet, i, now / 1e6, true[i])
            watch(fleet.zones, fleet.entered, fleet.happenings, i, now, true[i, X], true[i, Z])
            _measure(fleet, i, n, seed, true[i], seen)
            if wire:
                encode_state(seen, message)
                navigate(fleet, i, now / 1e6, message)
                # The vehicle reports the command in force as it received it.
                encode_command(fleet.command[i], fleet.travel[i], buffer)
                sense(autopilots, i, message, buffer, now)
            else:
                autopilots.own[i, 0] = now / 1e6
                copy(seen, autopilots.own[i, 1:])
                copy(fleet.command[i], autopilots.own[i, 14:])
            if autopilots.leader[i] == 1:
                # Leaders hear each other's records up to the tick before; all share a tick's state only after this.
                _receive(ether, inbox, events, i, now, latency, seed)
                lead(autopilots, inbox, i, now, period)
            else:
                _refer(autopilots, i, now, period)
        if not wire:
            for i in range(k):
                if recording.lost[i] == 0:
                    if autopilots.leader[i] == 0:
                        _announce(autopilots, inbox, i)
                    _send(ether, autopilots, events, i, now)
            if _SWEEPS > 1:
                for i in range(k):
                    if recording.lost[i] == 0 and autopilots.leader[i] == 0:
                        _receive(ether, inbox, events, i, now, latency, seed)
                _settle(ether, autopilots, inbox, recording.lost, now, period / 1e6)
        for i in range(k):
            if recording.lost[i] == 0 and autopilots.leader[i] == 0:
                _receive(ether, inbox, events, i, now, latency, seed)
                if not _control(autopilots, inbox, i, period / 1e6):
                    recording.lost[i] = DIVERGED
                    recording.lost_us[i] = now
                    fill(autopilots.signals[i], np.nan)
        if wire and now % exchange == 0:
            for i in range(k):
                if recording.lost[i] == 0:
                    _send(ether, autopilots, events, i, now)
        for i in range(k):
            diverged_now = recording.lost[i] == DIVERGED and recording.lost_us[i] == now
            if recording.lost[i] > 0 and not diverged_now:
                continue
            if not wire:
                _latch(fleet, autopilots, i, wire, buffer, scratch.target)
                _actuate(fleet, i, now / 1e6)
            if n % every == 0:
                row = n // every
                copy(true[i], recording.truth[row, i])
                copy(fleet.command[i], recording.command[row, i])
                copy(fleet.acting[i], recording.acting[row, i])
                _conditions(fleet, i, now / 1e6, recording.conditions[row, i])
                copy(autopilots.signals[i], recording.signals[row, i])
            if n % report_every == 0 and recording.lost[i] == 0:
                for edge in range(inbox.degree[i]):
                    report_link(inbox, i, edge, recording.links[n // report_every, i, edge])
            why = _advance(fleet, i, now, period, step)
            if why > 0 and recording.lost[i] == 0:
                recording.lost[i] = why
                recording.lost_us[i] = now + period
