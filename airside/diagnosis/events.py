"""Changes of what a UAV believes of its actuators as events: noted by the tick with their numbers, worded later."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ftcc.airside.diagnosis.beliefs import (
    BIAS,
    FAULTY,
    HEALTHY,
    KINDS,
    LOSS,
    SENSOR,
    SUSPECTED,
    WRONG,
    Belief,
)
from ftcc.link.actuators import unit_of
from ftcc.link.compiled import compiled_within, copy, fields, store, width
from ftcc.link.events import CAPACITY, note

__all__ = ["BELIEVES", "Announced", "belief_text", "new_announced", "new_details", "note_beliefs"]

BELIEVES = 7
"""Kind of the events of this module; their number is the slot of the actuator."""

_STATE, _KIND = (Belief._fields.index(name) for name in ("state", "kind"))


class Announced(NamedTuple):
    """What was last announced of an actuator: a row of ``Diagnosis.announced``."""

    state: float
    """Index into `STATES`, never *suspected*."""
    kind: float
    """Index into `KINDS`."""


def new_announced(k: int, actuators: int) -> NDArray[np.float64]:
    """(k, actuators, n): `Announced` before the first tick, all healthy."""
    return np.zeros((k, actuators, width(Announced)))


def new_details() -> NDArray[np.float64]:
    """(rows, n): by row of the list of events, the state announced before and the new `Belief`."""
    return np.zeros((CAPACITY, 1 + width(Belief)))


@compiled_within
def note_beliefs(autopilots, i, now_us):
    """Note an event for each actuator of UAV ``i`` of which it believes something else than was last announced.

    *Suspected* is announced to nobody, nor a suspicion that has come to nothing.
    """
    d = autopilots.diagnosis
    for slot in range(d.belief.shape[1]):
        state, kind = d.belief[i, slot, _STATE], d.belief[i, slot, _KIND]
        announced = fields(Announced, d.announced[i, slot])
        if state == SUSPECTED or (state == announced.state and kind == announced.kind):
            continue
        n = autopilots.events.used[0]
        note(autopilots.events, now_us, i, BELIEVES, slot)
        if autopilots.events.used[0] > n:
            # In a full list it waits for the next tick.
            d.details[n, 0] = announced.state
            copy(d.belief[i, slot], d.details[n, 1:])
            store(Announced(state, kind), d.announced[i, slot])


def belief_text(actuator: str, before: float, belief: Belief) -> tuple[str, str]:
    """Severity and text of a change of ``belief`` about an ``actuator``; ``before`` is the state announced before.

    What a STATUSTEXT of 50 characters must not lose comes first.
    """
    name = actuator.replace("_", " ")
    if belief.state == HEALTHY:
        return "info", f"{name} healthy again"
    if belief.state != FAULTY:
        if before == FAULTY:
            return "warning", f"{name}: its fault has changed, not known yet how"
        delay = belief.detected_at - belief.suspected_at
        return (
            "warning",
            f"{name}: something is wrong, not known yet what (noticed {delay:.2f} s after it began)",
        )
    kind = int(belief.kind)
    if kind >= SENSOR:
        return "warning", f"{name} not faulty itself: {KINDS[kind]}"
    bias = f"{belief.bias:.2f} +- {belief.bias_sd:.2f}"
    if unit_of(actuator) != "-":
        bias += f" {unit_of(actuator)}"
    effectiveness = f"effectiveness {belief.effectiveness:.2f} +- {belief.effectiveness_sd:.2f}"
    if kind == BIAS:
        return "warning", f"{name} faulty: bias {bias}"
    if kind == WRONG:
        return "warning", f"{name} faulty: {KINDS[kind]}, {effectiveness}, bias {bias}"
    if kind == LOSS:
        return "warning", f"{name} faulty: {KINDS[kind]}, {effectiveness}"
    return "warning", f"{name} faulty: {KINDS[kind]}"
