"""The flight of an autopilot process, compiled: from the states of its vehicles to the commands that answer them.

A template, see `instantiate`: the free name ``stages`` is the module `stages` for a scheme. `compiled_stages.flight_of`
gives this module with it filled in. `tick` lists the stages in their order, and the functions below it do each for one
UAV; the rest waits for what a tick needs. No stage reads a wall clock.
"""

from __future__ import annotations

from typing import Any

from ftcc.airside.attacks.lies import is_quiet, must_be_recorded
from ftcc.airside.defence.arrays import Edge as Standing
from ftcc.airside.flight_path import Own
from ftcc.airside.group import EVENTS, LOST, PUBLISH, SECOND, TELEMETRY, WRITE
from ftcc.airside.link_events import set_links
from ftcc.link.actuators import encode_command
from ftcc.link.attitude_target import decode_target, encode_target
from ftcc.link.channel import LINK_REPORT, Edge, report_link
from ftcc.link.compiled import compiled, compiled_apart, compiled_to_wait, compiled_within, copy
from ftcc.link.exchange import append, begin
from ftcc.link.process import RESEND
from ftcc.link.recording import LINK_COLUMNS, is_full
from ftcc.link.system_calls import monotonic, wait
from ftcc.link.timing import tick_of, ticks_a_second
from ftcc.link.waiting import ATTEND, DATAGRAM, FLOWN, GO_ON, MAIL, WORK
from ftcc.link.wire import (
    BY_ATTITUDE,
    BY_POSITION,
    is_readable,
    read_state,
    receive_datagram,
    send_again,
    send_attitude_target,
    send_command,
    send_position_target,
)

__all__ = ["fly", "take", "tick"]

# A template has no such name until `instantiate` gives it.
if "stages" not in globals():
    raise ImportError("ftcc.airside.flight is a template: use ftcc.airside.compiled_stages.flight_of(scheme)")

stages: Any = globals()["stages"]

_publish = stages.publish

_V, _GAMMA, _CHI = (Own._fields.index(name) for name in ("V", "gamma", "chi"))

_STANDING = Standing._fields.index("standing")
_SENDER = Edge._fields.index("sender")
_REPORT = [column.name for column in LINK_COLUMNS].index(LINK_REPORT[0])
"""Where the report on a link begins in a row of its recording."""
_TRUST = [column.name for column in LINK_COLUMNS].index("trust")

_DATAGRAMS = 64
"""Read of one vehicle at a time, at most: a flood must not hold up the others for ever."""
_LOOK = 20
"""Longest wait before the clock is looked at, ms."""
_AHEAD = 4
"""Lockstep: exchanges that a sender may be ahead of its receivers' acknowledgements, beyond the latency."""


@compiled_apart
def _sense(autopilots, i, state, reported, now_us):
    stages.sense(autopilots, i, state, reported, now_us)


@compiled_apart
def _hear(attacks, exchange, inbox, events, timing, i, now_us):
    stages.hear(attacks, exchange, inbox, events, timing, i, now_us)


@compiled_apart
def _diagnose(autopilots, i, now_us, dt):
    stages.diagnose(autopilots, i, now_us, dt)


@compiled_apart
def _refer(autopilots, inbox, i, now_us, period_us):
    stages.refer(autopilots, inbox, i, now_us, period_us)


@compiled_apart
def _control(autopilots, inbox, i, dt):
    return stages.control(autopilots, inbox, i, dt)


@compiled_within
def tick(group, timing, now_us):
    """One tick of the autopilots that are ``active``."""
    every = range(group.active.shape[0])
    for i in every:
        if group.active[i] == 1:
            sense(group, i, now_us)
    set_links(group.link_events, group.inbox, now_us)
    for i in every:
        if group.active[i] == 1:
            hear(group, timing, i, now_us)
            diagnose(group, timing, i, now_us)
            refer(group, timing, i, now_us)
            control(group, timing, i, now_us)
            actuate(group, i, now_us)
    if now_us % timing.exchange_us == 0:
        if group.on_mesh[0] == 1:
            # Also without a record in it a transmission acknowledges what this process has received.
            begin(
                group.transmission, now_us // timing.exchange_us, group.complete[0], 0, group.autopilots.shared.shape[1]
            )
        for i in every:
            if group.active[i] == 1:
                publish(group, timing, i, now_us)
    for i in every:
        if group.active[i] == 1:
            record(group, timing, i, now_us)


@compiled_within
def sense(group, i, now_us):
    """The state that has come becomes the present one.

    Where the vehicle does not say which command is in force, it is the one that answers its last state.
    """
    copy(group.arrived[i], group.states[i])
    copy(group.arrived_controls[i] if group.command_reported[i] == 1 else group.controls[i], group.reported[i])
    group.pending[i] = -1
    _sense(group.autopilots, i, group.states[i], group.reported[i], now_us)


