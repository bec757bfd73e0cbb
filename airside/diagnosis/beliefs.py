"""What a UAV believes of its actuators, and what it tells others of itself: the words, and the columns of a recording.

States and kinds are numbers in arrays and in recordings, words everywhere else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.scheme import Quantity
from ftcc.link.actuators import by_slot, unit_of
from ftcc.link.compiled import width

__all__ = [
    "BIAS",
    "FAULTY",
    "FLOATING",
    "HEALTHY",
    "HEALTH_SHARED",
    "KINDS",
    "LOSS",
    "NOT_ACTUATOR",
    "NO_KIND",
    "SENSOR",
    "SLOW",
    "STATES",
    "STUCK",
    "SUSPECTED",
    "UNDETERMINED",
    "WRONG",
    "Belief",
    "Health",
    "belief_signals",
    "new_beliefs",
    "new_health",
]

STATES = ("healthy", "suspected", "undetermined", "faulty")
"""Of an actuator, in order of severity; *undetermined*: something is wrong, and data do not say yet what."""
HEALTHY, SUSPECTED, UNDETERMINED, FAULTY = range(len(STATES))

KINDS = ("none", "loss", "bias", "loss and bias", "stuck", "floating", "slow", "sensor", "disturbance")
"""Of a fault. *floating*: without any effect; *sensor*, *disturbance*: none of an actuator."""
NO_KIND, LOSS, BIAS, WRONG, STUCK, FLOATING, SLOW, SENSOR, NOT_ACTUATOR = range(len(KINDS))


class Belief(NamedTuple):
    """What a UAV believes of one actuator: a row of ``Diagnosis.belief``."""

    state: float
    """Index into `STATES`."""
    kind: float
    """Index into `KINDS`."""
    effectiveness: float
    """Estimate; 1 = healthy."""
    effectiveness_sd: float
    """Its standard deviation."""
    bias: float
    """Estimate of the lumped additive effect, in the unit of the actuator."""
    bias_sd: float
    """Its standard deviation."""
    evidence: float
    """Of the test that detects: its statistic over its threshold, largest of both directions; >= 1 is an alarm."""
    suspected_at: float
    """s, beginning of what led to the latest alarm; nan: none."""
    detected_at: float
    """s; nan: not."""
    isolated_at: float
    """s; nan: not."""


class Health(NamedTuple):
    """What a UAV tells others of itself: a row of ``Diagnosis.health``; it travels in its records, in this order."""

    state: float
    """The most severe of its actuators, index into `STATES`."""
    effectiveness: float
    """The least of its actuators that are known to be faulty; 1 without a fault."""
    climb_left: float
    """Climb rate that it can keep up besides what level flight takes, m/s; inf is not sent, see `MOST_CLIMB`."""
    belongs: float
    """1: it flies with the swarm; 0: it has left, and others leave it out."""


MOST_CLIMB = 100.0
"""``climb_left`` of an aircraft that nothing limits, m/s."""

_WORDS = {
    "health": "state of {}: 0 healthy, 1 suspected, 2 undetermined, 3 faulty",
    "kind": "kind of fault of {}, see the documentation",
    "effectiveness_hat": "estimated effectiveness of {}",
    "effectiveness_sd": "standard deviation of the estimated effectiveness of {}",
    "bias_hat": "estimated additive effect of {}",
    "bias_sd": "standard deviation of the estimated additive effect of {}",
    "evidence": "statistic of the test of {} over its threshold",
}
"""By beginning of a recorded column: its meaning. The order is that of `Belief`."""

HEALTH_SHARED = (
    Quantity("health", "-", "most severe state of its actuators"),
    Quantity("worst_effectiveness", "-", "least effectiveness of its actuators"),
    Quantity("climb_left", "m/s", "climb rate that it can keep up"),
    Quantity("belongs", "-", "1: flies with the swarm"),
)
"""What records carry behind the scheme's ``SHARED`` where diagnosis is on, as `Health`."""


def belief_signals(actuators: Iterable[str]) -> tuple[Quantity, ...]:
    """The columns that a recording with diagnosis has behind the scheme's signals, for a plant's actuators.

    For each actuator, by slot: ``health_X``, ``kind_X``, ``effectiveness_hat_X``, ``effectiveness_sd_X``,
    ``bias_hat_X``, ``bias_sd_X``, ``evidence_X``; then `HEALTH_SHARED`.
    """
    columns = [
        Quantity(
            f"{name}_{actuator}",
            unit_of(actuator) if name.startswith("bias") else "-",
            meaning.format(actuator),
            role="plain",
        )
        for actuator in by_slot(actuators)
        for name, meaning in _WORDS.items()
    ]
    return (*columns, *HEALTH_SHARED)


def new_beliefs(k: int, actuators: int) -> NDArray[np.float64]:
    """(k, actuators, n): `Belief` in healthy actuators before the first tick."""
    row = Belief(HEALTHY, NO_KIND, 1.0, 0.0, 0.0, 0.0, 0.0, math.nan, math.nan, math.nan)
    beliefs = np.empty((k, actuators, width(Belief)))
    beliefs[:] = row
    return beliefs


def new_health(k: int) -> NDArray[np.float64]:
    """(k, n): `Health` of UAVs before the first tick."""
    health = np.empty((k, width(Health)))
    health[:] = Health(HEALTHY, 1.0, MOST_CLIMB, 1.0)
    return health
