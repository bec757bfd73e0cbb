"""The flight of a vehicle process, compiled: from the commands that answer the last states to the next states.

A template, see `link.compiled`: the free name ``cycle`` is the module of the flight of one vehicle on a plant.
`plants.flight_of` gives this module with it filled in. `tick` lists the steps of a tick; `fly` waits for each tick.
"""

from __future__ import annotations

from typing import Any

from ftcc.link.actuators import decode_command
from ftcc.link.attitude_target import decode_target, path_of
from ftcc.link.compiled import compiled_apart, compiled_to_wait, compiled_within, copy, fields, store
from ftcc.link.messages import StateMessage
from ftcc.link.process import RESEND
from ftcc.link.recording import is_full
from ftcc.link.system_calls import monotonic, pause, wait
from ftcc.link.timing import tick_of, ticks_a_second
from ftcc.link.waiting import ATTEND, DATAGRAM, FLOWN, GO_ON, HELD, WORK
from ftcc.link.wire import (
    BY_ACTUATORS,
    BY_ATTITUDE,
    BY_POSITION,
    is_readable,
    read_attitude_target,
    read_command,
    read_position_target,
    receive_datagram,
    send_again,
    send_state,
)
from ftcc.sim.actuation import latch
from ftcc.sim.obstacles import clearance
from ftcc.sim.plant import X, Z

__all__ = ["fly", "take", "tick"]

if "cycle" not in globals():
    raise ImportError("ftcc.sim.flight is a template: use ftcc.sim.plants.flight_of(plant)")

cycle: Any = globals()["cycle"]

_conditions = cycle.conditions

_DATAGRAMS = 64
"""Read from one autopilot at a time, at most: a flood must not delay a tick for ever."""
_LOOK = 20
"""Longest wait before the clock is looked at, ms."""
_SHORT = 1e-3
"""Shorter waits are slept, s: `wait` takes whole milliseconds."""
_BEHIND = 0.1
"""Lag behind its pace that a swarm in lockstep catches up, wall s; beyond it, the pace is put back."""


@compiled_apart
def _sense(fleet, i, tick, now_us, seed, true, measured, state, controls):
    cycle.sense(fleet, i, tick, now_us, seed, true, measured, state, controls)


@compiled_apart
def _advance(fleet, i, start_us, period_us, step_us):
    return cycle.advance(fleet, i, start_us, period_us, step_us)


@compiled_within
def _now(group, timing):
    return group.tick[0] * timing.period_us


@compiled_within
def _answers_last(group, timing, i):
    """Whether the newest command of vehicle ``i`` answers its last state."""
    return group.tick[0] > 0 and group.answered[i] == _now(group, timing) - timing.period_us


@compiled_within
def tick(group, timing):
    """One tick of the vehicles: the newest commands come into force, states go out, and all fly on to the next."""
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1:
            bring_into_force(group, timing, i)
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1:
            state, controls = group.states[i], group.controls[i]
            now_us = _now(group, timing)
            _sense(group.fleet, i, group.tick[0], now_us, timing.seed, group.true[i], group.measured, state, controls)
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1:
            transmit(group, timing, i)
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1:
            record(group, timing, i)
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1:
            fly_on(group, timing, i)


@compiled_within
def bring_into_force(group, timing, i):
    """Put the newest command of vehicle ``i`` into force; one that does not answer its last state is late."""
    if group.tick[0] == 0:
        return
    fleet = group.fleet
    if not _answers_last(group, timing, i):
        group.late[i] += 1
    if group.answered[i] < 0:
        return
    if group.travels_by[i] == BY_POSITION:
        copy(group.targets[i], fleet.target[i])
        return
    if group.travels_by[i] == BY_ATTITUDE:
        copy(group.received[i], group.latched)
    else:
        decode_command(group.received[i], fleet.travel[i], group.latched)
    latch(fleet, i, group.latched)


@compiled_within
def transmit(group, timing, i):
    """Send the state of vehicle ``i``; with the command in force, unless it is the one that answers the last state."""
    now_us, state = _now(group, timing), group.states[i]
    if group.travels_by[i] == BY_ATTITUDE:
        n = group.tick[0] % group.paths.shape[1]
        group.path_stamps[i, n] = now_us
        sent = fields(StateMessage, state)
        store(path_of(sent.vx, sent.vy, sent.vz), group.paths[i, n])
    as_answered = _answers_last(group, timing, i) and group.delays[i] == 0
    send_state(group.wire, i, now_us, state, group.controls[i], not as_answered)


@compiled_within
def _write_truth(group, i, now_us, out):
    """Write truth, commands, what acts and conditions of vehicle ``i`` into ``out``, see ``process.truth_array``."""
    commands = group.true.shape[1]
    acting = commands + group.controls.shape[1]
    copy(group.true[i], out)
    copy(group.fleet.command[i], out[commands:])
    copy(group.fleet.acting[i], out[acting:])
    _conditions(group.fleet, i, now_us / 1e6, out[acting + group.controls.shape[1] :])


@compiled_within
def record(group, timing, i):
    """Fill a row of the recording of vehicle ``i``, where one is due."""
    if group.tick[0] % timing.record_every != 0:
        return
    now_us = _now(group, timing)
    row = group.rows.values[i, group.rows.filled[i]]
    row[0], row[1] = now_us / 1e6, float(group.fleet.uav[i])
    _write_truth(group, i, now_us, row[2:])
    if group.fleet.zones.shape[0] > 0:
        row[row.shape[0] - 1] = clearance(group.fleet.zones, group.true[i, X], group.true[i, Z])
    group.rows.filled[i] += 1


