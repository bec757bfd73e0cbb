"""A whole flight in one process, tick by tick: what the processes do, in the same order, through the same functions.

A template, see `link.compiled`: the free names are ``stages``, the stages of the scheme, and ``cycle``, the flight
of the plant. `one_process.loop_of` fills them in.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ftcc.airside.attacks.lies import hear_through_lies, is_quiet, tell
from ftcc.airside.defence.arrays import Edge
from ftcc.airside.flight_path import Own
from ftcc.airside.link_events import set_links
from ftcc.link.actuators import as_sent, decode_command, encode_command
from ftcc.link.attitude_target import decode_target, encode_target
from ftcc.link.channel import LINK_REPORT, report_link
from ftcc.link.compiled import compiled, compiled_apart, compiled_within, copy, fill
from ftcc.link.exchange import newest_slot
from ftcc.link.timing import ticks_a_second
from ftcc.sim.actuation import latch
from ftcc.sim.obstacles import watch
from ftcc.sim.plant import DIVERGED, X, Z

__all__ = ["fly_by_wire", "fly_ideally"]

if "stages" not in globals() or "cycle" not in globals():
    raise ImportError(
        "ftcc.groundside.simulation.flight_loop is a template: use ftcc.groundside.simulation.one_process.loop_of"
    )

stages: Any = globals()["stages"]
cycle: Any = globals()["cycle"]

_control = stages.control
_diagnose = stages.diagnose
_predict_shared = stages.predict_shared
_publish = stages.publish
_refer = stages.refer
_sense = stages.sense
_set_shared = stages.set_shared
_SWEEPS = stages.SWEEPS
_actuate = cycle.actuate
_truth = cycle.truth
_measure = cycle.measure
_state_of = cycle.sense
_advance = cycle.advance
_conditions = cycle.conditions

_TRUST = len(LINK_REPORT)
"""Where the trust in the sender stands behind the report on a link."""
_STANDING = Edge._fields.index("standing")
_OWN_COMMAND = Own._fields.index("aileron")
"""Index of the first actuator command in `Own`."""
_V, _GAMMA, _CHI = (Own._fields.index(name) for name in ("V", "gamma", "chi"))


@compiled_apart
def _hear(attacks, exchange, inbox, events, timing, i, now_us):
    stages.hear(attacks, exchange, inbox, events, timing, i, now_us)


_SETTLED = 1e-6
"""The exchange at one time is repeated until no shared value changes by more than this, in its unit."""


@compiled
def fly_by_wire(world, timing, first, last):
    """Fly the ticks first..last-1 as between processes.

    Messages carry states and commands as float32, records have the mesh's latency, and a command acts one sample after
    its measurement.
    """
    for n in range(first, last):
        set_links(world.events, world.inbox, n * timing.period_us)
        _tick_by_wire(world, timing, n)
        _record(world, timing, n)
        _advance_vehicles(world, timing, n)


@compiled
def fly_ideally(world, timing, first, last):
    """Fly the ticks first..last-1 with ideal exchange.

    Not one function with `fly_by_wire`: a flight needs one of them, and either takes seconds to compile.
    """
    for n in range(first, last):
        set_links(world.events, world.inbox, n * timing.period_us)
        _ideal_tick(world, timing, n)
        _record(world, timing, n)
        _advance_vehicles(world, timing, n)


@compiled_within
def _tick_by_wire(world, timing, n):
    """All sense the last command's effect, then each hears, steps and shares."""
    autopilots, inbox, lost, now = world.autopilots, world.inbox, world.recording.lost, n * timing.period_us
    for i in range(lost.shape[0]):
        if lost[i] == 0:
            if n > 0:
                _apply_last_command(world, i)
            _state_of(world.fleet, i, n, now, timing.seed, world.true[i], world.measured, world.state, world.controls)
            _sense(autopilots, i, world.state, world.controls, now)
    for i in range(lost.shape[0]):
        if lost[i] == 0:
            _hear(world.attacks, world.exchange, inbox, world.events, timing, i, now)
            _diagnose(autopilots, i, now, timing.period_us / 1e6)
            _refer(autopilots, inbox, i, now, timing.period_us)
            _control_follower(world, timing, i, now)
    if now % timing.exchange_us == 0:
        for i in range(lost.shape[0]):
            if lost[i] == 0:
                _publish(autopilots, world.attacks, world.exchange, world.events, i, now // timing.exchange_us, now)


@compiled_within
def _ideal_tick(world, timing, n):
    """All sense, then all share, then all step; a command acts at once."""
    autopilots, inbox, lost, now = world.autopilots, world.inbox, world.recording.lost, n * timing.period_us
    for i in range(lost.shape[0]):
        if lost[i] > 0:
            continue
        fleet, true = world.fleet, world.true[i]
        _truth(fleet, i, now / 1e6, true)
        watch(fleet.zones, fleet.entered, fleet.events, i, now, true[X], true[Z])
        _measure(fleet, i, n, timing.seed, true, world.measured)
        own = autopilots.own[i]
        own[0] = now / 1e6
        copy(world.measured, own[1:])
        copy(fleet.command[i], own[_OWN_COMMAND:])
        if autopilots.leader[i] == 1:
            # Leaders use each other's records of the previous tick; records of this tick are published later.
            _hear(world.attacks, world.exchange, inbox, world.events, timing, i, now)
        _diagnose(autopilots, i, now, timing.period_us / 1e6)
        _refer(autopilots, inbox, i, now, timing.period_us)
    for i in range(lost.shape[0]):
        if lost[i] == 0:
            if autopilots.leader[i] == 0:
                _set_shared(autopilots, inbox, i)
            _publish(autopilots, world.attacks, world.exchange, world.events, i, world.exchange.next_sequence[i], now)
    if _SWEEPS > 1:
        for i in range(lost.shape[0]):
            if lost[i] == 0 and autopilots.leader[i] == 0:
                _hear(world.attacks, world.exchange, inbox, world.events, timing, i, now)
        _settle_exchange(world, now, timing.period_us / 1e6)
    for i in range(lost.shape[0]):
        if lost[i] == 0 and autopilots.leader[i] == 0:
            _hear(world.attacks, world.exchange, inbox, world.events, timing, i, now)
            _control_follower(world, timing, i, now)
    for i in range(lost.shape[0]):
        if _flies(world.recording, i, now):
            if autopilots.leader[i] == 1:
                copy(autopilots.target[i], world.fleet.target[i])
            else:
                latch(world.fleet, i, autopilots.command[i])
            _actuate(world.fleet, i, now / 1e6)


@compiled_within
def _flies(recording, i, now):
    """Return whether UAV ``i`` still flies at ``now`` (us); it does if its law diverged only at this tick."""
    return recording.lost[i] == 0 or (recording.lost[i] == DIVERGED and recording.lost_us[i] == now)


@compiled_within
def _apply_last_command(world, i):
    """Put the last command of UAV ``i`` into force, as a message carries it."""
    fleet, autopilots = world.fleet, world.autopilots
    if autopilots.leader[i] == 1:
        copy(autopilots.target[i], fleet.target[i])
        as_sent(fleet.target[i, 1:])
        return
    if fleet.code[i, 0] > 0.0:
        own = autopilots.own[i]
        V, gamma, chi = own[_V], own[_GAMMA], own[_CHI]
        encode_target(autopilots.command[i], V, gamma, chi, autopilots.travel[i], autopilots.code[i], world.target)
        decode_target(world.target, V, gamma, chi, fleet.travel[i], fleet.code[i], world.controls)
    else:
        encode_command(autopilots.command[i], autopilots.travel[i], world.controls)
        decode_command(world.controls, fleet.travel[i], world.controls)
    latch(fleet, i, world.controls)


@compiled_within
def _control_follower(world, timing, i, now):
    """Step the law of a follower; the UAV is lost if its command is not finite."""
    if world.autopilots.leader[i] == 1:
        return
    if not _control(world.autopilots, world.inbox, i, timing.period_us / 1e6):
        world.recording.lost[i] = DIVERGED
        world.recording.lost_us[i] = now
        fill(world.autopilots.signals[i], np.nan)


@compiled_within
def _settle_exchange(world, now, dt):
    """Repeat the ideal exchange at this time until the shared values converge; all UAVs exchange at once.

    For a law whose shared values depend on its neighbours' values of the same time: an algebraic loop around the graph.
    """
    attacks, exchange, autopilots, inbox, lost = (
        world.attacks,
        world.exchange,
        world.autopilots,
        world.inbox,
        world.recording.lost,
    )
    for _ in range(_SWEEPS - 1):
        moved = 0.0
        for i in range(lost.shape[0]):
            if lost[i] == 0 and autopilots.leader[i] == 0:
                _predict_shared(autopilots, inbox, i, dt)
                told, last = autopilots.shared[i], exchange.values[i, newest_slot(exchange, i)]
                if not is_quiet(attacks):
                    tell(attacks, exchange, told, i, exchange.next_sequence[i] - 1, now)
                    told = attacks.told[i]
                for m in range(last.shape[0]):
                    moved = max(moved, abs(told[m] - last[m]))
                copy(told, last)
        for i in range(lost.shape[0]):
            for edge in range(inbox.degree[i]):
                if inbox.stamp[i, edge] == now:
                    row = exchange.sender[i, edge]
                    if is_quiet(attacks):
                        copy(exchange.values[row, newest_slot(exchange, row)], inbox.values[i, edge])
                    else:
                        sequence = exchange.next_sequence[row] - 1
                        hear_through_lies(attacks, exchange, i, edge, sequence, inbox.values[i, edge])
        if moved <= _SETTLED:
            break


@compiled
def _keep(values, places, row):
    """Copy the entries ``places`` of a vector into a row."""
    for m in range(places.shape[0]):
        row[m] = values[places[m]]


@compiled_within
def _record(world, timing, n):
    """Record a row of each flying UAV, and a report on each of its in-edges, if they are due."""
    recording, fleet, now = world.recording, world.fleet, n * timing.period_us
    kept = recording.kept
    every, report_every = timing.record_every, ticks_a_second(timing.period_us)
    for i in range(recording.lost.shape[0]):
        if n % every == 0 and _flies(recording, i, now):
            row = n // every - recording.first[0]
            _keep(world.true[i], kept.truth, recording.truth[row, i])
            _keep(fleet.command[i], kept.command, recording.command[row, i])
            _keep(fleet.acting[i], kept.acting, recording.acting[row, i])
            if kept.conditions.shape[0] > 0:
                _conditions(fleet, i, now / 1e6, world.conditions)
                _keep(world.conditions, kept.conditions, recording.conditions[row, i])
            _keep(world.autopilots.signals[i], kept.signals, recording.signals[row, i])
        if n % report_every == 0 and recording.lost[i] == 0:
            for edge in range(world.inbox.degree[i]):
                report = n // report_every - recording.first[1]
                row = recording.links[report, i, edge]
                report_link(world.inbox, i, edge, row)
                row[_TRUST] = world.autopilots.defence.edges[i, edge, _STANDING]


@compiled_within
def _advance_vehicles(world, timing, n):
    """Advance the vehicles by one period; a vehicle that leaves its model's valid range is lost."""
    now, recording = n * timing.period_us, world.recording
    for i in range(recording.lost.shape[0]):
        if _flies(recording, i, now):
            why = _advance(world.fleet, i, now, timing.period_us, timing.step_us)
            if why > 0 and recording.lost[i] == 0:
                recording.lost[i] = why
                recording.lost_us[i] = now + timing.period_us