@compiled_within
def hear(group, timing, i, now_us):
    """Take the records that are due through the channel into the inbox."""
    _hear(group.attacks, group.exchange, group.inbox, group.link_events, timing, i, now_us)


if stages.ACTIVE:

    @compiled_within
    def diagnose(group, timing, i, now_us):
        """What the UAV finds out about its own actuators."""
        _diagnose(group.autopilots, i, now_us, timing.period_us / 1e6)

else:

    @compiled_within
    def diagnose(group, timing, i, now_us):
        pass


@compiled_within
def refer(group, timing, i, now_us):
    """The reference at this tick: a leader's profile, a follower's own."""
    _refer(group.autopilots, group.inbox, i, now_us, timing.period_us)


@compiled_within
def control(group, timing, i, now_us):
    """Step the law; a UAV whose command is not finite ends here."""
    group.done[i] = now_us // timing.period_us
    autopilots = group.autopilots
    if autopilots.leader[i] == 1:
        return
    if _control(autopilots, group.inbox, i, timing.period_us / 1e6):
        encode_command(autopilots.command[i], autopilots.travel[i], group.controls[i])
    else:
        group.active[i] = 0
        group.alive[i] = 0
        group.lost[0] += 1


@compiled
def encode_attitude(autopilots, i, target, controls):
    """The command of UAV ``i`` as an attitude target (5,), and what the vehicle reads of it, in fractions of travel."""
    own = autopilots.own[i]
    V, gamma, chi = own[_V], own[_GAMMA], own[_CHI]
    encode_target(autopilots.command[i], V, gamma, chi, autopilots.travel[i], autopilots.code[i], target)
    decode_target(target, V, gamma, chi, autopilots.travel[i], autopilots.code[i], controls)
    encode_command(controls, autopilots.travel[i], controls)


@compiled_within
def actuate(group, i, now_us):
    """Send the command to the vehicle."""
    if group.active[i] == 0:
        return
    wire, autopilots = group.wire, group.autopilots
    if group.travels_by[i] == BY_POSITION:
        sent = send_position_target(wire, i, autopilots.target[i])
    elif group.travels_by[i] == BY_ATTITUDE:
        encode_attitude(autopilots, i, group.target, group.controls[i])
        sent = send_attitude_target(wire, i, now_us, group.target)
    else:
        sent = send_command(wire, i, now_us, group.controls[i])
    if not sent:
        group.unsendable[0] = 1


@compiled_within
def publish(group, timing, i, now_us):
    """Post a record to the out-neighbours in this process, and put it into the next transmission for the others."""
    sequence = now_us // timing.exchange_us
    _publish(group.autopilots, group.attacks, group.exchange, group.link_events, i, sequence, now_us)
    if group.heard_outside[i] == 1:
        uav, radio_on = group.wire.system[i], group.link_events.radio_on[i]
        values = group.autopilots.shared[i] if is_quiet(group.attacks) else group.attacks.told[i]
        if not append(group.transmission, uav, sequence, now_us, radio_on, values):
            group.unsendable[0] = 1


@compiled_within
def record(group, timing, i, now_us):
    """Write a row of the recording, and one on each in-edge, where they are due."""
    n = now_us // timing.period_us
    rows, links = group.rows, group.link_rows
    if n % timing.record_every == 0 and group.autopilots.leader[i] == 0:
        row = rows.values[i, rows.filled[i]]
        row[0], row[1] = now_us / 1e6, float(group.wire.system[i])
        copy(group.autopilots.signals[i], row[2:])
        rows.filled[i] += 1
    if n % ticks_a_second(timing.period_us) == 0:
        for edge in range(group.inbox.degree[i]):
            row = links.values[i, links.filled[i]]
            row[0], row[1] = now_us / 1e6, float(group.wire.system[i])
            row[2] = float(group.inbox.edges[i, edge, _SENDER])
            report_link(group.inbox, i, edge, row[_REPORT:])
            row[_TRUST] = group.autopilots.defence.edges[i, edge, _STANDING]
            links.filled[i] += 1


