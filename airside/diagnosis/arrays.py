"""What the stage `diagnose` works on, a row per UAV."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.diagnosis.beliefs import new_beliefs, new_health
from ftcc.airside.diagnosis.decision import SLEWS, SUMS
from ftcc.airside.diagnosis.estimator import STATES
from ftcc.airside.diagnosis.events import new_announced, new_details
from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.airside.diagnosis.motion import Motion
from ftcc.airside.flight_path import Own
from ftcc.airside.spec import AutopilotSpec
from ftcc.link.actuators import ACTUATORS, in_slots
from ftcc.link.compiled import Room, width

__all__ = ["RECENT", "Diagnosis", "Memory", "Seen", "Trial", "new_diagnosis"]

RECENT = 128
"""Ticks that are remembered, to estimate from the onset of a fault on."""


class Memory(NamedTuple):
    """What is remembered of a UAV as a whole."""

    begun_at: float
    """Time of the first tick, s; nan before it."""
    path: float
    """Observer of the flight path: its error, rad,"""
    path_base: float
    """what it has learned to expect, rad/s,"""
    path_mean: float
    """and the recent mean of its residual, rad/s."""
    bank_slip: float
    """Observers of the kinematics of bank, angle of attack and sideslip: their errors, rad."""
    alpha_slip: float
    beta_slip: float
    excused_until: float
    """Until when alarms are put down to a navigation fault, s."""


class Trial(NamedTuple):
    """What is remembered of an actuator."""

    position: float
    """By the nominal actuator, without a fault; its unit."""
    rate: float
    """Of it, where it is of second order, unit/s."""
    direct: float
    """Observer of the motion: its error, unit times s,"""
    direct_base: float
    """what it has learned to expect, unit,"""
    direct_mean: float
    """and the recent mean of its residual, unit."""
    air_square: float
    """Of the flight path's residual in the actuator's unit: recent mean square, unit^2, product with ``direct``."""
    air_product: float
    regressor_mean: float
    """Recent mean of the uncertain part of the drift, unit."""
    up: float
    """Sums of the test, in both directions, unit times s."""
    down: float
    quiet_at: float
    """When the larger one was last zero, s."""
    apart: float
    """Recent mean of what only the flight path says, unit."""
    kept_effectiveness: float
    """Before the alarm: effectiveness of the healthy actuator beside that of the nominal one,"""
    kept_sd: float
    """Standard deviation of the former,"""
    kept_bias: float
    """additive effect,"""
    candidate: float
    """Kind that data speak for at present, and since when, s."""
    candidate_since: float
    whole: float
    """Observer of the motion against a healthy actuator: its error, unit times s."""
    filtered: float
    """``position`` through the filter of the residuals."""
    sums: Annotated[NDArray[np.float64], Room((SUMS,))]
    """Weighted sums since the alarm, see `decision.gather`."""
    slow: Annotated[NDArray[np.float64], Room((len(SLEWS),))]
    """The bank of slow actuators, see `decision.follow`."""
    lagging: Annotated[NDArray[np.float64], Room((len(SLEWS),))]
    off: Annotated[NDArray[np.float64], Room((len(SLEWS),))]
    square: Annotated[NDArray[np.float64], Room((len(SLEWS),))]
    x: Annotated[NDArray[np.float64], Room((STATES,))]
    """State and covariance of the filter, see `estimator`."""
    P: Annotated[NDArray[np.float64], Room((STATES, STATES))]


class Seen(NamedTuple):
    """What a tick showed of an actuator, as `estimator.predict` takes it."""

    step: float
    drift: float
    regressor: float
    position: float


class Diagnosis(NamedTuple):
    """Of k autopilots of a swarm with active fault tolerance; a is 4, the slots of the actuators."""

    on: NDArray[np.int64]
    """(k,): 1 where it is on."""
    accommodates: NDArray[np.int64]
    """(k,): 1 where the own law is told."""
    cooperates: NDArray[np.int64]
    """(k,): 1 where the swarm makes room."""
    shares: NDArray[np.int64]
    """(1,): index in a record at which `Health` begins."""
    columns: NDArray[np.int64]
    """(1,): index in ``signals`` at which beliefs begin."""
    gains: NDArray[np.float64]
    """(k, n): see `DiagnosisGains`."""
    has: NDArray[np.int64]
    """(k, 4): 1 where the aircraft has that actuator."""
    point: NDArray[np.int64]
    """(k,): 1 for an aircraft that is steered by load factor and bank."""
    travel: NDArray[np.float64]
    """(k, 4): full deflection of the actuators, rad and N."""
    lag: NDArray[np.float64]
    """(k, 4): nominal bandwidth of the actuators, rad/s; 0 = none."""
    damping: NDArray[np.float64]
    """(k, 4): nominal damping of second-order ones; 0 = first order."""
    positions: NDArray[np.float64]
    """(k, 4): mean positions of the nominal actuators since the tick before."""
    memory: NDArray[np.float64]
    """(k, n): see `Memory`."""
    before: NDArray[np.float64]
    """(k, n): `Own` of the tick before."""
    motion: NDArray[np.float64]
    """(k, 4, n): the `Motion` of each actuator at this tick."""
    trial: NDArray[np.float64]
    """(k, a, n): see `Trial`."""
    recent: NDArray[np.float64]
    """(k, a, `RECENT`, 4): of the last ticks, see `Seen`."""
    recent_at: NDArray[np.int64]
    """(k,): number of ticks since the first."""
    belief: NDArray[np.float64]
    """(k, a, n): see `Belief`."""
    health: NDArray[np.float64]
    """(k, n): see `Health`."""
    announced: NDArray[np.float64]
    """(k, a, n): see `events.Announced`."""
    details: NDArray[np.float64]
    """(rows, n): numbers of the events in ``Autopilots.events``, see `events.new_details`."""
    assumed: NDArray[np.float64]
    """(k, 4, 2): effectiveness and bias that the law is told of."""
    model: NDArray[np.float64]
    """(k, n): the `Model` that the law is told of."""
    own: NDArray[np.float64]
    """(k, n): `Own` with the command in force as it acts by what is believed."""


def new_diagnosis(specs: Sequence[AutopilotSpec], signals: int, shared: int) -> Diagnosis:
    """Before the first tick; ``signals`` and ``shared`` are the numbers of values of the scheme itself."""
    k = len(specs)
    named = [(spec, in_slots(spec.diagnosis.actuators)) for spec in specs]
    a = len(ACTUATORS)
    trial = np.zeros((k, a, width(Trial)))
    gains = np.array([spec.diagnosis.gains for spec in specs], np.float64)
    first = Trial._fields.index
    trial[:, :, first("kept_effectiveness")] = 1.0
    trial[:, :, first("candidate_since")] = math.inf
    at = width(Trial) - STATES * STATES
    spread_coefficient = gains[:, DiagnosisGains._fields.index("sd_coefficient")]
    for i in range(k):
        trial[i, :, at - STATES + 1] = 1.0
        for n in (1, 3):
            trial[i, :, at + n * STATES + n] = spread_coefficient[i] ** 2
    memory = np.zeros((k, width(Memory)))
    memory[:, Memory._fields.index("begun_at")] = math.nan
    assumed = np.zeros((k, len(ACTUATORS), 2))
    assumed[:, :, 0] = 1.0
    return Diagnosis(
        on=np.array([spec.diagnosis.on and spec.role == "follower" for spec in specs], np.int64),
        accommodates=np.array([spec.diagnosis.accommodates for spec in specs], np.int64),
        cooperates=np.array([spec.diagnosis.cooperates for spec in specs], np.int64),
        shares=np.array([shared], np.int64),
        columns=np.array([signals], np.int64),
        gains=gains,
        has=np.array([[name in spec.diagnosis.actuators for name in slots] for spec, slots in named], np.int64),
        point=np.array(["bank" in spec.diagnosis.actuators for spec in specs], np.int64),
        travel=np.array([spec.travel for spec in specs], np.float64),
        lag=np.array([spec.diagnosis.lag for spec in specs], np.float64),
        damping=np.array([spec.diagnosis.damping for spec in specs], np.float64),
        positions=np.zeros((k, len(ACTUATORS))),
        memory=memory,
        before=np.zeros((k, len(Own._fields))),
        motion=np.zeros((k, len(ACTUATORS), len(Motion._fields))),
        trial=trial,
        recent=np.zeros((k, a, RECENT, len(Seen._fields))),
        recent_at=np.zeros(k, np.int64),
        belief=new_beliefs(k, a),
        health=new_health(k),
        announced=new_announced(k, a),
        details=new_details(),
        assumed=assumed,
        model=np.array([spec.model for spec in specs], np.float64),
        own=np.zeros((k, len(Own._fields))),
    )
