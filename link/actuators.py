"""The actuators in every message, vector and table: their order, and commands as MAVLink carries them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ftcc.link.compiled import compiled

__all__ = [
    "ACTUATORS",
    "AILERON",
    "ELEVATOR",
    "RUDDER",
    "SLOT",
    "THRUST",
    "as_sent",
    "by_slot",
    "decode_command",
    "encode_command",
    "in_slots",
    "unit_of",
]

ACTUATORS = ("aileron", "elevator", "rudder", "thrust")
"""As controls 0-3 of HIL_ACTUATOR_CONTROLS."""

AILERON, ELEVATOR, RUDDER, THRUST = range(4)

SLOT = {name: slot for slot, name in enumerate(ACTUATORS)} | {"bank": AILERON, "load_factor": ELEVATOR}
"""Which control carries an actuator. A point mass is steered by bank and load factor instead of surfaces."""

_UNITS = {"thrust": "N", "load_factor": "-"}


def unit_of(actuator: str) -> str:
    """Unit of a deflection."""
    return _UNITS.get(actuator, "rad")


def in_slots(used: Iterable[str]) -> tuple[str, ...]:
    """Names of the four controls where the actuators ``used`` stand in theirs."""
    names = list(ACTUATORS)
    for name in used:
        names[SLOT[name]] = name
    return tuple(names)


def by_slot(used: Iterable[str]) -> tuple[str, ...]:
    """The actuators ``used`` alone, in the order of their slots."""
    return tuple(sorted(used, key=SLOT.__getitem__))


@compiled
def as_sent(values):
    """Round ``values`` in place to float32, as a message does."""
    for i in range(values.shape[0]):
        values[i] = float(np.float32(values[i]))


@compiled
def encode_command(command, travel, controls):
    """Write ``command`` (4,), rad and N, as fractions of ``travel`` (4,) into ``controls`` (4,), in float32.

    An actuator without travel gets 0.
    """
    for i in range(len(ACTUATORS)):
        controls[i] = float(np.float32(command[i] / travel[i])) if travel[i] > 0.0 else 0.0


@compiled
def decode_command(controls, travel, command):
    """The inverse of `encode_command`: writes ``controls`` (4,) as ``command`` (4,), rad and N."""
    for i in range(len(ACTUATORS)):
        command[i] = controls[i] * travel[i]
