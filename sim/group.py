"""The vehicles of a vehicle process as plain arrays: the fleet, its wire, and what a tick works on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.link.actuators import ACTUATORS
from ftcc.link.mavlink import SIMULATOR
from ftcc.link.messages import AttitudeTarget, PositionTarget, StateMessage
from ftcc.link.recording import Rows
from ftcc.link.wire import BY_ACTUATORS, BY_ATTITUDE, BY_POSITION, Wire, new_wire
from ftcc.sim.build import build_fleet
from ftcc.sim.fleet import Fleet
from ftcc.sim.plant import TRUTH
from ftcc.sim.plants import conditions_of
from ftcc.sim.spec import VehicleSpec

__all__ = ["PATHS", "VehicleGroup", "build_group", "truth_report_width"]

PATHS = 16
"""States whose path a vehicle remembers, for commands that come late."""

_NEVER = np.iinfo(np.int64).max


class VehicleGroup(NamedTuple):
    """k vehicles of one plant that fly in one process."""

    fleet: Fleet
    wire: Wire
    rows: Rows
    """Rows of the recording."""
    alive: NDArray[np.int64]
    """(k,): 0 once a vehicle is lost."""
    why: NDArray[np.int64]
    """(k,): why a vehicle is lost, a key of ``plant.LOST``; 0 = reported, or not lost."""
    lost: NDArray[np.int64]
    """(1,): vehicles lost in flight whose loss is not reported yet."""
    true: NDArray[np.float64]
    """(k, 13): the true states of this tick, in the order of ``plant.TRUTH``."""
    measured: NDArray[np.float64]
    """(13,): room for one of them as measured."""
    states: NDArray[np.float64]
    """(k, 13): the states as sent, see ``messages.StateMessage``."""
    controls: NDArray[np.float64]
    """(k, 4): the commands in force, fractions of travel."""
    travels_by: NDArray[np.int64]
    """(k,): how commands travel to a vehicle: BY_ACTUATORS, BY_ATTITUDE or BY_POSITION of `wire`."""
    delays: NDArray[np.int64]
    """(k,): samples by which a command acts later than it has to."""
    received: NDArray[np.float64]
    """(k, 4): the newest commands: fractions of travel, or, if they come as attitude targets, rad, N, load factor."""
    targets: NDArray[np.float64]
    """(k, 7): the newest targets of reference points, see ``messages.PositionTarget``."""
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
    truth_reports: NDArray[np.float64]
    """(k, n): the truth for the station, in the order of ``process.truth_array``, without the last."""
    truth_every: NDArray[np.int64]
    """(1,): ticks between two times at which a truth report may be due."""
    tick: NDArray[np.int64]
    """(1,): the next tick."""
    limit: NDArray[np.int64]
    """(1,): the last tick that may be flown at present."""
    pace: NDArray[np.float64]
    """(3,): wall time (monotonic, s) at which a tick is due, that tick, and simulated seconds per second."""
    attention: NDArray[np.float64]
    """(1,): wall time at which Python checks launcher and clock again, s."""
    since: NDArray[np.float64]
    """(1,): wall time since which answers are awaited, s."""
    room: NDArray[np.int64]
    """(2,): for the clock, see `system_calls`."""


def truth_report_width(plant: str) -> int:
    """Numbers in a row of ``VehicleGroup.truth_reports``: truth, commands, what acts, conditions."""
    return len(TRUTH) + 2 * len(ACTUATORS) + len(conditions_of(plant))


def _travels_by(spec: VehicleSpec) -> int:
    if spec.kind == "reference_point":
        return BY_POSITION
    return BY_ATTITUDE if spec.attitude_code.loading > 0.0 else BY_ACTUATORS


def build_group(specs: Sequence[VehicleSpec], rows: Rows, truth_every: int) -> VehicleGroup:
    """Arrays for ``specs``, which share one plant, before the first tick.

    A truth report may be due every ``truth_every`` ticks.
    """
    k = len(specs)
    return VehicleGroup(
        fleet=build_fleet(specs),
        wire=new_wire([spec.uav for spec in specs], SIMULATOR),
        rows=rows,
        alive=np.ones(k, np.int64),
        why=np.zeros(k, np.int64),
        lost=np.zeros(1, np.int64),
        true=np.zeros((k, len(TRUTH))),
        measured=np.zeros(len(TRUTH)),
        states=np.zeros((k, len(StateMessage._fields))),
        controls=np.zeros((k, len(ACTUATORS))),
        travels_by=np.array([_travels_by(spec) for spec in specs], np.int64),
        delays=np.array([spec.delay for spec in specs], np.int64),
        received=np.zeros((k, len(ACTUATORS))),
        targets=np.zeros((k, len(PositionTarget._fields))),
        attitude=np.zeros(len(AttitudeTarget._fields)),
        target=np.zeros(len(PositionTarget._fields)),
        latched=np.zeros(len(ACTUATORS)),
        answered=np.full(k, -1, np.int64),
        path_stamps=np.full((k, PATHS), -1, np.int64),
        paths=np.zeros((k, PATHS, 3)),
        late=np.zeros(k, np.int64),
        truth_reports=np.zeros((k, truth_report_width(specs[0].plant))),
        truth_every=np.full(1, truth_every),
        tick=np.zeros(1, np.int64),
        limit=np.full(1, _NEVER),
        pace=np.array([0.0, 0.0, math.inf]),
        attention=np.zeros(1),
        since=np.zeros(1),
        room=np.zeros(2, np.int64),
    )
