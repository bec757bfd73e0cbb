"""The vehicles of a process as plain arrays: all that their compiled flight works on, from datagram to datagram."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.attitude_target import TARGET
from ftcc.link.mavlink import SIMULATOR
from ftcc.link.recording import Rows
from ftcc.link.wire import BY_ACTUATORS, BY_ATTITUDE, BY_POSITION, STATE, Wire, new_wire
from ftcc.sim.plant import TRUTH, Fleet
from ftcc.sim.plants import conditions_of
from ftcc.sim.spec import VehicleSpec, build

__all__ = ["PATHS", "VehicleGroup", "build_group", "knowledge_width"]

PATHS = 16
"""States whose path a vehicle remembers, for commands that come late."""

_NEVER = np.iinfo(np.int64).max


class VehicleGroup(NamedTuple):
    """k vehicles of one plant that fly in one process."""

    fleet: Fleet
    wire: Wire
    rows: Rows
    """Of the recording."""
    alive: NDArray[np.int64]
    """(k,): 0 once a vehicle is lost."""
    why: NDArray[np.int64]
    """(k,): why, a key of ``plant.LOST``."""
    lost: NDArray[np.int64]
    """(1,): vehicles that were lost in flight and of which nobody was told yet."""
    true: NDArray[np.float64]
    """(k, 13): the states of this tick, in the order of ``TRUTH``."""
    seen: NDArray[np.float64]
    """(13,): room for one as measured."""
    states: NDArray[np.float64]
    """(k, 13): as the autopilots are told, see ``wire.STATE``."""
    controls: NDArray[np.float64]
    """(k, 4): the commands in force, fractions of travel."""
    travels_by: NDArray[np.int64]
    """(k,): how commands travel to a vehicle, see `wire`."""
    delays: NDArray[np.int64]
    """(k,): samples by which a command acts later than it has to."""
    received: NDArray[np.float64]
    """(k, 4): the newest commands: fractions of travel, or, if they come as attitude targets, rad, N, load factor."""
    targets: NDArray[np.float64]
    """(k, 7): the newest targets of reference points."""
    attitude: NDArray[np.float64]
    """(5,): room for an attitude target,"""
    target: NDArray[np.float64]
    """(7,): and for one of a reference point."""
    latched: NDArray[np.float64]
    """(4,): room for a command on its way into force."""
    answered: NDArray[np.int64]
    """(k,): stamp of the newest state that was answered, us; -1 before the first."""
    path_stamps: NDArray[np.int64]
    """(k, PATHS): stamps of the last states sent, us."""
    paths: NDArray[np.float64]
    """(k, PATHS, 3): their speed, flight-path angle and course."""
    late: NDArray[np.int64]
    """(k,): ticks at which no command answered the state before."""
    known: NDArray[np.float64]
    """(k, n): what only the simulator knows, in the order of ``process.truth_array``, without the last."""
    truth_every: NDArray[np.int64]
    """(1,): ticks between two looks whether the station is to be told the truth."""
    tick: NDArray[np.int64]
    """(1,): the next one."""
    limit: NDArray[np.int64]
    """(1,): the last one that may be flown at present."""
    pace: NDArray[np.float64]
    """(3,): wall time (monotonic, s) at which a tick is due, that tick, and simulated seconds per second."""
    attention: NDArray[np.float64]
    """(1,): wall time from which on Python wants to look around, s."""
    since: NDArray[np.float64]
    """(1,): wall time since which answers are awaited, s."""
    room: NDArray[np.int64]
    """(2,): for the clock, see `system_calls`."""


def knowledge_width(plant: str) -> int:
    """How many numbers only the simulator knows of a vehicle: truth, commands, what acts, conditions."""
    return len(TRUTH) + 8 + len(conditions_of(plant))


def _travels_by(spec: VehicleSpec) -> int:
    if spec.kind == "reference_point":
        return BY_POSITION
    return BY_ATTITUDE if spec.attitude_code.loading > 0.0 else BY_ACTUATORS


def build_group(specs: Sequence[VehicleSpec], rows: Rows, truth_every: int) -> VehicleGroup:
    """Arrays for ``specs``, which share one plant, before the first tick; ``truth_every`` ticks the station is told."""
    k = len(specs)
    return VehicleGroup(
        fleet=build(specs),
        wire=new_wire([spec.uav for spec in specs], SIMULATOR),
        rows=rows,
        alive=np.ones(k, np.int64),
        why=np.zeros(k, np.int64),
        lost=np.zeros(1, np.int64),
        true=np.zeros((k, len(TRUTH))),
        seen=np.zeros(len(TRUTH)),
        states=np.zeros((k, len(STATE))),
        controls=np.zeros((k, 4)),
        travels_by=np.array([_travels_by(spec) for spec in specs], np.int64),
        delays=np.array([spec.delay for spec in specs], np.int64),
        received=np.zeros((k, 4)),
        targets=np.zeros((k, 7)),
        attitude=np.zeros(len(TARGET)),
        target=np.zeros(7),
        latched=np.zeros(4),
        answered=np.full(k, -1, np.int64),
        path_stamps=np.full((k, PATHS), -1, np.int64),
        paths=np.zeros((k, PATHS, 3)),
        late=np.zeros(k, np.int64),
        known=np.zeros((k, knowledge_width(specs[0].plant))),
        truth_every=np.full(1, truth_every),
        tick=np.zeros(1, np.int64),
        limit=np.full(1, _NEVER),
        pace=np.array([0.0, 0.0, math.inf]),
        attention=np.zeros(1),
        since=np.zeros(1),
        room=np.zeros(2, np.int64),
    )
