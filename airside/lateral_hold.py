"""A simple lateral hold, for laws that fly in a vertical plane on an aircraft that can leave it: course by bank.

It knows the nominal roll axis and nothing of faults: there is no integral, so a biased aileron leaves an error of bank
and course.
"""

from __future__ import annotations

import math

from ftcc.airside.elements.nonlinear import clip
from ftcc.link.actuators import AILERON, RUDDER
from ftcc.link.compiled import compiled
from ftcc.link.rotation import wrapped

__all__ = ["hold_course"]

COURSE_RATE = 0.3
"""Course error to course rate, 1/s; the bank that turns so fast is asked for."""
LARGEST_BANK = 0.5
"""rad."""
ROLL_STIFFNESS = 40.0
"""Bank error to roll acceleration, at most, 1/s^2; the airframe's own roll damping does the rest. Where that is weak,
as on a large aircraft, the stiffness is what it damps critically."""
YAW_DAMPING = 0.2
"""Yaw rate beyond that of a coordinated turn to rudder, s."""
LEAST_AIRSPEED = 8.0
"""Surfaces are taken to act at least as at this airspeed, m/s."""


@compiled
def hold_course(own, course, model, command):
    """Set aileron and rudder of ``command`` (4,) for straight flight of ``own`` on ``course`` (rad), wings level."""
    V = max(own.V, LEAST_AIRSPEED)
    away = wrapped(course - own.chi)
    bank = clip(math.atan(COURSE_RATE * away * V / model.g), -LARGEST_BANK, LARGEST_BANK)
    rolling = 0.5 * model.rho * V * V * model.S * model.b * model.Clda / model.Ix
    turning = model.g / V * math.sin(own.mu)
    damping = -0.25 * model.rho * V * model.S * model.b * model.b * model.Clp / model.Ix
    stiffness = min(ROLL_STIFFNESS, 0.25 * damping * damping)
    aileron = stiffness * wrapped(bank - own.mu) / rolling
    rudder = YAW_DAMPING * (own.r - turning)
    command[AILERON] = clip(aileron, model.aileron_min, model.aileron_max)
    command[RUDDER] = clip(rudder, model.rudder_min, model.rudder_max)
