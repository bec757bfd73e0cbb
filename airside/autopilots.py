"""The autopilots of a process as plain arrays, a row each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.defence.arrays import Defence, new_defence
from ftcc.airside.diagnosis.arrays import Diagnosis, new_diagnosis
from ftcc.airside.diagnosis.beliefs import HEALTH_SHARED, belief_signals
from ftcc.airside.diagnosis.cooperation_arrays import Cooperation, new_cooperation
from ftcc.airside.flight_path import Own
from ftcc.airside.references.longitudinal import Reference
from ftcc.airside.references.profiles import (
    FROM_GROUND,
    PROFILE_PARAMETERS,
    PROFILE_STATES,
    TRIGGER_COLUMNS,
    new_profile_state,
    profile_arrays,
    trigger_rows,
)
from ftcc.airside.scheme import Quantity, Scheme
from ftcc.airside.schemes import find
from ftcc.airside.spec import AutopilotSpec, is_active
from ftcc.link.actuators import SLOT
from ftcc.link.channel import Channel, Inbox, new_inbox
from ftcc.link.compiled import width
from ftcc.link.events import EventList, new_events
from ftcc.link.flight_modes import MISSION
from ftcc.link.messages import PositionTarget
from ftcc.link.timing import Timing

__all__ = ["Autopilots", "build", "recorded_signals"]


class Autopilots(NamedTuple):
    """k autopilots of one scheme."""

    own: NDArray[np.float64]
    """(k, n): see `Own`."""
    reference: NDArray[np.float64]
    """(k, n): the ``Reference`` of the scheme's plant."""
    reference_parameters: NDArray[np.float64]
    """(k, n): see `OwnReference`."""
    reference_commands: NDArray[np.float64]
    """(k, m, c): see `OwnReference`; unused rows have time inf. The last two are free for commands from the ground."""
    state: NDArray[np.float64]
    """(k, n): the scheme's ``State``."""
    output: NDArray[np.float64]
    """(k, n): the scheme's ``Output`` of the last step."""
    started: NDArray[np.int64]
    """(k,): 1 once the law has its initial state."""
    stepping: NDArray[np.int64]
    """(1,): whose law was called last."""
    gains: NDArray[np.float64]
    """(k, n): the scheme's ``Gains``."""
    model: NDArray[np.float64]
    """(k, n): see `Model`."""
    weight: NDArray[np.float64]
    """(k, n): a_ij of the in-edges; less of those who have left."""
    leader: NDArray[np.int64]
    """(k,): 1 for a leader."""
    command: NDArray[np.float64]
    """(k, 4): command by slot."""
    target: NDArray[np.float64]
    """(k, n): see `PositionTarget`."""
    shared: NDArray[np.float64]
    """(k, m): what the neighbours hear, in the order of the scheme's ``SHARED``."""
    signals: NDArray[np.float64]
    """(k, n): the scheme's ``SIGNALS``; nan for a leader."""
    travel: NDArray[np.float64]
    """(k, 4): full deflection of the actuators."""
    code: NDArray[np.float64]
    """(k, n): see `AttitudeCode`."""
    datum: NDArray[np.float64]
    """(k,): altitude from which that in the vehicle's messages counts, m."""
    offset: NDArray[np.float64]
    """(k,): lateral position, m."""
    profile: NDArray[np.float64]
    """(k, n): parameters of the leaders' profiles, see `profile_arrays`."""
    profile_commands: NDArray[np.float64]
    """(k, n, 3): their commands by time; unused rows have time inf. The last `FROM_GROUND` are the ground's."""
    profile_triggers: NDArray[np.float64]
    """(k, n, 4): their commands by position, see `trigger_rows`; unused rows have position inf."""
    profile_state: NDArray[np.float64]
    """(k, n): see `new_profile_state`."""
    leader_shares: NDArray[np.int64]
    """(m,): which entries of its `Reference` a leader shares; -1 = unused."""
    actuator: NDArray[np.int64]
    """(n,): slot of each of the scheme's commands."""
    course: NDArray[np.float64]
    """(k,): course that `lateral_hold` keeps, rad; nan = it does nothing."""
    mode: NDArray[np.int64]
    """(k,): flight mode, see `link.flight_modes`."""
    held_us: NDArray[np.int64]
    """(k,): time spent in hold, by which the clocks of references are behind, us."""
    defence: Defence
    """What is left of what neighbours tell; one comparison where it is off."""
    diagnosis: Diagnosis | None
    """None without active fault tolerance."""
    cooperation: Cooperation | None
    """As above."""
    events: EventList
    """What leaders, and UAVs that leave or change a belief, have to report, see `leader.drain_leader_events`."""


class _Profiles(NamedTuple):
    """The leaders' profiles as arrays, see the fields of `Autopilots`; a follower's rows are not used."""

    parameters: NDArray[np.float64]
    commands: NDArray[np.float64]
    triggers: NDArray[np.float64]
    state: NDArray[np.float64]