@compiled_within
def fly_on(group, timing, i):
    """Fly vehicle ``i`` for one period; one that leaves its model is lost."""
    why = _advance(group.fleet, i, _now(group, timing), timing.period_us, timing.step_us)
    if why > 0:
        group.why[i] = why
        group.alive[i] = 0
        group.lost[0] += 1


@compiled_within
def report_truth(group, timing):
    """Set the truth reports of the living vehicles after this tick."""
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1:
            _write_truth(group, i, _now(group, timing), group.truth_reports[i])


# The flight of a vehicle process: ticks, and waiting for them.


@compiled_within
def _read_command(group, timing, i):
    """Read a command for vehicle ``i`` in the datagram at hand; returns the time (us) of the state that it answers.

    -1 if there is no command, -2 if it is too old.
    """
    wire = group.wire
    if group.travels_by[i] == BY_ACTUATORS:
        return read_command(wire, group.received[i])
    if group.travels_by[i] == BY_POSITION:
        stamp = read_position_target(wire, group.target)
    else:
        stamp = read_attitude_target(wire, group.attitude)
    n = tick_of(stamp, timing.period_us)
    if n < 0:
        return -1
    stamp = n * timing.period_us
    if group.travels_by[i] == BY_POSITION:
        copy(group.target, group.targets[i])
        group.targets[i, 0] = stamp / 1e6
        return stamp
    for n in range(group.paths.shape[1]):
        if group.path_stamps[i, n] == stamp:
            V, gamma, chi = group.paths[i, n, 0], group.paths[i, n, 1], group.paths[i, n, 2]
            travel, code = group.fleet.travel[i], group.fleet.code[i]
            decode_target(group.attitude, V, gamma, chi, travel, code, group.received[i])
            return stamp
    return -2


@compiled_within
def take(group, timing, i):
    """Take in the datagram at hand for vehicle ``i``: GO_ON if it is a command, DATAGRAM if not, see `link.waiting`."""
    stamp = _read_command(group, timing, i)
    if stamp == -1:
        return DATAGRAM
    if group.alive[i] == 0:
        # A lost aircraft reports that again, each time it is asked.
        send_again(group.wire, i)
    else:
        group.answered[i] = max(group.answered[i], stamp)
    return GO_ON


@compiled_within
def listen(group, timing, until):
    """Read what the autopilots sent, until all have answered ``until`` (us); if that is negative, all there is."""
    for i in range(group.alive.shape[0]):
        for _ in range(_DATAGRAMS):
            if until >= 0 and (group.alive[i] == 0 or group.answered[i] >= until):
                break
            if not receive_datagram(group.wire, i):
                break
            cause = take(group, timing, i)
            if cause != GO_ON:
                return cause
    return GO_ON


@compiled_within
def _all_answered(group, stamp):
    missing = 0
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1 and group.answered[i] < stamp:
            missing += 1
    return missing == 0


@compiled_within
def due_at(group, timing):
    """Wall time at which the next tick is due, s."""
    pace = group.pace
    return pace[0] + (group.tick[0] - pace[1]) * (timing.period_us / 1e6) / pace[2]


@compiled_within
def ask_again(group, wanted, now):
    """Send states again that are not answered: a datagram may be lost."""
    if wanted < 0 or now - group.since[0] < RESEND:
        return
    group.since[0] = now
    for i in range(group.alive.shape[0]):
        if group.alive[i] == 1 and group.answered[i] < wanted:
            send_again(group.wire, i)


@compiled_within
def something_to_do(group, timing):
    """Whether Python has something to do after this tick: rows to write, losses and events to report, truth to send."""
    if group.fleet.events.used[0] > 0 or group.lost[0] > 0 or group.tick[0] % group.truth_every[0] == 0:
        return True
    if group.tick[0] % ticks_a_second(timing.period_us) == 0:
        return True
    return group.tick[0] == timing.ticks or is_full(group.rows)


@compiled_to_wait
def fly(group, timing, lockstep):
    """Fly tick after tick until Python has something to do; returns the cause, see `link.waiting`.

    A tick waits for its time, in lockstep also for the answers to the last states. In lockstep a swarm that has fallen
    behind its pace continues at that pace, without catching up.
    """
    others = group.alive.shape[0]
    while True:
        over = group.tick[0] > timing.ticks or not group.alive.any()
        held = group.tick[0] > group.limit[0] and not over
        wanted = _now(group, timing) - timing.period_us if lockstep and not held else -1
        cause = listen(group, timing, wanted)
        if cause != GO_ON:
            return cause
        answered = wanted < 0 or _all_answered(group, wanted)
        now = monotonic(group.room)
        if now >= group.attention[0]:
            return ATTEND
        rest = 0.0 if over or held else due_at(group, timing) - now
        if answered and rest <= 0.0 and not held:
            if over:
                return FLOWN
            if lockstep and rest < -_BEHIND:
                group.pace[0] += -rest - _BEHIND
            tick(group, timing)
            group.since[0] = now
            work = something_to_do(group, timing)
            if work:
                report_truth(group, timing)
            group.tick[0] += 1
            if work:
                return WORK
        elif 0.0 < rest < _SHORT:
            pause(rest, group.room)
        else:
            # Before the tick is due, wait for other descriptors alone: the sockets are read then, all at once.
            first, milliseconds = (others, min(int(rest * 1e3), _LOOK)) if rest > 0.0 else (0, _LOOK)
            ask_again(group, wanted, now)
            wait(group.wire.polled[first:], milliseconds)
            if is_readable(group.wire, others):
                return ATTEND
            if held:
                return HELD
