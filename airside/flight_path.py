"""Flight-path variables from telemetry: the only window through which an autopilot sees its aircraft."""

from __future__ import annotations

import math
from typing import NamedTuple

from ftcc.link.actuators import AILERON, ELEVATOR, RUDDER, THRUST
from ftcc.link.attitude_target import path_of
from ftcc.link.compiled import compiled, fields, store
from ftcc.link.messages import StateMessage
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
        See `StateMessage`.
    t : float
        Stamp, s.
    command : (4,) float
        Command in force by actuator, rad and N.
    own : (18,) float
        Written.
    """
    sent = fields(StateMessage, message)
    vx, vy, vz = sent.vx, sent.vy, sent.vz
    speed, gamma, chi = path_of(vx, vy, vz)
    nose, wing, belly = body_axes(sent.q1, sent.q2, sent.q3, sent.q4)
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
    seen = Own(
        t=t,
        x=sent.x,
        y=sent.y,
        z=-sent.z,
        V=speed,
        gamma=gamma,
        chi=chi,
        mu=mu,
        alpha=alpha,
        beta=beta,
        theta=math.atan2(-nose[2], math.sqrt(wing[2] * wing[2] + belly[2] * belly[2])),
        p=sent.rollspeed,
        q=sent.pitchspeed,
        r=sent.yawspeed,
        aileron=command[AILERON],
        elevator=command[ELEVATOR],
        rudder=command[RUDDER],
        thrust=command[THRUST],
    )
    store(seen, own)