def _profiles_of(specs: Sequence[AutopilotSpec], timing: Timing) -> _Profiles:
    k = len(specs)
    arrays = [profile_arrays(spec.profile, timing.period) if spec.profile else None for spec in specs]
    commands = max([1 + FROM_GROUND] + [len(pair[1]) for pair in arrays if pair])
    triggers = max([1] + [len(spec.profile.triggers) for spec in specs if spec.profile])
    profiles = _Profiles(
        parameters=np.zeros((k, PROFILE_PARAMETERS)),
        commands=np.full((k, commands, 3), math.inf),
        triggers=np.full((k, triggers, TRIGGER_COLUMNS), math.inf),
        state=np.zeros((k, PROFILE_STATES)),
    )
    for i, (spec, pair) in enumerate(zip(specs, arrays, strict=True)):
        if pair and spec.profile:
            profiles.parameters[i], profiles.commands[i, : len(pair[1])] = pair
            senders = [neighbour.uav for neighbour in spec.neighbours]
            profiles.triggers[i, : len(spec.profile.triggers)] = trigger_rows(spec.profile, spec.uav, senders)
            profiles.state[i] = new_profile_state(spec.profile)
    return profiles


def _reference_commands_of(specs: Sequence[AutopilotSpec]) -> NDArray[np.float64]:
    """The commands of the UAVs' own references as one table, with two free last rows."""
    tables = [spec.reference.commands for spec in specs]
    columns = max([1] + [len(row) for table in tables for row in table])
    commands = np.full((len(specs), max(map(len, tables)) + 2, columns), math.inf)
    for rows, table in zip(commands, tables, strict=True):
        for row, given in zip(rows, table, strict=False):
            row[:] = given
    return commands


def _inbox_of(specs: Sequence[AutopilotSpec], values: int) -> tuple[Inbox, NDArray[np.float64]]:
    """The inbox with the quality of every in-edge and what is known before take-off; the weights of the in-edges."""
    senders = [[neighbour.uav for neighbour in spec.neighbours] for spec in specs]
    inbox = new_inbox(senders, [spec.uav for spec in specs], values, Channel())
    weight = np.zeros(inbox.valid.shape)
    for i, spec in enumerate(specs):
        inbox.quality[i, :] = spec.channel
        for edge, neighbour in enumerate(spec.neighbours):
            weight[i, edge] = neighbour.weight
            if neighbour.briefing:
                inbox.values[i, edge, : len(neighbour.briefing)] = neighbour.briefing
                inbox.valid[i, edge] = 1.0
    return inbox, weight


def _leader_shares(scheme: Scheme, shared_width: int) -> NDArray[np.int64]:
    shares = [Reference._fields.index(quantity.name) for quantity in scheme.shared.get("leader", ())]
    return np.array(shares + [-1] * (shared_width - len(shares)), np.int64)


def recorded_signals(spec: AutopilotSpec) -> tuple[Quantity, ...]:
    """What an autopilot records, the same for all of a swarm: the scheme's signals, then those of diagnosis."""
    beliefs = belief_signals(spec.diagnosis.actuators) if spec.diagnosis.on else ()
    return (*find(spec.scheme).signals, *beliefs)


def build(specs: Sequence[AutopilotSpec], timing: Timing) -> tuple[Autopilots, Inbox]:
    """Arrays for ``specs``, which share one scheme, before the first tick."""
    scheme: Scheme = find(specs[0].scheme)
    k = len(specs)
    active = is_active(specs)
    shared_width = scheme.shared_width + (len(HEALTH_SHARED) if active else 0)
    inbox, weight = _inbox_of(specs, shared_width)
    profiles = _profiles_of(specs, timing)
    leader = np.array([spec.role == "leader" for spec in specs], np.int64)
    signals = np.zeros((k, len(recorded_signals(specs[0]))))
    signals[leader == 1] = math.nan
    autopilots = Autopilots(
        own=np.zeros((k, len(Own._fields))),
        reference=np.array([spec.reference.initial for spec in specs], np.float64),
        reference_parameters=np.array([spec.reference.parameters for spec in specs], np.float64),
        reference_commands=_reference_commands_of(specs),
        state=np.zeros((k, width(scheme.module.State))),
        output=np.zeros((k, width(scheme.module.Output))),
        started=np.zeros(k, np.int64),
        stepping=np.zeros(1, np.int64),
        gains=np.array([spec.gains for spec in specs], np.float64),
        model=np.array([spec.model for spec in specs], np.float64),
        weight=weight,
        leader=leader,
        command=np.array([spec.command for spec in specs], np.float64),
        target=np.zeros((k, len(PositionTarget._fields))),
        shared=np.zeros((k, shared_width)),
        signals=signals,
        travel=np.array([spec.travel for spec in specs], np.float64),
        code=np.array([spec.attitude_code for spec in specs], np.float64),
        datum=np.array([spec.datum for spec in specs], np.float64),
        offset=np.array([spec.offset for spec in specs], np.float64),
        profile=profiles.parameters,
        profile_commands=profiles.commands,
        profile_triggers=profiles.triggers,
        profile_state=profiles.state,
        leader_shares=_leader_shares(scheme, shared_width),
        actuator=np.array([SLOT[name] for name in scheme.commands], np.int64),
        course=np.array([math.nan if spec.course is None else spec.course for spec in specs]),
        mode=np.full(k, MISSION),
        held_us=np.zeros(k, np.int64),
        defence=new_defence(specs, scheme, inbox.valid.shape[1], shared_width),
        diagnosis=new_diagnosis(specs, len(scheme.signals), scheme.shared_width) if active else None,
        cooperation=new_cooperation(specs, scheme, weight, profiles.parameters, shared_width) if active else None,
        events=new_events(),
    )
    return autopilots, inbox