@compiled_within
def something_to_do(group, timing, now_us):
    """Set ``to_do``; whether Python has something to do after this tick."""
    to_do = 0
    if group.transmission.used[0] > 0:
        to_do |= PUBLISH
    if is_full(group.rows) or is_full(group.link_rows) or must_be_recorded(group.attacks):
        to_do |= WRITE
    if now_us // timing.period_us % ticks_a_second(timing.period_us) == 0:
        to_do |= SECOND
    if group.autopilots.events.used[0] > 0:
        to_do |= EVENTS
    if group.lost[0] > 0 or group.unsendable[0] > 0:
        to_do |= LOST
    if now_us >= group.telemetry_us[0] and monotonic(group.room) >= group.telemetry_wall[0]:
        to_do |= TELEMETRY
    group.to_do[0] = to_do
    return to_do > 0


# Waiting for what a tick needs.


@compiled_within
def take(group, timing, i):
    """Read the datagram at hand for UAV ``i``; one that was answered already is answered once more."""
    stamp, reported = read_state(group.wire, group.arrived[i], group.arrived_controls[i])
    n = tick_of(stamp, timing.period_us)
    if n < 0:
        return DATAGRAM
    if n > group.done[i]:
        group.pending[i], group.command_reported[i] = n, reported
    elif n == group.done[i]:
        send_again(group.wire, i)
    return GO_ON


@compiled_within
def listen(group, timing):
    """Read what the vehicles sent, until each has a state."""
    for i in range(group.alive.shape[0]):
        for _ in range(_DATAGRAMS):
            if group.alive[i] == 0 or group.pending[i] >= 0 or not receive_datagram(group.wire, i):
                break
            cause = take(group, timing, i)
            if cause != GO_ON:
                return cause
    return GO_ON


@compiled_within
def ask_again(group, now):
    """Lockstep: send commands again where the next state does not come: a datagram may be lost."""
    if now - group.since[0] < RESEND:
        return
    group.since[0] = now
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1 and group.pending[i] < 0:
            send_again(group.wire, i)


@compiled_within
def records_are_complete(group, timing, now_us):
    """Lockstep: whether every record that could be usable has come, and no receiver is far behind."""
    due = now_us - timing.latency_us
    if due >= 0 and group.complete[0] < due // timing.exchange_us:
        return False
    window = _AHEAD - (-timing.latency_us // timing.exchange_us)
    return now_us % timing.exchange_us != 0 or group.acknowledged[0] >= now_us // timing.exchange_us - window


@compiled_within
def _missing_states(group):
    """How many of those who are alive have no state yet."""
    missing = 0
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1 and group.pending[i] < 0:
            missing += 1
    return missing


@compiled_within
def _next_state(group):
    """The earliest tick of which a state has come; -1: none."""
    earliest = -1
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1 and group.pending[i] >= 0 and (earliest < 0 or group.pending[i] < earliest):
            earliest = group.pending[i]
    return earliest


@compiled_within
def is_over(group, timing):
    """Whether all who are alive have flown their last tick."""
    flying = 0
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1 and group.done[i] < timing.ticks:
            flying += 1
    return flying == 0


@compiled_within
def _fly_tick(group, timing, n):
    """Fly tick ``n`` of those whose state of it has come; whether Python has something to do then."""
    for i in range(group.alive.shape[0]):
        group.active[i] = 1 if group.alive[i] == 1 and group.pending[i] == n else 0
    tick(group, timing, n * timing.period_us)
    return something_to_do(group, timing, n * timing.period_us)


@compiled_to_wait
def fly(group, timing, lockstep):
    """Fly tick after tick until Python has something to do; why, see `link.waiting`.

    In lockstep a tick waits for the states of all and for every record that could be usable; otherwise it is flown for
    those whose state has come, with the newest records.
    """
    wire, others = group.wire, group.alive.shape[0]
    mesh = others + 1
    while True:
        if is_over(group, timing):
            return FLOWN
        cause = listen(group, timing)
        if cause != GO_ON:
            return cause
        now = monotonic(group.room)
        if now >= group.attention[0]:
            return ATTEND
        n = _next_state(group)
        ready = n >= 0 and not (lockstep and _missing_states(group) > 0)
        records = not lockstep or (ready and records_are_complete(group, timing, n * timing.period_us))
        if group.mail[0] == 1 and ready and not (lockstep and records):
            return MAIL
        if ready and records:
            work = _fly_tick(group, timing, n)
            group.since[0] = now
            if work:
                return WORK
            continue
        if ready:
            # Only the mesh is waited for, and what is always heard.
            wait(wire.polled[others:], _LOOK)
            if is_readable(wire, mesh):
                return MAIL
        else:
            # A record that comes early wakes nobody up.
            if lockstep:
                ask_again(group, now)
            descriptor = wire.polled[mesh, 0]
            wire.polled[mesh, 0] = -1
            wait(wire.polled, _LOOK)
            wire.polled[mesh, 0] = descriptor
        if is_readable(wire, others):
            return ATTEND
