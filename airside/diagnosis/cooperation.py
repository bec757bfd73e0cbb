"""The swarm makes room: what UAVs know of each other's health, and what they do about it.

Leaders climb and sink no faster than the weakest follower that belongs. A UAV that cannot keep up leaves: it says so in
its records, its neighbours fade it out of their sums, and it flies a reference of its own (`apart`). Once it is healthy
again, and back at its place, it belongs again, and fades in. Not in the monograph.
"""

from __future__ import annotations

import math

from ftcc.airside.diagnosis.apart import fly_apart, place
from ftcc.airside.diagnosis.beliefs import FAULTY, MOST_CLIMB, SUSPECTED, UNDETERMINED, Health
from ftcc.airside.diagnosis.cooperation_arrays import ATTITUDE, LONGITUDINAL, Apart, Neighbour
from ftcc.airside.diagnosis.gains import DiagnosisGains
from ftcc.airside.elements.vectors import turned
from ftcc.airside.flight_path import Own
from ftcc.airside.references import attitude, longitudinal, position
from ftcc.airside.references.profiles import CLAMPED, CLIMB_LIMIT, SINK_LIMIT
from ftcc.link.channel import Edge
from ftcc.link.compiled import compiled_apart, compiled_within, copy, fields
from ftcc.link.events import note
from ftcc.link.flight_modes import MISSION

__all__ = [
    "BACK",
    "LEFT",
    "NO_ROOM",
    "ROOM",
    "cooperate",
    "hears_virtual_leader",
    "is_apart",
    "makes_room",
    "refer_apart",
    "room_text",
]

ROOM, NO_ROOM, LEFT, BACK = 3, 4, 5, 6
"""Kinds of events: a leader makes room (for this UAV), no longer; a UAV has left, and is back."""

_BELONGS = Health._fields.index("belongs")
_KNOWN, _HEARD = Neighbour._fields.index("known"), 1
_WEAK_FOR, _SOUND_FOR, _BEGUN, _JOINS, _LIMIT = (
    Apart._fields.index(name) for name in ("weak_for", "sound_for", "begun", "joins", "limit")
)
_ENOUGH = 1.2
"""Climb rate of the weakest follower, over the leader's own limit, from which on it is not held back any more."""
_UNDER_WAY = 0.5
"""Rate at which a UAV that gets nearer to its place is on its way there, m/s."""
_GENTLY = 10.0
"""Who comes back moves the places of others, perhaps upwards: edges fade in this many times slower than out."""
_AS_NEW = 0.9
"""Effectiveness from which on a UAV may come back."""
_Z, _Z_DOT = (longitudinal.Reference._fields.index(name) for name in ("z", "z_dot"))
_SENDER = Edge._fields.index("sender")
_NEIGHBOUR_BELONGS = Neighbour._fields.index("belongs")


@compiled_within
def is_apart(autopilots, i):
    """Whether UAV ``i`` flies a reference of its own: it has left, and the ground has not taken it over."""
    d = autopilots.diagnosis
    return d.cooperates[i] == 1 and d.health[i, _BELONGS] == 0.0 and autopilots.mode[i] == MISSION


@compiled_within
def hears_virtual_leader(autopilots, i):
    """Whether the law of UAV ``i`` hears a virtual leader in the place of its neighbours."""
    return is_apart(autopilots, i) and autopilots.cooperation.kind[0] == LONGITUDINAL


@compiled_within
def makes_room(autopilots, i):
    """Whether leader ``i`` holds its climb rate back for a follower."""
    return autopilots.cooperation.apart[i, _LIMIT] < math.inf


@compiled_apart
def cooperate(autopilots, inbox, i, now_us, dt):
    """Bring what UAV ``i`` knows of its neighbours, its edges' weights and whether it belongs to this tick.

    To be called after `hear` and `diagnose`, before `refer`; ``dt`` is the control period, s.
    """
    gains = fields(DiagnosisGains, autopilots.diagnosis.gains[i])
    _look_around(autopilots, inbox, i, gains)
    if autopilots.leader[i] == 1:
        _make_room(autopilots, inbox, i, gains, now_us, dt)
        return
    if autopilots.mode[i] == MISSION:
        _decide(autopilots, inbox, i, gains, now_us, dt)
    else:
        autopilots.cooperation.apart[i, _WEAK_FOR] = 0.0
        autopilots.cooperation.apart[i, _BEGUN] = 0.0
    _weigh(autopilots, inbox, i, gains, dt)


@compiled_within
def _look_around(autopilots, inbox, i, gains):
    """Set what UAV ``i`` knows of its in-neighbours from their newest records."""
    at = autopilots.diagnosis.shares[0]
    for edge in range(inbox.degree[i]):
        row = autopilots.cooperation.neighbours[i, edge]
        row[_KNOWN] = 0.0
        if inbox.stamp[i, edge] >= 0:
            copy(inbox.values[i, edge, at:], row[_HEARD:])
            row[_KNOWN] = 1.0 if inbox.age[i, edge] <= gains.fresh else 0.0


@compiled_within
def _weigh(autopilots, inbox, i, gains, dt):
    """Fade the edges from those who have left out of the sums of UAV ``i``, and in from those who are back.

    A neighbour whose health has become unknown counts as it last said; all fade out while UAV ``i`` is apart itself.
    """
    c = autopilots.cooperation
    belongs = autopilots.diagnosis.health[i, _BELONGS]
    step = dt / gains.fading
    for edge in range(inbox.degree[i]):
        target = belongs * c.neighbours[i, edge, _NEIGHBOUR_BELONGS]
        share = c.share[i, edge]
        share += min(max(target - share, -step), step / _GENTLY)
        c.share[i, edge] = share
        autopilots.weight[i, edge] = share * c.weight[i, edge]


