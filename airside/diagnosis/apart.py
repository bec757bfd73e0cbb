"""The flight of a UAV that has left the swarm: straight and level, by a reference of its own; and its way back.

Laws of the vertical plane take their reference from what they hear. One that is apart hears a virtual leader in the
place of all neighbours, which begins where the law's own reference is, and goes to the altitude that the aircraft has
and to a speed that it can hold. On the way back it goes to the neighbours' weighted mean, where their sums vanish.
Other laws have a reference of their own: it goes to wings level, or straight on. The law's states go on all the time.
"""

from __future__ import annotations

import math

from ftcc.airside.diagnosis.ability import level_alpha, level_speed
from ftcc.airside.diagnosis.cooperation_arrays import ATTITUDE, LONGITUDINAL, Apart, Neighbour
from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.airside.elements.filters import reference_shaper
from ftcc.airside.elements.nonlinear import clip
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.references import attitude, longitudinal, position
from ftcc.link.compiled import compiled, compiled_within, fields, store

__all__ = ["fly_apart", "place"]

_Reference = longitudinal.Reference
_X, _X_DOT, _V, _V_DOT, _Z, _Z_DOT, _Z_DDOT = (
    _Reference._fields.index(name) for name in ("x", "x_dot", "V", "V_dot", "z", "z_dot", "z_ddot")
)
_POST, _POST_DOT, _POST_DDOT = (position.Reference._fields.index(name) for name in ("x", "x_dot", "x_ddot"))
_ALPHA = attitude.Command._fields.index("alpha")
_BEGUN, _GOES_V, _GOES_Z = (Apart._fields.index(name) for name in ("begun", "V", "z"))

# Chosen: gentler than any profile of a leader, so that what is left of an aircraft can follow.
_FREQUENCY = 1.0
"""Of the shaper of the altitude, rad/s."""
_CLIMB, _ACCELERATION = 3.0, 0.5
"""Its largest sink rate, m/s, and acceleration, m/s^2; the latter also of the speed."""
_OF_SPARE, _LEAST_CLIMB = 0.6, 0.1
"""Its largest climb rate: share of what the thrust leaves, and at least this, m/s."""
_CATCHES_UP = 0.2
"""Rate at which a distance or a difference in speed is made good, 1/s,"""
_OVERTAKES = 4.0
"""and the largest speed for it, m/s."""
_NEAR, _ALIKE = 1.0, 0.3
"""How near to its place a UAV joins, m, and its speeds, m/s."""


@compiled_within
def _column(autopilots, source):
    """Where all records of the vertical plane have the entry ``source`` of a `longitudinal.Reference`; -1: nowhere."""
    for m in range(autopilots.cooperation.columns[0]):
        if autopilots.leader_shares[m] == source:
            return m
    return -1


@compiled_within
def place(autopilots, inbox, i, source, rate):
    """Weighted mean of the neighbours that belong, at present, of an entry of their motion, and of its rate.

    Followers share what they take for a leader's motion in the same columns as leaders their motion. Nan, 0 where it is
    not shared, or where nobody that belongs is known.
    """
    c = autopilots.cooperation
    column, rate_column = _column(autopilots, source), _column(autopilots, rate)
    total, rates, weights = 0.0, 0.0, 0.0
    if column >= 0 and rate_column >= 0:
        for edge in range(inbox.degree[i]):
            neighbour = fields(Neighbour, c.neighbours[i, edge])
            if neighbour.known > 0.0 and neighbour.belongs > 0.0:
                weight, record = c.weight[i, edge], inbox.values[i, edge]
                total += weight * (record[column] + record[rate_column] * inbox.age[i, edge])
                rates += weight * record[rate_column]
                weights += weight
    if weights == 0.0:
        return math.nan, 0.0
    return total / weights, rates / weights


@compiled_within
def _begin_lone(autopilots, i, own, row):
    """The virtual leader where the law's own reference is."""
    shared = autopilots.shared[i]
    altitude, rate = _column(autopilots, _Z), _column(autopilots, _Z_DOT)
    start = _Reference(
        x=own.x,
        V=own.V,
        V_dot=0.0,
        z=shared[altitude] if altitude >= 0 else own.z,
        z_dot=shared[rate] if rate >= 0 else 0.0,
        z_ddot=0.0,
        x_dot=own.V * math.cos(own.gamma),
    )
    store(start, row)


@compiled
def _move_lone(row, V, x, x_dot, z, z_dot, spare, dt):
    """Move the virtual leader towards airspeed ``V``, forward position ``x`` and altitude ``z`` with their rates.

    ``spare`` is the climb rate that the thrust leaves, m/s.
    """
    lone = fields(_Reference, row)
    forward = x_dot + clip(_CATCHES_UP * (x - lone.x), -_OVERTAKES, _OVERTAKES) if x == x else V
    V_dot = clip(_CATCHES_UP * (V - lone.V), -_ACCELERATION, _ACCELERATION)
    fastest = _CLIMB if z < lone.z else clip(_OF_SPARE * spare, _LEAST_CLIMB, _CLIMB)
    up, up_dot, jerk = reference_shaper(lone.z, lone.z_dot, lone.z_ddot, z, z_dot, _FREQUENCY, fastest, _ACCELERATION)
    moved = _Reference(
        x=lone.x + dt * lone.x_dot,
        V=lone.V + dt * V_dot,
        V_dot=V_dot,
        z=lone.z + dt * up,
        z_dot=lone.z_dot + dt * up_dot,
        z_ddot=lone.z_ddot + dt * jerk,
        x_dot=lone.x_dot + dt * clip(forward - lone.x_dot, -_ACCELERATION, _ACCELERATION),
    )
    store(moved, row)


