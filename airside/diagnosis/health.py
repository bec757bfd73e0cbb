"""What a UAV can still do, from what it believes of its actuators: what it tells its neighbours and the ground."""

from __future__ import annotations

import math

from ftcc.airside.diagnosis.ability import end_of
from ftcc.airside.diagnosis.arrays import Trial
from ftcc.airside.diagnosis.beliefs import FAULTY, HEALTHY, MOST_CLIMB, SENSOR, Belief, Health
from ftcc.airside.flight_path import Own
from ftcc.airside.model import Model
from ftcc.airside.point_mass import drag
from ftcc.link.actuators import ELEVATOR, THRUST
from ftcc.link.compiled import compiled, compiled_apart, compiled_within, copy, fields, store

__all__ = ["climb_of_load", "climb_of_thrust", "set_health", "share_health"]

_STATE = Belief._fields.index("state")
_FILTERED = Trial._fields.index("filtered")
_LEAST_AIRSPEED = 10.0
"""m/s."""
_RESERVE = 0.1
"""Load factor beyond that of level flight that counts as unlimited."""
_BELONGS = Health._fields.index("belongs")


@compiled
def climb_of_thrust(V, gamma, alpha, most, a):
    """Climb rate (m/s) that the thrust ``most`` (N) keeps up at airspeed ``V``: (T cos(alpha) - D) V / (m g)."""
    force = 0.5 * a.rho * V * V * a.S
    resistance = force * (a.CD0 + a.CDa * alpha + a.CDa2 * alpha * alpha)
    return (most * math.cos(alpha) - resistance) * V / (a.m * a.g)


@compiled
def climb_of_load(load_factor):
    """Climb rate (m/s) that a largest ``load_factor`` leaves: none without a reserve to begin a climb with."""
    return MOST_CLIMB * min(max((load_factor - 1.0) / _RESERVE, 0.0), 1.0)


@compiled
def _load_left(V, acting, a):
    """Load factor that an elevator adds with what it has left, ``acting`` (rad), eqs. (2.6)-(2.7) at rest.

    What disturbs the aircraft beside its fault is in its present command, so what is left counts from there.
    """
    force = 0.5 * a.rho * V * V * a.S
    return force * (a.CLde - a.CLa * a.Cmde / a.Cma) * acting / (a.m * a.g)


@compiled_within
def share_health(autopilots, i):
    """Append the `Health` of UAV ``i`` to what it shares."""
    d = autopilots.diagnosis
    copy(d.health[i], autopilots.shared[i, d.shares[0] :])


@compiled_apart
def set_health(autopilots, i, gains):
    """Set ``Diagnosis.health`` of UAV ``i``; whether it belongs is decided elsewhere."""
    d = autopilots.diagnosis
    state, least, climb = HEALTHY, 1.0, MOST_CLIMB
    own, model = fields(Own, autopilots.own[i]), fields(Model, autopilots.model[i])
    V = max(own.V, _LEAST_AIRSPEED)
    for slot in range(d.belief.shape[1]):
        if d.has[i, slot] == 0:
            continue
        belief = fields(Belief, d.belief[i, slot])
        state = max(state, int(belief.state))
        if belief.state == FAULTY and belief.kind < SENSOR:
            least = min(least, min(max(belief.effectiveness, 0.0), 1.0))
        if slot == THRUST:
            most, known = end_of(d, i, slot, model.thrust_max)
            if known and d.point[i] == 1:
                climb = min(climb, max((most - drag(V, 1.0, model)) * V / (model.m * model.g), 0.0))
            elif known:
                climb = min(climb, max(climb_of_thrust(V, own.gamma, own.alpha, most, model), 0.0))
        elif slot == ELEVATOR:
            load, known = end_of(d, i, slot, d.travel[i, slot] if d.point[i] == 1 else model.elevator_min)
            if known and d.point[i] == 0:
                left = belief.effectiveness * (model.elevator_min - d.trial[i, slot, _FILTERED])
                load = 1.0 + _load_left(V, left, model)
            if known:
                climb = min(climb, climb_of_load(load))
    store(Health(float(state), least, climb, d.health[i, _BELONGS]), d.health[i])