@compiled_within
def _make_room(autopilots, inbox, i, gains, now_us, dt):
    """Limit the profile of leader ``i`` to what the weakest follower that belongs can keep up, at a limited pace."""
    c = autopilots.cooperation
    least, weakest = math.inf, 0
    for edge in range(inbox.degree[i]):
        neighbour = fields(Neighbour, c.neighbours[i, edge])
        if inbox.stamp[i, edge] < 0 or inbox.age[i, edge] > gains.silent or neighbour.belongs == 0.0:
            continue
        climb = gains.room * neighbour.climb_left
        if neighbour.climb_left < MOST_CLIMB and climb < least:
            least, weakest = climb, inbox.edges[i, edge, _SENDER]
    limit, step = c.apart[i, _LIMIT], gains.room_pace * dt
    own = max(c.limits[i, 0], c.limits[i, 1])
    if least >= own * (1.0 if limit == math.inf else _ENOUGH):
        least = math.inf
    if least < limit:
        if limit == math.inf:
            note(autopilots.events, now_us, i, ROOM, weakest)
        # It begins at the present rate, which is no jump.
        present = abs(autopilots.reference[i, _Z_DOT])
        limit = max(least, min(limit, max(present, least)) - step)
    elif least > limit:
        limit = min(limit + step, least)
        # A profile that is slower by itself needs no limit.
        if least == math.inf and (limit >= own or autopilots.profile_state[i, CLAMPED] == 0.0):
            limit = math.inf
            note(autopilots.events, now_us, i, NO_ROOM, 0)
    c.apart[i, _LIMIT] = limit
    autopilots.profile[i, CLIMB_LIMIT] = min(c.limits[i, 0], limit)
    autopilots.profile[i, SINK_LIMIT] = min(c.limits[i, 1], limit)


@compiled_within
def _off_its_place(autopilots, inbox, i, gains):
    """How far UAV ``i`` is off its place, over what it may be; 0 where its place is not known.

    In the vertical plane also while it is on its way there: who leaves or comes back moves the places of others.
    """
    own, reference = fields(Own, autopilots.own[i]), autopilots.reference[i]
    kind = autopilots.cooperation.kind[0]
    if kind == LONGITUDINAL:
        z, z_dot = place(autopilots, inbox, i, _Z, _Z_DOT)
        nearer = (own.V * math.sin(own.gamma) - z_dot) * (1.0 if z > own.z else -1.0)
        return abs(own.z - z) / gains.astray if z == z and nearer < _UNDER_WAY else 0.0
    if kind == ATTITUDE:
        wanted = fields(attitude.Reference, reference)
        error = turned((own.mu, own.alpha, own.beta), (wanted.mu, wanted.alpha, wanted.beta))
        return max(abs(error[0]), abs(error[1]), abs(error[2])) / gains.astray_angle
    post = fields(position.Reference, reference)
    x, y, z = own.x - post.x, own.y - post.y, own.z - post.z
    return math.sqrt(x * x + y * y + z * z) / gains.astray


@compiled_within
def _decide(autopilots, inbox, i, gains, now_us, dt):
    """Whether UAV ``i`` leaves, or begins to fly back."""
    d, row = autopilots.diagnosis, autopilots.cooperation.apart[i]
    health = fields(Health, d.health[i])
    if health.belongs == 0.0:
        able = health.effectiveness >= _AS_NEW and health.climb_left >= MOST_CLIMB
        sound = health.state <= SUSPECTED or (health.state == FAULTY and able)
        row[_SOUND_FOR] = row[_SOUND_FOR] + dt if sound else 0.0
        row[_JOINS] = 1.0 if row[_SOUND_FOR] > gains.returning else 0.0
        return
    # A law of attitude climbs by nobody's wish.
    weak = health.climb_left < gains.least_climb and autopilots.cooperation.kind[0] != ATTITUDE
    weak = weak or (health.state >= UNDETERMINED and _off_its_place(autopilots, inbox, i, gains) > 1.0)
    row[_WEAK_FOR] = row[_WEAK_FOR] + dt if weak else 0.0
    if row[_WEAK_FOR] > gains.leaving:
        d.health[i, _BELONGS] = 0.0
        row[_WEAK_FOR], row[_SOUND_FOR], row[_BEGUN], row[_JOINS] = 0.0, 0.0, 0.0, 0.0
        note(autopilots.events, now_us, i, LEFT, 0)


@compiled_apart
def refer_apart(autopilots, inbox, i, now_us, period_us):
    """Bring the reference of UAV ``i``, which is apart, to this tick; from the next one on it belongs if it is back."""
    if fly_apart(autopilots, inbox, i, now_us, period_us):
        autopilots.diagnosis.health[i, _BELONGS] = 1.0
        note(autopilots.events, now_us, i, BACK, 0)


def room_text(kind: int, number: int) -> tuple[str, str]:
    """Severity and text of an event of a kind of this module."""
    return {
        ROOM: ("warning", f"leader makes room: it climbs and sinks no faster than UAV {number} can"),
        NO_ROOM: ("info", "leader makes room for nobody any more"),
        LEFT: ("warning", "leaves the swarm: it cannot keep up"),
        BACK: ("info", "is back in the swarm"),
    }[kind]