@compiled
def _has_arrived(row, V, x, z, z_dot):
    lone = fields(_Reference, row)
    beside = x != x or abs(x - lone.x) < _NEAR
    return beside and abs(z - lone.z) < _NEAR and abs(z_dot - lone.z_dot) < _ALIKE and abs(V - lone.V) < _ALIKE


@compiled_within
def _fly_lone(autopilots, inbox, i, joins, hold, own, level, dt):
    """The vertical plane: whether the virtual leader has come back to the UAV's place."""
    c = autopilots.cooperation
    row = c.lone[i]
    arrived = False
    z, z_dot = place(autopilots, inbox, i, _Z, _Z_DOT)
    if joins > 0.0 and z == z:
        x, x_dot = place(autopilots, inbox, i, _X, _X_DOT)
        V, _ = place(autopilots, inbox, i, _V, _V_DOT)
        V = V if V == V else c.speed[i]
        _move_lone(row, V, x, x_dot, z, z_dot, level.spare, dt)
        arrived = _has_arrived(row, V, x, z, z_dot)
    else:
        x = own.x if _column(autopilots, _X) >= 0 else math.nan
        _move_lone(row, level.V, x, level.V, hold, level.climb, level.spare, dt)
    autopilots.reference[i, _V] = c.speed[i] if arrived else row[_V]
    autopilots.reference[i, _V_DOT] = 0.0 if arrived else row[_V_DOT]
    for m in range(c.records.shape[2]):
        source = autopilots.leader_shares[m]
        c.records[i, 0, m] = row[source] if source >= 0 else 0.0
    return arrived


@compiled
def _fly_straight(row, own, begun, level, dt):
    """Three axes: straight and level from the own motion on, at a speed that goes to that of ``level``."""
    north, east = math.cos(own.chi), math.sin(own.chi)
    if begun == 0.0:
        row[_POST], row[_POST + 1], row[_POST + 2] = own.x, own.y, own.z
        ground = own.V * math.cos(own.gamma)
        row[_POST_DOT], row[_POST_DOT + 1] = ground * north, ground * east
        row[_POST_DOT + 2] = own.V * math.sin(own.gamma)
    speed = math.sqrt(row[_POST_DOT] * row[_POST_DOT] + row[_POST_DOT + 1] * row[_POST_DOT + 1])
    faster = clip(_CATCHES_UP * (level.V - speed), -_ACCELERATION, _ACCELERATION) / max(speed, 1.0)
    row[_POST_DDOT], row[_POST_DDOT + 1] = faster * row[_POST_DOT], faster * row[_POST_DOT + 1]
    row[_POST_DDOT + 2] = clip(level.climb - row[_POST_DOT + 2], -_ACCELERATION, _ACCELERATION)
    for axis in range(3):
        row[_POST + axis] += dt * row[_POST_DOT + axis]
        row[_POST_DOT + axis] += dt * row[_POST_DDOT + axis]


@compiled_within
def fly_apart(autopilots, inbox, i, now_us, period_us):
    """Bring the reference of UAV ``i``, which is apart, to this tick; whether it is back at its place."""
    c, dt = autopilots.cooperation, period_us / 1e6
    row = c.apart[i]
    own, model = fields(Own, autopilots.own[i]), fields(Model, autopilots.model[i])
    apart = fields(Apart, row)
    if c.kind[0] == ATTITUDE:
        c.level[i, 0, _ALPHA] = level_alpha(autopilots.diagnosis, i, own.V, model)
        attitude.refer(autopilots.reference_parameters[i], c.level[i], autopilots.reference[i], now_us, period_us)
        return apart.joins > 0.0
    if apart.begun == 0.0:
        row[_GOES_V] = c.speed[i] if c.kind[0] == LONGITUDINAL else own.V
        row[_GOES_Z] = own.z
        if c.kind[0] == LONGITUDINAL:
            _begin_lone(autopilots, i, own, c.lone[i])
    row[_BEGUN] = 1.0
    level = level_speed(autopilots.diagnosis, i, row[_GOES_V], model)
    if c.kind[0] == LONGITUDINAL:
        # What falls all the same is not called back.
        if abs(own.z - row[_GOES_Z]) > fields(DiagnosisGains, autopilots.diagnosis.gains[i]).astray:
            row[_GOES_Z] = own.z
        row[_GOES_Z] += dt * level.climb
        return _fly_lone(autopilots, inbox, i, apart.joins, row[_GOES_Z], own, level, dt)
    # A place around a fire goes on without it, at any course: it stays apart.
    _fly_straight(autopilots.reference[i], own, apart.begun, level, dt)
    return False
