"""Flight-path variables from telemetry: the only window through which an autopilot sees its aircraft."""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.link.attitude_target import path_of
from ftcc.link.compiled import compiled
from ftcc.link.rotation import body_axes

__all__ = ["Own", "decode_state"]


class Own(NamedTuple):
    """What an autopilot knows of its own aircraft at one instant (still air: airspeed is ground speed)."""

    t: float
    """Simulated time of the measurement, s."""
    x: float
    """Position north, m."""
    y: float
    """Position east, m."""
    z: float
    """Altitude, up, m."""
    V: float
    """Airspeed, m/s."""
    gamma: float
    """Flight-path angle, rad."""
    chi: float
    """Course, rad."""
    mu: float
    """Bank about the velocity, rad."""
    alpha: float
    """Angle of attack, rad."""
    beta: float
    """Sideslip, rad."""
    theta: float
    """Pitch angle, rad."""
    p: float
    q: float
    r: float
    """Body rates, rad/s."""
    aileron: float
    elevator: float
    rudder: float
    thrust: float
    """Command that the vehicle reports in force from now on, rad and N."""


@compiled
def decode_state(message, t, command, own):
    """Flight-path variables, in the order of `Own`, from the fields of the two state messages.

    Parameters
    ----------
    message : (13,) float
        ATTITUDE_QUATERNION q1..q4, rates; LOCAL_POSITION_NED x, y, z, vx, vy, vz.
    t : float
        Stamp, s.
    command : (4,) float
        Command in force (aileron, elevator, rudder, thrust).
    own : (18,) float
        Written.
    """
    vx, vy, vz = message[10], message[11], message[12]
    speed, gamma, chi = path_of(vx, vy, vz)
    nose, wing, belly = body_axes(message[0], message[1], message[2], message[3])
    u = nose[0] * vx + nose[1] * vy + nose[2] * vz
    v = wing[0] * vx + wing[1] * vy + wing[2] * vz
    w = belly[0] * vx + belly[1] * vy + belly[2] * vz
    alpha = math.atan2(w, u)
    beta = math.atan2(v, math.sqrt(u * u + w * w))
    # Bank: the body's y axis, freed of sideslip, against the horizontal normal of the path and its "down".
    east_x, east_y = -math.sin(chi), math.cos(chi)
    down_x, down_y, down_z = math.sin(gamma) * math.cos(chi), math.sin(gamma) * math.sin(chi), math.cos(gamma)
    side = wing[0] * east_x + wing[1] * east_y
    fall = wing[0] * down_x + wing[1] * down_y + wing[2] * down_z
    mu = math.atan2(fall, side)
    own[0] = t
    own[1], own[2], own[3] = message[7], message[8], -message[9]
    own[4], own[5], own[6], own[7], own[8], own[9] = speed, gamma, chi, mu, alpha, beta
    own[10] = math.atan2(-nose[2], math.sqrt(wing[2] * wing[2] + belly[2] * belly[2]))
    own[11], own[12], own[13] = message[4], message[5], message[6]
    own[14], own[15], own[16], own[17] = command[0], command[1], command[2], command[3]
