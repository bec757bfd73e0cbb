"""The messages of a tick as rows of numbers: which field of which MAVLink message stands in which column."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["AttitudeTarget", "PositionTarget", "StateMessage"]


class StateMessage(NamedTuple):
    """The state that a vehicle sends: the float32 fields of ATTITUDE_QUATERNION and LOCAL_POSITION_NED."""

    q1: float
    """Attitude, body to north-east-down, scalar first."""
    q2: float
    q3: float
    q4: float
    rollspeed: float
    """Rates about the body's axes, rad/s."""
    pitchspeed: float
    yawspeed: float
    x: float
    """Position north, east, down, m."""
    y: float
    z: float
    vx: float
    """Velocity over the ground north, east, down, m/s."""
    vy: float
    vz: float


class AttitudeTarget(NamedTuple):
    """A command by attitude: the fields of SET_ATTITUDE_TARGET that are used."""

    q1: float
    """Attitude, body to north-east-down, scalar first."""
    q2: float
    q3: float
    q4: float
    thrust: float
    """Share of the full thrust."""


class PositionTarget(NamedTuple):
    """A leader's target for its reference point. SET_POSITION_TARGET_LOCAL_NED carries it, with z and vz down."""

    time: float
    """Simulated time for which it holds, s."""
    x: float
    """Position north, east, up, m."""
    y: float
    z: float
    vx: float
    """Velocity north, east, up, m/s."""
    vy: float
    vz: float
