"""The own law is told of a known fault: a static virtual actuator (Steffen, Control Reconfiguration, Springer 2005).

The law sees an aircraft whose actuators are healthy and have the travel that is left: its limits are those that the
faulty actuator reaches, and the command in force is told as it acts. What the law commands is then divided by what is
believed of the actuator. So the nominal model that the law inverts contains the fault, and no law knows of it. What is
told is bounded and changes at a limited rate; it is told while the fault is known.
"""

from __future__ import annotations

import math

from ftcc.airside.diagnosis.beliefs import BIAS, FAULTY, HEALTHY, LOSS, WRONG, Belief
from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.link.actuators import ACTUATORS, AILERON, ELEVATOR, RUDDER, THRUST
from ftcc.link.compiled import compiled, compiled_apart, compiled_within, copy, fields

__all__ = ["accommodate", "command_for", "is_accommodated"]

_COMMAND = Own._fields.index("aileron")
_LIMITS = tuple(
    (Model._fields.index(f"{name}_min"), Model._fields.index(f"{name}_max"))
    for name in ("aileron", "elevator", "rudder", "thrust")
)
"""By slot: indices of the limits in `Model`."""
_MOST = 1.2
"""Largest effectiveness that is told."""
_SHARE = 0.8
"""Largest bias that is told, share of the travel."""
_EFFECTIVENESS, _BIAS = range(2)
_TIME = Own._fields.index("t")
_DITHER, _DITHER_FREQUENCY = (DiagnosisGains._fields.index(name) for name in ("dither", "dither_frequency"))
_APART = 0.5 * math.pi
"""Between the dithers of two actuators, rad: they do not add up."""

assert (AILERON, ELEVATOR, RUDDER, THRUST) == (0, 1, 2, 3)


@compiled
def _towards(value, target, most):
    return value + min(max(target - value, -most), most)


@compiled_apart
def accommodate(autopilots, i, dt):
    """Bring what the law of UAV ``i`` is told of its actuators to this tick: after `diagnose`, before the law."""
    d = autopilots.diagnosis
    if not is_accommodated(autopilots, i):
        return
    gains = fields(DiagnosisGains, d.gains[i])
    copy(autopilots.model[i], d.model[i])
    copy(autopilots.own[i], d.own[i])
    for slot in range(len(ACTUATORS)):
        if d.has[i, slot] == 0:
            continue
        belief, assumed, travel = fields(Belief, d.belief[i, slot]), d.assumed[i, slot], d.travel[i, slot]
        known = belief.state == FAULTY and belief.effectiveness_sd < gains.determined
        if known and (belief.kind == LOSS or belief.kind == BIAS or belief.kind == WRONG):
            effectiveness = min(max(belief.effectiveness, gains.least), _MOST) if belief.kind != BIAS else 1.0
            bias = min(max(belief.bias, -_SHARE * travel), _SHARE * travel)
        elif belief.state == HEALTHY:
            effectiveness, bias = 1.0, 0.0
        else:
            effectiveness, bias = assumed[_EFFECTIVENESS], assumed[_BIAS]
        assumed[_EFFECTIVENESS] = _towards(assumed[_EFFECTIVENESS], effectiveness, gains.pace * dt)
        assumed[_BIAS] = _towards(assumed[_BIAS], bias, gains.pace * travel * dt)
        for end in range(2):
            d.model[i, _LIMITS[slot][end]] = (
                assumed[_EFFECTIVENESS] * autopilots.model[i, _LIMITS[slot][end]] + assumed[_BIAS]
            )
        d.own[i, _COMMAND + slot] = assumed[_EFFECTIVENESS] * autopilots.own[i, _COMMAND + slot] + assumed[_BIAS]


@compiled_within
def is_accommodated(autopilots, i):
    """Whether the law of UAV ``i`` flies by ``Diagnosis.own`` and ``Diagnosis.model``."""
    return autopilots.diagnosis.on[i] == 1 and autopilots.diagnosis.accommodates[i] == 1


@compiled_within
def command_for(autopilots, i, slot, wanted):
    """The command by which an actuator of UAV ``i``, by what is believed of it, does what is ``wanted``, rad or N.

    The dither, if there is one, comes on top.
    """
    d = autopilots.diagnosis
    command, travel = wanted, d.travel[i, slot]
    if is_accommodated(autopilots, i):
        assumed = d.assumed[i, slot]
        if assumed[_EFFECTIVENESS] != 1.0 or assumed[_BIAS] != 0.0:
            command = min(max((wanted - assumed[_BIAS]) / assumed[_EFFECTIVENESS], -travel), travel)
    if d.on[i] == 1 and d.gains[i, _DITHER] > 0.0:
        swing = math.sin(d.gains[i, _DITHER_FREQUENCY] * autopilots.own[i, _TIME] + _APART * slot)
        command = min(max(command + d.gains[i, _DITHER] * travel * swing, -travel), travel)
    return command
